"""From readings of the sensors to the state of the vehicle."""
