"""Input of the identification: samples in the order of their stamps, maneuver phases, axis records."""
