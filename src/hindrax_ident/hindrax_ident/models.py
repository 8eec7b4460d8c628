"""The models: one equation per degree of freedom, its coefficients with unit, bounds and meaning, its known terms.

    (m + m_a) v' = tau + known - drag(v) - b - k_r s(attitude),    drag(v) = k_q |v| v + k_l v

COB-2023-1394 eq. 2 at constant velocity, with the acceleration of Eidsvik 2015 and the hydrostatics of Fossen 2011
eq. 4.6. Everything is in SNAME body axes about the center of mass. Heave has drag of its own for either direction, as
in COB-2023-1394 Table 3: its two motions share b (there: the net buoyancy) and the mass.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hindrax_core.errors import UsageError
from hindrax_core.readings import Vec3
from hindrax_core.vehicle import AXES, Thruster, Vehicle
from hindrax_ident.arrays import Array

HORIZONTAL = (0, 1)
"""Axes along which water may move unnoticed, and a tilt shows net buoyancy."""


@dataclass(frozen=True, slots=True)
class Motion:
    """One row of COB-2023-1394 Table 3: axis 0 to 5 (surge to yaw), and the direction (0: both) it is flown in."""

    name: str
    axis: int
    side: int = 0


MOTIONS: dict[str, Motion] = {
    motion.name: motion
    for motion in (
        Motion("surge", 0),
        Motion("sway", 1),
        Motion("heave_down", 2, 1),
        Motion("heave_up", 2, -1),
        Motion("roll", 3),
        Motion("pitch", 4),
        Motion("yaw", 5),
    )
}


def motion_named(name: str) -> Motion:
    """Find a motion; UsageError when there is none of that name."""
    try:
        return MOTIONS[name]
    except KeyError as error:
        raise UsageError(f"motion {name!r}: unknown, wanted one of {', '.join(MOTIONS)}") from error


def motions_of(axis: int) -> tuple[Motion, ...]:
    """Return the motions that excite an axis: one, or two for heave."""
    return tuple(motion for motion in MOTIONS.values() if motion.axis == axis)


@dataclass(frozen=True, slots=True)
class Coefficient:
    """One number of a model: name, unit, physical bounds, meaning."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


def coefficients(axis: int) -> dict[str, Coefficient]:
    """Every coefficient a motion on this axis may have, by name, with the units of the axis."""
    turns = axis >= 3
    unit = ("N m s^2", "N m s", "N m", "kg m^2", "N m") if turns else ("N s^2/m^2", "N s/m", "N", "kg", "N")
    far = math.inf
    rows = (
        Coefficient("k_q", unit[0], 0.0, far, "quadratic drag"),
        Coefficient("k_l", unit[1], -far, far, "linear drag"),
        Coefficient("b", unit[2], -far, far, "net buoyancy" if axis == 2 else "offset"),
        Coefficient("added_mass", unit[3], 0.0, far, "added moment of inertia" if turns else "added mass"),
        Coefficient("k_r", unit[4], -far, far, "restoring moment per unit of sine"),
    )
    return {row.name: row for row in rows}


