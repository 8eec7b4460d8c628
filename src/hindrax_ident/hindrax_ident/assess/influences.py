"""Influence quantities: what may act on a record beside the model, one row each (GUM, JCGM 100, clause 4).

A row has a name, a unit, a prior standard deviation, an effect, and a remedy that knows its command (`remedies`). Its
effect is what one unit does to the record: unmodeled impulses on the vehicle, or errors of the measurements. From it
alone `uncertainty_budget` computes what the row contributes to each coefficient, and what the record shows of it. A new
influence is a new row.

The deviations of water, thrust and hull are those of a usual pool (`docs/reference/worlds.md` has their sources).
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.vehicle import AXES, AxisGain, Vehicle
from hindrax_ident.arrays import Array, Index, array, largest
from hindrax_ident.assess.posterior import root
from hindrax_ident.assess.thrust_calibration import ThrustErrorMode, modes, thrust_shares
from hindrax_ident.fit.delay import lag_impulse, latency_impulse
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.model.motion_model import HORIZONTAL, INCIDENCE, areas_across
from hindrax_ident.model.simulation import per_step
from hindrax_ident.model.six_axes import inertial_force, symmetric
from hindrax_ident.model.thrust_lag import LaggedThrust
from hindrax_ident.records.axis_record import LEAST_COUPLING, Record, about_samples
from hindrax_ident.remedies import (
    COAST,
    DESCRIBE_THRUSTERS,
    ONE_AXIS,
    SHORT_TETHER,
    THRUSTER_SWEEP,
    USE_ITS_SPEEDS,
    VEHICLE_FILE,
    WEIGH_THRUST,
    Remedy,
)
from hindrax_ident.tuning import Tuning

DEADBAND_SIGMA = 0.5
"""Standard deviation of the share of thrust missing inside a dead band that no file describes [-]."""
OWN_CONDITIONS_S = 900.0
"""After a longer pause a run has unknowns of its own: water, trim and battery are those of another hour."""
MOST_RUNS = 8
"""Runs of a pooled record that have unknowns of their own, at most: their number is that of the explanations."""
FOUND_DELAY_S = 0.1
"""Prior standard deviation of a delay that the record gave against the vehicle file."""
FILTER_SIGMA = 0.05
"""Standard deviation of the time constant of a filter that was undone, as a share of it (`fit.smoothing`) [-]."""
INFLOW_mps, INFLOW_N = 0.5, 10.0
SAG_S = 900.0
LOSSES = 0.06
"""Root mean square of the share of thrust lost between thrusters and hull: mean 5 %, at most 10 %. Wash of neighbors at
1.45 of a share of 0 to 5 % (one neighbor as loaded, one idle), and half of the thrusters towards the hull with another
(`docs/reference/worlds.md`: Bulten, Stoltenkamp 2013)."""
LOADED_SAG = 0.03
"""The same of the share lost at the largest thrust to 0 to 50 mohm of cable and battery: 9 A, thrust with V^1.7."""
MEASURED_SAG = 0.005
"""Share of the thrust that may still fall where the supply is measured: its voltage is used in steps of 0.1 V."""
WORKING_THRUST = 0.1
"""Share of the largest thrust from which a thruster works on its curve [-]."""
COASTS_FROM, COAST_S = 0.5, 1.0
"""Share of the highest speed that a coast has at least once [-], and how long it lasts at least [s]."""
MEMORY_S, WAKE_S = 1.0, 4.0
"""Time constants of fluid memory, and of the vehicle's own wake."""
TETHER = 0.04
"""Standard deviation of the pull or drag of a tether, as a share of the largest thrust [-]."""
FRICTION_SPEED = 0.02
"""Share of the highest speed below which dry friction is less than that of motion [-]."""
CROSS_DRAG, OFF_DIAGONAL = 0.5, 0.1
"""Standard deviations of the drag that an axis has from the speed across it, of that of one speed, and of off-diagonal
terms of added mass and drag, of the own ones [-]."""
LEAST_CROSSING = 0.003
"""Impulse of another axis, of those of the thrust, below which it is nothing [-]."""
MOST_CROSSINGS = 4
SMOOTH_S = 0.4
"""Mean of a velocity before its change: that of one sample is noise."""
SURGE, HEAVE, YAW = 0, 2, 5
NEAR_MODEL = 0.03
"""Share of the influences of a usual pool that is left in water near the model [-]."""
IDLING = 10.0
"""Percentile of the effort that is that of idle thrusters."""
NOT_WEIGHED = AxisGain(load=1.0, sigma=0.0)
OTHER_AXES = "forces of the other axes"
LAG, LATENCY, STAMPS, LOOKS = "thrust lag", "latency of the velocity", "stamps of the record", "looks at the pulses"
GAIN, RUN, MODEL = "gain", "run", "model"
"""Scope of a row: scales all forces; differs in each run, so it belongs to `std`; is missing in the model."""


