"""Whether uncertainties hold: against other fluids, other laws, and a posterior without linearization."""
