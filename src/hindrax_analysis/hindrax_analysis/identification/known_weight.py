"""Gain of the thrust from a known weight: the vehicle keeps its place with it and without it. No load cell.

At rest, gain x thrust of the curves + known load + what else pulls = 0. What else pulls (net buoyancy, tether, current)
is the same with and without. Pure, over the events of any record; uncertainty by GUM (JCGM 100), clause 5.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_control.prior_dynamics import PriorDynamics, prior_dynamics
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.readings import Vec6, vec6
from hindrax_core.signals import IdentEvent, Thrust, Velocity
from hindrax_core.vehicle import AXES, AxisGain, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.thrust_calibration import PROBABLE, lost_to_dead_bands, thrust_shares

BLOCKS = 8
"""Parts of a hold whose means give the deviation of the mean of all."""
LEAST_SAMPLES = 5 * BLOCKS
LARGEST_DRIFT = 0.03
"""Mean velocity of a hold above which the vehicle does not keep its place [m/s, rad/s]."""
LEAST_SHARE = 0.3
"""Thrust in a direction, of the largest load, from which its gain is reported."""
DVL_mps = 0.002
"""Standard deviation of a bias of the velocity, at which a vehicle that holds its place by it drifts."""
DEAD_BAND = 0.015
"""Standard deviation of a thrust near the dead bands, of the largest [-]."""
DIFFERENCE = 0.02
"""Prior standard deviation of half the difference of the gain between both ways [-]."""
SHARES = (0.0, 1.0, -1.0, 1.0, -1.0)
"""Of the load, which hang one after the other: twice each way, the second time with an emptier battery."""
SAG_per_s = 0.1 / 900.0
"""Prior standard deviation of the thrust's drift: that of the budget's row."""
SUPPLY = 0.003
"""Thrust between two charged batteries, or two settings of a supply [-]."""
ALIGNMENT = 0.0006
"""Load that does not act along the axis: two degrees."""
KNOWN_WITHOUT = 0.045
"""Deviation of the gain without a weighing: losses between thrusters and hull 4 %, curves 2 % (ADR 35) [-]."""
MOST_MISFIT = 20.0
"""Contradiction of the holds, in standard deviations, from which they are no weighing."""
ASIDE = 0.15
"""Standard deviation of the moment that a thrust on other axes turns out to have, per its part of the effort [-].

