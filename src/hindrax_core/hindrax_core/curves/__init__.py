"""Curves of thrusters: cubic branches, their inverses, and what makes them valid."""
