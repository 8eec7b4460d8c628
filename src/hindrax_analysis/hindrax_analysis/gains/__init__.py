"""Gains from an identified model: how fast each hold may be, and the same for other controllers."""
