"""Bench experiments that find hydrodynamic coefficients without flying: one module per experiment, all pure."""
