"""The pulses of a commissioning: each thruster alone, back and forth; then the whole vehicle, by what was found.

One thruster pushes forth for a quarter of a second, back for half, forth for a quarter: rate and angle end where they
began, so the next one can follow soon, and the vehicle hardly leaves its place or its attitude.
"""

import math

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_control.commissioning.response import Prior
from hindrax_control.maneuver.goal import LONGEST_PULSE_S, MOST_PULSE_N, Pulse
from hindrax_core.vehicle import Vehicle

QUARTER_S = 0.25
SWING_rad = math.radians(5.0)
"""Largest angle that a pulse of a single thruster may make."""
RUNNING = 1.3
"""Forces are at least this multiple of the smallest that a thruster can give."""
TURN_radps, AHEAD_mps, DIVE_mps = 0.6, 0.2, 0.2
LEAN_rad = math.radians(6.0)
"""Tilt of the whole vehicle's motions at rest, where thrusters cannot push without it; it swings to twice of it."""
LISTING_rad, GENTLEST = math.radians(7.0), 0.5
"""List at rest up to which it is allowed, and the part of it that is left of it at the most."""
START_S = 0.25
"""What the lag of the thrusters takes off a pulse."""
SUNK_m = 0.2
"""Deeper than at rest by this, it climbs instead of diving."""
LEAST_SHARE = 0.15
"""A push along an axis is worth it from this share of a thruster's force on."""
COAST_S = 1.5
RISE_m, MOST_RISES = 0.12, 12
"""Way up of one push against a slow sinking, and how many follow each other at the most."""


def probe_N(vehicle: Vehicle, B: Matrix, share: float = 1.0) -> tuple[float, ...]:
    """Force of each thruster's pulses: up to 3 N, less where it would swing the vehicle too far.

    Parameters
    ----------
    vehicle
        Inertia, restoring moments and dead bands.
    B : (6, thrusters) [-, m]
        Effectiveness.
    share : [-]
        Of the usual force, where the thruster still turns with it.

    Returns
    -------
    tuple[float, ...]
        (thrusters,) [N].
    """
    inertia = Prior(vehicle).inertia[3:]
    # Forth, back, forth: the angle peaks in the middle, at the acceleration times the square of a quarter.
    swing = np.max(np.abs(B[3:]) / inertia[:, None], axis=0, initial=0.0) * QUARTER_S**2
    found = []
    for curve, per_newton in zip(thrust_curves(vehicle), swing, strict=True):
        least_N = RUNNING * max(abs(gap) for gap in curve.gap_N)
        wanted_N = min(MOST_PULSE_N, SWING_rad / per_newton if per_newton > 0.0 else MOST_PULSE_N)
        found.append(min(MOST_PULSE_N, max(least_N, share * wanted_N)))
    return tuple(found)


def single_pulses(vehicle: Vehicle, B: Matrix, share: float = 1.0) -> tuple[Pulse, ...]:
    """Pulses of each thruster alone, in the order of the vehicle file.

    Parameters
    ----------
    vehicle
        With n thrusters.
    B : (6, n) [-, m]
        Effectiveness.
    share : [-]
        Of the usual force.

    Returns
    -------
    tuple[Pulse, ...]
        Each forward, back for twice as long, and forward: it ends about where it began.
    """
    pulses: list[Pulse] = []
    for index, force_N in enumerate(probe_N(vehicle, B, share)):
        for sign, quarters in ((1.0, 1), (-1.0, 2), (1.0, 1)):
            forces_N = tuple(sign * force_N * (at == index) for at in range(len(vehicle.thrusters)))
            pulses.append(Pulse(forces_N, quarters * QUARTER_S, calm=len(pulses) % 3 == 0))
    return tuple(pulses)


