"""For changing the code; these need the clone."""
