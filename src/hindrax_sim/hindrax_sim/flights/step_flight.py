"""A vehicle that comes to rest and is then asked for a step: how soon it settles, and how well it holds after that.

    settled, error = step_flight(vehicle, model, STEPS[0])

In lock-step, in a world of one's choice, with the gains that follow from a model of the vehicle and some knobs.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from hindrax_control.hold.holds import HoldKnobs, Holds, Setpoint
from hindrax_control.hold.station_keeping import StationKeeping, StationKeepingKnobs
from hindrax_control.pool_bounds import PoolBounds
from hindrax_core.events import Stamped, seconds_between
from hindrax_core.signals import Allocation, Navigation
from hindrax_core.vehicle import Vehicle
from hindrax_sim.conditions.world_table import IDEAL, sizes_of
from hindrax_sim.flights.lockstep import Lockstep, LockstepCommand
from hindrax_sim.flights.pool_flight import calibrated
from hindrax_sim.world import Conditions

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

    def __init__(
        self,
        vehicle: Vehicle,
        step: SetpointStep,
        holds: HoldKnobs | None = None,
        station: StationKeepingKnobs | None = None,
    ) -> None:
        self._holds, self._station = Holds(vehicle, holds), StationKeeping(vehicle, station)
        self._box = PoolBounds(vehicle, 0.0)
        self._step = step
        self._first: Stamped[Navigation] | None = None
        self._last_s = 0.0
        self._stepped = False
        self.errors: list[tuple[float, float]] = []

    def step(self, navigation: Stamped[Navigation], became: Allocation | None, *, armed: bool) -> LockstepCommand:
        """Hold; the setpoints change once.

        Parameters
        ----------
        navigation, became, armed
            As of `LockstepPilot.step`.

        Returns
        -------
        LockstepCommand
            Wrench of holds and station keeping.
        """
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


@dataclass(frozen=True, slots=True)
class StepOutcome:
    """Time after which the error stays within its band [s], and its root mean square in the end [m, rad].

    `settled` is whether it ever did; a flight that left the water or turned over never does.
    """

    settled_s: float
    error: float
    settled: bool


def step_flight(
    vehicle: Vehicle,
    model: Vehicle,
    step: SetpointStep,
    *,
    holds: HoldKnobs | None = None,
    station: StationKeepingKnobs | None = None,
    world: str = IDEAL,
    seed: int = SEED,
) -> StepOutcome:
    """Fly a step of the setpoints with the true vehicle.

    Parameters
    ----------
    vehicle
        The truth.
    model
        What the pilot takes for it; the gains are made of this one.
    step
        Which setpoints change, and by how much.
    holds, station
        Knobs; None: defaults.
    world, seed
        As of `pool_flight.fly`.

    Returns
    -------
    StepOutcome
        Time until the error stays within its band, and what remains of it.
    """
    pilot = StepPilot(calibrated(model), step, holds, station)
    conditions = Conditions(sizes=sizes_of(world, seed))
    for _ in Lockstep(calibrated(vehicle), pilot, seed, conditions=conditions).run(READY_S + STEP_S + EACH_S):
        pass
    return outcome_of(pilot.errors, step.band)


def outcome_of(errors: Sequence[tuple[float, float]], band: float) -> StepOutcome:
    """Outcome of the errors after a step, with their times [s]."""
    if not errors or not all(math.isfinite(error) for _, error in errors):
        return StepOutcome(EACH_S, math.inf, settled=False)
    outside = max((time_s for time_s, error in errors if abs(error) > band), default=0.0)
    rest = [error * error for time_s, error in errors if time_s > errors[-1][0] - REST_S]
    return StepOutcome(outside, math.sqrt(sum(rest) / len(rest)), settled=outside < EACH_S - REST_S)
