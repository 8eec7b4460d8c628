"""A dress rehearsal: a pool test flown in lock-step, reported as a timetable with clearances, charge and intervals."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

from hindrax_control.maneuver.goal import PLATEAUS
from hindrax_control.maneuver.maneuver import ManeuverOutput
from hindrax_control.maneuver.plan import Plan
from hindrax_control.prior_dynamics import guessed
from hindrax_core.events import Stamp, seconds_between
from hindrax_core.text.refusals import Refusal
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.objections import Objection
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.online.aim import Aim
from hindrax_sim.conditions.world_table import IDEAL
from hindrax_sim.flights.pool_flight import fly
from hindrax_sim.world import World

S_PER_H = 3600.0
REPORT_S = 5.0


@dataclass(slots=True)
class Flown:
    """One motion of a rehearsal: when it is flown, how near the hull comes to walls and floor, and what it draws."""

    motion: str
    begin_s: float
    end_s: float
    wall_m: float = math.inf
    floor_m: float = math.inf
    charge_Ah: float = 0.0
    """Of the thrusters alone."""


@dataclass(frozen=True, slots=True)
class ExpectedBand:
    """Standard deviations to be expected, as shares of the drag at the highest speed, and of the added mass [-].

    `noise`: of this record alone. NaN where the coefficient will not be identified, with `reasons`.
    """

    speed: float
    noise: float
    calibrated: float
    added_mass: float
    reasons: tuple[Objection, ...]


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """Forecast of a pool test. `aborted`: "guard: sentence" of the rehearsal, empty when all was flown."""

    vehicle: str
    world: str
    plans: tuple[Plan, ...]
    flown: tuple[Flown, ...]
    bands: Mapping[str, ExpectedBand]
    ended: str
    """Reason why an experiment chose nothing more."""
    aborted: Refusal

    @property
    def seconds(self) -> float:
        """Time in the water, from the start of the maneuver to its end [s]."""
        return self.flown[-1].end_s if self.flown else 0.0

    @property
    def charge_Ah(self) -> float:
        """Charge that the thrusters draw."""
        return sum(one.charge_Ah for one in self.flown)

    def document(self) -> dict[str, object]:
        """Plain data for JSON."""
        return {
            "vehicle": self.vehicle,
            "world": self.world,
            "plan": [{"motion": one.motion, "rates": list(one.rates), "seconds": one.seconds} for one in self.plans],
            "timetable": [asdict(one) for one in self.flown],
            "seconds": self.seconds,
            "charge_Ah": self.charge_Ah,
            "bands": {motion: asdict(band) for motion, band in self.bands.items()},
            "ended": self.ended,
            "aborted": self.aborted or None,
            "aborted_by": self.aborted.word,
        }


def rehearse(
    motions: Sequence[str],
    seed: int,
    world: str = IDEAL,
    *,
    vehicle: Vehicle,
    excitation: str = PLATEAUS,
    aim: Aim | None = None,
    report: Callable[[str], object] = lambda _: None,
) -> Rehearsal:
    """Fly motions in lock-step with the vehicle file as the truth; UsageError when they cannot be flown.

    Parameters
    ----------
    motions, seed, world, excitation, aim
        As of `pool_flight.fly`.
    vehicle
        One without hydrodynamics is given those that its plans suppose.
    report
        Told how far it is, once per `REPORT_S` of the vehicle.

    Returns
    -------
    Rehearsal
        For each motion its time, the nearest wall and floor and the charge; and the expected uncertainty.
    """
    if vehicle.hydrodynamics is None:
        vehicle = replace(vehicle, hydrodynamics=guessed(vehicle))
    rows: list[Flown] = []
    started: Stamp | None = None
    reported = [0]

    def watch(truth: World, output: ManeuverOutput) -> None:
        """Keep a row for every motion, in the order in which they are flown."""
        nonlocal started
        started = truth.stamp if started is None else started
        now_s = seconds_between(started, truth.stamp)
        motion = output.phase.motion.partition("_")[0]
        if now_s >= REPORT_S * reported[0]:
            reported[0] += 1
            part = f"{motion}, {len({one.motion for one in rows} | {motion})} of {len(motions)}" if motion else "begins"
            report(f"{part}, {now_s:.0f} s in the water")
        if motion and (not rows or rows[-1].motion != motion):
            rows.append(Flown(motion, now_s, now_s))
        row = rows[-1]
        along_m, across_m, below_m = truth.box.clearance_m(truth.plant)
        row.wall_m, row.floor_m = min(row.wall_m, along_m, across_m), min(row.floor_m, below_m)
        row.charge_Ah += truth.supply_A * (now_s - row.end_s) / S_PER_H
        row.end_s = now_s

    flight = fly(motions, seed, world, vehicle=vehicle, excitation=excitation, watch=watch, aim=aim)
    bands = {motion: _band(result) for motion, result in flight.outcome.results.motions.items()}
    ended = flight.experiment.ended if flight.experiment else ""
    return Rehearsal(vehicle.name, world, flight.plans, tuple(rows), bands, ended, flight.aborted)


def _band(result: MotionResult) -> ExpectedBand:
    drag, mass = result.drag, result.coefficients.get("added_mass")
    force, std = drag.quoted(-1) if drag else (math.nan, math.nan)
    return ExpectedBand(
        speed=result.speeds[1],
        noise=abs(float(drag.std[-1] / drag.force[-1])) if drag else math.nan,
        calibrated=abs(std / force) if drag else math.nan,
        added_mass=abs(mass.quoted[1] / mass.quoted[0]) if mass else math.nan,
        reasons=result.reasons,
    )