@dataclass(frozen=True)
class AxisFit:
    """One axis of one run: its vehicle, record, fit and tuning; arrays on the fit's grid, (n,) each."""

    vehicle: Vehicle
    record: Record
    fit: OutputErrorFit
    tuning: Tuning
    delay_found: bool = False
    """Whether lag or latency of the record were estimated, against the vehicle file."""

    @property
    def axis(self) -> int:
        """Axis of the fit: 0 to 5."""
        return self.fit.model.axis

    @property
    def weighing(self) -> AxisGain:
        """Result of a known weight on this axis, perhaps in no direction."""
        return self.vehicle.thrust_gain.get(AXES[self.axis], NOT_WEIGHED)

    @property
    def weighed(self) -> tuple[float, ...]:
        """Directions in which a known weight measured the thrust: signs."""
        ways = ((1.0, self.weighing.positive), (-1.0, self.weighing.negative))
        return tuple(sign for sign, one in ways if one is not None)

    @cached_property
    def steps_s(self) -> Array:
        """Length of the step that ends at each time: (n,) [s]."""
        return self.fit.problem.grid.steps_s

    @property
    def v(self) -> Array:
        """Fitted velocity: (n,) [m/s, rad/s]."""
        return self.fit.linear.path.v

    @cached_property
    def thrust(self) -> Array:
        """Thrust after its lag: (n,) [N, N m]."""
        return LaggedThrust(self.record.thrust.t, self.record.thrust.y, self.record.lag_s).force(self._thrust_s)

    @cached_property
    def inflow(self) -> Array:
        """Loss of thrust per inflow, after the lag: (n,) [N^0.5, N^0.5 m^2]; as a rule where it is not recorded.

        Then each thruster has its share of the thrust, and some hold the net buoyancy in every motion.
        """
        recorded, vehicle = self.record.inflow, self.vehicle
        if len(recorded):
            return LaggedThrust(recorded.t, recorded.y, self.record.lag_s).force(self._thrust_s)
        held_N = 0.0 if self.axis == HEAVE else vehicle.net_buoyancy_N
        shares = thrust_shares(vehicle, HEAVE) if vehicle.thrusters else {}
        holding = {index: share for index, (_, share) in shares.items()}
        out = np.zeros(len(self.v))
        for index, (per_newton, share) in thrust_shares(vehicle, self.axis).items():
            out += per_newton**2 * np.sqrt(np.abs(share * self.thrust + holding.get(index, 0.0) * held_N))
        return out

    @cached_property
    def others(self) -> Array:
        """Velocities of all axes in units of this one's, by the length of the vehicle; its own zero: (n, 6)."""
        t = self.fit.problem.grid.times_s
        if not self.record.others:
            return np.zeros((len(t), 6))
        wanted = round(SMOOTH_S / max(1e-9, float(np.median(self.steps_s[self.steps_s > 0.0]))))
        kernel = np.ones(min(max(1, wanted), len(t)))  # of a flight that was cut off there is less than that
        weight = np.convolve(np.ones(len(t)), kernel, "same")
        rows = [np.convolve(np.interp(t, one.t, one.y), kernel, "same") / weight for one in self.record.others]
        return np.stack(rows, axis=1) * self._to_own

    @cached_property
    def crossing(self) -> Array:
        """Impulses of what the other axes do to this one, each of one deviation: (n, k), k at most MOST_CROSSINGS.

        Off-diagonal added mass and drag of each axis, and the drag that grows with the whole speed; of all these the
        combinations that do most, as unknowns of one deviation may be rotated.
        """
        others = self.others
        own_kind = others[:, :3] if self.axis < 3 else others[:, 3:]
        whole = np.sqrt(self.v**2 + np.sum(own_kind**2, axis=1))
        # A fit that has this drag as its parameter k_w knows it, and how well.
        cross = 0.0 if self.fit.model.crossed else CROSS_DRAG
        across = -self.top_drag / max(1e-9, self.speed**2) * (whole - np.abs(self.v)) * self.v
        drags = self.top_drag / max(1e-9, self.speed**2) * np.abs(others) * others
        columns = [
            self.of_force(cross * across),
            self.of_force(OFF_DIAGONAL * drags),
            self._off_diagonal_masses(),
        ]
        U, sizes, _ = np.linalg.svd(np.hstack(columns), full_matrices=False)
        matters = sizes[:MOST_CROSSINGS] > LEAST_CROSSING * np.linalg.norm(self.of_force(self.thrust))
        return array((U * sizes)[:, :MOST_CROSSINGS][:, matters])

    @cached_property
    def _to_own(self) -> Array:
        """Velocity of each axis in the unit of this one, by the length of the vehicle: (6,) [-, m, 1/m]."""
        length = self.vehicle.characteristic_length_m
        return array(np.where(np.arange(6) >= 3, length, 1.0) / (length if self.axis >= 3 else 1.0))

    def _off_diagonal_masses(self) -> Array:
        """Impulses of off-diagonal masses, each of one deviation: (n, k) [N s, N m s].

        M_ab carries momentum along a by motion along b. Where a is this axis, its change is an acceleration here; and
        all momentum turns with the body (Kirchhoff): a force across motions that neither need accelerate. Pairs are
        those with this axis, and those of a hull with port alike starboard: surge, heave, pitch and sway, roll, yaw.
        """
        nu = self.others / self._to_own
        nu[:, self.axis] = self.v
        own = self.mass * self._to_own**2
        columns = []
        for a, b in itertools.combinations(range(6), 2):
            if self.axis in (a, b) or (b - a) % 2 == 0:
                M = OFF_DIAGONAL * math.sqrt(own[a] * own[b]) * symmetric((a, b))
                change = per_step(nu @ M[self.axis], self.fit.problem.grid.starts)
                turned = inertial_force(M, nu, np.zeros_like(nu))[:, self.axis]
                columns.append(-change - self.of_force(turned)[:, 0])
        return np.stack(columns, axis=1)

    @cached_property
    def speed(self) -> float:
        """Highest speed [m/s, rad/s]."""
        return largest(self.v)

    @cached_property
    def pull(self) -> float:
        """Largest thrust commanded [N, N m]."""
        return largest(self.record.thrust.y)

    @property
    def _thrust_s(self) -> Array:
        return self.fit.problem.grid.times_s - self.record.latency_s

    @property
    def stamp_doubt_s(self) -> float:
        """Standard deviation of the stamps that residuals cannot correct [s].

        A motion that comes before its thrust is one by stamps that are off, or by forces that nobody recorded: no
        record tells which, so all of the time by which it comes first is doubt.
        """
        early_s = -(self.record.lag_s + self.record.latency_s)
        return max(0.0 if self.tuning.stamp_doubt_s is None else self.tuning.stamp_doubt_s, early_s)

    @property
    def look_sigma_s(self) -> float:
        """Standard deviation of the time of the thrust, where its changes are seen at the next look only [s].

        Each is late by any part of the time between two looks, and by another part than the next; the mean is in the
        lag. Changes count by their squares, as in a fit.
        """
        power = np.diff(self.record.thrust.y) ** 2
        share = float(np.linalg.norm(power)) / max(1e-12, float(np.sum(power)))
        return self.vehicle.output.looks_s * share / math.sqrt(12.0)

    @property
    def thrust_doubt(self) -> float:
        """Unmodeled dead band or pull as a share of the largest thrust [-]."""
        return 0.0 if self.tuning.thrust_doubt is None else self.tuning.thrust_doubt

    @property
    def delay_sigma_s(self) -> float:
        """Prior standard deviation of lag and latency [s]."""
        found_s = FOUND_DELAY_S if self.delay_found else 0.0
        return max(self.tuning.timing_sigma_s, self.tuning.lag_doubt_s or 0.0, found_s)

    @property
    def delays_fitted(self) -> bool:
        """Whether lag and latency were fitted together with the parameters."""
        return self.delay_found or self.tuning.lag_doubt_s is not None

    def drag(self, v: Array) -> Array:
        """Drag of the fit at velocities (n,): (n,) [N, N m]."""
        drags = self.fit.model.drags
        return self.fit.model.columns(v, v)[:, :drags] @ self.fit.theta[:drags]

    @cached_property
    def top_drag(self) -> float:
        """Drag at the highest speed, without its sign [N, N m]."""
        return float(np.abs(self.drag(array([self.speed]))[0]))

    def slope(self) -> Array:
        """Derivative of the drag: (n,) [N s/m, N m s]."""
        return self.fit.model.slope(self.fit.theta, self.v, self.fit.problem.grid.across)

    @property
    def mass(self) -> float:
        """Total mass or inertia of the fit [kg, kg m^2]."""
        return float(self.fit.theta[-1])

    def of_force(self, force: Array) -> Array:
        """Impulses over each step of forces at its ends, (n,) or (n, k): (n, k) [N s, N m s]."""
        table = np.column_stack([force])
        return 0.5 * self.steps_s[:, None] * (table + np.roll(table, 1, axis=0))

    def of_commands(self, commands: Array, times_s: Array | None = None) -> Array:
        """Impulses over each step of errors of the commanded thrust, through its lag.

        Parameters
        ----------
        commands : (c, k) [N, N m per unit]
            Errors of k influences for each command.
        times_s : (c,) [s]
            From when on each is in force; None: those of the thrust.

        Returns
        -------
        Array
            (n, k) [N s, N m s per unit], zero at the start of a stretch.
        """
        times_s = self.record.thrust.t if times_s is None else times_s
        totals = [LaggedThrust(times_s, one, self.record.lag_s) for one in commands.T]
        return per_step(np.stack([one.impulse(self._thrust_s) for one in totals], axis=1), self.fit.problem.grid.starts)

    def delayed(self, time_s: float) -> Array:
        """Velocity through a first-order lag, from rest at the start of each stretch: (n,) [m/s, rad/s]."""
        out: list[float] = []
        keep = np.exp(-self.steps_s / time_s).tolist()
        for v, one, start in zip(self.v.tolist(), keep, self.fit.problem.grid.starts.tolist(), strict=True):
            out.append(v if start else v + (out[-1] - v) * one)
        return np.array(out)

    @cached_property
    def run(self) -> Index:
        """Number of the run of each time, where records of several are pooled: (n,), from 0."""
        t = self.fit.problem.grid.times_s
        return np.cumsum(np.diff(t, prepend=t[:1]) > OWN_CONDITIONS_S, dtype=np.intp)

    def each_run(self, columns: Array) -> Array:
        """Columns (n, k) that are unknowns of each run by itself: (n, k r), r the longest MOST_RUNS of all runs."""
        longest = np.argsort(-np.bincount(self.run), kind="stable")[:MOST_RUNS]
        return np.hstack([np.where(self.run[:, None] == one, columns, 0.0) for one in longest])

    @property
    def position(self) -> Array:
        """Position from the middle of the flown distance, in units of half of it: (n,) [-]."""
        s = self.fit.linear.path.s - float(np.median(self.fit.linear.path.s))
        return s / max(1e-9, largest(s))