@dataclass(frozen=True, slots=True)
class Model:
    """The equation of one axis. Parameters in the order of `names`; the last is always the total mass.

    `split`: drag has coefficients of its own for negative velocity. `restores`: k_r is among the parameters.
    """

    axis: int
    rigid: float
    split: bool = False
    restores: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters: drag (k_q, k_l; then for negative velocity), b, k_r where it restores, total mass."""
        drag = ("k_q", "k_l", "k_q_negative", "k_l_negative") if self.split else ("k_q", "k_l")
        return (*drag, "b", *(("k_r",) if self.restores else ()), "mass")

    @property
    def drags(self) -> int:
        """Number of drag coefficients; b comes right behind them."""
        return 4 if self.split else 2

    def names_of(self, side: int) -> tuple[str, ...]:
        """Parameters that a motion in one direction reports, in the order of `Coefficient` names."""
        suffix = "_negative" if self.split and side < 0 else ""
        return (f"k_q{suffix}", f"k_l{suffix}", "b", "mass", *(("k_r",) if self.restores else ()))

    def columns(self, v: Array, position: Array) -> Array:
        """What multiplies each parameter but the mass: (n, p - 1) [m^2/s^2, m/s, 1] or [rad^2/s^2, rad/s, 1, 1]."""
        square = np.abs(v) * v
        drag = [square, v]
        if self.split:
            ahead, back = v > 0.0, v <= 0.0
            drag = [square * ahead, v * ahead, square * back, v * back]
        rest = [np.sin(position)] if self.restores else []
        return np.stack([*drag, np.ones_like(v), *rest], axis=1)

    def force(self, theta: Array, v: Array, position: Array) -> Array:
        """Force that resists: drag + b + restoring, (n,) [N] or [N m]."""
        return np.asarray(self.columns(v, position) @ theta[:-1])

    def slope(self, theta: Array, v: Array) -> Array:
        """How drag rises with velocity: (n,) [N s/m] or [N m s]."""
        if not self.split:
            return np.asarray(2.0 * theta[0] * np.abs(v) + theta[1])
        ahead = v > 0.0
        return np.where(ahead, 2.0 * theta[0] * v + theta[1], -2.0 * theta[2] * v + theta[3])


def rigid_mass(vehicle: Vehicle, axis: int) -> float:
    """Mass or moment of inertia of the body alone [kg, kg m^2]."""
    return vehicle.mass_kg if axis < 3 else vehicle.inertia[axis - 3]


def model_of(vehicle: Vehicle, axis: int, *, split: bool | None = None) -> Model:
    """Return the equation of an axis: heave is split unless told otherwise, roll and pitch restore."""
    return Model(axis, rigid_mass(vehicle, axis), axis == 2 if split is None else split, axis in (3, 4))


def restoring(vehicle: Vehicle) -> float:
    """k_r of roll and pitch as the vehicle file has it: buoyancy times its height above the center of mass [N m]."""
    return vehicle.buoyancy_N * (vehicle.center_of_mass_m[2] - vehicle.center_of_buoyancy_m[2])


def known_force(vehicle: Vehicle, axis: int, attitude_rad: Vec3) -> float:
    """Hydrostatic force that tilt brings into surge and sway [N]; zero on the other axes. Fossen 2011 eq. 4.6.

    Roll and pitch have theirs as k_r, heave as b.
    """
    roll, pitch, _ = attitude_rad
    sinking_N = -vehicle.net_buoyancy_N
    if axis == 0:
        return -sinking_N * math.sin(pitch)
    if axis == 1:
        return sinking_N * math.cos(pitch) * math.sin(roll)
    return 0.0


def lag_s(vehicle: Vehicle, axis: int) -> float:
    """Time constant of the thrust on an axis: mean over the thrusters, weighted by what they contribute [s]."""
    shares = [(abs(effect(vehicle, thruster)[axis]), thruster.lag_s) for thruster in vehicle.thrusters]
    total = sum(share for share, _ in shares)
    return sum(share * lag for share, lag in shares) / total if total > 0.0 else 0.0


def effect(vehicle: Vehicle, thruster: Thruster) -> tuple[float, ...]:
    """Wrench about the center of mass per newton of a thruster, six numbers [-]*3, [m]*3. COB-2023-1394 eq. 9."""
    d = thruster.direction
    x, y, z = (p - c for p, c in zip(thruster.position_m, vehicle.center_of_mass_m, strict=True))
    return (*d, y * d[2] - z * d[1], z * d[0] - x * d[2], x * d[1] - y * d[0])


def axis_named(name: str) -> int:
    """Index of surge to yaw; a motion's name serves as well."""
    if name in AXES:
        return AXES.index(name)
    return motion_named(name).axis
