"""The parts of the ICM-20948: its signal and converters, FIFO, inner I2C master, and the magnetometer."""
