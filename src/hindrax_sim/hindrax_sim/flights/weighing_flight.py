"""A known-weight test in lock-step: the vehicle keeps its place while the load of a world comes and goes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from hindrax_control.allocation.allocator import WEIGHED_AT, AllocationKnobs
from hindrax_control.hold.holds import HOLDS, Setpoint
from hindrax_control.pilot import Pilot
from hindrax_core.events import Stamp, Stamped, after, seconds_between
from hindrax_core.signals import Allocation, IdentEvent, Navigation, Phase, Thrust, Velocity
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_sim.conditions.hull import KnownLoad
from hindrax_sim.conditions.world_table import sizes_of
from hindrax_sim.flights.lockstep import Lockstep, LockstepCommand
from hindrax_sim.flights.pool_flight import calibrated
from hindrax_sim.world import Conditions

MOCK_LOADS = {"surge": "line", "sway": "line_aside", "heave": "weight", "yaw": "lines_apart"}
"""Condition of a world that loads each axis."""
SETTLE_S, HOLD_S = 30.0, 20.0
RAMP_per_s = 0.1
"""How gently the load is put on."""
READY_S, LONGEST_START_S, DEPTH_m = 3.0, 30.0, 0.9


def mock_load(axis: str, load_N: float | None = None) -> str:
    """Condition of a world that hangs a load on an axis.

    Parameters
    ----------
    axis
        By name.
    load_N : [N]
        None: the usual one.

    Returns
    -------
    str
        As in `--world`.
    """
    return MOCK_LOADS[axis] if load_N is None else f"{MOCK_LOADS[axis]}={load_N:g}"


class WeighingPilot:
    """Arms, holds every axis, and hangs the load on the vehicle as the operator would."""

    def __init__(self, vehicle: Vehicle, shares: Sequence[float]) -> None:
        self.pilot = Pilot(vehicle)
        self.load: KnownLoad | None = None
        self._shares, self._started_at, self._first = shares, Stamp(0), Stamp(0)
        self._last = Stamp(0)
        self.spans: list[tuple[Stamp, Stamp, float]] = []
        """When a measurement begins and ends, and the share of the load that hangs."""
        self.disarmed_s = math.nan
        """When the stack disarmed by itself, after it was armed; NaN: it did not."""

    def step(self, navigation: Stamped[Navigation], became: Allocation | None, *, armed: bool) -> LockstepCommand:
        """Decide on the next order: hold everything, and change the load when its time is over.

        Parameters
        ----------
        navigation, became, armed
            As of `LockstepPilot.step`.

        Returns
        -------
        LockstepCommand
            Finished after the last load, and where the stack has disarmed: as beside a pool nobody arms it again.
        """
        stamp = navigation.stamp
        self._first = self._first or stamp
        flight = self.pilot.step(navigation.reading, stamp, became, armed=armed)
        if armed and not self._started_at:
            self._started_at = stamp
            for axis in HOLDS:
                if axis != "altitude":
                    level = {"roll": 0.0, "pitch": 0.0, "depth": DEPTH_m}
                    self.pilot.set(Setpoint(axis, value=level.get(axis, math.nan)))
        elapsed_s = seconds_between(self._started_at, stamp) if self._started_at else 0.0
        at, within_s = divmod(elapsed_s, SETTLE_S + HOLD_S)
        if self._started_at and not armed:
            self.disarmed_s = elapsed_s
        finished = at >= len(self._shares) or not math.isnan(self.disarmed_s)
        if self.load is not None and not finished:
            share = self._shares[int(at)]
            most = RAMP_per_s * seconds_between(self._last, stamp) if self._last else 1.0
            self.load.share += max(-most, min(most, share - self.load.share))
            self._last = stamp
            if within_s >= SETTLE_S and len(self.spans) == int(at):
                self.spans.append((stamp, after(stamp, HOLD_S), share))
        ready = seconds_between(self._first, stamp) > READY_S
        return LockstepCommand(flight.wrench, Phase("", "hover"), ready, finished=finished)


@dataclass(frozen=True, slots=True)
class WeighingFlight:
    """Record; begin and end of each measurement, and its load on the axis [N, N m]; why it ended before the last."""

    events: list[Stamped[IdentEvent]]
    spans: list[tuple[Stamp, Stamp, float]]
    aborted: str = ""


def fly_weighing(vehicle: Vehicle, axis: int, world: str, seed: int, shares: Sequence[float]) -> WeighingFlight:
    """Fly a known-weight test in a world with one known load.

    Parameters
    ----------
    vehicle
        The truth, and what the stack knows.
    axis
        That is weighed, 0 (surge) to 5 (yaw).
    world
        As of `--world`, with just one known load.
    seed
        Of noise and world.
    shares
        Of the load, which hang one after the other.

    Returns
    -------
    WeighingFlight
        Events for the identification, and for each share the span of its hold and its load [N, N m].
    """
    vehicle = calibrated(vehicle)
    pilot = WeighingPilot(vehicle, shares)
    step = Lockstep(vehicle, pilot, seed, conditions=Conditions(sizes=sizes_of(world, seed)))
    usual = AllocationKnobs()
    step.onboard.cycle.tune(replace(usual, idle_bias_N=WEIGHED_AT.get(AXES[axis], 1.0) * usual.idle_bias_N))
    (load,) = (one for one in step.world.truth.influences if isinstance(one, KnownLoad))
    pilot.load, load.share = load, 0.0
    events: list[Stamped[IdentEvent]] = []
    for event in step.run(len(shares) * (SETTLE_S + HOLD_S) + LONGEST_START_S):
        reading = event.reading
        if isinstance(reading, Allocation):
            events.append(Stamped(event.stamp, Thrust(reading.achieved, reading.forces_N)))
        elif isinstance(reading, Navigation):
            nu = (*reading.velocity_mps, *reading.rate_radps)
            events.append(Stamped(event.stamp, Velocity(nu, "navigation")))
    aborted = ""
    if not math.isnan(pilot.disarmed_s):
        why = "; ".join(step.onboard.unhealthy) or step.onboard.reason
        aborted = (
            f"{AXES[axis]}: disarmed {pilot.disarmed_s:.0f} s after it was armed, at {load.share:+.0%} of the load, "
            f"wanted all loads held; take a smaller load ({why})"
        )
    return WeighingFlight(
        events, [(begin, end, share * load.level[axis]) for begin, end, share in pilot.spans], aborted
    )
