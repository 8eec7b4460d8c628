"""Influence quantities: what may act on a record beside the model, one row each (GUM, JCGM 100, clause 4).

A row has a name, a unit, a prior standard deviation, an effect, and a remedy that knows its command (`remedies`). Its
effect is what one unit does to the record: unmodeled impulses on the vehicle, or errors of the measurements. From it
alone `uncertainty_budget` computes what the row contributes to each coefficient, and what the record shows of it. A new
influence is a new row.

The deviations of water, thrust and hull are those of a usual pool (`docs/reference/worlds.md` has their sources).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.signals import Supply
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.axis_fit import HEAVE, PITCH, ROLL, SURGE, YAW, AxisFit
from hindrax_ident.assess.posterior import root
from hindrax_ident.assess.thrust_calibration import ThrustErrorMode, modes, supply_power, thrust_shares, usual_losses
from hindrax_ident.fit.delay import lag_impulse, latency_impulse, later_impulses
from hindrax_ident.fit.mean_velocities import mean_velocities
from hindrax_ident.model.motion_model import HORIZONTAL, INCIDENCE, areas_across
from hindrax_ident.model.simulation import per_step
from hindrax_ident.model.thrust_lag import LaggedThrust
from hindrax_ident.records.axis_record import LEAST_COUPLING, about_samples
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
from hindrax_ident.tuning import LAG_DIFFERENCE_S, Tuning

DEADBAND_SIGMA = 0.5
"""Standard deviation of the share of thrust missing inside a dead band that no file describes [-]."""
FILTER_SIGMA = 0.05
"""Standard deviation of the time constant of a filter that was undone, as a share of it (`fit.smoothing`) [-]."""
INFLOW_mps, INFLOW_N = 0.5, 10.0
INFLOW_LOSS = 0.3
"""Greatest share of 10 N that an inflow of 0.5 m/s takes: that of a propeller of 76 mm whose K_T falls evenly to zero
at J = 0.8; at J = 1, as of a pitch that is the diameter, 0.24, and less in the wake of the hull
(`docs/reference/worlds.md`)."""
SAG_S = 900.0
LOSSES = 0.06
"""Root mean square of the share of thrust lost between thrusters and hull: mean 5 %, at most 10 %. Wash of neighbors at
1.45 of a share of 0 to 5 % (one neighbor as loaded, one idle), and half of the thrusters towards the hull with another
(`docs/reference/worlds.md`: Bulten, Stoltenkamp 2013)."""
SAG, LOADED_SAG = 0.1, 0.03
"""Share of the voltage that a battery loses in SAG_S at most: a lithium cell from 4.0 to 3.6 V; and that is lost at the
largest thrust to 0 to 50 mohm of cable and battery: 9 A of 14.8 V [-]."""
MEASURED_SAG = 0.005
"""Share of the thrust that may still fall where the supply is measured: its voltage is used in steps of 0.1 V."""
EDGES, MOST_EDGES = 0.01, 3
"""Thrust lost to dead bands that differ, of the largest, where no curves tell it [-]; and how many unknowns stand for
those of all thrusters."""
WORKING_THRUST = 0.1
"""Share of the largest thrust from which a thruster works on its curve [-]."""
COASTS_FROM, COAST_S = 0.5, 1.0
"""Share of the highest speed that a coast has at least once [-], and how long it lasts at least [s]."""
MEMORY_S, WAKE_S = 1.0, 4.0
"""Time constants of fluid memory, and of the vehicle's own wake."""
ALIKE_S = 0.01
"""The same between the thrusters of one vehicle, which push along other axes."""
VELOCITY_OVER_S = 0.3
"""Time over which an instrument may average its velocities: one interval at 3 Hz."""
AVERAGED_S, AVERAGING = 1.0, 0.5
"""Time over which the rows of a table may be averages [s], and how much of what that hides they may hide [-]."""
TETHER = 0.04
"""Standard deviation of the pull of a tether, and in the record of another stack of its drag, as a share of the largest
thrust [-]."""
TETHER_N, TETHER_END_N, TETHER_mps = 2.0, 0.4, 0.5
"""Greatest drag of five meters of tether at that speed, and of the last of them, a fifth (`conditions/water.py`)."""
FRICTION_SPEED = 0.02
"""Share of the highest speed below which dry friction is less than that of motion [-]."""
NEAR_MODEL = 0.03
"""Share of the influences of a usual pool that is left in water near the model [-]."""
IDLING = 10.0
"""Percentile of the effort that is that of idle thrusters."""
OTHER_AXES = "forces of the other axes"
LAG, LATENCY, STAMPS, LOOKS = "thrust lag", "latency of the velocity", "stamps of the record", "looks at the pulses"
DIFFERENCES = "lags that differ"
GAIN, RUN, MODEL = "gain", "run", "model"
"""Scope of a row: scales all forces; differs in each run, so it belongs to `std`; is missing in the model."""


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
    `common`: the motions of a run share it, but for this deviation in `unit`, as lags of the same thrusters; 0: not.
    `of_each`: thrusters of a kind differ by it, as they are made.
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
    common: float = 0.0
    or_else: Callable[[AxisFit], str] = lambda _case: ""
    of_each: bool = False

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
    return error(thrust) - _shown(case, thrust, error)


