"""Bringing this clone to another machine, and starting it there."""
