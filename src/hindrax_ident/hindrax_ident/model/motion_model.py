"""The models: one equation per degree of freedom, the units of its coefficients, its known terms.

    (m + m_a) v' = tau + known - drag(v) - b - k_r s(attitude),    drag(v) = k_q |v| v + k_l v

COB-2023-1394 eq. 2 at constant velocity, with the acceleration of Eidsvik 2015 and the hydrostatics of Fossen 2011
eq. 4.6. Everything is in SNAME body axes about the center of mass. Heave has separate drag coefficients
per direction, as in COB-2023-1394 Table 3: its two motions share b (there: the net buoyancy) and the mass.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_core.readings import Vec3
from hindrax_core.vehicle import Thruster, Vehicle
from hindrax_ident.arrays import Array, array

HORIZONTAL = (0, 1)
"""Axes with possible unmeasured current, and with a component of net buoyancy when tilted."""


LEAST_SPEED = 1e-9
"""Speed below which nothing moves; it is divided by [m/s, rad/s]."""
LEAST_MASS = 0.5
"""Share of the mass of the body; less contradicts the vehicle file, and is reported [-]."""


INCIDENCE = 2.0
"""Standard deviation of the drag by incidence, in that of the projected area: a long hull has a drag coefficient of 0.3
along and 1.1 across (Hoerner 1965, chapter 3)."""


@dataclass(frozen=True, slots=True)
class Motion:
    """One row of COB-2023-1394 Table 3: axis 0 to 5 (surge to yaw) and direction of motion (0: both)."""

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


def motions_of(axis: int) -> tuple[Motion, ...]:
    """Motions that excite an axis: one, or two for heave."""
    return tuple(motion for motion in MOTIONS.values() if motion.axis == axis)


def axis_units(axis: int) -> tuple[str, str]:
    """Units of velocity and of force on this axis."""
    return ("rad/s", "N m") if axis >= 3 else ("m/s", "N")


def coefficient_units(axis: int) -> dict[str, str]:
    """Unit of each coefficient of motions on this axis.

    Parameters
    ----------
    axis
        Index, 0 to 5: surge, sway, heave, roll, pitch, yaw.

    Returns
    -------
    dict[str, str]
        `k_q`, `k_l`: quadratic and linear drag; `b`: net buoyancy in heave, elsewhere an offset; `added_mass`; `k_r`:
        restoring moment per sine of the angle; `k_w`: drag by the speed across.
    """
    square, of_axis = (
        ("N m s^2", ("N m s", "N m", "kg m^2", "N m")) if axis >= 3 else ("N s^2/m^2", ("N s/m", "N", "kg", "N"))
    )
    return dict(zip(("k_q", "k_l", "b", "added_mass", "k_r", "k_w"), (square, *of_axis, square), strict=True))


@dataclass(frozen=True, slots=True)
class Model:
    """The equation of one axis. Parameters in the order of `names`; the last is always the total mass.

    `split`: separate drag coefficients for negative velocity. `restores`: k_r is among the parameters. `crossed`: so is
    k_w, the drag that grows with the speed w across: k_w (sqrt(v^2 + w^2) - |v|) v. A bluff body, whose drag is that of
    its whole speed, has k_w = k_q; one that obeys the cross-flow principle has none (Faltinsen 1990, chapter 6).
    """

    axis: int
    rigid: float
    split: bool = False
    restores: bool = False
    crossed: bool = False

    @property
    def least_mass(self) -> float:
        """Smallest total mass that a fit may try: without any, nothing would be left of the thrust's lag."""
        return LEAST_MASS * self.rigid

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters: drag (k_q, k_l; then for negative velocity), b, k_w and k_r where there are, total mass."""
        drag = ("k_q", "k_l", "k_q_negative", "k_l_negative") if self.split else ("k_q", "k_l")
        more = (*(("k_w",) if self.crossed else ()), *(("k_r",) if self.restores else ()))
        return (*drag, "b", *more, "mass")

    @property
    def turns(self) -> bool:
        """Whether drag by incidence may act, which no record tells from drag along (`areas_across`)."""
        return self.crossed and self.axis < 3

    @property
    def drags(self) -> int:
        """Number of drag coefficients; b is the next parameter."""
        return 4 if self.split else 2

    def names_of(self, side: int) -> tuple[str, ...]:
        """Parameters reported by a motion in one direction, in the order of their names."""
        suffix = "_negative" if self.split and side < 0 else ""
        more = (*(("k_r",) if self.restores else ()), *(("k_w",) if self.crossed else ()))
        return (f"k_q{suffix}", f"k_l{suffix}", "b", "mass", *more)

    def columns(self, v: Array, position: Array, across: Array | float = 0.0) -> Array:
        """Regressors of all parameters but the mass.

        Parameters
        ----------
        v : (n,) [m/s, rad/s]
            Velocity along the axis.
        position : (n,) [m, rad]
            Angle, for the restoring moment, or depth.
        across : (n,) [m/s, rad/s]
            Speed across the axis, for k_w (`speed_across`).

        Returns
        -------
        Array
            (n, p - 1) [m^2/s^2, m/s, 1] or [rad^2/s^2, rad/s, 1, 1].
        """
        square = np.abs(v) * v
        drag = [square, v]
        if self.split:
            ahead, back = v > 0.0, v <= 0.0
            drag = [square * ahead, v * ahead, square * back, v * back]
        rest = [(np.hypot(v, across) - np.abs(v)) * v] if self.crossed else []
        rest += [np.sin(position)] if self.restores else []
        return np.stack([*drag, np.ones_like(v), *rest], axis=1)

    def force(self, theta: Array, v: Array, position: Array, across: Array | float = 0.0) -> Array:
        """Resisting force of the model: drag + b + restoring.

        Parameters
        ----------
        theta : (p,)
            Parameters in the order of `names`; the mass, the last one, resists no velocity and is not used.
        v : (n,) [m/s, rad/s]
            Velocity along the axis.
        position : (n,) [m, rad]
            Angle, for the restoring moment, or depth.
        across : (n,) [m/s, rad/s]
            Speed across the axis, for k_w.

        Returns
        -------
        Array
            (n,) [N, N m], positive against a positive velocity.
        """
        return np.asarray(self.columns(v, position, across) @ theta[:-1])

    def slope(self, theta: Array, v: Array, across: Array | float = 0.0) -> Array:
        """Derivative of drag with respect to velocity.

        Parameters
        ----------
        theta : (p,)
            Parameters in the order of `names`.
        v, across : (n,) [m/s, rad/s]
            Velocity along the axis, and speed across it, for k_w.

        Returns
        -------
        Array
            (n,) [N s/m] or [N m s].
        """
        if self.split:
            ahead = v > 0.0
            own = np.where(ahead, 2.0 * theta[0] * v + theta[1], -2.0 * theta[2] * v + theta[3])
        else:
            own = np.asarray(2.0 * theta[0] * np.abs(v) + theta[1])
        if not self.crossed:
            return own
        whole = np.maximum(np.hypot(v, across), LEAST_SPEED)
        return np.asarray(own + theta[self.drags + 1] * (whole + v * v / whole - 2.0 * np.abs(v)))


def speed_across(vehicle: Vehicle, axis: int, nu: Sequence[Array]) -> Array:
    """Speed at the hull by motion along the other axes, in the unit of this one.

    Of surge, sway and heave that of the center; of a turn that of the other turns, and of the center in turns of the
    longest half of the hull, which moves with both.

    Parameters
    ----------
    vehicle
        Its envelope.
    axis
        Index, 0 to 5.
    nu : (6,) of (n,) [m/s, rad/s]
        Velocities of all axes; that of the own one does not count.

    Returns
    -------
    Array
        (n,) [m/s, rad/s].
    """
    return array(np.linalg.norm(np.stack(nu, axis=1) * weights_across(vehicle, axis), axis=1))


def weights_across(vehicle: Vehicle, axis: int) -> Array:
    """What the velocity of each axis counts in the speed across one: (6,) [-, m or 1/m]."""
    weights = np.array([1.0] * 3 + [0.0] * 3 if axis < 3 else [2.0 / max(vehicle.envelope_m)] * 3 + [1.0] * 3)
    weights[axis] = 0.0
    return weights


def areas_across(vehicle: Vehicle, axis: int) -> Array:
    """What the velocity of each axis counts in the drag by incidence along one.

    Of an ellipsoid in the envelope: area times speed is the root of the sum of (area of an axis times its velocity)^2.

    Parameters
    ----------
    vehicle
        Its envelope.
    axis
        Index, 0 to 2.

    Returns
    -------
    Array
        (6,) [-]: area of each over that of the axis, 1 at least; 0 of the axis itself and of turns.
    """
    length, width, height = vehicle.envelope_m
    areas = np.array([width * height, length * height, length * width])
    weights = np.append(np.maximum(1.0, areas / areas[axis]), np.zeros(3))
    weights[axis] = 0.0
    return weights


def rigid_mass(vehicle: Vehicle, axis: int) -> float:
    """Mass or moment of inertia of the body without added mass [kg, kg m^2]."""
    return vehicle.mass_kg if axis < 3 else vehicle.inertia[axis - 3]


def model_of(vehicle: Vehicle, axis: int) -> Model:
    """Model of an axis: heave is split, roll and pitch restore."""
    return Model(axis, rigid_mass(vehicle, axis), axis == 2, axis in (3, 4))


def restoring(vehicle: Vehicle) -> float:
    """k_r of roll and pitch from the vehicle file: buoyancy times its height above the center of mass [N m]."""
    return vehicle.buoyancy_N * (vehicle.center_of_mass_m[2] - vehicle.center_of_buoyancy_m[2])


def offset(vehicle: Vehicle, axis: int) -> float:
    """B of an axis from the vehicle file [N, N m], Fossen 2011 eq. 4.6: net buoyancy, or a hull out of trim."""
    x, y, _ = (b - g for b, g in zip(vehicle.center_of_buoyancy_m, vehicle.center_of_mass_m, strict=True))
    return {2: vehicle.net_buoyancy_N, 3: vehicle.buoyancy_N * y, 4: -vehicle.buoyancy_N * x}.get(axis, 0.0)


def known_force(vehicle: Vehicle, axis: int, attitude_rad: Vec3) -> float:
    """Hydrostatic force that is no unknown: the part of the net buoyancy that tilt brings into surge and sway.

    In roll and pitch hydrostatics are estimated as k_r, in heave as b. Fossen 2011 eq. 4.6, whose W - B is `sinking_N`.

    Parameters
    ----------
    vehicle
        Gives the net buoyancy.
    axis
        Index, 0 to 5.
    attitude_rad : (3,) [rad]
        Roll, pitch, yaw.

    Returns
    -------
    float
        [N] along the body's axis, SNAME; zero on the axes other than surge and sway.
    """
    roll, pitch, _ = attitude_rad
    sinking_N = -vehicle.net_buoyancy_N
    if axis == 0:
        return -sinking_N * math.sin(pitch)
    if axis == 1:
        return sinking_N * math.cos(pitch) * math.sin(roll)
    return 0.0


def lag_s(vehicle: Vehicle, axis: int) -> float | None:
    """Time constant of the thrust on an axis: mean over the thrusters, weighted by what each contributes to it.

    Parameters
    ----------
    vehicle
        Thrusters with their lags.
    axis
        Index, 0 to 5.

    Returns
    -------
    float or None
        [s]; None where no thruster acts on the axis: not known, which is not the same as 0.
    """
    shares = [(abs(unit_wrench(vehicle, thruster)[axis]), thruster.lag_s) for thruster in vehicle.thrusters]
    total = sum(share for share, _ in shares)
    return sum(share * lag for share, lag in shares) / total if total > 0.0 else None


def unit_wrench(vehicle: Vehicle, thruster: Thruster) -> tuple[float, ...]:
    """Wrench about the center of mass per newton of a thruster, six numbers [-]*3, [m]*3. COB-2023-1394 eq. 9."""
    d = thruster.direction
    x, y, z = (p - c for p, c in zip(thruster.position_m, vehicle.center_of_mass_m, strict=True))
    return (*d, y * d[2] - z * d[1], z * d[0] - x * d[2], x * d[1] - y * d[0])
