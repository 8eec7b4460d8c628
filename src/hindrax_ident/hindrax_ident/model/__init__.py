"""The equations of motion, their parameters, and their prior."""
