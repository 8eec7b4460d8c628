"""The physics of the mock: rigid body in water, thrusters, pool walls."""
