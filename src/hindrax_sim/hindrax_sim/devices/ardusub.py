"""An ArduSub as a sensor: the emulated autopilot on a line of its own, with nothing wired to its outputs."""

import math

from hindrax_core.readings import Inertial, Leak, Magnetic, Pressure, Reading
from hindrax_sim.devices.ardupilot.firmware import ArduSub, AutopilotTruth, autopilot_truth
from hindrax_sim.devices.emulator import Emulator


def _near(found: tuple[float, ...], true: tuple[float, ...], most: float) -> bool:
    return all(abs(one - other) <= most for one, other in zip(found, true, strict=True))


def _agrees(truth: AutopilotTruth, reading: Reading) -> bool:
    """Five sigma, the steps of the wire, and what the truth does in a few milliseconds."""
    if isinstance(reading, Inertial):
        rates = _near(reading.rate_radps, truth.rate_radps, 0.01)
        return rates and _near(reading.specific_force_mps2, truth.specific_force_mps2, 0.15)
    if isinstance(reading, Magnetic):
        return _near(reading.field_T, truth.field_T, 2e-6)
    if isinstance(reading, Pressure):
        return abs(reading.pressure_Pa - truth.water_Pa) < 200.0
    return reading.wet == truth.wet if isinstance(reading, Leak) else False


def _example(seconds: float) -> AutopilotTruth:
    rates = (0.2 * math.sin(seconds), -0.1, 0.15 * math.cos(0.7 * seconds))
    return AutopilotTruth((0.1, -0.05, 1.0), rates, (0.5 * math.sin(0.5 * seconds), 0.3, -9.7), water_Pa=1.2e5)


EMULATOR = Emulator(lambda seed: ArduSub((), seed), autopilot_truth, _example, _agrees)
