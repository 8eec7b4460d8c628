"""Replays recorded wire frames through the real code and compares field by field."""
