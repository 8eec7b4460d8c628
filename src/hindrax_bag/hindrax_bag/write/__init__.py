"""Writing bags: MCAP files, limits, counting of lost messages."""
