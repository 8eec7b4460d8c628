"""The plant: a rigid body with thrusters in water, six degrees of freedom, in plain scalars for speed.

M v' + C(v) v + D(v) v + g(attitude) = tau, with v relative to the water (Fossen 2011, eq. 6.1 and section 8.3).
Everything is written about the center of mass, so the rigid-body part is diagonal and an offset of the center of mass
appears only in lever arms. Frames: SNAME body axes; the reference frame is north, east, down with z = 0 at the surface.

Symbols of `step` and `coupling`: u v w p q r velocities; X Y Z K M N forces and moments, which gather all that acts
before they become accelerations; mx my mz Ix Iy Iz body and entrained water of each axis; P = (px, py, pz) linear and
h = (hx, hy, hz) angular momentum. C(v) v is what Kirchhoff's equations have for a body in an ideal fluid (Fossen 2011,
eq. 6.43), with the momenta of body and water together:

    P' = (X, Y, Z) - omega x P,      h' = (K, M, N) - omega x h - v x P

The last term is the Munk moment: it turns a hull across its way. With added mass along the axes alone it is products of
differences such as (my - mz) v w; `coupling` has the general case.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TypeAlias

import numpy as np

from hindrax_core.errors import UsageError
from hindrax_core.readings import Quaternion, Vec3, Vec6, vec6
from hindrax_core.rotation import minus
from hindrax_core.vehicle import AXES, Hydrodynamics, Vehicle
from hindrax_sim.physics.geometry import combined, quaternion, rotate_back
from hindrax_sim.physics.thruster import ThrusterLag, thruster_force, wrench_per_newton

Rows: TypeAlias = list[list[float]]
Accelerations: TypeAlias = Callable[[Vec6, Vec6], Vec6]
"""Solves M a = forces - C v; the forces hold all but what the off-diagonal momenta add to C v."""
LONGEST_STEP_S = 0.005
MOST_FORCES = 20_000

ThrustLoss: TypeAlias = Callable[[list[float]], list[float]]
"""Steady forces of all thrusters, each as if it ran alone, to those that they have together [N]."""
Influence: TypeAlias = "Callable[[Plant, float], Vec6]"
"""What acts on the plant beside its own law, asked at the beginning of every step of so many seconds: its wrench about
the center of mass in body axes during this step [N, N m]. It may change water and supply."""


class Plant:
    """Integrates the motion of one vehicle by an Euler step about the middle of its forces.

    Attitude follows the new rates (semi-implicit), so that a free pendulum keeps its energy.

    State: `x y z` [m] center of mass, `qw qx qy qz` body to north-east-down, `u v w p q r` [m/s, rad/s] through the
    water. `du .. dr` are the accelerations of the last step. `sx sy sz` [m] and `ax ay az` [rad] are the ground covered
    and the angle turned in body axes since the start: what a DVL reports are their differences. `time_s` is the sum of
    all steps. `pulses_us` and `targets_N` are the command of each thruster and its steady force; electric currents
    follow that without lag.
    """

    __slots__ = (
        "_coupling", "_current", "_differences", "_drag", "_gains", "_inertia", "_influences", "_lags", "_losses",
        "_statics", "_steady_N", "_supply_V", "_vehicle", "_wrenches", "ax", "ay", "az", "dp", "dq", "dr", "du", "dv",
        "dw", "p", "pulses_us", "q", "qw", "qx", "qy", "qz", "r", "sx", "sy", "sz", "targets_N", "time_s", "u", "v",
        "w", "x", "y", "z",
    )  # fmt: skip
    confined = True
    """Whether walls and floor of the pool stop it."""

    def __init__(
        self, vehicle: Vehicle, influences: Sequence[Influence] = (), losses: Sequence[ThrustLoss] = ()
    ) -> None:
        hydrodynamics = truth_of(vehicle)
        self._vehicle = vehicle
        self._influences, self._losses = tuple(influences), tuple(losses)
        body = (vehicle.mass_kg, vehicle.mass_kg, vehicle.mass_kg, *vehicle.inertia)
        self._inertia = vec6(own + added for own, added in zip(body, hydrodynamics.added_mass, strict=True))
        mx, my, mz, Ix, Iy, Iz = self._inertia
        # Factors of the products v w, w u, u v (Munk) and q r, r p, p q (gyroscopic) in K, M, N.
        self._differences = (my - mz, mz - mx, mx - my, Iy - Iz, Iz - Ix, Ix - Iy)
        self._coupling = coupling(self._inertia, hydrodynamics)
        # Factors a, b of the force (a x + b) x, for positive and for negative motion: it always opposes x.
        both_ways = [(one, one.of(backward=True)) for one in map(hydrodynamics.drag, AXES)]
        self._drag = tuple(k for ahead, (q, l) in both_ways for k in (-ahead.k_q, -ahead.k_l, q, -l))
        buoyancy_N = vehicle.buoyancy_N
        bx, by, bz = (buoyancy_N * arm for arm in minus(vehicle.center_of_buoyancy_m, vehicle.center_of_mass_m))
        awash_z = 0.5 * vehicle.envelope_m[2] + vehicle.center_of_mass_m[2]
        self._statics = (awash_z, vehicle.weight_N - buoyancy_N, bx, by, bz)
        self._wrenches = tuple(wrench_per_newton(vehicle, thruster) for thruster in vehicle.thrusters)
        lags = [thruster.lag_s for thruster in vehicle.thrusters]
        self._lags = [
            ThrusterLag(lag_s, [index for index, one in enumerate(lags) if one == lag_s])
            for lag_s in dict.fromkeys(lags)
        ]
        # Pulses repeat.
        self._steady_N = lru_cache(MOST_FORCES)(
            lambda index, pulse_us, supply_V: thruster_force(vehicle, vehicle.thrusters[index], pulse_us, supply_V)
        )
        self._gains = (1.0,) * len(vehicle.thrusters)
        self._supply_V = vehicle.supply_V
        self._current: Vec3 | None = None
        self.time_s = 0.0
        self.drive([vehicle.curves[thruster.curve].stop_us for thruster in vehicle.thrusters])
        self.place((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    # ---- inputs

    def place(self, position_m: Vec3, attitude_rad: Vec3) -> None:
        """Place the center of mass at a position (north, east, down) with roll, pitch, yaw, at rest over the ground."""
        self.x, self.y, self.z = position_m
        self.qw, self.qx, self.qy, self.qz = quaternion(attitude_rad)
        self.u = self.v = self.w = self.p = self.q = self.r = 0.0
        self.du = self.dv = self.dw = self.dp = self.dq = self.dr = 0.0
        self.sx = self.sy = self.sz = self.ax = self.ay = self.az = 0.0
        if self._current is not None:
            self.u, self.v, self.w = (-along for along in self._into_body(self._current))

    def drive(self, pulses_us: Sequence[float]) -> None:
        """Apply one pulse per thruster, in the order of the vehicle file, until the next call; 0 is no signal."""
        self.pulses_us = tuple(pulses_us)
        commanded = zip(self.pulses_us, self._gains, strict=True)
        forces = [self._steady_N(index, pulse, self._supply_V) * gain for index, (pulse, gain) in enumerate(commanded)]
        for loss in self._losses:
            forces = loss(forces)
        self.targets_N = tuple(forces)
        for lag in self._lags:
            lag.set_target(combined([(forces[index], self._wrenches[index]) for index in lag.thrusters]))

    def scale_thrusters(self, gains: Sequence[float]) -> None:
        """Scale the curve of each thruster from now on: 1 is as in the vehicle file, 0 is failed."""
        self._gains = tuple(gains)
        self.drive(self.pulses_us)

    @property
    def supply_V(self) -> float:
        """Voltage at the ESCs."""
        return self._supply_V

    @supply_V.setter
    def supply_V(self, volts: float) -> None:
        self._supply_V = volts
        self.drive(self.pulses_us)

    @property
    def current_mps(self) -> Vec3:
        """Velocity of the water (north, east, down), the same everywhere."""
        return self._current or (0.0, 0.0, 0.0)

    @current_mps.setter
    def current_mps(self, current: Vec3) -> None:
        # The velocity over ground does not jump when the water does, so the velocity through the water must.
        change = self._into_body(minus(current, self.current_mps))
        self.u, self.v, self.w = self.u - change[0], self.v - change[1], self.w - change[2]
        self._current = current if any(current) else None

    # ---- outputs

    @property
    def thrust(self) -> Vec6:
        """Wrench of all thrusters about the center of mass, after the lag."""
        return combined([(1.0, lag.wrench) for lag in self._lags])

    @property
    def quaternion(self) -> Quaternion:
        """Attitude: rotates a vector from the body into north, east, down."""
        return (self.qw, self.qx, self.qy, self.qz)

    @property
    def velocity_over_ground(self) -> Vec3:
        """Velocity of the center of mass over ground in body axes [m/s]."""
        if self._current is None:
            return (self.u, self.v, self.w)
        cu, cv, cw = self._into_body(self._current)
        return (self.u + cu, self.v + cv, self.w + cw)

    def _awash(self, emerged_m: float) -> tuple[float, float, float, float]:
        """Net weight [N] and buoyancy's moments per unit of "down" [N m] with the top this far out of the water.

        The hull counts as a box: it displaces by the share of its height that is under water, about the same center.
        """
        _, net, bx, by, bz = self._statics
        vehicle = self._vehicle
        share = max(0.0, 1.0 - emerged_m / vehicle.envelope_m[2])
        return net + (1.0 - share) * vehicle.buoyancy_N, share * bx, share * by, share * bz

    def _into_body(self, vector: Vec3) -> Vec3:
        return rotate_back((self.qw, self.qx, self.qy, self.qz), vector)

    def mid_step(self, dt: float) -> Vec6:
        """Velocities through the water in the middle of a step of `dt`, by the acceleration before."""
        half = 0.5 * dt
        return (
            self.u + half * self.du,
            self.v + half * self.dv,
            self.w + half * self.dw,
            self.p + half * self.dp,
            self.q + half * self.dq,
            self.r + half * self.dr,
        )

    # ---- equation of motion

    def step(self, dt: float) -> None:  # noqa: PLR0915  # one law, unrolled: a call costs as much as four products
        """Advance the state.

        Forces are evaluated once: with the velocities of the middle of the step (`mid_step`), the mean of the thrust
        over it, and the attitude at its begin. One Euler step with them makes the velocities; the attitude then turns
        by the new rates, and the way over ground is that of the middle. Steps are short anyway, for the wires.

        Parameters
        ----------
        dt : [s]
            LONGEST_STEP_S at most keeps the attitude stable.
        """
        # First, because an influence may move the water, and with it the velocities through the water.
        extra = combined([(1.0, one(self, dt)) for one in self._influences]) if self._influences else None
        u_was, v_was, w_was, p_was, q_was, r_was = self.u, self.v, self.w, self.p, self.q, self.r
        qw, qx, qy, qz = self.qw, self.qx, self.qy, self.qz
        mx, my, mz, Ix, Iy, Iz = self._inertia
        myz, mzx, mxy, Iyz, Izx, Ixy = self._differences

        # Drag taken at the beginning would make the vehicle seem lighter by half a step times the slope of its drag.
        u, v, w, p, q, r = self.mid_step(dt)

        # Drag, with its own coefficients per direction: ..n and ..m are quadratic and linear for negative motion.
        Xq, Xl, Xn, Xm, Yq, Yl, Yn, Ym, Zq, Zl, Zn, Zm, Kq, Kl, Kn, Km, Mq, Ml, Mn, Mm, Nq, Nl, Nn, Nm = self._drag
        X = (Xq * u + Xl) * u if u > 0.0 else (Xn * u + Xm) * u
        Y = (Yq * v + Yl) * v if v > 0.0 else (Yn * v + Ym) * v
        Z = (Zq * w + Zl) * w if w > 0.0 else (Zn * w + Zm) * w
        K = (Kq * p + Kl) * p if p > 0.0 else (Kn * p + Km) * p
        M = (Mq * q + Ml) * q if q > 0.0 else (Mn * q + Mm) * q
        N = (Nq * r + Nl) * r if r > 0.0 else (Nn * r + Nm) * r

        # Thrust: first-order lag; the rest to the target decays, and its mean over the step acts.
        for lag in self._lags:
            keep, mean = lag.shares if dt == lag.dt else lag.decay(dt)
            X_left, Y_left, Z_left, K_left, M_left, N_left = lag.left
            X_goal, Y_goal, Z_goal, K_goal, M_goal, N_goal = lag.target
            lag.left = (keep * X_left, keep * Y_left, keep * Z_left, keep * K_left, keep * M_left, keep * N_left)
            X += X_goal + mean * X_left
            Y += Y_goal + mean * Y_left
            Z += Z_goal + mean * Z_left
            K += K_goal + mean * K_left
            M += M_goal + mean * M_left
            N += N_goal + mean * N_left

        # Rotation body to north-east-down of the quaternion, from twice its products:
        # R = [1 - yy - zz, xy - wz, xz + wy; xy + wz, 1 - xx - zz, yz - wx; xz - wy, yz + wx, 1 - xx - yy]
        # The last row is "down" in body axes.
        x2, y2, z2 = qx + qx, qy + qy, qz + qz
        xx, yy, zz = x2 * qx, y2 * qy, z2 * qz
        xy, xz, yz = x2 * qy, x2 * qz, y2 * qz
        wx, wy, wz = x2 * qw, y2 * qw, z2 * qw
        down_x, down_y, down_z = xz - wy, yz + wx, 1.0 - xx - yy

        # Net weight along "down", and r_b x (buoyancy, upwards), with r_b from the center of mass to that of buoyancy.
        # A hull partly out of the water displaces less.
        awash_z, net, bx, by, bz = self._statics
        if self.z < awash_z:
            net, bx, by, bz = self._awash(awash_z - self.z)
        X += net * down_x
        Y += net * down_y
        Z += net * down_z
        K += bz * down_y - by * down_z
        M += bx * down_z - bz * down_x
        N += by * down_x - bx * down_y

        # Coriolis and centripetal of body and entrained water together: -omega x P, and -omega x h - v x P.
        px, py, pz = mx * u, my * v, mz * w
        X += r * py - q * pz
        Y += p * pz - r * px
        Z += q * px - p * py
        K += Iyz * q * r + myz * v * w
        M += Izx * r * p + mzx * w * u
        N += Ixy * p * q + mxy * u * v

        if extra is not None:
            X, Y, Z, K, M, N = combined([(1.0, (X, Y, Z, K, M, N)), (1.0, extra)])

        coupled = self._coupling
        if coupled is None:
            du, dv, dw, dp, dq, dr = X / mx, Y / my, Z / mz, K / Ix, M / Iy, N / Iz
        else:
            du, dv, dw, dp, dq, dr = coupled((X, Y, Z, K, M, N), (u, v, w, p, q, r))
        self.time_s += dt
        self.du, self.dv, self.dw, self.dp, self.dq, self.dr = du, dv, dw, dp, dq, dr
        self.u = u_was + du * dt
        self.v = v_was + dv * dt
        self.w = w_was + dw * dt
        self.p = p = p_was + dp * dt
        self.q = q = q_was + dq * dt
        self.r = r = r_was + dr * dt

        # Displacement over ground: the motion of the water is added, R' times the current.
        current = self._current
        if current is not None:
            cx, cy, cz = current
            u += (1.0 - yy - zz) * cx + (xy + wz) * cy + down_x * cz
            v += (xy - wz) * cx + (1.0 - xx - zz) * cy + down_y * cz
            w += (xz + wy) * cx + (yz - wx) * cy + down_z * cz
        step_x, step_y, step_z = u * dt, v * dt, w * dt
        self.sx += step_x
        self.sy += step_y
        self.sz += step_z
        self.x += (1.0 - yy - zz) * step_x + (xy - wz) * step_y + (xz + wy) * step_z
        self.y += (xy + wz) * step_x + (1.0 - xx - zz) * step_y + (yz - wx) * step_z
        self.z += down_x * step_x + down_y * step_y + down_z * step_z
        p *= dt
        q *= dt
        r *= dt
        self.ax += p
        self.ay += q
        self.az += r
        # Quaternion times (1, half of the turned angle): the first terms of its exponential.
        p *= 0.5
        q *= 0.5
        r *= 0.5
        nw, nx = qw - qx * p - qy * q - qz * r, qx + qw * p + qy * r - qz * q
        ny, nz = qy + qw * q + qz * p - qx * r, qz + qw * r + qx * q - qy * p
        # The norm stays so close to one that the first terms of its series give the root.
        unit = 1.5 - 0.5 * (nw * nw + nx * nx + ny * ny + nz * nz)
        self.qw, self.qx, self.qy, self.qz = nw * unit, nx * unit, ny * unit, nz * unit


def truth_of(vehicle: Vehicle) -> Hydrodynamics:
    """Hydrodynamics of a mock vehicle; UsageError where its file has none."""
    if vehicle.hydrodynamics is None:
        remedy = "`./hindrax estimate --vehicle FILE` prints a block to add to the file"
        raise UsageError(f"{vehicle.name}.hydrodynamics: missing, wanted the mock's truth; {remedy}")
    return vehicle.hydrodynamics


def coupling(inertia: Vec6, hydrodynamics: Hydrodynamics) -> Accelerations | None:
    """Accelerations of forces and velocities with off-diagonal added mass.

    In an ideal fluid added mass is symmetric, and its momenta are those of the energy: so the symmetric part makes C v
    (Fossen 2011, property 6.2). Measured matrices are not symmetric (Xu, Ma, Han 2017): all of it resists.
    The momenta along the diagonal are in `step`, so here are those of the off-diagonal part alone.

    Parameters
    ----------
    inertia : (6,) [kg, kg m^2]
        Body and added mass of each axis.
    hydrodynamics
        With `added_mass_cross`, (6, 6), zero on its diagonal.

    Returns
    -------
    Accelerations | None
        From forces (6,) [N, N m] and velocities (6,) [m/s, rad/s] to accelerations (6,) [m/s^2, rad/s^2], in body axes;
        None without such a mass.

    Raises
    ------
    UsageError
        For another shape, or masses with which the kinetic energy can be negative.
    """
    if not hydrodynamics.added_mass_cross:
        return None
    cross = np.array(hydrodynamics.added_mass_cross, dtype=float)
    if cross.shape != (6, 6) or np.any(np.diag(cross)):
        raise UsageError("hydrodynamics.added_mass_cross: wanted 6 rows of 6 with a zero diagonal (see added_mass)")
    whole = np.diag(inertia) + cross
    lowest = float(np.linalg.eigvalsh(0.5 * (whole + whole.T))[0])
    if lowest <= 0.0:
        raise UsageError(f"hydrodynamics.added_mass_cross: energy can be negative ({lowest:g} kg), make it smaller")
    momentum: Rows = (0.5 * (cross + cross.T)).tolist()
    inverse: Rows = np.linalg.inv(whole).tolist()

    def accelerations(forces: Vec6, velocities: Vec6) -> Vec6:
        """M^-1 (forces - omega x P, moments - omega x h - v x P), with P and h of the off-diagonal masses."""
        u, v, w, p, q, r = velocities
        px, py, pz, hx, hy, hz = _times(momentum, velocities)
        X, Y, Z, K, M, N = forces
        left = (
            X + r * py - q * pz,
            Y + p * pz - r * px,
            Z + q * px - p * py,
            K + r * hy - q * hz + w * py - v * pz,
            M + p * hz - r * hx + u * pz - w * px,
            N + q * hx - p * hy + v * px - u * py,
        )
        return _times(inverse, left)

    return accelerations


def _times(matrix: Rows, vector: Vec6) -> Vec6:
    """Matrix (6, 6) times a vector, in plain numbers: numpy takes longer to start than this to end."""
    a, b, c, d, e, f = vector
    return vec6([A * a + B * b + C * c + D * d + E * e + F * f for A, B, C, D, E, F in matrix])
