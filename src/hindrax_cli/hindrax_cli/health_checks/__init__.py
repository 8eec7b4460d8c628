"""What is wrong with this machine and this vehicle, and what to do about it."""
