"""Recorded wire frames through the real code again, compared field by field with what was recorded."""
