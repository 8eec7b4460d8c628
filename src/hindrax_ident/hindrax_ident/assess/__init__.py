"""Assessment of a fit: uncertainty bands, misfit, verdict, results."""
