"""Measurements of the stack to identification events: the same code live, over a bag and in lock-step.

    for event in feed.step(measurement):
        for estimate in session.step(event): ...

Only here measurements of different topics are sorted by their stamps.

Events refer to the center of mass, like the equations of motion.

Of several DVLs or depth sensors the first of the vehicle file is taken: its noise and its mount are one thing.

Surge and sway come from the DVL as measured (moved to the center of mass), not from the navigator, whose filter would
color their noise. Rates come from the gyroscope. Heave has no instrument: its depth comes directly from the
pressure, for the same reason; the navigator's heave velocity is used where there is no pressure.
"""

import heapq
import math
from collections.abc import Iterable, Iterator
from typing import Generic, TypeAlias, TypeVar

from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.readings import BottomVelocity, Pressure, Vec3, Vec6
from hindrax_core.rotation import cross, matrix, rotate
from hindrax_core.sensor_table import Capability
from hindrax_core.signals import NAN, Attitude, IdentEvent, Navigation, Phase, Thrust, Velocity, Way
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_ident.tuning import Tuning

Measurement: TypeAlias = BottomVelocity | Pressure | Navigation | IdentEvent
"""A measurement, or an event that needs no conversion."""
DROPPED = "late events dropped"
"""Name in /diagnostics of the number of measurements that came too late to be used."""
VELOCITIES = (BottomVelocity, Navigation, Velocity, Way)
"""Measurements to which `velocity_latency_s` applies."""
KINDS = (Phase, Thrust, Navigation, Pressure, BottomVelocity, Attitude, Way, Velocity)
"""Order at equal stamps: inputs to the vehicle first, then its motion."""
RANKS: dict[type, int] = {kind: rank for rank, kind in enumerate(KINDS)}
EARLIEST = Stamp(-(2**62))
ReadingT = TypeVar("ReadingT")


class StampSorter(Generic[ReadingT]):
    """Sorts measurements by stamp, whatever the order of arrival.

    Topics arrive in different orders live and from a bag; estimates must not depend on it. Each measurement and each
    event waits a short time for others with an earlier stamp, and longer for those of a kind that lags behind on a busy
    machine; later arrivals are dropped and counted.
    """

    __slots__ = ("_count", "_heap", "_newest", "_newest_of", "_released", "dropped", "lag_s", "wait_s")

    def __init__(self, wait_s: float, lag_s: float = 0.0) -> None:
        """`wait_s`: largest delay against measurements with neighboring stamps; `lag_s`: longest wait for a kind."""
        self.wait_s, self.lag_s = wait_s, lag_s
        self.dropped = 0
        self._heap: list[tuple[Stamp, int, str, int, Stamped[ReadingT]]] = []
        self._count = 0
        self._newest = self._released = EARLIEST
        self._newest_of: dict[tuple[int, str], Stamp] = {}

    def push(self, *measurements: Stamped[ReadingT]) -> Iterator[Stamped[ReadingT]]:
        """Add measurements, also a backlog of them, and yield all that have waited long enough.

        One that is too late is dropped and counted.
        """
        for one in measurements:
            stamp, reading = one.stamp, one.reading
            if stamp < self._released:
                self.dropped += 1
                continue
            kind = (RANKS[type(reading)], reading.source if isinstance(reading, Velocity | Way) else "")
            self._count += 1
            heapq.heappush(self._heap, (stamp, *kind, self._count, one))
            self._newest = max(self._newest, stamp)
            self._newest_of[kind] = max(self._newest_of.get(kind, stamp), stamp)
        # A kind that is silent for longer is ignored: a lost sensor must not stop the others.
        silent = after(self._newest, -self.lag_s)
        slowest = min((newest for newest in self._newest_of.values() if newest > silent), default=self._newest)
        yield from self._until(min(slowest, after(self._newest, -self.wait_s)))

    def flush(self) -> Iterator[Stamped[ReadingT]]:
        """Yield all waiting measurements."""
        yield from self._until(self._newest)

    def _until(self, stamp: Stamp) -> Iterator[Stamped[ReadingT]]:
        while self._heap and self._heap[0][0] <= stamp:
            entry = heapq.heappop(self._heap)
            self._released = entry[0]
            yield entry[4]


