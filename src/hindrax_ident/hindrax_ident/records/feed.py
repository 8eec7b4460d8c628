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
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

from hindrax_core.events import EARLIEST, Stamp, Stamped, after, stamp_from_s
from hindrax_core.readings import BottomVelocity, Pressure, Vec3, Vec6
from hindrax_core.rotation import cross, matrix, minus, rotate
from hindrax_core.sensor_table import Capability
from hindrax_core.signals import NAN, Attitude, IdentEvent, Navigation, Phase, Thrust, Velocity, Way
from hindrax_core.vehicle import Mount, Vehicle
from hindrax_ident.records.binning import SONAR
from hindrax_ident.tuning import Tuning


@dataclass(frozen=True, slots=True)
class WallRange:
    """Range to a wall, of a sonar by its name in the vehicle file, and the sonar's confidence in it (0 to 1)."""

    range_m: float
    sensor: str
    confidence: float = 1.0


Measurement: TypeAlias = BottomVelocity | Pressure | WallRange | Navigation | IdentEvent
"""A measurement, or an event that needs no conversion."""
LEAST_CONFIDENCE = 0.5
HALF_BEAM_rad = math.radians(12.5)
"""Of a Ping1D (datasheet: 25 deg at -3 dB)."""
MOST_TURNED, MOST_TILTED = math.cos(math.radians(10.0)), math.cos(math.radians(25.0))
"""Cosines of the angle between the sonar's axis and the normal of the wall, and of the tilt, up to which its range is
that of the wall."""
WALL_SONARS: Sequence[Capability] = ("range_ahead", "range_aside")
DROPPED = "late events dropped"
"""Name in /diagnostics of the number of measurements that came too late to be used."""
VELOCITIES = (BottomVelocity, WallRange, Navigation, Velocity, Way)
"""Measurements to which `velocity_latency_s` applies."""
KINDS = (Phase, Thrust, Navigation, Pressure, BottomVelocity, WallRange, Attitude, Way, Velocity)
"""Order at equal stamps: inputs to the vehicle first, then its motion."""
RANKS: dict[type, int] = {kind: rank for rank, kind in enumerate(KINDS)}
ReadingT = TypeVar("ReadingT")


class StampSorter(Generic[ReadingT]):
    """Sorts measurements by stamp, whatever the order of arrival.

    Topics arrive in different orders live and from a bag; estimates must not depend on it. Each measurement and each
    event waits a short time for others with an earlier stamp, and longer for those of a kind that lags behind on a busy
    machine; later arrivals are dropped and counted.
    """

    __slots__ = ("_count", "_heap", "_lag_ns", "_newest", "_newest_of", "_released", "_wait_ns", "dropped")

    def __init__(self, wait_s: float, lag_s: float = 0.0) -> None:
        """`wait_s`: largest delay against measurements with neighboring stamps; `lag_s`: longest wait for a kind."""
        self._wait_ns, self._lag_ns = stamp_from_s(wait_s), stamp_from_s(lag_s)
        self.dropped = 0
        self._heap: list[tuple[Stamp, int, str, int, Stamped[ReadingT]]] = []
        self._count = 0
        self._newest = self._released = EARLIEST
        self._newest_of: dict[tuple[int, str], Stamp] = {}

    def push(self, *measurements: Stamped[ReadingT]) -> Iterator[Stamped[ReadingT]]:
        """Add measurements, also a backlog of them; one that is too late is dropped and counted.

        Parameters
        ----------
        *measurements
            In any order.

        Yields
        ------
        Stamped[ReadingT]
            Those that have waited long enough, in the order of their stamps.
        """
        for one in measurements:
            stamp, reading = one.stamp, one.reading
            if stamp < self._released:
                self.dropped += 1
                continue
            kind = (RANKS[type(reading)], _source(reading))
            self._count += 1
            heapq.heappush(self._heap, (stamp, *kind, self._count, one))
            self._newest = max(self._newest, stamp)
            self._newest_of[kind] = max(self._newest_of.get(kind, stamp), stamp)
        # A kind that is silent for longer is ignored: a lost sensor must not stop the others.
        silent = self._newest - self._lag_ns
        slowest = min((newest for newest in self._newest_of.values() if newest > silent), default=self._newest)
        yield from self._until(min(slowest, Stamp(self._newest - self._wait_ns)))

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
        self._dvl_lever_m = minus(mount.position_m, self._center_m)
        self._below_sensor_m = minus(self._center_m, _first_mount(vehicle, "depth").position_m)
        self._sonars = {name: _Looking(vehicle.sensors[name], self._center_m) for name in wall_sonars(vehicle)}
        self._attitude_rad: Vec3 = (NAN, NAN, NAN)
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
        if isinstance(reading, WallRange):
            return self._wall_range(stamp, reading)
        if isinstance(reading, Navigation):
            return self._navigation(stamp, reading)
        if isinstance(reading, Phase):
            for sonar in self._sonars.values():
                sonar.aim(reading, self._attitude_rad[2])
        return (Stamped(stamp, reading),)

    def _dvl(self, stamp: Stamp, reading: BottomVelocity) -> tuple[Stamped[IdentEvent], ...]:
        """Surge and sway of the center of mass: velocity at the DVL minus that due to rotation at its lever."""
        if reading.velocity_mps is None:
            return ()
        rotated = rotate(self._rotation, reading.velocity_mps)
        by_rotation = cross(self._rate_radps, self._dvl_lever_m)
        nu: Vec6 = (rotated[0] - by_rotation[0], rotated[1] - by_rotation[1], NAN, NAN, NAN, NAN)
        return (Stamped(stamp, Velocity(nu, "dvl")),)

    def _wall_range(self, stamp: Stamp, reading: WallRange) -> tuple[Stamped[IdentEvent], ...]:
        """Way of the center of mass along the axis that the sonar looks along; none where it may see something else."""
        sonar = self._sonars.get(reading.sensor)
        if sonar is None or not reading.confidence >= LEAST_CONFIDENCE:
            return ()
        way_m = sonar.way_m(reading.range_m, self._attitude_rad)
        if not math.isfinite(way_m):
            return ()
        ways: Vec3 = (way_m, NAN, NAN) if sonar.axis == 0 else (NAN, way_m, NAN)
        return (Stamped(stamp, Way(ways, SONAR)),)

    def _navigation(self, stamp: Stamp, state: Navigation) -> tuple[Stamped[IdentEvent], ...]:
        """Heave velocity, rates, attitude and depth; the navigator's velocity and depth are those of the origin."""
        self._rate_radps, self._attitude_rad = state.rate_radps, state.attitude_rad
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


