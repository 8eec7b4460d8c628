"""Hydrodynamic models, estimators, and the identification session."""
