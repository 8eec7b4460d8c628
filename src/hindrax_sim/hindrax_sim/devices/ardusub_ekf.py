"""The velocity of an ArduSub's estimator, as something aids it: the emulated autopilot with the truth of a DVL."""

import math
from dataclasses import replace

from hindrax_core.readings import BottomVelocity, Reading
from hindrax_sim.devices.ardupilot.firmware import ArduSub, AutopilotTruth
from hindrax_sim.devices.dvl75 import dvl_truth
from hindrax_sim.devices.dvl75_sentences import DvlTruth
from hindrax_sim.devices.emulator import Emulator

SATURATED = (30.0, -30.0, 30.0)


class ArduSubEkf(ArduSub):
    """An autopilot on a line of its own whose estimator is aided."""

    def set_truth(self, truth: object, now_s: float) -> None:
        """Set what aids it."""
        if isinstance(truth, DvlTruth):
            self._truth = aided(self._truth, truth)
            if self._saturated:
                self._truth = replace(self._truth, velocity_mps=SATURATED)
        else:
            super().set_truth(truth, now_s)  # type: ignore[arg-type]  # that of the autopilot itself


def aided(truth: AutopilotTruth, aid: DvlTruth) -> AutopilotTruth:
    """What an autopilot knows with a DVL: attitude and velocity; no velocity without an echo."""
    velocity = None if aid.altitude_m is None else aid.velocity_mps
    return replace(truth, attitude_rad=aid.attitude_rad, velocity_mps=velocity)


def _agrees(truth: DvlTruth, reading: Reading) -> bool:
    if not isinstance(reading, BottomVelocity):
        return False
    found = reading.velocity_mps or truth.velocity_mps
    return all(abs(one - true) < 0.06 for one, true in zip(found, truth.velocity_mps, strict=True))


EMULATOR = Emulator(
    lambda seed: ArduSubEkf((), seed),
    dvl_truth,
    lambda s: DvlTruth((0.4 * math.sin(0.5 * s), -0.3, 0.1), (0.05, -0.1, 2.0)),
    _agrees,
)
