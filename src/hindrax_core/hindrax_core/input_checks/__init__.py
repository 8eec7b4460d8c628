"""Checks of what other programs send: its stamp, its publisher, and the count of what was refused."""
