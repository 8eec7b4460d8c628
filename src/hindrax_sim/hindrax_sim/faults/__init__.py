"""Faults by name: of serial devices, of the I2C bus, of vehicle and water."""
