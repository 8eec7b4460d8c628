"""The mixer of ArduSub: which thruster does what for which axis, and the sticks that come nearest to wanted pulses.

u = F s: motors u (n,) of axes s (6,): forward, lateral, throttle (up), yaw, pitch, roll, all -1 to 1. Factors of
ArduSub's AP_Motors6DOF (public source), by FRAME_CONFIG. A motor's pulse is 1500 us, and its direction times u times
the way to the end of its range.

n (n,), n F = 0, is what no stick moves: four thrusters of a plane against each other, which leave no wrench either. But
pulses are no forces: between them lies a dead band, of 60 us of a T200. So wanted pulses p become forces t(p), which
are moved along n by the one l at which the pulses of t(p) + l n are in reach of the sticks, n u = 0: the wrench stays.
Where a frame has no such n, or several, the sticks are the least squares.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from hindrax_core.thrust.curves import Curve, running

CENTER_us = 1500.0
Matrix: TypeAlias = npt.NDArray[np.float64]
Axes6: TypeAlias = tuple[float, float, float, float, float, float]
PITCH = 4
ROUNDING = 1e-9
SAMPLES, GRID, PASSES = 24, 49, 3
LEVEL_N = 1e-3
"""Thrust to which the dead band rises in a table: no inverse has a jump."""

_VECTORED = (
    (-1.0, 1.0, 0.0, 1.0, 0.0, 0.0),
    (-1.0, -1.0, 0.0, -1.0, 0.0, 0.0),
    (1.0, 1.0, 0.0, -1.0, 0.0, 0.0),
    (1.0, -1.0, 0.0, 1.0, 0.0, 0.0),
)
_PAIR = ((1.0, 0.0, 0.0, -1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 1.0, 0.0, 0.0))
_SIMPLE = (
    *_PAIR,
    (0.0, 0.0, -1.0, 0.0, 0.0, 1.0),
    (0.0, 0.0, -1.0, 0.0, 0.0, -1.0),
    (0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
)
FACTORS: Mapping[int, tuple[Axes6, ...]] = {
    0: (
        (1.0, 0.0, 0.0, -1.0, 0.0, 0.0),
        (1.0, 0.0, 0.0, 1.0, 0.0, 0.0),
        (0.0, 0.0, 0.45, 0.0, 0.5, -0.5),
        (0.0, 0.0, 0.45, 0.0, 0.5, 0.5),
        (0.0, 0.0, 1.0, 0.0, -1.0, 0.0),
        (0.0, 1.0, 0.0, 0.0, 0.0, -0.25),
    ),
    1: (*_VECTORED, (0.0, 0.0, -1.0, 0.0, 0.0, 1.0), (0.0, 0.0, -1.0, 0.0, 0.0, -1.0)),
    2: (
        *_VECTORED,
        (0.0, 0.0, -1.0, 0.0, -1.0, 1.0),
        (0.0, 0.0, -1.0, 0.0, -1.0, -1.0),
        (0.0, 0.0, -1.0, 0.0, 1.0, 1.0),
        (0.0, 0.0, -1.0, 0.0, 1.0, -1.0),
    ),
    3: (
        (0.0, 0.0, 1.0, 0.0, 1.0, 1.0),
        (1.0, 0.0, 0.0, 1.0, 0.0, 0.0),
        (0.0, 0.0, 1.0, 0.0, -1.0, 1.0),
        (0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 1.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 1.0, 0.0, 1.0, -1.0),
        (1.0, 0.0, 0.0, -1.0, 0.0, 0.0),
        (0.0, 0.0, 1.0, 0.0, -1.0, -1.0),
    ),
    4: (*_PAIR, (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)),
    5: _SIMPLE[:4],
    6: _SIMPLE,
}
"""Motors 1 to n of a frame: BLUEROV1, VECTORED, VECTORED_6DOF, VECTORED_6DOF_90DEG, SIMPLEROV_3 to 5."""


@dataclass(frozen=True, slots=True)
class Motor:
    """One thruster of the vehicle file at the autopilot: number from 1, output from 0, and its sense (1 or -1).

    `pulses_us`, `thrust_N`: its curve at rising pulses, strictly rising, positive for long pulses.
    """

    number: int
    channel: int
    direction: float
    pulses_us: Matrix
    thrust_N: Matrix


def thrust_table(curve: Curve, supply_V: float, *, mirrored: bool) -> tuple[Matrix, Matrix]:
    """Tabulate a thruster; its dead band is all but level, so that both columns rise.

    Parameters
    ----------
    curve
        Of the vehicle file.
    supply_V : [V]
        At which it holds.
    mirrored
        Whether the thruster turns the other way.

    Returns
    -------
    tuple[Matrix, Matrix]
        Pulses (m,) [us] and thrusts (m,) [N].
    """
    now = running(curve, supply_V)
    back = np.linspace(now.negative.from_us, now.negative.to_us, SAMPLES)
    forth = np.linspace(now.positive.from_us, now.positive.to_us, SAMPLES)
    below_us, above_us = now.dead_us
    pulses = [*back, min(below_us, curve.stop_us - 1.0), curve.stop_us, max(above_us, curve.stop_us + 1.0), *forth]
    thrusts = [
        *(min(now.negative.force_N(one), -LEVEL_N) for one in back.tolist()),
        *(-0.5 * LEVEL_N, 0.0, 0.5 * LEVEL_N),
        *(max(now.positive.force_N(one), LEVEL_N) for one in forth.tolist()),
    ]
    if mirrored:
        pulses, thrusts = [2.0 * curve.stop_us - one for one in pulses[::-1]], [-one for one in thrusts[::-1]]
    return np.maximum.accumulate(pulses), np.maximum.accumulate(thrusts)


def push_of(frame: int, number: int) -> tuple[float, float, float]:
    """Where a motor of a frame pushes when it is to (body axes, z down); not normalized."""
    forward, lateral, throttle, *_ = FACTORS[frame][number - 1]
    return forward, lateral, -throttle


class Mixer:
    """The mixer of one frame, for motors in the order of the vehicle file."""

    def __init__(self, frame: int, motors: Sequence[Motor], low_us: float = 1100.0, high_us: float = 1900.0) -> None:
        self._motors = tuple(motors)
        self._factors = np.array([FACTORS[frame][one.number - 1] for one in motors])
        self._sticks = np.linalg.pinv(self._factors)
        self._down_us, self._up_us = CENTER_us - low_us, high_us - CENTER_us
        self._balances = [one for one in map(self._balance, _groups(self._factors)) if one is not None]

    @property
    def pitches(self) -> bool:
        """Whether the frame turns about y."""
        return bool(np.any(self._factors[:, PITCH]))

    def sticks(self, pulses_us: Sequence[float]) -> Axes6:
        """Sticks that come nearest to pulses, one a motor; more than 1 where the mixer cannot give as much."""
        u = [self._part(one, pulse) for one, pulse in zip(self._motors, pulses_us, strict=True)]
        for group, n in self._balances:
            for index, part in zip(group, self._balanced(group, n, pulses_us), strict=True):
                u[index] = part
        forward, lateral, throttle, yaw, pitch, roll = (self._sticks @ u).tolist()
        return forward, lateral, throttle, yaw, pitch, roll

    def _part(self, motor: Motor, pulse_us: Any) -> Any:
        """Part of a motor's way, in its sense; for arrays too."""
        away = pulse_us - CENTER_us
        return motor.direction * away / np.where(away > 0.0, self._up_us, self._down_us)

    def _balance(self, group: tuple[int, ...]) -> tuple[tuple[int, ...], Matrix] | None:
        """What no stick moves of the thrusters of a group, if that is one thing."""
        factors = self._factors[list(group)]
        _, sizes, rows = np.linalg.svd(factors.T)
        rank = int(np.sum(sizes > ROUNDING))
        return (group, rows[-1]) if len(group) == rank + 1 else None

    def _balanced(self, group: tuple[int, ...], n: Matrix, pulses_us: Sequence[float]) -> list[float]:
        """Motors of a group, in reach of the sticks, that leave the wrench of pulses."""
        motors = [self._motors[index] for index in group]
        thrusts = [
            one.direction * np.interp(pulses_us[index], one.pulses_us, one.thrust_N)
            for index, one in zip(group, motors, strict=True)
        ]
        # n u rises with l, steeply where a thruster crosses its dead band: three finer grids, then a straight line.
        most = 2.0 * max(float(one.thrust_N[-1] - one.thrust_N[0]) for one in motors)
        low, high = -most, most
        for _ in range(PASSES):
            moved = np.linspace(low, high, GRID)
            u = np.array(
                [
                    self._part(one, np.interp(one.direction * (t + moved * k), one.thrust_N, one.pulses_us))
                    for one, t, k in zip(motors, thrusts, n.tolist(), strict=True)
                ]
            )
            rest = n @ u
            at = int(np.clip(np.searchsorted(rest, 0.0), 1, GRID - 1))
            low, high = moved[at - 1], moved[at]
        span = rest[at] - rest[at - 1]
        share = float(np.clip(-rest[at - 1] / span, 0.0, 1.0)) if span > 0.0 else 0.5
        found: list[float] = ((1.0 - share) * u[:, at - 1] + share * u[:, at]).tolist()
        return found


def _groups(factors: Matrix) -> Iterator[tuple[int, ...]]:
    """Motors that share sticks, directly or by others."""
    left = set(range(len(factors)))
    while left:
        group = {min(left)}
        while more := {one for one in left - group if np.any(factors[one] * np.any(factors[list(group)], axis=0))}:
            group |= more
        left -= group
        yield tuple(sorted(group))
