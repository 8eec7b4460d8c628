"""Starts the stack: launch files, vehicle files, processes, supervisor, access rights."""
