"""Recorded data."""