@dataclass(frozen=True, slots=True)
class Influence:
    """One row. `sigma`: prior standard deviation in `unit`, 0 where the influence cannot act.

    `effect`: per unit, impulses over each step (grid, k), or with `of_readings` errors of each measurement (n, k).
    `considered`: the record may not judge it, because it would do so by details that other rows explain as well;
    unless it was flown so that they do not: `shown`.
    `measured`: its prior is that of an experiment, such as a known weight.
    `drag`: the force of one unit at velocities (n,), (n, k), where it belongs to the drag of the hull.
    `near`: share of the deviation that is left in water near the model; less than 1 for what a usual pool has.
    `usual_cause`: a cause whose rows may be as in usual water while all others are as near the model; "" has none.
    `loss`: it acts in one direction, the positive one, as losses of thrust do: all of them add up.
    `or_else`: what is no row and leaves the same in a record of a case: named with it, since no record tells which.
    """

    name: str
    unit: str
    scope: str
    sigma: Callable[[AxisFit], float]
    effect: Callable[[AxisFit], Array]
    remedy: Remedy
    of_readings: bool = False
    considered: bool = False
    measured: bool = False
    shown: Callable[[AxisFit], bool] = lambda _case: False
    drag: Callable[[AxisFit, Array], Array] | None = None
    near: float = 1.0
    usual_cause: str = ""
    loss: bool = False
    or_else: Callable[[AxisFit], str] = lambda _case: ""

    def __reduce__(self) -> "tuple[Callable[[str], Influence], tuple[str]]":
        """By its name, as results of other processes come: the functions of a row cannot be pickled."""
        return influence_named, (self.name,)