def _shown(case: AxisFit, thrust: Array, error: Callable[[Array], Array]) -> Array:
    """Part of an error of the thrust, (n,) to (n, k), that is in the gain which a known weight showed."""
    out, gain = array(np.zeros((len(thrust), 1))), case.weighing
    for sign in case.weighed:
        out = out + np.maximum(0.0, sign * thrust)[:, None] * error(array([sign * gain.load])) / gain.load
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


def _differences(case: AxisFit) -> Array:
    """Change by a second of the lag of thrust that goes, of thrust that turns round, and of changes by their size.

    To first order a change that is later by T takes T of itself from the impulse, as a latency does.
    """
    y, grid = case.record.thrust.y, case.fit.problem.grid
    changes = np.diff(y, prepend=0.0)
    by_size = np.cumsum(changes * np.abs(changes)) / max(1e-9, case.pull)
    slower = LaggedThrust(case.record.thrust.t, array(by_size), case.record.lag_s).force(case.thrust_s)
    return np.hstack([later_impulses(case.record, grid), per_step(-slower[:, None], grid.starts)])


def _averaged_velocity(case: AxisFit) -> Array:
    """Velocities that are means in place of values: what is taken off goes with the square of their time."""
    grid, problem, path = case.fit.problem.grid, case.fit.problem, case.fit.linear.path
    states = np.stack([path.v, path.s], axis=1)
    means = mean_velocities(problem.t, grid.times_s, grid.bounds[:, problem.index], VELOCITY_OVER_S)
    return np.where(problem.channel == 0, means.of(states) - problem.predicted(states), 0.0)[:, None]


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
    """Thrust lost where the dead band of each thruster is wider by an independent draw: the combinations that do most.

    Without the forces of the thrusters a constant loss, of a hundredth of the largest thrust.
    """
    forces, curves = case.record.forces, case.vehicle.curves
    if not len(forces) or not curves or forces.y.shape[1] != len(case.vehicle.thrusters):
        edge = max(1e-9, WORKING_THRUST * case.pull)
        constant = case.record.thrust.y
        return case.of_commands(
            _unweighed(case, constant, lambda y: -EDGES * case.pull * np.clip(y / edge, -1.0, 1.0)[:, None])
        )
    usual = usual_losses(case.vehicle)
    columns = np.stack([d * usual[i](forces.y[:, i]) for i, d in enumerate(forces.per_newton.tolist())], axis=1)
    shares = thrust_shares(case.vehicle, case.axis)

    def together(y: Array) -> Array:
        """Of thrusters that share a thrust (n,): (n, k)."""
        return np.stack([d * usual[i](share * y) for i, (d, share) in shares.items()], axis=1)

    shown = case.of_commands(_shown(case, case.record.thrust.y, together))
    impulses = case.of_commands(columns, forces.t) - shown
    U, sizes, _ = np.linalg.svd(impulses, full_matrices=False)
    return array((U * sizes)[:, :MOST_EDGES])


# ---- water


def _memory(case: AxisFit) -> Array:
    """Flow that follows late: a share of the drag, and one of the mass (Cummins' convolution, one exponential)."""
    late = case.delayed(MEMORY_S)
    of_drag, of_mass = case.drag(case.v) - case.drag(late), -case.mass * (case.v - late) / MEMORY_S
    return case.of_force(np.stack([of_mass, of_drag], axis=1))


def _averaging(case: AxisFit) -> Array:
    """Drag that averages over a second hide, of forces and velocities: the mean of it is not that of the mean velocity.

    It goes with the square of that time. Without this row it passes for an inflow loss, or for delayed flow.
    """
    grid = case.fit.problem.grid
    means = mean_velocities(grid.times_s, grid.times_s, grid.bounds, AVERAGED_S)
    v, drag = (means.of(np.stack([x, np.cumsum(case.of_force(x)[:, 0])], axis=1)) for x in (case.v, case.drag(case.v)))
    return case.of_force(case.drag(v) - drag)


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


def _tether_drag(case: AxisFit) -> float:
    """Deviation of the drag of a tether at the highest speed [N, N m]: evenly up to the greatest.

    It goes with the square of the speed. A share of the thrust is no measure of it, because that also holds against
    buoyancy and restoring moment: it was 8 % of heave's drag, where the tether has 4, and a tenth of that of roll and
    pitch. What turns moves the end of the tether alone, at the top of the stern. In the record of another stack
    neither vehicle nor tether is known, and the thrust is all there is.
    """
    if case.tuning.thrust_doubt is not None:
        return max(TETHER, case.thrust_doubt) * case.pull
    if case.axis < ROLL:
        return TETHER_N * (case.speed / TETHER_mps) ** 2 / math.sqrt(3.0)
    length, _, height = case.vehicle.envelope_m
    lever_m = 0.5 * {ROLL: height, PITCH: math.hypot(length, height), YAW: length}[case.axis]
    return lever_m * TETHER_END_N * (lever_m * case.speed / TETHER_mps) ** 2 / math.sqrt(3.0)


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
    path = case.fit.linear.path
    return case.fit.problem.predicted(np.stack([path.v, path.s], axis=1))[:, None]


