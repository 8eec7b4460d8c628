"""A commissioning in lock-step: the vehicle's own pilot flies the pulses, with a vehicle that is built otherwise."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_control.commissioning.commissioning import Commissioning
from hindrax_control.commissioning.findings import Findings
from hindrax_control.maneuver.goal import Goal
from hindrax_control.maneuver.maneuver import ManeuverOutput
from hindrax_control.pilot import Pilot
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.signals import Allocation, Navigation, Phase
from hindrax_core.text.refusals import NOTHING, Refusal
from hindrax_core.vehicle import Vehicle
from hindrax_sim.conditions.world_table import IDEAL, sizes_of
from hindrax_sim.faults.fault_registry import FaultSpec
from hindrax_sim.flights.lockstep import Lockstep, LockstepCommand
from hindrax_sim.flights.pool_flight import calibrated
from hindrax_sim.world import Conditions

AFLOAT_S, REST_S = 3.0, 3.0
"""Time until the navigator has begun, and that of the rest before arming."""
PATIENCE_S, LONGEST_S = 10.0, 300.0


@dataclass(frozen=True, slots=True)
class CommissioningFlight:
    """What was found, how long it took from the rest on [s], and the largest true tilt [deg]."""

    findings: Findings
    seconds: float
    tilt_deg: float


class CommissioningPilot:
    """Rests, arms, flies what the commissioning asks for, as an operator with the command does."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.pilot, self.work = Pilot(vehicle), Commissioning(vehicle)
        self.ended = ""
        self._first: Stamp | None = None
        self._rested = False
        self._asked: Stamp | None = None
        self._goal: Goal | None = None
        self._began = False

    def step(self, navigation: Stamped[Navigation], became: Allocation | None, *, armed: bool) -> LockstepCommand:
        """Decide on the next order: first rest, then one goal of pulses after the other.

        Parameters
        ----------
        navigation, became, armed
            As of `LockstepPilot.step`.

        Returns
        -------
        LockstepCommand
            Wrench or forces, and whether it should be armed.
        """
        stamp = navigation.stamp
        self._first = self._first or stamp
        flight = self.pilot.step(navigation.reading, stamp, became, armed=armed)
        since_s = seconds_between(self._first, stamp)
        if since_s < AFLOAT_S + REST_S:
            return LockstepCommand()
        if not self._rested:
            self._rested = True
            self.work.rest(Stamp(stamp - round(REST_S * 1e9)), stamp)
            return self._follow(stamp)
        if not armed:
            return self._wait(stamp, flight.maneuver)
        if self._goal is not None or (flight.maneuver is not None and flight.maneuver.done):
            return self._end_or_begin(stamp, flight.maneuver)
        phase = flight.maneuver.phase if flight.maneuver else Phase("", "")
        return LockstepCommand(flight.wrench, phase, armed=True, forces_N=flight.forces_N)

    def _wait(self, stamp: Stamp, flown: ManeuverOutput | None) -> LockstepCommand:
        """Arm; end where that takes too long, or where it was disarmed in flight."""
        self._asked = self._asked or stamp
        if not self._began and seconds_between(self._asked, stamp) <= PATIENCE_S:
            return LockstepCommand(armed=True)
        self.ended = f"disarmed: {flown.aborted if flown else 'it did not arm'}"
        return LockstepCommand(finished=True)

    def _end_or_begin(self, stamp: Stamp, flown: ManeuverOutput | None) -> LockstepCommand:
        """Begin the goal that waits, or ask for one after the end of the last."""
        goal, self._goal = self._goal, None
        if goal is None:
            return self._follow(stamp, flown.aborted if flown else NOTHING)
        try:
            self.pilot.fly(goal)
        except HindraxError as error:
            self.ended = str(error)
        self._began = True
        return LockstepCommand(armed=True, finished=bool(self.ended))

    def _follow(self, stamp: Stamp, aborted: Refusal = NOTHING) -> LockstepCommand:
        """Fly the next pulses, or end."""
        pulses = self.work.gentler(stamp, aborted) if aborted else self.work.next_pulses(stamp)
        if pulses is None:
            self.ended = aborted
            return LockstepCommand(finished=True)
        self._goal = Goal((), pulses=pulses)
        return LockstepCommand(armed=True)


def fly_commissioning(
    vehicle: Vehicle,
    seed: int,
    world: str = IDEAL,
    faults: Sequence[FaultSpec] = (),
    *,
    built: Vehicle | None = None,
    by_bytes: bool = False,
) -> CommissioningFlight:
    """Commission a vehicle file in lock-step.

    Parameters
    ----------
    vehicle
        Whose file is to be proven.
    seed
        Of noise, and of what is random in world and faults.
    world
        As of `--world`.
    faults
        On top of it.
    built
        The vehicle as it is; None: as its file.
    by_bytes
        Whether all goes through drivers and emulators; it takes ten times as long.

    Returns
    -------
    CommissioningFlight
        Findings, time and the largest tilt.
    """
    vehicle = calibrated(vehicle)
    pilot = CommissioningPilot(vehicle)
    step = Lockstep(
        vehicle,
        pilot,
        seed,
        by_bytes=by_bytes,
        conditions=Conditions(sizes=sizes_of(world, seed)),
        faults=faults,
        listen=pilot.work.on_reading,
        built=built,
    )
    tilt = 1.0
    for event in step.run(LONGEST_S):
        if isinstance(event.reading, Allocation):
            pilot.work.on_forces(event.stamp, event.reading.forces_N)
        roll, pitch, _ = step.world.attitude_rad
        tilt = min(tilt, math.cos(roll) * math.cos(pitch))
    ended = "; ".join(one for one in (pilot.ended, *step.onboard.unhealthy) if one)
    return CommissioningFlight(pilot.work.finalize(ended), step.elapsed_s - AFLOAT_S, math.degrees(math.acos(tilt)))
