"""Thrust over pulse: cubics and tables, their checks and inverses."""