def _filter(case: AxisFit) -> Array:
    """What a filter that is longer by a second, and is undone, adds to the velocities: a share of the transients."""
    problem, time_s = case.fit.problem, case.record.smoothing_s or case.record.filter_doubt_s
    if case.record.means:
        # A mean over T takes T^2 / 24 of the second derivative away, one that is flat a part of the fourth as T^4.
        path, power = case.fit.linear.path, 2.0 * len(case.record.means)
        taken = case.v[problem.index] - problem.predicted(np.stack([path.v, path.s], axis=1))
        return np.where(problem.channel == 0, power / case.record.means[0][1] * taken, 0.0)[:, None]
    gained = (case.v - case.delayed(time_s)) / time_s
    return np.where(problem.channel == 0, gained[problem.index], 0.0)[:, None]


def _filter_doubt(case: AxisFit) -> float:
    """Of one that the fit knows a share, and all of one that it does not."""
    known_s = case.record.smoothing_s + sum(over_s for _, over_s in case.record.means[:1])
    return FILTER_SIGMA * known_s + case.record.filter_doubt_s


def _instrument_averages(case: AxisFit) -> float:
    """Of an instrument that nobody describes; where its filter was found, that has a row of its own."""
    known = case.record.means or case.record.smoothing_s > 0.0
    return 0.0 if known or case.tuning.lag_doubt_s is None else 1.0


def _of_ranges(sigma: float) -> Callable[[AxisFit], float]:
    """Of a record of ranges to a wall alone."""
    return lambda case: sigma if case.record.ranged else 0.0


def _sag(greatest: float, known: Supply) -> Callable[[AxisFit], float]:
    """Of a voltage lost evenly up to the greatest share; of one that is `known` so well, what its rounding leaves."""

    def sigma(case: AxisFit) -> float:
        """Root mean square, as thrust."""
        lost = supply_power(case.vehicle) * greatest / math.sqrt(3.0)
        return MEASURED_SAG if case.record.supply >= known else lost

    return sigma


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
        "inflow loss", "of 10 N at 0.5 m/s", GAIN, _always(INFLOW_LOSS / math.sqrt(3.0)), _inflow,
        COAST, considered=True, shown=_coasts, near=0.005, usual_cause="inflow", loss=True,
    ),
    Influence(
        "differences between idle thrusters", "of their forces", MODEL,
        lambda case: 0.06 if _idle(case) > 0.0 else 0.0,
        _idle_differences,
        Remedy("measure each thruster near its dead band, or lower `allocation.idle_bias_N`", THRUSTER_SWEEP),
        considered=True, near=0.37, of_each=True,
    ),
    Influence(
        "sag over the run", "in 15 min", GAIN, _sag(SAG, Supply.AT_REST), _drift,
        Remedy("measure the supply voltage, or repeat the first leg at the end", condition="battery_sag"),
        near=NEAR_MODEL, loss=True,
    ),
    Influence(
        "sag under load", "-", MODEL, _sag(LOADED_SAG, Supply.MEASURED), _load,
        Remedy("measure the supply voltage at the ESCs", condition="supply_resistance"), near=NEAR_MODEL, loss=True,
    ),
    Influence(
        "dead bands that differ", "sigma", MODEL, _always(1.0), _edges,
        Remedy("measure the pulse at which each thruster starts", THRUSTER_SWEEP), near=NEAR_MODEL, of_each=True,
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
        DIFFERENCES, "s", MODEL, _always(LAG_DIFFERENCE_S), _differences,
        Remedy("measure how the thrust comes and goes, or coast more often", condition="late_stops"),
        common=ALIKE_S, or_else=lambda case: "" if _coasts(case) else "inflow loss",
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
        "drag of the tether", "N", MODEL, _tether_drag, lambda case: case.of_force(-_braking(case)),
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
        "averaging of the table", "of that over 1 s", RUN,
        lambda case: 0.0 if case.tuning.lag_doubt_s is None else AVERAGING, _averaging,
        Remedy("record forces and velocities as they are, at their own rates"),
    ),
    Influence(
        "averaging of the velocity", "of that over 0.3 s", RUN, _instrument_averages, _averaged_velocity,
        Remedy("record the velocity as the instrument gives it"), of_readings=True,
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
        _filter_doubt, _filter,
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
    # What changes a loss goes with it: a plant without losses has none that change with the load. A simulator's
    # thrusters are all alike, too.
    there = (row for row in rows if case.vehicle.losses or not (row.loss or row.usual_cause == "losses" or row.of_each))
    known = [(row, row.sigma(case)) for row in there]
    return [(row, sigma) for row, sigma in known if sigma > 0.0 and math.isfinite(sigma)]