def influence_named(name: str) -> Influence:
    """The row of the table `INFLUENCES`."""
    return next(one for one in INFLUENCES if one.name == name)


# ---- thrust


def _gains(case: AxisFit) -> list[ThrustErrorMode]:
    return modes(case.vehicle, case.axis) if len(case.record.thrust) else []


def _calibration(case: AxisFit) -> Array:
    """One column per unknown of the thrust curves, each of one standard deviation."""
    kinds = [(mode.error, root(mode.covariance)) for mode in _gains(case)]
    return case.of_commands(
        _unweighed(case, case.record.thrust.y, lambda y: np.hstack([error(y) @ root for error, root in kinds]))
    )


def _unweighed(case: AxisFit, thrust: Array, error: Callable[[Array], Array]) -> Array:
    """Rest of an error of the thrust, (n,) to (n, k), beside the gain that a known weight showed with it."""
    out, gain = error(thrust), case.weighing
    for sign in case.weighed:
        out = out - np.maximum(0.0, sign * thrust)[:, None] * error(array([sign * gain.load])) / gain.load
    return out


def _losses(case: AxisFit) -> Array:
    """Thrust lost between thrusters and hull, less what a known weight has shown of it.

    Of yaw it shows nothing: its loads are small, so the thrusters that hold against them idle against each other, and
    what neighbors take from each other is the same on both sides. In a turn all push one way round, and all lose
    (a share of 0.044 to neighbors, in the mock: gain 0.98 held, 0.89 flown).
    """
    y = case.record.thrust.y
    lost = -y[:, None] if case.axis == YAW else _unweighed(case, y, lambda thrust: -thrust[:, None])
    return case.of_commands(lost)


def _weighed_gain(case: AxisFit) -> Array:
    """Standard deviations of the gain, the same both ways and different each way: two columns."""
    y, gain = case.record.thrust.y, case.weighing
    known = np.isin(np.sign(y), case.weighed)
    return case.of_commands(np.stack([gain.sigma * y * known, gain.sigma_difference * np.abs(y) * known], axis=1))


def _idle(case: AxisFit) -> float:
    """Root of the sum of squares of what the thrusters put on the axis when they idle against each other [N, N m]."""
    effort = case.record.effort.y
    turning = effort[effort > 0.0]
    return math.sqrt(float(np.percentile(turning, IDLING))) if len(turning) else 0.0


def _idle_differences(case: AxisFit) -> Array:
    """A constant force while thrusters turn; none while all of them rest, as in a coast of heave."""
    effort = case.record.effort
    return case.of_commands(array(_idle(case) * (effort.y > 0.0)[:, None]), effort.t)


