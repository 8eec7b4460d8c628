"""The I2C bus of the mock vehicle as a file, for third-party programs; an extra that only `hindrax mock` looks for."""
