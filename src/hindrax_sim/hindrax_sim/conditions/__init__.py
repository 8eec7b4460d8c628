"""What a realistic world does that the model does not know: one row of a table each."""