def _inflow(case: AxisFit) -> Array:
    """Thrust lost to water that already moves along: T = T_nn n|n| - T_nu |n| u, Fossen 2011 eq. 9.8.

    A unit loses all of 10 N at 0.5 m/s along the thruster; a vehicle without thrusters, of its largest thrust.
    """
    reference_N = INFLOW_N
    if not case.vehicle.thrusters:
        ((_, share),) = thrust_shares(case.vehicle, case.axis).values()
        reference_N = abs(share) * case.pull
    return case.of_force(-math.sqrt(reference_N) * case.inflow * case.v / INFLOW_mps)


def _coasts(case: AxisFit) -> bool:
    """Whether the thrust was taken away at speed, and for a while: beside plateaus, that separates inflow from drag."""
    idle = np.abs(case.thrust) < WORKING_THRUST * case.pull
    fast = np.abs(case.v) > COASTS_FROM * case.speed
    begins = np.flatnonzero(np.diff(idle, prepend=idle[:1]) | case.fit.problem.grid.starts)
    lasts_s = np.add.reduceat(np.where(case.fit.problem.grid.starts, 0.0, case.steps_s), begins)
    # A swing is slow where it begins, and fast as it passes level.
    return bool(np.any(idle[begins] & np.logical_or.reduceat(fast, begins) & (lasts_s > COAST_S)))


def _drift(case: AxisFit) -> Array:
    """Thrust that falls evenly from the start of a run, by all in 15 min; pooled records each restart."""
    t, run = case.fit.problem.grid.times_s, case.run
    begins = np.where(run > 0, t[np.searchsorted(run, run)], 0.0)
    return case.of_force(-case.thrust * (t - begins) / SAG_S)


def _load(case: AxisFit) -> Array:
    return case.of_force(_unweighed(case, case.thrust, lambda T: -(T * np.abs(T))[:, None] / max(1e-9, case.pull)))


def _lag(case: AxisFit) -> Array:
    return lag_impulse(case.record, case.fit.problem.grid)


def _dead_band(case: AxisFit) -> Array:
    """Thrust reduced by a force of the size of the sigma, and lost below it: two columns of one deviation."""
    command, band = case.record.thrust.y, max(1e-9, case.thrust_doubt * case.pull)
    return case.of_commands(
        np.stack(
            [-band * np.clip(command / band, -1.0, 1.0), -DEADBAND_SIGMA * command * (np.abs(command) < band)], axis=1
        )
    )


def _thrust_exponent(case: AxisFit) -> Array:
    """Change of the thrust per unit of its exponent over that recorded, the same at the largest."""
    y, pull = case.record.thrust.y, max(1e-9, case.pull)
    x = np.abs(y) / pull
    return case.of_commands((pull * np.sign(y) * x * np.log(np.maximum(x, 1e-9)))[:, None])


def _edges(case: AxisFit) -> Array:
    edge = max(1e-9, WORKING_THRUST * case.pull)
    return case.of_commands(
        _unweighed(case, case.record.thrust.y, lambda y: -case.pull * np.clip(y / edge, -1.0, 1.0)[:, None])
    )


# ---- water


def _memory(case: AxisFit) -> Array:
    """Flow that follows late: a share of the drag, and one of the mass (Cummins' convolution, one exponential)."""
    late = case.delayed(MEMORY_S)
    of_drag, of_mass = case.drag(case.v) - case.drag(late), -case.mass * (case.v - late) / MEMORY_S
    return case.of_force(np.stack([of_mass, of_drag], axis=1))


def _wake(case: AxisFit) -> Array:
    behind = case.delayed(WAKE_S)
    return case.of_force(case.slope() * behind * (behind * case.v < 0.0))


def _asymmetry_sigma(case: AxisFit) -> float:
    """A hull is alike to port and starboard, so only ahead and astern differ, and in pitch what bow and top share.

    Where only the record gives the thrust, it may be weaker in one direction of any axis.
    """
    if case.fit.model.split:
        return 0.0
    return 0.05 if case.axis == SURGE or case.thrust_doubt > 0.0 else 0.0125


def _asymmetry(case: AxisFit, v: Array) -> Array:
    """Quadratic drag greater ahead and smaller astern, in shares of that at the highest speed: (n, 1) [N, N m]."""
    return case.top_drag * (v[:, None] / max(1e-9, case.speed)) ** 2


def _exponent(case: AxisFit, v: Array) -> Array:
    """Change of the drag per unit of its exponent: (n, 1) [N, N m]."""
    x = np.abs(v) / max(1e-9, case.speed)
    return array((case.top_drag * np.sign(v) * x * x * np.log(np.maximum(x, 1e-9)))[:, None])


def _incidence(case: AxisFit) -> Array:
    """Drag along by the area that a hull turns to flow at an angle, where that is larger than the own one.

    The record cannot tell it from drag along: where it moves along there is an angle too.
    """
    larger = areas_across(case.vehicle, case.axis)
    turned = np.sqrt(case.v**2 + np.sum((larger * case.others) ** 2, axis=1))
    return case.of_force(-case.top_drag / max(1e-9, case.speed**2) * (turned - np.abs(case.v)) * case.v)


