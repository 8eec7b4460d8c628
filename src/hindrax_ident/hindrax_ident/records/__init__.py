"""What the identification learns from: samples in the order of their stamps, maneuver phases, axis records."""
