"""Flights of the whole stack without ROS, in lockstep with the simulated vehicle: one process, no clock."""
