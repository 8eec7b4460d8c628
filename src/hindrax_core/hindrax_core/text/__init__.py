"""Text that people read or write: sentences on a screen, YAML."""
