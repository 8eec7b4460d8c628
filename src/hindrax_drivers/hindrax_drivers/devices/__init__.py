"""Devices as pure objects: bytes and time in, readings out; register devices yield what they want of their bus."""
