"""Reading bags: decoded, recovered, surveyed."""
