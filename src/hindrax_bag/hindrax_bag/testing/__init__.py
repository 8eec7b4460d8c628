"""What tests of this package and of those above it share; nothing that flies imports it."""
