"""Brings the stack up: launch files, vehicle files, processes, supervisor, access rights."""
