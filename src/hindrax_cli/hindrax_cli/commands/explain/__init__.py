"""Explained and proven."""
