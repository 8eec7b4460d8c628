"""What the sensors claim of themselves, judged by gravity, by the rates and by what the thrusters were found to do.

The vehicle file claims where a sensor is and which way it looks. The pulses of a commissioning have moved the vehicle
in ways that are known by then: rates by the gyroscope, translations by the wrench that was found, through the prior's
response (`Evidence.motion`). Each sensor is compared with that motion, up to what it may be wrong about: a DVL by a
current, a pressure sensor by its zero, a magnetometer by fields of its own. So every series counts about its own mean,
and what decides is mostly how much of the motion a sensor follows, because sizes hang on the prior's inertia.

A claim is proven or wrong only where the motion could show the contrary; otherwise it stays open, with the reason.
Shapes: k samples of a sensor, n of the model or the gyroscope, interpolated onto the k.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix
from hindrax_control.commissioning.findings import MEASURED, OPEN, PROVEN, WRONG, Finding, Mend
from hindrax_control.commissioning.hypotheses import RIGHT_TURNS, angles_deg, turn_of
from hindrax_control.commissioning.recording import Recording, Series
from hindrax_control.commissioning.response import BEFORE_S, Prior, Window, carried, grid, lagged
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.vehicle import Mount, Vehicle

JOINED_S = 2.5
"""Pulses of the body that follow each other sooner are one motion."""
LOCKED = 0.5
"""Share of the velocities with a lock below which a DVL does not look at the floor."""
AGREES, DECIDES = 0.6, 0.2
"""Least correlation of a mount with the motion, and its lead over the next best."""
DEEPER_m = 0.06
"""A dive that shows which way the depth counts."""
ZERO_m = 0.15
STEEPEST, FLATTEST = -1.6, -0.55
"""Change of a range by the depth of a sonar that looks down; one that looks along the floor sees it change faster."""
UNMOVED = 0.5
"""Largest change of the floor below while the vehicle turns, moves and dives, as a part of that of the depth."""
LEAST_TURN_rad = 0.15
AT_WORK, LEAST_A, LEAST_AT_WORK = 0.6, 0.3, 5
"""Share of the largest current from which on a sample is at work; the least current and samples that show a sag."""
SAG = "supply sag under load"
SAG_SHARE, LEAST_SAG_OHM, LARGEST_SIGMA_OHM = 0.3, 0.02, 0.05
"""A supply may sag by so much more than its file says; beyond the last deviation nothing is shown."""
FOLLOWS, ASTRAY = 0.6, 1.0
"""Part of the turning of the field that the gyroscope leaves: with this it follows, beyond that it turns elsewhere."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """Everything that the claims of sensors are judged by; `found`: effectiveness (6, n) by output, (6, 0) unknown."""

    vehicle: Vehicle
    recording: Recording
    prior: Prior
    rest: Window | None
    turn: Matrix
    upright: bool
    windows: list[Window]
    """In which the whole body was moved."""
    singles: list[Window]
    """In which a thruster was pulsed alone."""
    found: Matrix
    lag_s: float
    offset_radps: Matrix

    @property
    def moved(self) -> bool:
        """Whether the body was moved, and by which wrench is known."""
        return bool(self.windows) and self.found.shape[1] > 0

    def motion(self, window: Window) -> tuple[Matrix, Matrix, Matrix]:
        """Times (n,), rates of all axes (n, 6), and forces along them (n, 6), by the prior and what was found."""
        times_s = grid(window)
        wrench = lagged(times_s, self.recording.forces, window, self.lag_s) @ self.found.T
        return times_s, self.prior.respond(times_s, wrench)[1], wrench

    def rates(self, window: Window) -> tuple[Matrix, Matrix]:
        """Times and rates of the gyroscope in body axes (n, 3)."""
        mount = self.vehicle.sensors[self.recording.inertial.source]
        times_s, rows = self.recording.inertial.between(window.begin_s, window.end_s)
        return times_s, (rows[:, 3:] - self.offset_radps) @ (self.turn @ turn_of(mount.rotation_deg)).T

    def down(self, window: Window) -> tuple[Matrix, Matrix]:
        """Times (n,) [s] and direction of gravity in body axes (n, 3) [-], from the rest ahead of a motion on."""
        mount = self.vehicle.sensors[self.recording.inertial.source]
        body = self.turn @ turn_of(mount.rotation_deg)
        _, rows = self.recording.inertial.between(window.begin_s, window.begin_s + BEFORE_S)
        times_s, rates = self.rates(window)
        if not (len(rows) and len(times_s)):
            return np.zeros(0), np.zeros((0, 3))
        rest = -body @ rows[:, :3].mean(axis=0)
        return times_s, carried(times_s, rates, rest / float(np.linalg.norm(rest)))


def claims(evidence: Evidence) -> list[Finding]:
    """Findings of DVL, sonar, magnetometer, depth and supply."""
    return [*_velocity(evidence), *_echo(evidence), *_depth(evidence), *_magnetic(evidence), *_supply(evidence)]


def turned(source: str, mount: Mount, turn: Matrix, why: str, likelihood: float = 1.0) -> Finding:
    """Finding that a sensor is mounted with a turn on top of that of its file.

    Parameters
    ----------
    source, mount
        Name of the sensor, and its mount by the file.
    turn : (3, 3) [-]
        On top of it.
    why
        What shows it.
    likelihood : [-]
        Of the turn, against all others.

    Returns
    -------
    Finding
        With the line that mends the file.
    """
    claimed = str(list(mount.rotation_deg))
    rotation_deg = list(angles_deg(turn @ turn_of(mount.rotation_deg)))
    mend = Mend(("sensors", source, "rotation_deg"), rotation_deg)
    return Finding(f"{source} mount", WRONG, claimed, f"{why}: turned to {rotation_deg}", likelihood, mends=(mend,))


def _seen(series: Series, window: Window | None) -> Matrix:
    """Values at rest (n, k)."""
    return series.between(window.begin_s, window.end_s)[1] if window else np.zeros((0, 1))


def _blind(source: str, claimed: str, what: str) -> Finding:
    remedy = "see that it sends (`./hindrax monitor`), mount it so that it looks down, and commission again"
    return Finding(f"{source} mount", WRONG, claimed, what, remedy=remedy)


def _velocity(evidence: Evidence) -> Iterator[Finding]:
    for source in evidence.vehicle.measuring("velocity"):
        mount = evidence.vehicle.sensors[source]
        claim, claimed = f"{source} mount", str(list(mount.rotation_deg))
        values = _seen(evidence.recording.velocity[source], evidence.rest)
        if not len(values) or float(np.isfinite(values[:, 0]).mean()) < LOCKED:
            yield _blind(source, claimed, "no bottom lock at rest: it does not look at the floor")
        elif evidence.moved:
            yield _velocity_turn(evidence, source, mount, evidence.windows)
        else:
            # One that is turned may end the flight before the body is moved: it contradicts the accelerometer. Then
            # single thrusters must do, where they show it.
            alone = _velocity_turn(evidence, source, mount, evidence.singles if evidence.found.shape[1] else [])
            unmoved = Finding(claim, OPEN, claimed, "locked; the vehicle was not moved")
            yield alone if alone.verdict == WRONG else unmoved


def _velocity_turn(evidence: Evidence, source: str, mount: Mount, windows: Sequence[Window]) -> Finding:
    """Which turn about the vertical brings its velocities into line with the motions of the body.

    Both are velocities at the sensor, which the lever makes faster than the body as it turns: v + omega x r. The score
    of a turn R is the correlation of R y and v over all windows, sum(R y . v) / sqrt(sum |y|^2 sum |v|^2): it does not
    depend on how strong the thrusters are. Only level components count, of which R turns one into the other; R is one
    of four. The best must lead the next: noise alone prefers one too.
    """
    turns = [turn for turn in RIGHT_TURNS if turn[2, 2] > 0.5]
    claim, claimed = f"{source} mount", str(list(mount.rotation_deg))
    scores: Matrix = np.zeros(len(turns))
    power: Matrix = np.zeros(2)
    lever_m = np.subtract(mount.position_m, evidence.vehicle.center_of_mass_m)
    for window in windows:
        times_s, rows = evidence.recording.velocity[source].between(window.begin_s, window.end_s)
        known = np.isfinite(rows[:, 0])
        times_s, rows = times_s[known], rows[known, :3]
        if len(times_s) < 10:
            continue
        model_s, rates, _ = evidence.motion(window)
        gyro_s, gyro = evidence.rates(window)
        turning = np.column_stack([np.interp(times_s, gyro_s, gyro[:, axis]) for axis in range(3)])
        at_sensor = np.column_stack([np.interp(times_s, model_s, rates[:, axis]) for axis in range(3)])
        at_sensor = at_sensor + np.cross(turning, lever_m)
        body = _without_spikes(rows) @ turn_of(mount.rotation_deg).T
        at_sensor, body = _level(at_sensor)[:, :2], _level(body)
        power += np.array([np.sum(at_sensor**2), np.sum(body[:, :2] ** 2)])
        scores += [float(np.sum((body @ turn.T)[:, :2] * at_sensor)) for turn in turns]
    if not power.all():
        return Finding(claim, OPEN, claimed, "no lock while the vehicle moved")
    scores = scores / math.sqrt(float(power[0] * power[1]))
    best, next_best = np.sort(scores)[::-1][:2]
    if best < AGREES or best - next_best < DECIDES:
        return Finding(
            claim, OPEN, claimed, f"its velocities follow the motion by {best:.0%} only", float(max(0.0, best))
        )
    turn = turns[int(np.argmax(scores))]
    if np.allclose(turn, np.eye(3)):
        return Finding(claim, PROVEN, claimed, f"its velocities follow the motion ({best:.0%})", float(best))
    return turned(source, mount, turn, "its velocities point elsewhere", float(best))


def _without_spikes(rows: Matrix) -> Matrix:
    """Median of each sample and its neighbours: a false lock is one sample."""
    padded = np.vstack((rows[:1], rows, rows[-1:]))
    return np.asarray(np.median(np.stack((padded[:-2], padded[1:-1], padded[2:])), axis=0))


def _level(rows: Matrix) -> Matrix:
    """Values about their mean: a current and an offset are no motion."""
    return np.asarray(rows - rows.mean(axis=0))


def _dive(evidence: Evidence) -> Window | None:
    """Window in which the vehicle was pushed down and up most."""
    if not evidence.moved:
        return None
    heave = [float(np.max(np.abs(evidence.motion(one)[1][:, 2]), initial=0.0)) for one in evidence.windows]
    best = int(np.argmax(heave))
    return evidence.windows[best] if heave[best] > 0.05 else None


def _depths_m(evidence: Evidence, window: Window, series: Series) -> tuple[Matrix, Matrix]:
    times_s, rows = series.between(window.begin_s, window.end_s)
    return times_s, _depth_m(evidence, rows[:, 0])


def _depth_m(evidence: Evidence, pressure_Pa: Matrix) -> Matrix:
    water = evidence.vehicle.water
    return (pressure_Pa - water.surface_pressure_Pa) / (water.density_kgpm3 * GRAVITY_mps2)


def _depth(evidence: Evidence) -> Iterator[Finding]:
    for source in evidence.vehicle.measuring("depth"):
        series, vehicle = evidence.recording.pressure[source], evidence.vehicle
        values = _seen(series, evidence.rest)
        if not len(values):
            yield Finding(f"{source} depth", OPEN, "", "sends nothing", remedy="`./hindrax doctor`")
            continue
        found_m = float(np.median(_depth_m(evidence, values[:, 0])))
        afloat = min(1.0, vehicle.weight_N / vehicle.buoyancy_N) - 0.5
        wanted_m = max(0.0, afloat * vehicle.envelope_m[2] + vehicle.sensors[source].position_m[2])
        claimed = f"{wanted_m:.2f} m afloat"
        if vehicle.net_buoyancy_N <= 0.0:
            words = f"{found_m:.2f} m at rest; it does not float, so nothing shows the zero"
            yield Finding(f"{source} zero", MEASURED, "sinks", words)
        elif abs(found_m - wanted_m) <= ZERO_m:
            yield Finding(f"{source} zero", PROVEN, claimed, f"{found_m:.2f} m")
        else:
            surface_Pa = round(
                vehicle.water.surface_pressure_Pa + (found_m - wanted_m) * vehicle.water.density_kgpm3 * 9.81
            )
            mend = Mend(("water", "surface_pressure_Pa"), float(surface_Pa))
            yield Finding(f"{source} zero", WRONG, claimed, f"{found_m:.2f} m", mends=(mend,))
        yield from _dive_claims(evidence, source)


def _dive_claims(evidence: Evidence, source: str) -> Iterator[Finding]:
    """Direction of the depth, and net buoyancy, by the dive."""
    claim, claimed, window = f"{source} direction", "deeper is more", _dive(evidence)
    if window is None:
        yield Finding(claim, OPEN, claimed, "the vehicle was not dived")
        return
    times_s, depths_m = _depths_m(evidence, window, evidence.recording.pressure[source])
    if len(times_s) < 10:
        yield Finding(claim, OPEN, claimed, "no pressure in the dive")
        return
    by_thrust, net_N, follows = _dive_fit(evidence, times_s, depths_m, window)
    span_m = float(np.ptp(depths_m))
    if span_m < DEEPER_m or follows < AGREES:
        words = f"the dive changed the depth by {span_m:.2f} m, and explains {follows:.0%} of that"
        yield Finding(claim, OPEN, claimed, words)
    elif by_thrust > 0.0:
        yield Finding(claim, PROVEN, claimed, f"follows the dive over {span_m:.2f} m", follows)
    else:
        yield Finding(claim, WRONG, claimed, "rises when it is pushed down", follows, "check sensor and driver")
    if source == evidence.recording.first_pressure.source:
        yield Finding("net buoyancy", MEASURED, f"{evidence.vehicle.net_buoyancy_N:+.1f} N", f"{net_N:+.1f} N, roughly")


def _dive_fit(evidence: Evidence, times_s: Matrix, depths_m: Matrix, window: Window) -> tuple[float, float, float]:
    """Gain of the thrust in the way of a dive [-], net buoyancy [N], and the share of the way that both explain.

    They act beside the depth and the speed with which the window begins: depth = a z_thrust + c z_1 + speed t +
    depth_0, linear in all four. z_thrust is the way that the found wrench would make, z_1 that of one newton downward,
    both by the prior; their shapes differ because the pulses end and weight does not. c is the net weight, hence the
    sign.
    """
    model_s, rates, _ = evidence.motion(window)
    constant = evidence.prior.respond(model_s, np.ones(len(model_s)))[1][:, 2]
    step_s = model_s[1] - model_s[0]
    by_thrust, by_newton = (np.interp(times_s, model_s, np.cumsum(one) * step_s) for one in (rates[:, 2], constant))
    since = times_s - times_s[0]
    columns = np.column_stack((by_thrust, by_newton, since, np.ones_like(since)))
    found, *_ = np.linalg.lstsq(columns, depths_m, rcond=None)
    left = depths_m - columns @ found
    explained = 1.0 - float(np.sum(left**2)) / max(1e-9, float(np.sum((depths_m - depths_m.mean()) ** 2)))
    return float(found[0]), -float(found[1]), explained


def _sonars(vehicle: Vehicle) -> list[str]:
    """Sensors that look at the floor by their mount, but for DVLs."""
    others = vehicle.measuring("velocity")
    return [name for name in vehicle.measuring("altitude") if name not in others]


def _echo(evidence: Evidence) -> Iterator[Finding]:
    for source in _sonars(evidence.vehicle):
        mount = evidence.vehicle.sensors[source]
        claim, claimed = f"{source} mount", str(list(mount.rotation_deg))
        values = _seen(evidence.recording.echo[source], evidence.rest)
        window = _dive(evidence)
        if not len(values):
            yield _blind(source, claimed, "no echo at rest: it does not look at the floor")
        elif window is None:
            yield Finding(claim, OPEN, claimed, "has an echo; the vehicle was not dived")
        else:
            yield _echo_slope(evidence, source, claimed, window)


def _echo_slope(evidence: Evidence, source: str, claimed: str, window: Window) -> Finding:
    """How its range changes with the depth: by as much, the other way, if it looks down; and with nothing else."""
    claim = f"{source} mount"
    ranges_m, depths_m = _echoes(evidence, source, window)
    if len(ranges_m) < 10 or float(np.ptp(depths_m)) < DEEPER_m:
        return Finding(claim, OPEN, claimed, "too little of a dive to show where it looks")
    slope = float(np.polyfit(depths_m - depths_m.mean(), ranges_m, 1)[0])
    if not STEEPEST < slope < FLATTEST:
        where = "it looks up" if slope > 0.5 else "it looks aside"
        return _blind(source, claimed, f"its range changes by {slope:+.2f} m per metre of depth: {where}")
    # A dive drifts a little, so a beam along the floor may follow the depth by chance; it sees every turn and move.
    left_m = min(_astray_m(evidence, source, tilted=tilted) for tilted in (False, True))
    if left_m > UNMOVED * float(np.std(depths_m)):
        words = f"its range changes by {left_m:.2f} m as the vehicle turns and moves: it looks aside"
        return _blind(source, claimed, f"{words}, or the floor is uneven here")
    return Finding(claim, PROVEN, claimed, f"its range falls by {-slope:.2f} m per metre of depth")


def _echoes(evidence: Evidence, source: str, window: Window, beam: Matrix | None = None) -> tuple[Matrix, Matrix]:
    """Ranges (n,) without single echoes of something else, and depths (n,) at their times [m].

    Along the vertical where `beam` (3,) is given, the axis of the sonar in the body.
    """
    times_s, rows = evidence.recording.echo[source].between(window.begin_s, window.end_s)
    pressure_s, depths_m = _depths_m(evidence, window, evidence.recording.first_pressure)
    if len(times_s) < 10 or len(pressure_s) < 10:
        return np.zeros(0), np.zeros(0)
    ranges_m = _without_spikes(rows)[:, 0]
    if beam is not None:
        gyro_s, down = evidence.down(window)
        ranges_m = ranges_m * np.interp(times_s, gyro_s, down @ beam) if len(gyro_s) else ranges_m
    return ranges_m, np.interp(times_s, pressure_s, depths_m)


def _astray_m(evidence: Evidence, source: str, *, tilted: bool) -> float:
    """Standard deviation of the height of the floor over all motions, each about its own mean.

    A narrow beam meets the floor along its axis (`tilted`), a wide one right below, whatever the tilt.
    """
    axis = turn_of(evidence.vehicle.sensors[source].rotation_deg)[:, 2] if tilted else None
    heights = [sum(_echoes(evidence, source, window, axis)) for window in evidence.windows]
    level = [one - one.mean() for one in heights if isinstance(one, np.ndarray) and len(one)]
    return float(np.std(np.concatenate(level)))


def _magnetic(evidence: Evidence) -> Iterator[Finding]:
    """Whether the field turns in the magnetometer as the gyroscope turns."""
    for source in evidence.vehicle.measuring("field"):
        claim, claimed = f"{source} magnetometer", "turns with the gyroscope"
        if not evidence.moved or not evidence.recording.magnetic[source].times_s:
            yield Finding(claim, OPEN, claimed, "the vehicle was not turned, or it sends nothing")
            continue
        off = np.zeros(2)
        for window in evidence.windows:
            off += _field_errors(evidence, source, window)
        if not off[1] > 0.0:
            yield Finding(claim, OPEN, claimed, "the vehicle did not turn enough")
            continue
        left = math.sqrt(float(off[0] / off[1]))
        if left < FOLLOWS:
            yield Finding(claim, PROVEN, claimed, f"explains {1.0 - left * left:.0%} of the turning of the field")
        elif left < ASTRAY:
            words = f"explains only {1.0 - left * left:.0%} of the turning of the field"
            yield Finding(claim, OPEN, claimed, words, remedy="turn it farther from the source of the disturbance")
        else:
            remedy = "look for a magnet or a current near it; `./hindrax imu` calibrates it"
            yield Finding(claim, WRONG, claimed, "the field turns otherwise", remedy=remedy)


def _field_errors(evidence: Evidence, source: str, window: Window) -> Matrix:
    """Squared changes of the field that the gyroscope does not explain, and all of them.

    The earth's field is fixed, so in the body m' = -omega x m: with angles instead of rates, each step changes it by
    -(step of the angle) x m, summed from the first sample on. Measured fields stand on the right, not summed ones, so
    that errors do not grow. Level components only: a turn about the vertical leaves the third as it is.

    A constant rate about the vertical is taken off both: a vehicle afloat may turn while the offset of its gyroscope
    is taken, by 0.7 deg/s in one pool, which is 24 degrees after 35 s. A pulse, there and back, is no such ramp.
    """
    times_s, rows = evidence.recording.magnetic[source].between(window.begin_s, window.end_s)
    gyro_s, gyro = evidence.rates(window)
    if len(times_s) < 10 or len(gyro_s) < 20:
        return np.zeros(2)
    mount = evidence.vehicle.sensors[source]
    field = rows[:, :3] @ (evidence.turn @ turn_of(mount.rotation_deg)).T
    angle = np.cumsum(gyro * np.gradient(gyro_s)[:, None], axis=0)
    turned_rad = np.column_stack([np.interp(times_s, gyro_s, angle[:, axis]) for axis in range(3)])
    if float(np.ptp(turned_rad[:, 2])) < LEAST_TURN_rad:
        return np.zeros(2)
    wanted = field[0] - np.cumsum(np.vstack((np.zeros(3), np.cross(np.diff(turned_rad, axis=0), field[:-1]))), axis=0)
    drift = _level(np.cumsum(np.gradient(times_s)[:, None] * np.cross((0.0, 0.0, 1.0), field), axis=0))[:, :2]
    off, change = (_level(one)[:, :2] for one in (field - wanted, field))
    off, change = (one - drift * float(np.sum(drift * one) / np.sum(drift**2)) for one in (off, change))
    return np.array([np.sum(off**2), np.sum(change**2)])


def _supply(evidence: Evidence) -> Iterator[Finding]:
    if not evidence.vehicle.measuring("supply"):
        return
    times_s, rows = evidence.recording.battery.between(-math.inf, math.inf)
    at_rest = _seen(evidence.recording.battery, evidence.rest)
    claimed = f"{evidence.vehicle.supply_V:g} V"
    if not len(at_rest) or not len(times_s):
        yield Finding("supply", OPEN, claimed, "the battery sensor sends nothing", remedy="`./hindrax doctor`")
        return
    rest_V, least_V = float(np.median(at_rest[:, 0])), float(np.min(rows[:, 0]))
    current_A = float(np.nanmax(rows[:, 1])) if np.isfinite(rows[:, 1]).any() else math.nan
    with_A = f" at {current_A:.1f} A" if math.isfinite(current_A) else ""
    yield Finding(
        "supply", MEASURED, claimed, f"{rest_V:.1f} V at rest, {rest_V - least_V:.2f} V less under load{with_A}"
    )
    yield _sag(evidence.vehicle, *_resistance_ohm(rows[:, 0], rows[:, 1]))


def _resistance_ohm(voltage_V: Matrix, current_A: Matrix) -> tuple[float, float]:
    """Resistance by which the voltage (k,) falls with the current (k,), and its deviation [ohm]; NaN: not shown.

    Between samples at rest and at work, by their medians: a sensor measures both one after the other, so that those at
    the edges of a pulse belong to no load. Both noises are those of samples about their medians.
    """
    known = np.isfinite(voltage_V) & np.isfinite(current_A)
    voltage_V, current_A = voltage_V[known], np.abs(current_A[known])
    most_A = float(np.max(current_A, initial=0.0))
    work, rest = current_A >= AT_WORK * most_A, current_A <= (1.0 - AT_WORK) * most_A
    if most_A < LEAST_A or min(work.sum(), rest.sum()) < LEAST_AT_WORK:
        return math.nan, math.nan
    step_A = float(np.median(current_A[work]) - np.median(current_A[rest]))
    fall_V = float(np.median(voltage_V[rest]) - np.median(voltage_V[work]))
    # 1.2533 is the deviation of a median over that of a mean, of normal noise.
    noises = (1.2533 * np.std(voltage_V[part]) / math.sqrt(part.sum()) for part in (rest, work))
    return fall_V / step_A, math.hypot(*noises) / step_A


def _sag(vehicle: Vehicle, found_ohm: float, sigma_ohm: float) -> Finding:
    """Finding on the resistance of the supply: wrong where it sags more than its file says, beyond the noise."""
    claim, declared_ohm = SAG, vehicle.supply_ohm
    claimed = "none" if declared_ohm is None else f"{1e3 * declared_ohm:g} mohm"
    if not sigma_ohm <= LARGEST_SIGMA_OHM:  # nor is NaN
        return Finding(claim, MEASURED, claimed, "not shown: the sensor measures no current, or there was too little")
    found = f"{1e3 * found_ohm:.0f} mohm +- {1e3 * sigma_ohm:.0f}"
    if declared_ohm is None:
        return Finding(claim, MEASURED, claimed, found)
    if found_ohm - declared_ohm <= max(SAG_SHARE * declared_ohm, LEAST_SAG_OHM, 3.0 * sigma_ohm):
        return Finding(claim, PROVEN, claimed, found)
    remedy = "look at plugs, cables and the age of the battery; or declare it"
    mends = (Mend(("supply_ohm",), round(found_ohm, 3)),)
    return Finding(claim, WRONG, claimed, found, remedy=remedy, mends=mends)
