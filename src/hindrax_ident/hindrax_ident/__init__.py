"""Hydrodynamic models, estimators, the identification session, bench experiments, exports and reports."""
