"""From a wrench to pulses: guard, effectiveness, exact bounded allocation, thrust curves, faults of thrusters."""