class Feed:
    """Converts measurements in the order of arrival to identification events in the order of stamps."""

    def __init__(self, vehicle: Vehicle, tuning: Tuning | None = None) -> None:
        tuning = tuning or Tuning()
        self._latency_s = 0.0 if tuning.velocity_latency_s is None else tuning.velocity_latency_s
        self._sorter: StampSorter[Measurement] = StampSorter(tuning.reorder_s + abs(self._latency_s), tuning.lagging_s)
        mount = _first_mount(vehicle, "velocity")
        roll, pitch, yaw = (math.radians(angle) for angle in mount.rotation_deg)
        self._rotation = matrix((roll, pitch, yaw))
        self._center_m = vehicle.center_of_mass_m
        self._dvl_lever_m = _difference(mount.position_m, self._center_m)
        self._below_sensor_m = _difference(self._center_m, _first_mount(vehicle, "depth").position_m)
        self._rate_radps: Vec3 = (0.0, 0.0, 0.0)
        self._down: Vec3 = (0.0, 0.0, 1.0)
        self._water = vehicle.water

    def step(self, measurement: Stamped[Measurement]) -> Iterator[Stamped[IdentEvent]]:
        """Add one measurement; yield the events of all measurements released by it."""
        if self._latency_s and isinstance(measurement.reading, VELOCITIES):
            measurement = Stamped(after(measurement.stamp, -self._latency_s), measurement.reading)
        for one in self._sorter.push(measurement):
            yield from self.events_of(one)

    def flush(self) -> Iterator[Stamped[IdentEvent]]:
        """Yield the events of all measurements still waiting."""
        for one in self._sorter.flush():
            yield from self.events_of(one)

    def all(self, measurements: Iterable[Stamped[Measurement]]) -> Iterator[Stamped[IdentEvent]]:
        """Yield the events of a whole record."""
        for measurement in measurements:
            yield from self.step(measurement)
        yield from self.flush()

    @property
    def dropped(self) -> int:
        """Number of measurements dropped because they arrived too late."""
        return self._sorter.dropped

    def events_of(self, measurement: Stamped[Measurement]) -> tuple[Stamped[IdentEvent], ...]:
        """Events of one measurement; none while the DVL has no velocity."""
        stamp, reading = measurement.stamp, measurement.reading
        if isinstance(reading, BottomVelocity):
            return self._dvl(stamp, reading)
        if isinstance(reading, Pressure):
            depth_m = self._water.depth_m(reading.pressure_Pa) + self._depth_of_lever_m(self._below_sensor_m)
            return (Stamped(stamp, Attitude((NAN, NAN, NAN), depth_m)),)
        if isinstance(reading, Navigation):
            return self._navigation(stamp, reading)
        return (Stamped(stamp, reading),)

    def _dvl(self, stamp: Stamp, reading: BottomVelocity) -> tuple[Stamped[IdentEvent], ...]:
        """Surge and sway of the center of mass: velocity at the DVL minus that due to rotation at its lever."""
        if reading.velocity_mps is None:
            return ()
        rotated = rotate(self._rotation, reading.velocity_mps)
        by_rotation = cross(self._rate_radps, self._dvl_lever_m)
        nu: Vec6 = (rotated[0] - by_rotation[0], rotated[1] - by_rotation[1], NAN, NAN, NAN, NAN)
        return (Stamped(stamp, Velocity(nu, "dvl")),)

    def _navigation(self, stamp: Stamp, state: Navigation) -> tuple[Stamped[IdentEvent], ...]:
        """Heave velocity, rates, attitude and depth; the navigator's velocity and depth are those of the origin."""
        self._rate_radps = state.rate_radps
        if math.isfinite(sum(state.attitude_rad)):
            self._down = matrix(state.attitude_rad)[2]  # Fossen 2011 eq. 2.18, last row: downward in body axes
        heave_mps = state.velocity_mps[2] + cross(state.rate_radps, self._center_m)[2]
        nu: Vec6 = (NAN, NAN, heave_mps, *state.rate_radps)
        return (
            Stamped(stamp, Attitude(state.attitude_rad, state.depth_m + self._depth_of_lever_m(self._center_m))),
            Stamped(stamp, Velocity(nu, "navigation")),
        )

    def _depth_of_lever_m(self, lever_m: Vec3) -> float:
        """Depth of the end of a lever in body axes below its beginning [m]."""
        return sum(share * length for share, length in zip(self._down, lever_m, strict=True))


def identified(vehicle: Vehicle, capability: Capability) -> str:
    """Sensor whose measurements the identification takes: the first of the vehicle file; empty where it has none."""
    return next(iter(vehicle.measuring(capability)), "")


def _first_mount(vehicle: Vehicle, capability: Capability) -> Mount:
    """Its mount; at the origin and not turned where the file has none."""
    return vehicle.sensors.get(identified(vehicle, capability), Mount(""))


def _difference(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
