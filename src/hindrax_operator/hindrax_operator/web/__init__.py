"""The page of a vehicle: the live view and the maneuvers in a browser."""
