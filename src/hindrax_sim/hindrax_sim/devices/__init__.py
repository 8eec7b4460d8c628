"""Emulators of the devices: byte for byte what their data sheets say, with a truth that can be set."""
