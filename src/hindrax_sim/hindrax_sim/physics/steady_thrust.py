"""Steady thrust of the mock's thrusters: pulse in, force out, from the vehicle file alone.

Independent of the allocator's curve on purpose: the mock shares only the vehicle file with the code under test.
"""

from __future__ import annotations

import math

from hindrax_core.curves.curve_branches import Branch, Curve
from hindrax_core.readings import Vec6
from hindrax_core.vehicle import Thruster, Vehicle

AMPERE = 0.13
"""Current [A] of a thruster per newton to the power 1.5: power goes with thrust to that power (momentum theory)."""


def thruster_A(force_N: float) -> float:
    """Electric current of a thruster [A]."""
    return AMPERE * math.pow(abs(force_N), 1.5)


def steady_force(curve: Curve, pulse_us: float, supply_V: float) -> float:
    """Force [N] that a thruster settles at. COB-2023-1394 eq. 1, scaled by a power of the supply voltage.

    Inside the dead band the force is zero; beyond the ends of a branch it is that of the end. Without a positive
    branch the negative one is mirrored about the stop pulse.
    """
    offset_us = pulse_us - curve.stop_us
    if abs(offset_us) < curve.dead_band_us or offset_us == 0.0:
        return 0.0
    if offset_us < 0.0:
        force_N = min(0.0, _end_to_end(curve.negative, pulse_us))
    elif curve.positive is not None:
        force_N = max(0.0, _end_to_end(curve.positive, pulse_us))
    else:
        force_N = -min(0.0, _end_to_end(curve.negative, curve.stop_us - offset_us))
    return float(force_N * (supply_V / curve.supply_V) ** curve.supply_exponent)


def _end_to_end(branch: Branch, pulse_us: float) -> float:
    return branch.force_N(min(max(pulse_us, branch.from_us), branch.to_us))


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
