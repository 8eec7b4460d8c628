"""Holds of heading, roll, pitch, depth and altitude, and station keeping."""
