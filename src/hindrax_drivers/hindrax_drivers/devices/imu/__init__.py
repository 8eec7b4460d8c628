"""The parts of the ICM-20948: registers, samples of its FIFO, self-test, and the magnetometer."""
