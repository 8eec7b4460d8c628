"""What is true at one instant of a mock flight: pose, velocity, pulses on the wires; also as a line of a log."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from hindrax_core.readings import Vec3

NEUTRAL_us, TOLERANCE_us = 1500.0, 2.0


@dataclass(frozen=True, slots=True)
class TrueState:
    """Velocity is that over ground, in body axes. A pulse of zero is none at all. Place: along and across the pool."""

    now_s: float
    attitude_rad: Vec3
    velocity_mps: Vec3
    depth_m: float
    wall_hits: int
    place_m: tuple[float, float]
    pulses_us: tuple[float, ...]

    @classmethod
    def parse(cls, line: str) -> Self:
        """Undo `line`."""
        now_s, roll, pitch, yaw, u, v, w, depth_m, hits, x_m, y_m, *pulses = map(float, line.split())
        return cls(now_s, (roll, pitch, yaw), (u, v, w), depth_m, int(hits), (x_m, y_m), tuple(pulses))

    def line(self) -> str:
        """All numbers in their order."""
        numbers = (*self.attitude_rad, *self.velocity_mps, self.depth_m, self.wall_hits, *self.place_m, *self.pulses_us)
        return f"{self.now_s:.4f} {' '.join(f'{number:.4f}' for number in numbers)}\n"

    @property
    def neutral(self) -> bool:
        """Whether no thruster is told to turn."""
        return all(abs(pulse - NEUTRAL_us) < TOLERANCE_us or pulse == 0.0 for pulse in self.pulses_us)

    @property
    def tilt_deg(self) -> float:
        """Angle between the vehicle's vertical and the world's."""
        roll, pitch, _ = self.attitude_rad
        return math.degrees(math.acos(max(-1.0, min(1.0, math.cos(roll) * math.cos(pitch)))))