def _tether(case: AxisFit) -> Array:
    """Pull that grows with the distance; in yaw, at the stern and always from one side: its moment turns with heading.

    One unknown in each direction.
    """
    if case.axis != YAW:
        return case.of_force(-case.position)
    heading = np.cumsum(case.v * case.steps_s)
    return case.of_force(-np.stack([np.sin(heading), np.cos(heading)], axis=1))


def _longer_tether(case: AxisFit) -> Array:
    """Change of the drag of a tether from the middle of the way to its end: it grows with its length."""
    return case.of_force(-_braking(case) * case.position)


def _braking(case: AxisFit) -> Array:
    """Against the motion, with speed squared, 1 at the highest: (n,) [-]."""
    x = case.v / max(1e-9, case.speed)
    return np.abs(x) * x


def _friction(case: AxisFit) -> Array:
    """A rope that drags over the floor or an edge: against the motion, and the same at every speed."""
    return case.of_force(-np.tanh(case.v / max(1e-9, FRICTION_SPEED * case.speed)))


def _current(case: AxisFit) -> Array:
    """Water that moves along the axis: where runs are pooled, half of its variance is that of all, half each run's own.

    As one for all, currents of two runs that differ cancel, and the water seems still; as one of each alone, a current
    that is always there would be averaged away.
    """
    moving = case.of_force(case.slope())
    if case.run[-1] == 0:
        return moving
    return math.sqrt(0.5) * np.hstack([moving, case.each_run(moving)])


def _seiche(case: AxisFit) -> Array:
    """Standing wave along the pool: water that moves, and takes the vehicle along as it accelerates (Froude-Krylov).

    Each run has its own, with a phase of its own: as one for all, those of two runs cancel, and the pool seems still.
    """
    pool = case.vehicle.pool
    rate = math.pi * math.sqrt(GRAVITY_mps2 * pool.depth_m) / pool.length_m
    phase = rate * case.fit.problem.grid.times_s
    own = case.mass - case.fit.model.rigid + case.vehicle.volume_m3 * case.vehicle.water.density_kgpm3
    parts = [case.slope() * np.cos(phase) - own * rate * np.sin(phase)]
    parts += [case.slope() * np.sin(phase) + own * rate * np.cos(phase)]
    return case.each_run(case.of_force(np.stack(parts, axis=1)))


def _coriolis(case: AxisFit) -> Array:
    grid = case.fit.problem.grid
    totals = [about_samples(error).impulse(grid.times_s) for error in case.record.coriolis_errors]
    return per_step(np.stack(totals, axis=1), grid.starts)


# ---- sensors


def tilt_sigma_rad(vehicle: Vehicle, tuning: Tuning) -> float:
    """Standard deviation of roll and pitch from the accelerometer.

    Uncalibrated: its typical offset of 25 mg as two standard deviations (TDK DS-000189, table 2). After `./hindrax imu
    calibrate`: 3 mg, the drift over a few degrees of warming.

    Parameters
    ----------
    vehicle
        Whose inertial sensor may be calibrated.
    tuning
        `raw_tilt_sigma_rad` before a calibration, `tilt_sigma_rad` after it.

    Returns
    -------
    float
        Deviation of a static tilt [rad]: an offset over the acceleration of gravity.
    """
    known = any(key.startswith("accel") for mount in vehicle.sensors.values() for key in mount.calibration)
    return tuning.tilt_sigma_rad if known else tuning.raw_tilt_sigma_rad


def _tilts(case: AxisFit) -> bool:
    return case.fit.model.restores or case.axis in HORIZONTAL


def _tilt(case: AxisFit) -> Array:
    """Force or moment per radian of wrong roll or pitch; level by a tilted sensor, net buoyancy pushes along."""
    if case.fit.model.restores:
        return case.of_force(case.fit.theta[-2] * np.cos(case.fit.linear.path.s))
    return case.of_force(np.full(len(case.v), case.vehicle.net_buoyancy_N))


def _velocity_gain(case: AxisFit) -> Array:
    """Every measured velocity, and every distance, larger by its share."""
    problem, path = case.fit.problem, case.fit.linear.path
    return np.stack([path.v, path.s], axis=1)[problem.index, problem.channel][:, None]


def _filter(case: AxisFit) -> Array:
    """What a filter that is longer by a second, and is undone, adds to the velocities: a share of the transients."""
    problem, time_s = case.fit.problem, case.record.smoothing_s or case.record.filter_doubt_s
    gained = (case.v - case.delayed(time_s)) / time_s
    return np.where(problem.channel == 0, gained[problem.index], 0.0)[:, None]


def _of_ranges(sigma: float) -> Callable[[AxisFit], float]:
    """Of a record of ranges to a wall alone."""
    return lambda case: sigma if case.record.ranged else 0.0


def _sag(assumed: float) -> Callable[[AxisFit], float]:
    """Of the assumed supply voltage; of a measured one, what its rounding to 0.1 V leaves."""
    return lambda case: MEASURED_SAG if case.record.supply_measured else assumed


