"""Effectiveness, allocation, thruster curves, guard, navigator, holds and maneuvers."""
