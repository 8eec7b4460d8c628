"""Steady thrust of the mock's thrusters: pulse in, force out, from the vehicle file alone.

Independent of the allocator's curve on purpose: the mock shares only the vehicle file with the code under test.
"""

from __future__ import annotations

import math

from hindrax_core.curves.curve_branches import Curve
from hindrax_core.readings import Vec6
from hindrax_core.vehicle import Thruster, Vehicle

AMPERE = 0.13
"""Current [A] of a thruster per newton to the power 1.5: power goes with thrust to that power (momentum theory)."""


def thruster_A(force_N: float) -> float:
    """Electric current of a thruster [A]."""
    return AMPERE * math.pow(abs(force_N), 1.5)


def steady_force(curve: Curve, pulse_us: float, supply_V: float) -> float:
    """Force [N] that a thruster settles at. COB-2023-1394 eq. 1, scaled by a power of the supply voltage.

    Inside the dead band the force is zero, and rises evenly from there to a branch that begins later; beyond a branch
    it is that of the end. Without a positive branch the negative one is mirrored about the stop pulse.
    """
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


def thruster_force(vehicle: Vehicle, thruster: Thruster, pulse_us: float, supply_V: float) -> float:
    """Steady force along the thruster's own direction; a pulse of zero is no signal, and the ESC stops."""
    curve = vehicle.curves[thruster.curve]
    if pulse_us <= 0.0:
        return 0.0
    if thruster.reversed:
        pulse_us = 2.0 * curve.stop_us - pulse_us
    return steady_force(curve, pulse_us, supply_V)


def wrench_per_newton(vehicle: Vehicle, thruster: Thruster) -> Vec6:
    """Wrench about the center of mass of one newton of this thruster: [d; r x d]. COB-2023-1394 eq. 9."""
    dx, dy, dz = thruster.direction
    rx, ry, rz = (p - c for p, c in zip(thruster.position_m, vehicle.center_of_mass_m, strict=True))
    return (dx, dy, dz, ry * dz - rz * dy, rz * dx - rx * dz, rx * dy - ry * dx)
