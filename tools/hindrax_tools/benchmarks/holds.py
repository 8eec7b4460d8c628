"""How well the holds hold and how soon they settle, with the model in the vehicle file and without.

With it, feed-forward of mass and drag and all gains are of the identified vehicle, once `./hindrax export --to vehicle`
has written them there. Without it, displaced volume and a box of its envelope stand in. Lock-step in an ideal world.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.hold.holds import Holds, Setpoint
from hindrax_control.hold.station_keeping import StationKeeping
from hindrax_control.pool_bounds import PoolBounds
from hindrax_core.events import Stamped, seconds_between
from hindrax_core.signals import Allocation, Navigation
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_sim.flights.lockstep import Lockstep, LockstepCommand
from hindrax_sim.flights.pool_flight import calibrated

SEED = 3
READY_S, STEP_S, EACH_S = 8.0, 14.0, 14.0
"""Time to arming; to the step, for coming to rest; and after it."""
REST_S = 4.0
"""Last part of the time after the step, in which the hold error counts."""
ALWAYS = (Setpoint("roll", value=0.0), Setpoint("pitch", value=0.0))


@dataclass(frozen=True, slots=True)
class SetpointStep:
    """What is asked for: a way along the pool [m], a depth [m], a heading [rad]; and when it counts as reached."""

    name: str
    way_m: float = 0.0
    depth_m: float = 0.7
    heading_rad: float = 0.0
    band: float = 0.05
    unit: str = "m"
    scale: float = 1.0


STEPS = (
    SetpointStep("1 m along", way_m=1.0),
    SetpointStep("0.4 m down", depth_m=1.1, band=0.03),
    SetpointStep("90 deg", heading_rad=math.pi / 2.0, band=math.radians(2.0), unit="deg", scale=math.degrees(1.0)),
)


class StepPilot:
    """Comes to rest, then steps; keeps the errors after the step with their times [s]."""

    def __init__(self, vehicle: Vehicle, step: SetpointStep) -> None:
        self._holds, self._station, self._box = Holds(vehicle), StationKeeping(vehicle), PoolBounds(vehicle, 0.0)
        self._step = step
        self._first: Stamped[Navigation] | None = None
        self._last_s = 0.0
        self._stepped = False
        self.errors: list[tuple[float, float]] = []

    def step(self, navigation: Stamped[Navigation], became: Allocation | None, *, armed: bool) -> LockstepCommand:
        """Hold; the setpoints change once."""
        self._first = self._first or navigation
        time_s, state = seconds_between(self._first.stamp, navigation.stamp), navigation.reading
        place = self._box.place(state)
        if not armed:
            self._station.start(place)
            self._set(replace(self._step, depth_m=0.7, heading_rad=0.0))
        elif time_s >= READY_S + STEP_S and not self._stepped:
            self._stepped = True
            self._set(self._step)
            x_m, y_m = self._station.goal_m or (place.x_m, place.y_m)
            self._station.goal_m = (x_m + self._step.way_m, y_m)
        if self._stepped:
            self.errors.append((time_s - READY_S - STEP_S, self._error(state)))
        held = self._holds.step(state, navigation.stamp, became.shortfall if became else (0.0,) * 6, armed=armed)
        X, Y = self._station.step(place, time_s - self._last_s) if armed else (0.0, 0.0)
        self._last_s = time_s
        _, _, Z, K, M, N = held.wrench
        return LockstepCommand((X, Y, Z, K, M, N), armed=time_s >= READY_S)

    def _set(self, step: SetpointStep) -> None:
        for setpoint in (Setpoint("depth", value=step.depth_m), Setpoint("heading", value=step.heading_rad), *ALWAYS):
            self._holds.set(setpoint)

    def _error(self, state: Navigation) -> float:
        if self._step.way_m:
            return (self._station.goal_m or (math.nan,))[0] - self._box.place(state).x_m
        if self._step.heading_rad:
            return math.remainder(self._step.heading_rad - state.attitude_rad[2], math.tau)
        return self._step.depth_m - state.depth_m


def rows() -> list[dict[str, Any]]:
    """A row per vehicle and step: settling time and hold error with the model, beside those without it."""
    vehicles = [calibrated(load_vehicle(file)) for file in sorted(default_vehicle().parent.glob("*.yaml"))]
    return [_row(vehicle, step) for vehicle in vehicles for step in STEPS]


def _row(vehicle: Vehicle, step: SetpointStep) -> dict[str, Any]:
    known, unknown = measured(vehicle, vehicle, step), measured(vehicle, replace(vehicle, hydrodynamics=None), step)
    return {
        "name": f"{vehicle.name}, {step.name}: {_text(known, step)}",
        "peer": f"without the model: {_text(unknown, step)}",
        "ratio": unknown["settled_s"] / known["settled_s"],
        "with": known,
        "without": unknown,
    }


def _text(found: Mapping[str, float], step: SetpointStep) -> str:
    reached = found["settled_s"] < EACH_S - REST_S
    settled = f"settled in {found['settled_s']:.1f} s" if reached else f"not settled in {EACH_S:.0f} s"
    return f"{settled}, hold error {found['error'] * step.scale:.3f} {step.unit}"


def measured(vehicle: Vehicle, model: Vehicle, step: SetpointStep) -> dict[str, float]:
    """Time after which the error stays within the band [s], and its root mean square in the end [m, rad]."""
    pilot = StepPilot(model, step)
    for _ in Lockstep(vehicle, pilot, SEED).run(READY_S + STEP_S + EACH_S):
        pass
    outside = [time_s for time_s, error in pilot.errors if abs(error) > step.band]
    rest = [error * error for time_s, error in pilot.errors if time_s > pilot.errors[-1][0] - REST_S]
    return {"settled_s": max(outside, default=0.0), "error": math.sqrt(sum(rest) / len(rest))}
