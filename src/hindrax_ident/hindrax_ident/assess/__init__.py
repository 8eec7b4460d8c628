"""Assessment of a fit: intervals, misfit, verdict, results."""
