"""Pool runs of one degree of freedom, made from a model: for tests, for planning, for the Cramer-Rao bound.

Not the mock vehicle: no hull, no pool, no devices. Only the equation that is fitted, flown over a plan of forces, seen
through noise and rounding as a DVL, a gyroscope and a pressure sensor have them.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.signals import NAN, UNKNOWN6, Attitude, IdentEvent, Phase, Thrust, Velocity
from hindrax_ident.arrays import Array, array
from hindrax_ident.model.motion_model import Model
from hindrax_ident.model.simulation import Grid, Trajectory, trajectory
from hindrax_ident.model.thrust_lag import LaggedThrust

STEP_S = 0.005
COMMAND_S = 0.02
WINDOW = 400


@dataclass(frozen=True, slots=True)
class Sensors:
    """Rates [Hz], noise and rounding of what is measured.

    `velocity_sigma` [m/s, rad/s] is white; `rounding` [m] is that of the distance a DVL reports per interval (1 mm for
    a DVL-75; 0: none). `position_sigma` [m, rad].
    """

    velocity_Hz: float = 20.0
    velocity_sigma: float = 0.01
    rounding: float = 0.001
    position_Hz: float = 20.0
    position_sigma: float = 0.003


DVL = Sensors()
GYRO = Sensors(velocity_Hz=100.0, velocity_sigma=0.005, rounding=0.0)
DEPTH = Sensors(velocity_Hz=0.0, position_Hz=50.0, position_sigma=0.002)


def sensors_of(axis: int) -> Sensors:
    """Instruments that see a motion on this axis."""
    return DVL if axis < 2 else DEPTH if axis == 2 else GYRO


@dataclass(frozen=True, slots=True)
class Plan:
    """Forces told to the thrusters: from each time on, (n,) [s], (n,) [N, N m]; until `end_s`."""

    times_s: Array
    forces: Array
    end_s: float

    def commands(self) -> tuple[Array, Array]:
        """Commands at the rate of the allocator: times (n,) [s] and forces (n, ...) [N]."""
        times = array(np.arange(0.0, self.end_s, COMMAND_S))
        index = np.searchsorted(self.times_s, times + 1e-9, side="right") - 1
        return times, self.forces[index]


def back_and_forth(levels: tuple[float, ...], span_s: float, end_s: float) -> Plan:
    """Plateaus in both directions, level after level: +a, -a, +b, -b and so on, again and again."""
    times = array(np.arange(0.0, end_s, span_s))
    steps = np.arange(len(times))
    return Plan(times, np.array(levels)[(steps // 2) % len(levels)] * np.where(steps % 2 == 0, 1.0, -1.0), end_s)


@dataclass(frozen=True, slots=True)
class Flight:
    """What was commanded and how the vehicle really moved."""

    times_s: Array
    commands: Array
    grid: Grid
    path: Trajectory


def fly(model: Model, theta: Array, plan: Plan, lag_s: float, gain_noise: Array | None = None) -> Flight:
    """Move from rest. `gain_noise` (n,): relative error of each command that the record does not know of."""
    times, commands = plan.commands()
    given = commands if gain_noise is None else commands * (1.0 + gain_noise[: len(commands)])
    at = array(np.arange(0.0, plan.end_s + 0.5 * STEP_S, STEP_S))
    starts = np.zeros(len(at), bool)
    starts[0] = True
    impulse = np.diff(LaggedThrust(times, given, lag_s).impulse(at), prepend=0.0)
    impulse[0] = 0.0
    return Flight(times, commands, Grid(at, starts, impulse), _march(model, theta, at, impulse))


def _march(model: Model, theta: Array, at: Array, impulse: Array) -> Trajectory:
    """Motion from rest, window after window: over a short time any start is a good first guess."""
    v, s, parts = 0.0, 0.0, []
    for first in range(0, len(at) - 1, WINDOW):
        window = slice(first, min(first + WINDOW, len(at) - 1) + 1)
        n = len(at[window])
        starts = np.zeros(n, bool)
        starts[0] = True
        grid = Grid(at[window], starts, np.where(starts, 0.0, impulse[window]))
        path = trajectory(model, theta, grid, Trajectory(np.full(n, v), np.full(n, s)))
        if path is None:
            raise ValueError(f"no motion follows from the parameters {theta.tolist()}")
        v, s = float(path.v[-1]), float(path.s[-1])
        parts.append((path.v[:-1], path.s[:-1]))
    velocities, positions = zip(*parts, strict=True)
    return Trajectory(np.append(np.concatenate(velocities), v), np.append(np.concatenate(positions), s))


def events(
    flight: Flight, axis: int, motion: str, sensors: Sensors, rng: np.random.Generator, *, plateau_s: float = 0.0
) -> Iterator[Stamped[IdentEvent]]:
    """Return what the session would hear, in the order of time.

    With `plateau_s`, that long after each change of force the phase turns from transient to plateau.
    """
    parts = [*_phases(flight, motion, plateau_s), *_thrusts(flight, axis)]
    if sensors.velocity_Hz > 0.0:
        parts += _velocities(flight, axis, sensors, rng)
    if axis in (2, 3, 4):
        parts += _positions(flight, axis, sensors, rng)
    parts.sort(key=lambda event: event.stamp)
    yield from parts


def _phases(flight: Flight, motion: str, plateau_s: float) -> list[Stamped[IdentEvent]]:
    if plateau_s <= 0.0:
        return [Stamped(stamp_from_s(0.0), Phase(motion, "excite"))]
    changes = flight.times_s[np.concatenate([[True], np.diff(flight.commands) != 0.0])].tolist()
    ends = [*changes[1:], float(flight.grid.times_s[-1])]
    out: list[Stamped[IdentEvent]] = []
    for start, end in zip(changes, ends, strict=True):
        out.append(Stamped(stamp_from_s(start), Phase(motion, "transient")))
        if start + plateau_s < end:
            out.append(Stamped(stamp_from_s(start + plateau_s), Phase(motion, "plateau")))
    return out


def _thrusts(flight: Flight, axis: int) -> list[Stamped[IdentEvent]]:
    pairs = zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True)
    return [Stamped(stamp_from_s(t), Thrust(_only(axis, force, 0.0))) for t, force in pairs]


def _velocities(flight: Flight, axis: int, sensors: Sensors, rng: np.random.Generator) -> list[Stamped[IdentEvent]]:
    """Mean velocity over each interval, stamped at its middle."""
    every = round(1.0 / sensors.velocity_Hz / STEP_S)
    edges, dt = np.arange(0, len(flight.path.s), every), every * STEP_S
    v = np.diff(flight.path.s[edges]) / dt
    v = v + sensors.velocity_sigma * rng.standard_normal(len(v))
    if sensors.rounding > 0.0:
        v = np.round(v * dt / sensors.rounding) * sensors.rounding / dt
    middle = flight.grid.times_s[edges[:-1]] + 0.5 * dt
    source = "dvl75" if axis < 3 else "icm20948"
    pairs = zip(middle.tolist(), v.tolist(), strict=True)
    return [Stamped(stamp_from_s(t), Velocity(_only(axis, one, NAN), source)) for t, one in pairs]


def _positions(flight: Flight, axis: int, sensors: Sensors, rng: np.random.Generator) -> list[Stamped[IdentEvent]]:
    every = round(1.0 / sensors.position_Hz / STEP_S)
    s = flight.path.s[::every] + sensors.position_sigma * rng.standard_normal(len(flight.path.s[::every]))
    pairs = zip(flight.grid.times_s[::every].tolist(), s.tolist(), strict=True)
    if axis == 2:
        return [Stamped(stamp_from_s(t), Attitude((NAN, NAN, NAN), one)) for t, one in pairs]
    index = axis - 3
    return [Stamped(stamp_from_s(t), Attitude(_angles(index, one))) for t, one in pairs]


def _angles(index: int, angle: float) -> tuple[float, float, float]:
    return (angle if index == 0 else 0.0, angle if index == 1 else 0.0, 0.0)


def _only(axis: int, value: float, rest: float) -> tuple[float, float, float, float, float, float]:
    six = [rest] * len(UNKNOWN6)
    six[axis] = value
    return (six[0], six[1], six[2], six[3], six[4], six[5])
