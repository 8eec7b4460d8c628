"""Identification from velocities and wrenches of any vehicle, not divided into maneuvers.

As over a third-party record, each axis is identified apart, with everything that comes as its excitation; here while it
comes. Velocities and wrenches are those of the center of mass, SNAME.
"""

import math
from collections.abc import Iterator, Mapping, Sequence

from hindrax_core.events import Stamped, after
from hindrax_core.readings import Vec6
from hindrax_core.signals import NAN, Attitude, Estimate, IdentEvent, Phase, Thrust, Velocity, Way
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.assess.plausibility import turned_by, with_mass_checks, with_plausibility_check
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.model.motion_model import motions_of
from hindrax_ident.online.coupled_masses import with_found_masses
from hindrax_ident.online.session import Session
from hindrax_ident.records.feed import StampSorter
from hindrax_ident.tuning import Tuning, for_foreign_records

SOURCE = "record"
EVERY_S = 0.2
"""Least time between two estimates of an axis: one takes longer than learning from a sample, and there are six axes."""


class RecordSession:
    """One session per axis over the same measurements, in whatever order they come."""

    def __init__(self, vehicle: Vehicle, tuning: Tuning | None = None) -> None:
        tuning = for_foreign_records(tuning or Tuning())
        self._vehicle = vehicle
        self._sorter: StampSorter[IdentEvent] = StampSorter(tuning.reorder_s, tuning.lagging_s)
        self._sessions = [Session(vehicle, tuning, every_s=EVERY_S) for _ in AXES]
        self._pushed = [False] * len(AXES)
        self._started = False

    @property
    def dropped(self) -> int:
        """Number of measurements dropped because they arrived too late."""
        return self._sorter.dropped

    @property
    def pushed(self) -> list[Session]:
        """Sessions of the axes that were pushed."""
        return [session for session, pushed in zip(self._sessions, self._pushed, strict=True) if pushed]

    def step(self, *measurements: Stamped[IdentEvent]) -> Iterator[Stamped[Estimate]]:
        """Add velocities, attitudes and thrusts; yield the estimates of the axes that were pushed so far."""
        for event in self._sorter.push(*measurements):
            yield from self._process(event)

    def finalize(self) -> Mapping[str, MotionResult]:
        """Verdicts on the motions of the axes that were pushed; the measurements still waiting are left out."""
        outcomes = with_found_masses(
            self._vehicle, lambda masses: [session.finalize(found_masses=masses) for session in self.pushed]
        )
        turned = turned_by([self._sessions[0].planar()])
        checked = (
            with_plausibility_check(one, self._vehicle, turned)
            for outcome in outcomes
            for one in outcome.results.motions.values()
        )
        return {one.motion: with_mass_checks(one, self._vehicle) for one in checked}

    def _process(self, event: Stamped[IdentEvent]) -> Sequence[Stamped[Estimate]]:
        found: list[Stamped[Estimate]] = []
        for axis, session in enumerate(self._sessions):
            if not self._started:
                session.step(Stamped(after(event.stamp, -1e-3), Phase(motions_of(axis)[0].name, "excite")))
            reading = of_axis(event.reading, axis)
            if reading is not None:
                self._pushed[axis] |= isinstance(reading, Thrust) and reading.wrench[axis] != 0.0
                estimates = session.step(Stamped(event.stamp, reading))
                found += estimates if self._pushed[axis] else ()
        self._started = True
        return found


def of_axis(reading: IdentEvent, axis: int) -> IdentEvent | None:
    """Pick the part of a measurement that the session of one axis is to have.

    Velocities and thrusts are those of all axes: motion along the others causes forces on this one.

    Parameters
    ----------
    reading
        Any event of a record.
    axis
        0 to 5.

    Returns
    -------
    IdentEvent | None
        None where it says nothing about the axis.
    """
    if isinstance(reading, Thrust):
        return Thrust(finite_wrench(reading.wrench)) if math.isfinite(reading.wrench[axis]) else None
    if isinstance(reading, Velocity):
        return Velocity(reading.nu, SOURCE) if any(map(math.isfinite, reading.nu)) else None
    if isinstance(reading, Way):
        return reading if axis < 3 and math.isfinite(reading.way_m[axis]) else None
    if isinstance(reading, Attitude) and axis != 2:
        roll, pitch, _ = reading.attitude_rad
        return Attitude((roll, pitch, NAN)) if math.isfinite(roll) or math.isfinite(pitch) else None
    return None


def finite_wrench(wrench: Sequence[float]) -> Vec6:
    """Six forces and moments; zero where one is unknown: those of other axes show when they were flown."""
    X, Y, Z, K, M, N = (force if math.isfinite(force) else 0.0 for force in wrench)
    return (X, Y, Z, K, M, N)
