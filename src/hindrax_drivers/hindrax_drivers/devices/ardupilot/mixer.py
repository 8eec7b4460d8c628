"""The mixer of ArduSub: which thruster does what for which axis, and the sticks that come nearest to wanted pulses.

u = F s: motors (n,) by axes (6,) forward, lateral, throttle (up), yaw, pitch, roll, all -1 to 1. Factors: ArduSub's
AP_Motors6DOF (public source), by FRAME_CONFIG. A motor's pulse is 1500 us, and its direction times u times the way to
the end of its range. The sticks of wanted motors are the least squares: what no stick moves, pairs of thrusters against
each other, stays still.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

CENTER_us = 1500.0
Motors: TypeAlias = tuple[float, ...]
Axes6: TypeAlias = tuple[float, float, float, float, float, float]
AXES = ("forward", "lateral", "throttle", "yaw", "pitch", "roll")
PITCH_AND_ROLL = (4, 5)

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
    """One thruster of the vehicle file at the autopilot: number from 1, output from 0, and its sense (1 or -1)."""

    number: int
    channel: int
    direction: float


class Mixer:
    """The mixer of one frame, for motors in the order of the vehicle file."""

    def __init__(self, frame: int, motors: Sequence[Motor], low_us: float = 1100.0, high_us: float = 1900.0) -> None:
        self._factors = np.array([FACTORS[frame][one.number - 1] for one in motors])
        self._sticks = np.linalg.pinv(self._factors)
        self._directions = np.array([one.direction for one in motors])
        self._down_us, self._up_us = CENTER_us - low_us, high_us - CENTER_us

    def sticks(self, pulses_us: Sequence[float]) -> Axes6:
        """Sticks that come nearest to pulses, one a motor; more than 1 where the mixer cannot give as much."""
        away = np.asarray(pulses_us) - CENTER_us
        wanted = self._directions * away / np.where(away > 0.0, self._up_us, self._down_us)
        forward, lateral, throttle, yaw, pitch, roll = (self._sticks @ wanted).tolist()
        return forward, lateral, throttle, yaw, pitch, roll

    @property
    def pitches_or_rolls(self) -> bool:
        """Whether the frame turns about x or y."""
        return bool(np.any(self._factors[:, PITCH_AND_ROLL]))
