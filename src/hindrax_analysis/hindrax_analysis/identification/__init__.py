"""Identification over finished records, its result files, and many runs."""
