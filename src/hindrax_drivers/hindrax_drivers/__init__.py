"""Devices (pure), buses (the only input and output) and their lifecycle nodes."""
