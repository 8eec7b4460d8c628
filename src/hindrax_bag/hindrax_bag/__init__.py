"""MCAP bags: record, recover, read, replay, compare."""

__version__ = "0.1.0"
