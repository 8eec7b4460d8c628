"""How fast a hold may be: its margins over every vehicle that the uncertainty admits, and what the thrusters can give.

The loop of one axis, linear about rest (symbols as in `regulator.py`):

    L(s) = (K_p + K_d s + K_p / (T_i s)) / (M s^2 + d s + k) * e^(-T s) / (tau s + 1)

M inertia with added mass, d slope of the drag at rest, k restoring; tau lag of the thrust, T delay of state, cycle and
output. The law places poles for M, d, k alone; lag and delay are what limits it. Rest is the worst case: quadratic drag
only adds damping. Margins are those of classical control: the modulus margin 1/Ms is the distance of L from -1
(Aastroem and Murray, Feedback Systems, 2nd ed., section 10.3), and bounds gain margin Ms/(Ms-1) and phase margin
2 arcsin(1/(2 Ms)) from below.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_control.hold.regulator import gains
from hindrax_control.prior_dynamics import PriorDynamics

MOST_SENSITIVITY = 1.7
"""Ms allowed: gain margin of 2.4 at least, phase margin of 34 degrees at least, on the worst vehicle."""
INTEGRAL_RATIO = 3.0
"""Integral time times bandwidth. Less takes phase at the crossover, which lies above the bandwidth; more leaves a
vehicle that something holds (a tether, dead bands) short of its setpoint for longer: at six, one turn of thirty steps
in drawn pools stood 4 degrees off for six seconds."""
FREQUENCIES_radps = np.geomspace(0.02, 100.0, 500)
GRID = 60


@dataclass(frozen=True, slots=True)
class LoopDelays:
    """What stands between an error and its thrust: first-order lag of the thrust and pure delay [s]."""

    lag_s: float
    delay_s: float


@dataclass(frozen=True, slots=True)
class Margins:
    """Margins of a loop: peak sensitivity [-], gain margin [-], phase margin [rad]."""

    sensitivity: float
    gain: float
    phase_rad: float
    stable: bool


@dataclass(frozen=True, slots=True)
class Law:
    """Gains of a hold as `regulator.py` uses them, and the specification that they follow from."""

    bandwidth_radps: float
    damping: float
    proportional: float
    derivative: float
    integral_s: float


def law_of(freedom: PriorDynamics, bandwidth_radps: float, damping: float, integral_s: float) -> Law:
    """Law of a bandwidth for the vehicle as it is believed to be.

    Parameters
    ----------
    freedom
        Inertia, drag and stiffness of one axis.
    bandwidth_radps, damping, integral_s : [rad/s], [-], [s]
        Of the closed loop; time of the integral part.

    Returns
    -------
    Law
        Gains, with the specification that they follow from.
    """
    return Law(bandwidth_radps, damping, *gains(freedom, bandwidth_radps, damping), integral_s)


def worst_margins(law: Law, freedoms: Sequence[PriorDynamics], delays: LoopDelays) -> Margins:
    """Worst margins of a law over vehicles, which need not be the one that it was made for.

    Rows are vehicles, columns frequencies: L(i w) of all at once. The gain margin is read where the phase falls through
    -180 degrees, the phase margin where the size falls through one, at the last frequency before it; steps of the grid
    are below 2 %. Where the vehicle itself is stable, L has no pole to the right, so by Nyquist both margins decide.

    Parameters
    ----------
    law
        Gains.
    freedoms
        One vehicle or many.
    delays
        Lag and latency of the loop [s].

    Returns
    -------
    Margins
        Largest sensitivity, smallest gain and phase margin, and whether all are stable.
    """
    inertia, slope, restoring = (
        np.array([getattr(one, name) for one in freedoms])[:, None] for name in ("inertia", "slope", "restoring")
    )
    w = FREQUENCIES_radps
    s = 1j * w
    controller = law.proportional * (1.0 + 1.0 / (law.integral_s * s)) + law.derivative * s
    plant = 1.0 / (inertia * s * s + slope * s + restoring)
    loop = controller * plant * np.exp(-delays.delay_s * s) / (delays.lag_s * s + 1.0)
    phase = np.unwrap(np.angle(loop), axis=1)
    # A loop begins between -90 degrees (integral part alone) and -270 (with the mass at rest as well).
    phase -= 2.0 * math.pi * np.round((phase[:, :1] + math.pi) / (2.0 * math.pi))
    size = np.abs(loop)
    falls = (size[:, :-1] >= 1.0) & (size[:, 1:] < 1.0)
    turns = (phase[:, :-1] > -math.pi) & (phase[:, 1:] <= -math.pi)
    margin = float(np.min(phase[:, :-1][falls] + math.pi, initial=math.pi))
    beyond = float(np.max(size[:, :-1][turns], initial=0.0))
    gain = 1.0 / beyond if beyond > 0.0 else math.inf
    return Margins(float(np.max(1.0 / np.abs(1.0 + loop))), gain, margin, margin > 0.0 and gain > 1.0)


def fastest_law(
    freedoms: Sequence[PriorDynamics],
    delays: LoopDelays,
    *,
    damping: float,
    span_radps: tuple[float, float],
    most_sensitivity: float = MOST_SENSITIVITY,
) -> Law:
    """Law of the largest bandwidth whose worst margins are kept.

    The integral part repeats the proportional one in `INTEGRAL_RATIO` times the inverse bandwidth.

    Parameters
    ----------
    freedoms
        Vehicles; the first one is the believed one, for which the law is made.
    delays
        Lag and latency of the loop [s].
    damping : [-]
        Of the closed loop.
    span_radps : [rad/s]
        Least and largest bandwidth.
    most_sensitivity : [-]
        Largest |1 / (1 + L)|.

    Returns
    -------
    Law
        Where none is stable and keeps the sensitivity, the one with the smallest.
    """
    laws = [
        law_of(freedoms[0], bandwidth, damping, INTEGRAL_RATIO / bandwidth)
        for bandwidth in np.geomspace(*span_radps, GRID).tolist()
    ]
    # From the fast ones down: a slow law leaves the damping to the drag, which may be less than believed.
    for law in reversed(laws):
        found = worst_margins(law, freedoms, delays)
        if found.stable and found.sensitivity <= most_sensitivity:
            return law
    return min(laws, key=lambda law: worst_margins(law, freedoms, delays).sensitivity)


def reference_rate(freedom: PriorDynamics, bandwidth_radps: float, effort: float) -> float:
    """Rate of a reference whose drag and acceleration together take no more than an effort.

    The ramp of `regulator.py` changes its rate by 1.5 w v in a second; it does so from rest, and runs at v later, so
    both are bounded, not their sum, where acceleration is over before drag has grown: the larger of both counts.

    Parameters
    ----------
    freedom
        Inertia and drag.
    bandwidth_radps : [rad/s]
        w.
    effort : [N, N m]
        Largest.

    Returns
    -------
    float
        v [m/s, rad/s].
    """
    by_drag = freedom.rate_at(effort)
    by_start = effort / (1.5 * bandwidth_radps * freedom.inertia)
    return min(by_drag, by_start)
