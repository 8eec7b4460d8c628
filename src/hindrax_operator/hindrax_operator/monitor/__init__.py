"""The live view of a vehicle in a terminal."""
