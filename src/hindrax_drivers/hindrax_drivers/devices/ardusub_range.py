"""The rangefinder of an ArduSub, such as a Ping that BlueOS hands to the autopilot, over MAVLink.

DISTANCE_SENSOR says in which direction it looks; of several, the one that looks as the knob says is read. As the mount
of the vehicle file has it, the range is an altitude, or the distance to what lies ahead.
"""

import math
from dataclasses import dataclass

from hindrax_core.driver_interface import Output
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.knobs import knob
from hindrax_core.readings import Echo
from hindrax_core.rejects import RejectCode, reject
from hindrax_drivers.devices.ardupilot.companion import Companion
from hindrax_drivers.devices.ardupilot.link import FOURTH_COMPUTER, LATENCY_S, Handlers
from hindrax_drivers.driver import Driver
from hindrax_drivers.protocols.ardupilot import DISTANCE, Distance
from hindrax_drivers.timebase import Timebase

UNRATED = 0.99
"""Confidence where the message has no quality: what is in range counts."""


@dataclass(frozen=True, slots=True)
class ArduSubRangeKnobs:
    """Which rangefinder, and how often."""

    rate_Hz: float = knob(10.0, 1.0, 50.0, "distances that are asked for [Hz]")
    orientation: int = knob(25, 0, 101, "MAV_SENSOR_ORIENTATION of the rangefinder: 25 down, 0 ahead [-]")
    least_m: float = knob(0.3, 0.01, 10.0, "shortest distance; a Ping measures from 0.3 m on [m]")
    most_m: float = knob(100.0, 1.0, 600.0, "longest distance [m]")
    latency_s: float = knob(LATENCY_S, 0.0, 0.5, "measurement to arrival at the least [s]")
    stall_s: float = knob(1.5, 0.5, 60.0, "silence that is reported [s]")


DEFAULT_KNOBS = ArduSubRangeKnobs()


class ArduSubRange(Companion):
    """Serial device: bytes of the link in; Echo out, with no confidence where there is no echo."""

    def __init__(self, knobs: ArduSubRangeKnobs = DEFAULT_KNOBS) -> None:
        self._knobs = knobs
        self._clock = Timebase(1e-3, latency_s=knobs.latency_s, on_break=self._on_break)
        super().__init__("ardusub_range", FOURTH_COMPUTER, {DISTANCE: knobs.rate_Hz}, knobs.stall_s)

    def _handlers(self) -> Handlers:
        handlers = Handlers()
        handlers.on(Distance, self._on_distance)
        return handlers

    def _clear(self) -> None:
        self._clock.restart()
        self._count = 0

    def _on_distance(self, one: Distance, stamp: Stamp) -> list[Output]:
        if one.orientation != self._knobs.orientation:
            return []
        if self._is_old("distance", 1000 * one.boot_ms):
            return [Rejected(stamp, reject(RejectCode.REPEATED, "distance"), b"")]
        self._count += 1
        at = self._clock.map(one.boot_ms, stamp)
        if one.range_m > self._knobs.most_m:
            return [Rejected(stamp, reject(RejectCode.RANGE, "distance"), b"")]
        seen = one.range_m >= self._knobs.least_m and one.quality != 0.0
        confidence = (UNRATED if math.isnan(one.quality) else one.quality) if seen else 0.0
        return [Stamped(at, Echo(one.range_m, confidence, self._count))]


DRIVER = Driver(ArduSubRangeKnobs, lambda knobs, _mount, _vehicle: ArduSubRange(knobs))
