"""The flights behind the figures of the explanation: pool tests in lock-step, kept as plain numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.maneuver.goal import Goal
from hindrax_core.events import Stamped
from hindrax_core.signals import Estimate
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.online.session import Session
from hindrax_sim.flights.goal_pilot import GoalPilot
from hindrax_sim.flights.lockstep import Lockstep
from hindrax_sim.world import Conditions

LONGEST_S = 3600.0
EVERY = 40
"""Of the online estimates every so many are kept: a figure has no more points."""


@dataclass(frozen=True, slots=True)
class FigureFlight:
    """One pool test in surge: seed of everything random, and true thrust over the thrust that the curve promises."""

    seed: int
    thrust_gain: float


FLIGHTS = tuple(FigureFlight(seed, gain) for gain in (1.0, 1.03) for seed in range(1, 9))


def flown(flight: FigureFlight, vehicle_file: Path | None = None) -> dict[str, Any]:
    """Fly one and keep its coefficients, and what was known of them on the way."""
    vehicle = load_vehicle(vehicle_file or default_vehicle())
    session = Session(vehicle)
    pilot = GoalPilot(vehicle, Goal(("surge",), "plateaus", flight.seed))
    conditions = Conditions(sizes={"thrust_gain": flight.thrust_gain - 1.0})
    steps = Lockstep(vehicle, pilot, flight.seed, conditions=conditions, session=session).run(LONGEST_S)
    online = [event for event in steps if isinstance(event, Stamped) and isinstance(event.reading, Estimate)]
    result = session.finalize().results.motions["surge"]
    found = {
        name: [round(one, 5) for one in (number.value, number.std, number.std_calibrated)]
        for name, number in result.coefficients.items()
    }
    return {"seed": flight.seed, "thrust_gain": flight.thrust_gain, "found": found, "online": list(_course(online))}


def _course(online: list[Stamped[Any]]) -> Iterator[dict[str, Any]]:
    """Time since the first estimate, values and deviations, thinned."""
    first = online[0].stamp
    for one in online[::EVERY]:
        estimate: Estimate = one.reading
        deviations = [round(estimate.covariance[i][i] ** 0.5, 4) for i in range(len(estimate.names))]
        values = [round(value, 4) for value in estimate.values]
        yield {"time_s": round((one.stamp - first) * 1e-9, 2), "values": values, "stds": deviations}
