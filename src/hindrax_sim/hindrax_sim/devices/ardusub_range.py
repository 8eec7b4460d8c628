"""The rangefinder of an ArduSub: the emulated autopilot with the truth of a Ping."""

import math
from dataclasses import replace

from hindrax_core.readings import Echo, Reading
from hindrax_sim.devices.ardupilot.firmware import ArduSub, AutopilotTruth
from hindrax_sim.devices.emulator import Emulator
from hindrax_sim.devices.ping1d import HALF_BEAM_rad, PingTruth
from hindrax_sim.world import Mounting, World

SATURATED_m = 650.0


class ArduSubRange(ArduSub):
    """An autopilot on a line of its own with a rangefinder."""

    def set_truth(self, truth: object, now_s: float) -> None:
        """Set what the rangefinder looks at."""
        if isinstance(truth, PingTruth):
            found = replace(self._truth, range_m=SATURATED_m) if self._saturated else ranged(self._truth, truth)
            super().set_truth(found, now_s)


def ping_truth(world: World, at: Mounting) -> PingTruth:
    """What a sonar at a place of the vehicle would find."""
    return PingTruth(world.echo_m(at, HALF_BEAM_rad))


def ranged(truth: AutopilotTruth, echo: PingTruth) -> AutopilotTruth:
    """What an autopilot knows with a rangefinder."""
    return replace(truth, range_m=echo.distance_m)


def _agrees(truth: PingTruth, reading: Reading) -> bool:
    """Centimeters, and the way of the bottom in an interval."""
    return isinstance(reading, Echo) and truth.distance_m is not None and abs(reading.range_m - truth.distance_m) < 0.05


EMULATOR = Emulator(
    lambda seed: ArduSubRange((), seed),
    ping_truth,
    lambda seconds: PingTruth(2.5 + 0.3 * math.sin(0.5 * seconds)),
    _agrees,
)
