"""Guarded maneuvers: plan, legs, excitation, stages, guards."""
