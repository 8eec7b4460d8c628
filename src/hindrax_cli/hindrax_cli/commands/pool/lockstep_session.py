"""A pool session in lock-step, for `montecarlo --session`: legs and weighings of one world, without ROS."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hindrax_analysis.identification.known_weight import SHARES, LoadSpan, gain_or_reason, holds_of
from hindrax_analysis.identification.known_weight import weigh as weighed
from hindrax_analysis.identification.pool_session import (
    LEGS,
    MASS_GOAL,
    WEIGH,
    PoolSession,
    Reached,
    Step,
    drag_goal,
    order_of,
    planned_steps,
    reached_of,
)
from hindrax_analysis.identification.record_identification import events_apart
from hindrax_analysis.identification.supply_at_rest import RestVolts, at_rest_volts, gain_at_rest_volts
from hindrax_core.events import Stamped
from hindrax_core.signals import IdentEvent
from hindrax_core.text.digits import TWO_SIDED_95
from hindrax_core.vehicle import AXES, AxisGain, Vehicle, load_vehicle
from hindrax_ident.assess.results import Results
from hindrax_ident.online.session import Session
from hindrax_sim.conditions.world_table import rest_volts
from hindrax_sim.flights.pool_flight import PoolFlight, calibrated, fly
from hindrax_sim.flights.weighing_flight import fly_weighing, mock_load

SUPPLY = "supply"
"""Stage of a trial after which the supply of the first legs is known, at rest before and after them."""


def weigh_in_lockstep(
    vehicle: Vehicle, axis: str, world: str, seed: int, shares: Sequence[float] = SHARES
) -> tuple[AxisGain | None, float, str]:
    """Weigh an axis by a known load in lock-step.

    Parameters
    ----------
    vehicle
        Truth, and what the stack knows.
    axis
        By name.
    world, seed
        As of the legs; the load comes on top.
    shares
        Of the load, which hang one after the other.

    Returns
    -------
    tuple[AxisGain | None, float, str]
        Gain with its uncertainty, None without one; the seconds that it takes; why there is none.
    """
    number = AXES.index(axis)
    flight = fly_weighing(vehicle, number, f"{world},{mock_load(axis)}", seed, shares)
    spans = [LoadSpan(*one) for one in flight.spans]
    seconds = 1e-9 * (spans[-1].end - spans[0].begin) if spans else 0.0
    if flight.aborted:
        return None, seconds, flight.aborted
    # A hold that a guard ended is too short to cut out, as beside a pool.
    gain, reason = gain_or_reason(lambda: weighed(holds_of(flight.events, number, spans), number, vehicle))
    return gain, seconds, reason


@dataclass(frozen=True, slots=True)
class SessionTrial:
    """One session of a seed: where it stood after each kind of step, and error of the drag in its deviations."""

    seed: int
    steps: tuple[Step, ...]
    errors: Mapping[str, float] = field(default_factory=dict)
    """By motion: error of the drag at the highest speed; the 95 % interval ends at `TWO_SIDED_95` on either side."""
    trouble: str = ""


def session_trial(seed: int, motions: tuple[str, ...], vehicle_file: str, world: str, repeats: int = 2) -> SessionTrial:
    """Do all steps of a session in one world.

    Parameters
    ----------
    seed
        Of noise, excitation and world.
    motions
        Of the legs.
    vehicle_file
        Truth, and what the stack knows.
    world
        As of `--world`.
    repeats
        Further legs at most.

    Returns
    -------
    SessionTrial
        The estimate after the first legs, without the supply and with it, after all weighings, and after the repeats.
    """
    vehicle = calibrated(load_vehicle(vehicle_file))
    flights: list[PoolFlight] = []
    heard: list[Sequence[Stamped[IdentEvent]]] = []
    steps = planned_steps(motions, repeats)
    planned = steps[steps.index(f"{LEGS} 1") :]
    session = PoolSession({"motions": list(motions)}, planned)
    results = Results({}, vehicle)
    trouble = ""
    for name, after in zip(planned, (*planned[1:], ""), strict=True):
        step = Step(name)
        if step.kind == LEGS:
            events: list[Stamped[IdentEvent]] = []
            flight = fly(order_of(motions, int(step.subject)), seed, world, vehicle=vehicle, listen=events.append)
            trouble = trouble or str(flight.aborted)
            flights.append(flight)
            heard.append(events)
            step = replace(step, seconds=1e-9 * (events[-1].stamp - events[0].stamp) if events else 0.0)
        else:
            gain, seconds, remark = weigh_in_lockstep(vehicle, step.subject, world, seed)
            trouble = trouble or (f"{name}: {remark}" if remark else "")
            step = replace(step, gain=gain, seconds=seconds, remark=remark)
        read, volts = step, None
        if not vehicle.measuring("supply"):
            volts = RestVolts(*rest_volts(vehicle, world, seed, step.seconds))
            found = step.gain
            gain = None if found is None else gain_at_rest_volts(found, vehicle, volts)
            read = replace(step, volts=volts, gain=gain)
        if volts is not None and step.kind == LEGS:
            if len(flights) == 1:  # what the reading buys shows here best: all other steps are still to come
                session = replace(session, done=(replace(step, reached=_reached(_joint(heard, vehicle))),))
                read = replace(read, name=SUPPLY, seconds=0.0)
            heard[-1] = list(at_rest_volts(heard[-1], vehicle, volts))
        session = replace(session, done=(*session.done, read))
        if step.kind == LEGS or not after.startswith(WEIGH):
            results = _joint(heard, session.weighed(vehicle))
            session = replace(session, done=(*session.done[:-1], replace(read, reached=_reached(results))))
    return SessionTrial(seed, session.done, _errors(results, flights[0]), trouble)


def _reached(results: Results) -> dict[str, Reached]:
    return {motion: reached_of(one) for motion, one in results.motions.items()}


def _joint(heard: Sequence[Sequence[Stamped[IdentEvent]]], vehicle: Vehicle) -> Results:
    session = Session(vehicle, every_s=math.inf)
    for event in events_apart([iter(events) for events in heard]):
        session.step(event)
    return session.finalize().results


def _errors(results: Results, flight: PoolFlight) -> dict[str, float]:
    out = {}
    for motion, result in results.motions.items():
        if result.drag is not None:
            side = -1.0 if motion == "heave_up" else 1.0
            truth = abs(flight.drag_N(motion, side * float(result.drag.speed[-1])))
            force, std = result.drag.quoted(-1)
            if result.drag.corrected is not None:
                low, high = result.drag.corrected.at(-1).interval95
                std = abs((force - low if force > truth else high - force) / TWO_SIDED_95)
            out[motion] = (force - truth) / std
    return out


def session_summary(trials: Sequence[SessionTrial]) -> dict[str, Any]:
    """Document of `montecarlo --session`: per motion the goal, medians of what was reached, coverage of the drag.

    Parameters
    ----------
    trials
        One for each seed.

    Returns
    -------
    dict[str, Any]
        With `errors` by seed and motion: of the drag at the highest speed, +-1.96 at either end of its 95 % interval.
    """
    motions = dict.fromkeys(motion for trial in trials for motion in trial.errors)
    minutes = [sum(step.seconds for step in trial.steps) / 60.0 for trial in trials]
    return {
        "runs": len(trials),
        "minutes": float(np.median(minutes)),
        "motions": [_row(motion, [trial for trial in trials if motion in trial.errors]) for motion in motions],
        "errors": {str(trial.seed): dict(trial.errors) for trial in trials},
        "troubles": {str(trial.seed): trial.trouble for trial in trials if trial.trouble},
    }


def _row(motion: str, trials: Sequence[SessionTrial]) -> dict[str, object]:
    first, supplied, weighed_, last = [], [], [], []
    for trial in trials:
        stages = [step for step in trial.steps if motion in step.reached]
        first.append(stages[0].reached[motion].drag)
        supplied.append(next((one for one in stages if one.kind == SUPPLY), stages[0]).reached[motion].drag)
        weighed_.append(next((one for one in reversed(stages) if one.kind == WEIGH), stages[0]).reached[motion].drag)
        last.append(stages[-1].reached[motion])
    drags = np.array([one.drag for one in last])
    causes = [one.cause for one in last]
    return {
        "motion": motion,
        "runs": len(trials),
        "goal_drag": drag_goal(motion),
        "goal_added_mass": MASS_GOAL,
        "drag_first": float(np.median(first)),
        "drag_supply": float(np.median(supplied)),
        "drag_weighed": float(np.median(weighed_)),
        "drag": float(np.median(drags)),
        "drag_p90": float(np.percentile(drags, 90.0)),
        "floor": float(np.median([one.floor for one in last])),
        "cause": max(sorted(set(causes)), key=causes.count),
        "added_mass": float(np.median([one.added_mass for one in last])),
        "coverage95": float(np.mean([abs(trial.errors[motion]) <= TWO_SIDED_95 for trial in trials])),
    }