Thrusters differ, and near a dead band a force of 0.7 N is a third off: a line at the bow, whose pull aside takes 1.6 of
the effort of its moment, gave gains of yaw of 0.90 to 1.35 where two lines gave 0.99 (mock, *pool*)."""
PASSES = 3
EXACT = 1e-5
"""Least deviation of a hold, of the loads: numbers of a simulator may have none [-]."""
SOURCES = ("scatter of the thrust", "quality of the hold", "drift of the DVL", "dead bands")
OTHER_AXES, DIFFERENT = "thrust on other axes", "dead bands that differ"
BETTER = {
    OTHER_AXES: "lead the line so that it acts along the axis alone; yaw takes two lines that pull opposite ways",
    DIFFERENT: "weigh with a larger load, or with a larger idle_bias_N of the allocator, so that every thruster pushes "
    "well beyond its dead band",
}
"""What to do about a source, where LARGER is no help, or not all of it."""
LARGER = "weigh with a larger load, for longer, and with the tether slack"


@dataclass(frozen=True, slots=True)
class LoadSpan:
    """Interval of a load [N, N m, with the axis] on the vehicle, from one stamp to another."""

    begin: Stamp
    end: Stamp
    load: float


@dataclass(frozen=True, slots=True)
class Hold:
    """One span at rest: thrust of the curves (n,), velocity along the axis (m,), from `begin_s` on for `long_s`.

    `wrench` is the mean thrust on all axes [N, N m], `forces` (k,) that of each thruster [N]; empty where unknown.
    """

    load: float
    begin_s: float
    long_s: float
    thrust: Array
    velocity: Array
    wrench: Vec6 = (0.0,) * 6
    forces: Array = field(default_factory=lambda: array(np.zeros(0)), compare=False)


@dataclass(frozen=True, slots=True)
class Weighing:
    """Gain of one axis, each way, with what its standard deviation is made of [-], and the drift of the thrust [1/s].

    `misfit`: root mean square of what the holds contradict each other by, in standard deviations.
    """

    axis: str
    gain: AxisGain
    contributions: Mapping[str, float]
    drift_per_s: float
    misfit: float

    @property
    def refused(self) -> str:
        """Why its gain is worth nothing; empty where it is known better than without a weighing.

        The identification takes a gain for what it says: one of +- 50 % replaced what was known to 4.5 %.
        """
        if self.misfit > MOST_MISFIT:
            return (
                f"{self.axis}: the holds contradict each other by {self.misfit:.0f} deviations; check line and pulley"
            )
        if self.gain.sigma <= KNOWN_WITHOUT:
            return ""
        source = max(self.contributions, key=self.contributions.__getitem__)
        return (
            f"{self.axis}: the gain is known to +-{self.gain.sigma:.1%}, most of it by {source}, and to "
            f"{KNOWN_WITHOUT:.1%} without a weighing: {BETTER.get(source, LARGER)}"
        )


def holds_of(events: Iterable[Stamped[IdentEvent]], axis: int, spans: Sequence[LoadSpan]) -> list[Hold]:
    """Cut the spans of a known-weight test out of a record.

    Parameters
    ----------
    events
        Of the record, in any order.
    axis
        Index, 0 to 5.
    spans
        When which load was on the vehicle.

    Returns
    -------
    list[Hold]
        One per span.

    Raises
    ------
    HindraxError
        Names a span in which too little was recorded.
    """
    recorded, first = list(events), min((span.begin for span in spans), default=Stamp(0))
    out = []
    for span in spans:
        readings = [event.reading for event in recorded if span.begin <= event.stamp < span.end]
        thrusts = [one for one in readings if isinstance(one, Thrust)]
        wrenches = np.array([one.wrench for one in thrusts]).reshape(-1, len(AXES))
        velocity = [one.nu[axis] for one in readings if isinstance(one, Velocity) and math.isfinite(one.nu[axis])]
        if len(wrenches) < LEAST_SAMPLES or len(velocity) < 2:
            raise HindraxError(
                f"hold with {span.load:+.3g}: found {len(wrenches)} wrenches and {len(velocity)} velocities in "
                f"{seconds_between(span.begin, span.end):.0f} s, wanted {LEAST_SAMPLES} and 2"
            )
        long_s = seconds_between(span.begin, span.end)
        begin_s, mean = seconds_between(first, span.begin), vec6(wrenches.mean(axis=0).tolist())
        forces = np.mean([one.forces_N for one in thrusts], axis=0) if all(one.forces_N for one in thrusts) else []
        out.append(Hold(span.load, begin_s, long_s, wrenches[:, axis], np.array(velocity), mean, array(forces)))
    return out


def weigh(holds: Sequence[Hold], axis: int, vehicle: Vehicle, *, load_sigma: float = 0.002) -> Weighing:
    """Gain of an axis from holds with and without load: least squares of the balance at rest of every hold.

        gain x thrust + half the difference x |thrust| + what else pulls + drift x time x thrust = -load

    Four unknowns, linear, each hold weighted by its own deviation. Two are kept by priors from what a few holds cannot
    tell: the difference between both ways (unless one way alone was weighed, where it means nothing), and the drift of
    a battery. Thrust ahead and astern are means of their own, since a hold near balance works both ways.

    Parameters
    ----------
    holds
        Two at least, with loads that differ.
    axis
        Index, 0 to 5.
    vehicle
        Drag and inertia tell what a hold that was not quite still may be wrong by, the thrusters what thrust on other
        axes may be.
    load_sigma : [-]
        Standard deviation of weight and lever together.

    Returns
    -------
    Weighing
        Gain in each way that was weighed, and what its deviation is made of.

    Raises
    ------
    HindraxError
        Where the loads do not differ, the vehicle did not keep its place, or its thrust did not carry them.
    """
    name, unit = AXES[axis], "m/s" if axis < 3 else "rad/s"
    for hold in holds:
        if abs(hold.velocity.mean()) > LARGEST_DRIFT:
            raise HindraxError(
                f"{name}: moved at {hold.velocity.mean():+.3f} {unit} under {hold.load:+.3g}, "
                f"wanted at most {LARGEST_DRIFT:g}; hold the axis, or take a smaller load"
            )
    loads = np.array([hold.load for hold in holds])
    if len(holds) < 2 or np.ptp(loads) == 0.0:
        raise HindraxError(f"{name}: found no two loads that differ, wanted holds with the weight and without it")
    # Means of the thrust ahead and of that astern.
    ways = np.array([(np.maximum(hold.thrust, 0.0).mean(), np.minimum(hold.thrust, 0.0).mean()) for hold in holds])
    sigmas = np.maximum(_deviations(holds, axis, prior_dynamics(vehicle)[name]), EXACT * np.ptp(loads))
    reached = ways[:, 0].max(), -ways[:, 1].min()
    weighed = [reach >= LEAST_SHARE * float(np.abs(loads).max()) for reach in reached]
    if not any(weighed):
        raise HindraxError(
            f"{name}: in neither direction did the thrust carry {LEAST_SHARE:.0%} of the load, so something else did; "
            "weigh with the tether slack, away from walls and floor"
        )
    both = np.array([ways.sum(axis=1), ways[:, 0] - ways[:, 1]]).T
    middle_s = np.array([hold.begin_s + 0.5 * hold.long_s for hold in holds])
    # Unknown: the gain, half its difference between both ways, what else pulls, and the drift of the thrust.
    A = np.column_stack([both, np.ones(len(holds)), middle_s * both[:, 0]])
    prior = np.diag([0.0, DIFFERENCE**-2 if all(weighed) else 1e12, 0.0, SAG_per_s**-2])
    misfit = 1.0
    for _ in range(PASSES):
        # Holds that contradict each other are worth less, also against the priors: then these say more.
        wide = max(1.0, misfit) * sigmas
        weight = 1.0 / np.sum(wide**2, axis=1)
        solve = np.linalg.inv(A.T * weight @ A + prior)
        gains = solve @ (A.T * weight)
        theta = gains @ -loads
        residual = (-loads - A @ theta) / np.sqrt(np.sum(sigmas**2, axis=1))
        misfit = math.sqrt(float(residual @ residual) / max(1, len(holds) - 3))
    parts = {name: float(np.linalg.norm(gains[0] * wide[:, k])) for k, name in enumerate(SOURCES)}
    parts |= {"drift of the battery": float(abs(solve[0, 3])) / SAG_per_s}
    parts |= {OTHER_AXES: ASIDE * _effort_on_other_axes(holds, axis, vehicle)}
    parts |= {DIFFERENT: _by_dead_bands(holds, axis, vehicle, gains[0])}
    parts |= {"weight and lever": load_sigma, "another battery": SUPPLY, "alignment": ALIGNMENT}
    gain = AxisGain(
        load=float(np.abs(loads).max()),
        sigma=math.hypot(*parts.values()),
        sigma_difference=math.sqrt(solve[1, 1]) if all(weighed) else 0.0,
        positive=float(theta[0] + theta[1]) if weighed[0] else None,
        negative=float(theta[0] - theta[1]) if weighed[1] else None,
    )
    return Weighing(name, gain, parts, float(theta[3] / theta[0]), misfit)


def gain_or_reason(weighing: Callable[[], Weighing]) -> tuple[AxisGain | None, str]:
    """What a session, which goes on in either case, has of a weighing.

    Parameters
    ----------
    weighing
        Weighs; a HindraxError of it is the reason.

    Returns
    -------
    tuple[AxisGain | None, str]
        The gain, or None and why there is none that is worth anything.
    """
    try:
        found = weighing()
    except HindraxError as error:
        return None, str(error)
    return (None, found.refused) if found.refused else (found.gain, "")


def _effort_on_other_axes(holds: Sequence[Hold], axis: int, vehicle: Vehicle) -> float:
    """Thrust on other axes that comes and goes with the load, relative to that against the load: of thrusters [N/N].

    Each as the least squares of forces that give it (pseudo-inverse of the effectiveness), so that newtons and newton
    meters compare.
    """
    loads = np.array([hold.load for hold in holds])
    with_load = loads - loads.mean()
    slope = with_load @ np.array([hold.wrench for hold in holds]) / (with_load @ with_load)
    forces = np.linalg.pinv(effectiveness(vehicle))
    own = forces[:, axis] * slope[axis]
    slope[axis] = 0.0
    return float(np.linalg.norm(forces @ slope) / np.linalg.norm(own)) if own.any() else 0.0


def _by_dead_bands(holds: Sequence[Hold], axis: int, vehicle: Vehicle, per_balance: Array) -> float:
    """Standard deviation of a gain by dead bands that differ, each thruster's the same in all holds [-].

    What they take from thrusters that all push against the load, they take in flight too: it is in the gain, as it
    should be. What counts is the difference. In yaw of 2.25 N m thrusters idle against the load with 1.3 N, just above
    their least force: one that starts 6 us later gives none of it, and the gain was 1.15 (mock, *pool*, seed 40),
    "known to 1 %".

    Parameters
    ----------
    holds
        With the mean force of each thruster, else 0 is returned.
    axis, vehicle
        As of `weigh`.
    per_balance : (n,) [1/N, 1/(N m)]
        What an error of each hold's balance does to the gain.
    """
    if not vehicle.thrusters or any(len(hold.forces) != len(vehicle.thrusters) for hold in holds):
        return 0.0
    shares = np.array([share for _, share in thrust_shares(vehicle, axis).values()])
    held = [hold.forces for hold in holds]
    together = [array(shares * hold.wrench[axis]) for hold in holds]
    lost = np.array([lost_to_dead_bands(vehicle, one) for one in (*held, *together)])
    differ = lost[: len(holds)] - lost[len(holds) :]
    errors = effectiveness(vehicle)[axis] * np.einsum("h,hdk->dk", per_balance, differ)
    return math.sqrt(float(PROBABLE @ np.sum(errors**2, axis=1)))


def _deviations(holds: Sequence[Hold], axis: int, dynamics: PriorDynamics) -> Array:
    """Standard deviation of each hold's balance by source: (n, 4) [N, N m]."""
    largest = max(abs(float(hold.thrust.mean())) for hold in holds)
    out = []
    for hold in holds:
        blocks = np.array([part.mean() for part in np.array_split(hold.thrust, BLOCKS)])
        half = len(hold.velocity) // 2
        change = 2.0 * (hold.velocity[half:].mean() - hold.velocity[:half].mean())
        moving = dynamics.inertia * abs(change) / hold.long_s + abs(dynamics.drag_force(float(hold.velocity.mean())))
        drifting = dynamics.drag_force(DVL_mps) if axis < 3 else 0.0
        own = abs(float(hold.thrust.mean()))
        near_zero = DEAD_BAND * largest if own < 10.0 * DEAD_BAND * largest else 0.0
        out.append((float(blocks.std(ddof=1)) / math.sqrt(BLOCKS), moving, drifting, near_zero))
    return np.array(out)
