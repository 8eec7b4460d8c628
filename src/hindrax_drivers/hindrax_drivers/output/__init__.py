"""The thruster output: output guard, output, its host and thread, the enable line."""
