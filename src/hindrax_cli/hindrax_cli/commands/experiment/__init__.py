"""Bench experiments."""
