"""Faults flown in mock, judged by the pulses of the emulated output and the true pose: `./hindrax faults`."""