class _Looking:
    """A sonar that looks ahead or aside at a wall, which is at right angles to that axis when a motion begins."""

    def __init__(self, mount: Mount, center_m: Vec3) -> None:
        roll, pitch, yaw = (math.radians(angle) for angle in mount.rotation_deg)
        self._beam = beam = rotate(matrix((roll, pitch, yaw)), (0.0, 0.0, 1.0))
        self.axis = 0 if abs(beam[0]) >= abs(beam[1]) else 1
        self._sign = math.copysign(1.0, beam[self.axis])
        self._lever_m = minus(mount.position_m, center_m)
        self._before, self._heading_rad = Phase("", ""), NAN

    def aim(self, phase: Phase, heading_rad: float) -> None:
        """Take it that the wall is straight ahead, or aside, where a motion begins."""
        resting = ("", "settle")
        if phase.motion != self._before.motion or (self._before.phase in resting and phase.phase not in resting):
            self._heading_rad = heading_rad
        self._before = phase

    def way_m(self, range_m: float, attitude_rad: Vec3) -> float:
        """Way of the center of mass along the body axis [m]; NaN where the beam may hold something else than the wall.

        Within the beam the nearest point answers, that along the normal n if the beam holds it:

            n p = const - range cos(max(0, slant - half beam)) - n R lever
        """
        roll, pitch, heading = attitude_rad
        turned_rad = heading - self._heading_rad
        turn = matrix((roll, pitch, turned_rad))
        if not (turn[2][2] > MOST_TILTED and math.cos(turned_rad) > MOST_TURNED and range_m > 0.0):  # nor is NaN
            return NAN
        slant_rad = math.acos(min(1.0, self._sign * rotate(turn, self._beam)[self.axis]))
        nearest_m = range_m * math.cos(max(0.0, slant_rad - HALF_BEAM_rad))
        return -self._sign * nearest_m - rotate(turn, self._lever_m)[self.axis]


def wall_sonars(vehicle: Vehicle) -> tuple[str, ...]:
    """Sonars by which surge and sway are identified, the first of each; none beside a DVL."""
    if vehicle.measuring("velocity"):
        return ()
    return tuple(name for looks in WALL_SONARS for name in vehicle.measuring(looks)[:1])


def _source(reading: object) -> str:
    """What tells apart measurements of one kind."""
    if isinstance(reading, WallRange):
        return reading.sensor
    return reading.source if isinstance(reading, Velocity | Way) else ""


def identified(vehicle: Vehicle, capability: Capability) -> str:
    """Sensor whose measurements the identification takes: the first of the vehicle file; empty where it has none."""
    return next(iter(vehicle.measuring(capability)), "")


def _first_mount(vehicle: Vehicle, capability: Capability) -> Mount:
    """Its mount; at the origin and not turned where the file has none."""
    return vehicle.sensors.get(identified(vehicle, capability), Mount(""))
