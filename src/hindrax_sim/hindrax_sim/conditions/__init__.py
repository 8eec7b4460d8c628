"""Effects of a realistic world outside the model: one row of a table each."""