def body_pulses(vehicle: Vehicle, found: Matrix, *, sunk_m: float = 0.0, listing_rad: float = 0.0) -> tuple[Pulse, ...]:
    """Pulses that turn, move and dive the whole vehicle.

    Parameters
    ----------
    vehicle
        With n thrusters.
    found : (6, n) [-, m]
        Effectiveness as it was found.
    sunk_m : [m]
        Way that it has sunk meanwhile: it is pushed up by about that first, else it would end on the floor, and climbs
        instead of diving.
    listing_rad : [rad]
        List at rest: such a vehicle is pushed more gently.

    Returns
    -------
    tuple[Pulse, ...]
        Forces of all thrusters; but for those up, each push is followed by the opposite one.
    """
    prior = Prior(vehicle)
    lean_rad = LEAN_rad * max(GENTLEST, min(1.0, 2.0 - listing_rad / LISTING_rad))
    pulses: list[Pulse] = []
    down_N, down_s = _push(vehicle, prior, found, 2, DIVE_mps, lean_rad)
    deep = sunk_m > SUNK_m
    if deep:
        down_N = tuple(-force_N for force_N in down_N)
    rest = _rest(vehicle)
    dive = (Pulse(down_N, down_s), rest, Pulse(tuple(-force_N for force_N in down_N), down_s, calm=False), rest)
    if deep and down_s:
        pulses += (Pulse(down_N, down_s, calm=False), rest) * min(MOST_RISES, math.ceil((sunk_m - SUNK_m) / RISE_m))
        pulses += dive
    for axis, speed in ((5, TURN_radps), (0, AHEAD_mps), (1, AHEAD_mps)):
        forces_N, seconds = _push(vehicle, prior, found, axis, speed, lean_rad)
        if seconds:
            back_N = tuple(-force_N for force_N in forces_N)
            pulses.append(Pulse(forces_N, seconds))
            if axis == 5:
                pulses.append(rest)
            pulses.append(Pulse(back_N, seconds, calm=False))
    pulses += dive if down_s and not deep else ()
    return tuple(pulses)


def _rest(vehicle: Vehicle) -> Pulse:
    return Pulse((0.0,) * len(vehicle.thrusters), COAST_S, calm=False)


def _push(  # noqa: PLR0917  # a vehicle and how it is pushed
    vehicle: Vehicle, prior: Prior, found: Matrix, axis: int, speed: float, lean_rad: float
) -> tuple[tuple[float, ...], float]:
    """Forces along one axis and their duration, for a speed at its end; no duration where they do not serve it."""
    none = (0.0,) * found.shape[1]
    reach = 0.999 * MOST_PULSE_N * float(np.sum(np.abs(found[axis])))
    if reach < LEAST_SHARE * (MOST_PULSE_N if axis < 3 else 1.0):
        return none, 0.0
    least_N = np.array([max(abs(gap) for gap in curve.gap_N) for curve in thrust_curves(vehicle)])
    used = np.ones(found.shape[1], bool)
    forces: Matrix = np.zeros(found.shape[1])
    while used.any():
        # One that should give less than it can is left out, and the others share its part.
        forces = _shared(prior, found * used, axis, reach, lean_rad)
        weak = used & (np.abs(forces) < least_N)
        if not weak.any():
            break
        used &= ~weak
        forces = np.zeros(found.shape[1])
    given_axis = float(found[axis] @ forces)
    if given_axis < LEAST_SHARE * (MOST_PULSE_N if axis < 3 else 0.5):
        return none, 0.0
    seconds = speed * float(prior.inertia[axis]) / given_axis + START_S
    return tuple(map(float, forces)), min(LONGEST_PULSE_S, seconds)


def _shared(prior: Prior, found: Matrix, axis: int, reach: float, lean_rad: float) -> Matrix:
    """Forces (n,) that reach furthest along an axis within 3 N each, and lean the vehicle no further than LEAN.

    Least squares of a wrench that is `reach` along the axis and zero otherwise, each row in units of what is allowed
    of it, and the axis three times as heavy: B as it was found is not exact, and equality would chase its errors.
    A little of the identity keeps thrusters out that add nothing. The result is scaled to the first limit it meets.
    """
    # What nobody asked for is kept small: tilt at rest within LEAN, other forces and moments within these.
    righting = np.maximum(prior.restoring[3:5], 0.3) * lean_rad
    allowed = np.array([4.0, 4.0, 4.0, *righting, 0.4])
    weight, wanted = 1.0 / allowed, np.zeros(6)
    weight[axis], wanted[axis] = 3.0 / reach, reach
    rows = weight[:, None] * found
    forces = np.linalg.solve(rows.T @ rows + 0.01 * np.eye(found.shape[1]), rows.T @ (weight * wanted))
    most, lean = float(np.max(np.abs(forces))), float(np.max(np.abs((found @ forces)[3:5]) / righting))
    return np.asarray(forces * 0.999 / max(most / MOST_PULSE_N, lean, 1e-9))
