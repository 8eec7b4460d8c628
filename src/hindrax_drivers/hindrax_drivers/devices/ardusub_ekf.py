"""Velocity over ground by ArduSub's own estimator, over MAVLink: for a vehicle whose DVL or GPS is the autopilot's.

A velocity is one only while the estimator claims it: EKF_STATUS_REPORT says that horizontal and vertical velocity are
known, and not that a constant position is assumed. An unaided ArduSub still sends velocities, near rest and wrong.
LOCAL_POSITION_NED is turned into body axes by the ATTITUDE of the same moment.

What a filter made is no measurement: its errors last longer than its interval, and have no covariance in these
messages. Where a DVL can be read itself, read that.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from hindrax_core.driver_interface import Output
from hindrax_core.events import Rejected, Stamp, Stamped, seconds_between
from hindrax_core.knobs import knob
from hindrax_core.readings import BottomVelocity, Vec3
from hindrax_core.rejects import RejectCode, reject
from hindrax_core.rotation import matrix
from hindrax_drivers.devices.ardupilot.companion import Companion
from hindrax_drivers.devices.ardupilot.link import BAUD, LATENCY_S, THIRD_COMPUTER, Handlers, Link
from hindrax_drivers.driver import Driver
from hindrax_drivers.protocols.ardupilot import (
    ATTITUDE,
    EKF_STATUS,
    LOCAL_POSITION,
    Attitude,
    EstimatorStatus,
    LocalPosition,
)
from hindrax_drivers.timebase import Timebase

HORIZONTAL, VERTICAL, CONSTANT_POSITION = 1 << 1, 1 << 2, 1 << 7
"""EKF_STATUS_FLAGS."""
STATUS_Hz, STATUS_AGE_S = 5.0, 1.0
TOGETHER_ms = 60
"""Between the attitude and the velocity of one moment, at most."""


@dataclass(frozen=True, slots=True)
class ArduSubEkfKnobs:
    """Trust in the autopilot's estimate."""

    rate_Hz: float = knob(20.0, 2.0, 50.0, "velocities that are asked for [Hz]")
    sigma_mps: float = knob(0.03, 0.001, 1.0, "standard deviation of a velocity, which the messages do not have [m/s]")
    max_speed_mps: float = knob(5.0, 0.1, 20.0, "largest velocity along an axis [m/s]")
    latency_s: float = knob(LATENCY_S, 0.0, 0.5, "measurement to arrival at the least [s]")
    stall_s: float = knob(1.5, 0.5, 60.0, "silence that is reported [s]")


DEFAULT_KNOBS = ArduSubEkfKnobs()


