"""The operator's nodes."""