def _always(sigma: float) -> Callable[[AxisFit], float]:
    return lambda _case: sigma


INFLUENCES: tuple[Influence, ...] = (
    Influence(
        "thrust calibration", "sigma", GAIN,
        lambda case: 1.0 if _gains(case) else 0.0, _calibration,
        WEIGH_THRUST, considered=True,
    ),
    Influence(
        "gain by a known weight", "sigma", GAIN,
        lambda case: 1.0 if case.weighed else 0.0, _weighed_gain,
        Remedy("weigh with a larger load, for longer, with the battery of the flight"), considered=True, measured=True,
    ),
    Influence(
        "gain of the wrench", "-", GAIN,
        lambda case: case.tuning.wrench_gain_sigma, lambda case: case.of_commands(case.record.thrust.y[:, None]),
        Remedy("describe the thrusters in the vehicle file, or measure the wrench", VEHICLE_FILE), considered=True,
    ),
    Influence(
        "losses between thrusters and hull", "-", GAIN,
        lambda case: LOSSES if len(case.weighed) < 2 or case.axis == YAW else 0.0, _losses,
        WEIGH_THRUST, considered=True, near=0.16, usual_cause="losses", loss=True,
    ),
    Influence(
        # A record of a wrench alone has the exponent of the thrust for it.
        "losses that change with the load", "-", MODEL,
        lambda case: 0.0 if case.thrust_doubt > 0.0 else 0.03, _load,
        WEIGH_THRUST, near=NEAR_MODEL, usual_cause="losses",
    ),
    Influence(
        "inflow loss", "of 10 N at 0.5 m/s", GAIN, _always(0.12), _inflow,
        COAST, considered=True, shown=_coasts, near=0.005, usual_cause="inflow", loss=True,
    ),
    Influence(
        "differences between idle thrusters", "of their forces", MODEL,
        lambda case: 0.06 if _idle(case) > 0.0 else 0.0,
        _idle_differences,
        Remedy("measure each thruster near its dead band, or lower `allocation.idle_bias_N`", THRUSTER_SWEEP),
        considered=True, near=0.37,
    ),
    Influence(
        "sag over the run", "in 15 min", GAIN, _sag(0.1), _drift,
        Remedy("measure the supply voltage, or repeat the first leg at the end", condition="battery_sag"),
        near=NEAR_MODEL, loss=True,
    ),
    Influence(
        "sag under load", "-", MODEL, _sag(LOADED_SAG), _load,
        Remedy("measure the supply voltage at the ESCs", condition="supply_resistance"), near=NEAR_MODEL, loss=True,
    ),
    Influence(
        "dead bands that differ", "of the largest thrust", MODEL, _always(0.01), _edges,
        Remedy("measure the pulse at which each thruster starts", THRUSTER_SWEEP), near=NEAR_MODEL,
    ),
    Influence(
        "dead band of the thrust", "sigma", MODEL,
        lambda case: 1.0 if case.thrust_doubt * case.pull > 0.0 else 0.0, _dead_band,
        Remedy("describe the dead band in the vehicle file", VEHICLE_FILE),
    ),
    Influence(
        "exponent of the thrust", "-", MODEL,
        lambda case: (0.05 if _gains(case) else 0.15) if case.thrust_doubt > 0.0 else 0.0, _thrust_exponent,
        DESCRIBE_THRUSTERS, near=NEAR_MODEL,
    ),
    Influence(
        LAG, "s", RUN, lambda case: case.delay_sigma_s, _lag,
        Remedy("measure the thrust lag with `./hindrax step`", "./hindrax step --help"),
    ),
    Influence(
        LATENCY, "s", RUN, lambda case: case.delay_sigma_s,
        lambda case: latency_impulse(case.record, case.fit.problem.grid),
        Remedy("set velocity_latency_s to the latency of the instrument"),
    ),
    Influence(
        STAMPS, "s", RUN, lambda case: case.stamp_doubt_s, _lag,
        Remedy("record thrust and velocity with stamps of one clock"), considered=True,
    ),
    # Each change of thrust is late by a time of its own, which no common delay of the record is.
    Influence(
        LOOKS, "s", RUN, lambda case: case.look_sigma_s, _lag,
        Remedy("fly it again: more changes of thrust, each late by another time"), considered=True,
    ),
    Influence(
        "current", "m/s", MODEL,
        lambda case: case.tuning.current_sigma_mps if case.axis in HORIZONTAL else 0.0,
        _current,
        Remedy("fly each speed both ways, in still water", condition="current"),
    ),
    Influence(
        "seiche", "m/s", MODEL, lambda case: 0.006 if case.axis in HORIZONTAL else 0.0, _seiche,
        Remedy("wait until the water is still", condition="seiche"), near=NEAR_MODEL,
    ),
    Influence(
        "tether", "N", MODEL, lambda case: max(TETHER, case.thrust_doubt) * case.pull, _tether,
        Remedy("leave the tether slack, or float it, and fly near its fixed end", condition="tether"), near=NEAR_MODEL,
        or_else=lambda case: "a buoyancy that changes with depth" if case.axis == HEAVE else "",
    ),
    Influence(
        "drag of the tether", "N", MODEL, lambda case: max(TETHER, case.thrust_doubt) * case.pull,
        lambda case: case.of_force(-_braking(case)),
        SHORT_TETHER, near=NEAR_MODEL, loss=True,
    ),
    Influence(
        "drag of the tether with its length", "N", MODEL,
        lambda case: TETHER * case.pull if case.axis in HORIZONTAL else 0.0,
        _longer_tether, SHORT_TETHER, near=NEAR_MODEL,
    ),
    Influence(
        "friction of the tether", "N", MODEL, lambda case: case.thrust_doubt * case.pull, _friction,
        Remedy("keep the tether off the floor and the edge"), near=NEAR_MODEL,
    ),
    Influence(
        "fluid memory", "-", MODEL, _always(0.06), _memory,
        Remedy("longer plateaus and slower changes of speed", condition="fluid_memory"), near=NEAR_MODEL, loss=True,
    ),
    Influence(
        "own wake", "-", MODEL, _always(0.12), _wake,
        Remedy("rest between legs until the water is still", condition="wake"), near=NEAR_MODEL, loss=True,
    ),
    Influence(
        "fore/aft asymmetry", "-", MODEL,
        _asymmetry_sigma, lambda case: case.of_force(-_asymmetry(case, case.v)),
        Remedy("tow it ahead and astern, one record of `./hindrax towing` each", "./hindrax towing --help"),
        drag=_asymmetry, near=0.2,
    ),
    Influence(
        "exponent of the drag", "-", MODEL, _always(0.17),
        lambda case: case.of_force(-_exponent(case, case.v)),
        USE_ITS_SPEEDS, drag=_exponent, near=NEAR_MODEL,
    ),
    Influence(
        OTHER_AXES, "sigma", MODEL,
        lambda case: 1.0 if case.crossing.shape[1] else 0.0, lambda case: case.crossing,
        ONE_AXIS,
    ),
    Influence(
        "drag by incidence", "of the projected area", MODEL,
        lambda case: INCIDENCE if case.fit.model.turns else 0.0, _incidence,
        ONE_AXIS, considered=True,
    ),
    Influence(
        "masses of other axes", "sigma", RUN,
        lambda case: 1.0 if case.record.coriolis_errors else 0.0, _coriolis,
        Remedy("hold the other axes meanwhile, or fly surge, sway and heave longer in the same run"), considered=True,
        shown=lambda case: case.record.coupling > LEAST_COUPLING,
    ),
    Influence(
        "tilt of the accelerometer", "rad", RUN,
        lambda case: tilt_sigma_rad(case.vehicle, case.tuning) if _tilts(case) else 0.0, _tilt,
        Remedy("`./hindrax imu calibrate`", "./hindrax imu calibrate --write"), considered=True,
    ),
    Influence(
        "tilt of the mount", "rad", MODEL,
        lambda case: case.tuning.mount_sigma_rad if _tilts(case) else 0.0, _tilt,
        Remedy("align the sensors with the thrusters, and measure it", condition="imu_misalignment"), considered=True,
    ),
    Influence(
        "gain of the velocity", "-", GAIN, lambda case: case.tuning.velocity_gain_sigma, _velocity_gain,
        Remedy("compare the distance flown between two walls with a tape measure", condition="dvl_scale"),
        of_readings=True, considered=True,
    ),
    Influence(
        "speed of sound of the sonar", "-", GAIN, _of_ranges(0.01), _velocity_gain,
        Remedy("set the sonar's speed of sound for the water"), of_readings=True, considered=True,
    ),
    Influence(
        "filter of the velocity", "s", RUN,
        lambda case: FILTER_SIGMA * case.record.smoothing_s + case.record.filter_doubt_s, _filter,
        Remedy("record the velocity as the instrument gives it"), of_readings=True, considered=True,
    ),
    Influence(
        # cos(5 deg) is 0.004 below 1: wall, mount and thrust together are hardly better aligned by eye.
        "angle of sonar and wall", "-", GAIN, _of_ranges(0.004), _velocity_gain,
        Remedy("square the vehicle to the wall before the leg, by the smallest range"),
        of_readings=True, considered=True,
    ),
    Influence(
        "wander of the heading", "-", RUN, _of_ranges(0.002), _velocity_gain,
        Remedy("calibrate the compass, and fly away from iron"), of_readings=True, considered=True,
    ),
)  # fmt: skip


def acting(case: AxisFit, rows: Sequence[Influence] = INFLUENCES) -> list[tuple[Influence, float]]:
    """Rows that can act on a case, with their prior standard deviations in their units."""
    # What changes a loss goes with it: a plant without losses has none that change with the load.
    there = (row for row in rows if case.vehicle.losses or not (row.loss or row.usual_cause == "losses"))
    known = [(row, row.sigma(case)) for row in there]
    return [(row, sigma) for row, sigma in known if sigma > 0.0 and math.isfinite(sigma)]