class ArduSubEkf(Companion):
    """Serial device: bytes of the link in; BottomVelocity out, without a velocity while none is claimed."""

    def __init__(self, knobs: ArduSubEkfKnobs = DEFAULT_KNOBS) -> None:
        self._knobs = knobs
        self._clock = Timebase(1e-3, latency_s=knobs.latency_s, on_break=self._on_break)
        streams = {LOCAL_POSITION: knobs.rate_Hz, ATTITUDE: knobs.rate_Hz, EKF_STATUS: STATUS_Hz}
        super().__init__("ardusub_ekf", THIRD_COMPUTER, streams, knobs.stall_s)

    def _handlers(self) -> Handlers:
        handlers = Handlers()
        handlers.on(Attitude, self._on_attitude)
        handlers.on(LocalPosition, self._on_position)
        handlers.on(EstimatorStatus, self._on_status)
        return handlers

    def _clear(self) -> None:
        self._clock.restart()
        self._attitude: Attitude | None = None
        self._claims, self._claimed_at = False, Stamp(0)

    def _on_attitude(self, one: Attitude, _stamp: Stamp) -> list[Output]:
        self._attitude = one
        return []

    def _on_status(self, one: EstimatorStatus, stamp: Stamp) -> list[Output]:
        self._claims, self._claimed_at = claims_velocity(one), stamp
        return []

    def _on_position(self, one: LocalPosition, stamp: Stamp) -> list[Output]:
        if self._is_old("velocity", 1000 * one.boot_ms):
            return [Rejected(stamp, reject(RejectCode.REPEATED, "velocity"), b"")]
        at = self._clock.map(one.boot_ms, stamp)
        velocity = self._in_body(one) if self._claimed(stamp) else None
        interval_s, device_us = 1.0 / self._knobs.rate_Hz, 1000 * one.boot_ms
        if velocity is None:
            return [Stamped(at, BottomVelocity(None, math.inf, 0.0, interval_s, device_us))]
        if max(map(abs, velocity)) > self._knobs.max_speed_mps:
            return [Rejected(stamp, reject(RejectCode.RANGE, "velocity"), b"")]
        return [Stamped(at, BottomVelocity(velocity, self._knobs.sigma_mps, 1.0, interval_s, device_us))]

    def _claimed(self, stamp: Stamp) -> bool:
        return self._claims and seconds_between(self._claimed_at, stamp) <= STATUS_AGE_S

    def _in_body(self, one: LocalPosition) -> Vec3 | None:
        attitude = self._attitude
        if attitude is None or abs(one.boot_ms - attitude.boot_ms) > TOGETHER_ms:
            return None
        if not all(map(math.isfinite, (*one.velocity_mps, *attitude.angles_rad))):
            return None
        north, east, down = one.velocity_mps
        columns = zip(
            *matrix(attitude.angles_rad), strict=True
        )  # of the rotation into the reference: its inverse's rows
        u, v, w = (a * north + b * east + c * down for a, b, c in columns)
        return u, v, w


def claims_velocity(status: EstimatorStatus) -> bool:
    """Whether the estimator says that it knows a velocity, and does not assume a constant position."""
    known = status.flags & (HORIZONTAL | VERTICAL) == HORIZONTAL | VERTICAL
    return known and not status.flags & CONSTANT_POSITION


class VelocityClaim:
    """Listens on the line of an output: `claimed` whether the estimator claims a velocity, None before that is clear.

    One that started less than `aligned_s` ago may still align; of an older one a look of `look_s` is enough.
    """

    baud = BAUD
    ready = True

    def __init__(self, aligned_s: float, look_s: float) -> None:
        self._aligned_s, self._looks = aligned_s, look_s * STATUS_Hz
        self.link = Link((), {EKF_STATUS: STATUS_Hz, ATTITUDE: STATUS_Hz}, companion=THIRD_COMPUTER)
        self.claimed: bool | None = None
        self.up_s = math.inf
        """Time since the autopilot was switched on, as far as it has said."""
        self.starts, self._seen = 0, 0

    @property
    def aligning(self) -> bool:
        """Whether it has no velocity yet, and may still get one."""
        return self.claimed is None and self._seen > 0 and self.up_s <= self._aligned_s

    def start(self, stamp: Stamp) -> Iterable[Output]:
        """Begin anew after the line was opened."""
        self.starts += 1
        self.link.restart(stamp)
        return list(self.link.tick(stamp))

    def feed(self, data: bytes, stamp: Stamp) -> Iterable[Output]:
        """Decode received bytes."""
        for message in self.link.feed(data, stamp):
            if isinstance(message, Attitude):
                self.up_s = 1e-3 * message.boot_ms
            elif isinstance(message, EstimatorStatus) and self.claimed is None:
                self._seen += 1
                if claims_velocity(message):
                    self.claimed = True
                elif self.up_s > self._aligned_s and self._seen >= self._looks:
                    self.claimed = False
        return ()

    def tick(self, stamp: Stamp) -> Iterable[Output]:
        """Heartbeat and requests."""
        return list(self.link.tick(stamp))


DRIVER = Driver(ArduSubEkfKnobs, lambda knobs, _mount, _vehicle: ArduSubEkf(knobs))
