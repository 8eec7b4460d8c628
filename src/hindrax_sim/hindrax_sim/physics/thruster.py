"""The mock's thrusters: pulse in, steady force out, from the vehicle file alone; and the lag with which it is reached.

Independent of the allocator's curve on purpose: the mock shares only the vehicle file with the code under test.
"""

import math
from collections.abc import Sequence

import numpy as np

from hindrax_core.readings import Vec6
from hindrax_core.rotation import minus
from hindrax_core.signals import ZERO6
from hindrax_core.thrust.curves import Curve
from hindrax_core.thrust.table import ThrustTable
from hindrax_core.vehicle import Thruster, Vehicle
from hindrax_sim.physics.geometry import combined, lever_wrench

AMPERE = 0.13
"""Current [A] of a thruster per newton to the power 1.5: power goes with thrust to that power (momentum theory)."""


def thruster_A(force_N: float) -> float:
    """Electric current of a thruster [A]."""
    return AMPERE * math.pow(abs(force_N), 1.5)


def steady_force(curve: Curve, pulse_us: float, supply_V: float) -> float:
    """Force that a thruster settles at. COB-2023-1394 eq. 1, scaled by a power of the supply voltage; or a table.

    Inside the dead band the force is zero, and rises evenly from there to a branch that begins later; beyond a branch
    it is that of the end. Without a positive branch the negative one is mirrored about the stop pulse.

    Parameters
    ----------
    curve
        Of the thruster type.
    pulse_us : [us]
        Of a thruster that is not reversed.
    supply_V : [V]
        At its speed controller.

    Returns
    -------
    float
        [N], along its own x axis.
    """
    if curve.table is not None:
        return _table_force(curve.table, pulse_us, supply_V, curve.supply_exponent)
    offset_us = pulse_us - curve.stop_us
    if abs(offset_us) < curve.dead_band_us or offset_us == 0.0:
        return 0.0
    if offset_us > 0.0 and curve.positive is not None:
        branch, begin_us, at_us = curve.positive, curve.positive.from_us, pulse_us
    else:
        branch, begin_us, at_us = curve.negative, curve.negative.to_us, curve.stop_us - abs(offset_us)
    force_N = math.copysign(abs(branch.force_N(min(max(at_us, branch.from_us), branch.to_us))), offset_us)
    gap_us = abs(begin_us - curve.stop_us) - curve.dead_band_us
    force_N *= min(1.0, (abs(offset_us) - curve.dead_band_us) / gap_us) if gap_us > 0.0 else 1.0
    return float(force_N * (supply_V / curve.supply_V) ** curve.supply_exponent)


def _table_force(table: ThrustTable, pulse_us: float, supply_V: float, exponent: float) -> float:
    """Along the pulses of each row first, then between the voltages, or by the power of the voltage beyond them."""
    forces = [float(np.interp(pulse_us, table.pulse_us, row)) for row in table.force_N]
    held_V = min(max(supply_V, table.supply_V[0]), table.supply_V[-1])
    return float(np.interp(supply_V, table.supply_V, forces) * (supply_V / held_V) ** exponent)


def thruster_force(vehicle: Vehicle, thruster: Thruster, pulse_us: float, supply_V: float) -> float:
    """Steady force of one thruster of a vehicle.

    Parameters
    ----------
    vehicle, thruster
        Whose curve counts, and which one; where it is reversed, its pulses are mirrored.
    pulse_us : [us]
        On the wire; zero is no signal, and the speed controller stops.
    supply_V : [V]
        At its speed controller.

    Returns
    -------
    float
        [N], along `thruster.direction`.
    """
    curve = vehicle.curves[thruster.curve]
    if pulse_us <= 0.0:
        return 0.0
    if thruster.reversed:
        pulse_us = 2.0 * curve.stop_us - pulse_us
    return steady_force(curve, pulse_us, supply_V)


def wrench_per_newton(vehicle: Vehicle, thruster: Thruster) -> Vec6:
    """Wrench about the center of mass of one newton of this thruster: [d; r x d]. COB-2023-1394 eq. 9."""
    return lever_wrench(thruster.direction, minus(thruster.position_m, vehicle.center_of_mass_m))


class ThrusterLag:
    """First-order lag of all thrusters with one time constant; linear, so it may act on their joint wrench."""

    __slots__ = ("dt", "lag_s", "left", "shares", "target", "thrusters")

    def __init__(self, lag_s: float, thrusters: Sequence[int]) -> None:
        self.lag_s, self.thrusters = lag_s, thrusters
        self.target = self.left = ZERO6
        self.dt, self.shares = 0.0, (1.0, 1.0)

    def decay(self, dt: float) -> tuple[float, float]:
        """Remaining share of the way to the target after `dt`, and its mean over `dt`; cached for equal steps."""
        self.dt = dt
        keep = math.exp(-dt / self.lag_s) if self.lag_s > 0.0 else 0.0
        self.shares = (keep, (1.0 - keep) * self.lag_s / dt)
        return self.shares

    @property
    def wrench(self) -> Vec6:
        """Current wrench."""
        return combined([(1.0, self.target), (1.0, self.left)])

    def set_target(self, target: Vec6) -> None:
        """Set the target; the thrust does not jump."""
        self.left = combined([(1.0, self.wrench), (-1.0, target)])
        self.target = target
