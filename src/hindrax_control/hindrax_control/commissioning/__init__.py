"""What a vehicle file claims, proven in the water: pulses, the readings that answer them, and what explains these."""
