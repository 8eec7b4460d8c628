"""Run and drive the vehicle."""
