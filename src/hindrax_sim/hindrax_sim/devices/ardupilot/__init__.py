"""An ArduSub as its public sources and the MAVLink pages describe it, byte for byte. Imports nothing of the drivers."""
