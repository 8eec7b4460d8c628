"""Attitude from rates and gravity: a complementary filter whose trust in gravity starts high and falls.

The explicit complementary filter of Mahony, Hamel and Pflimlin (2008, eq. 32) on a quaternion. Heading is corrected
from outside, see `heading.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from hindrax_core.knobs import knob
from hindrax_core.readings import Quaternion, Vec3
from hindrax_core.rotation import IDENTITY, Matrix3
from hindrax_core.vehicle import GRAVITY_mps2


@dataclass(frozen=True)
class AttitudeKnobs:
    """How far gravity is trusted."""

    tilt_time_s: float = knob(20.0, 0.5, 1000.0, "time constant with which tilt follows gravity, once settled [s]")
    bias_time_s: float = knob(80.0, 1.0, 10000.0, "time constant of the gyroscope bias across the vertical [s]")
    gravity_gate_mps2: float = knob(1.0, 0.05, 10.0, "specific force this far from one g is no gravity [m/s^2]")
    offset_dps: float = knob(10.0, 0.1, 90.0, "largest believable gyroscope offset [deg/s]")


class AttitudeFilter:
    """Quaternion and gyroscope bias; angles in radians, body in SNAME axes."""

    __slots__ = ("_age_s", "_knobs", "bias_radps", "q", "rotation")

    def __init__(self, knobs: AttitudeKnobs) -> None:
        self._knobs = knobs
        self._age_s = 0.0
        self.bias_radps: Vec3 = (0.0, 0.0, 0.0)
        self.q: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self.rotation: Matrix3 = IDENTITY

    def align(self, specific_force_mps2: Vec3, rate_radps: Vec3) -> None:
        """Start level with gravity, heading zero; the mean rate is taken for the gyroscope's offset."""
        fx, fy, fz = specific_force_mps2
        roll, pitch = math.atan2(-fy, -fz), math.atan2(fx, math.hypot(fy, fz))
        cr, sr, cp, sp = math.cos(roll / 2), math.sin(roll / 2), math.cos(pitch / 2), math.sin(pitch / 2)
        self._set((cr * cp, sr * cp, cr * sp, -sr * sp))
        believable = math.hypot(*rate_radps) < math.radians(self._knobs.offset_dps)
        self.bias_radps = rate_radps if believable else (0.0, 0.0, 0.0)
        self._age_s = 1.0

    def turn(self, angle_rad: Vec3, dt_s: float) -> None:
        """Turn by what the gyroscope has seen in `dt_s`, bias already taken off."""
        x, y, z = angle_rad
        self._rotate(x, y, z)
        self._age_s += dt_s

    def level(self, specific_force_mps2: Vec3, dt_s: float) -> None:
        """Lean towards the measured gravity, the less the longer the filter has run."""
        fx, fy, fz = specific_force_mps2
        norm = math.sqrt(fx * fx + fy * fy + fz * fz)
        if abs(norm - GRAVITY_mps2) > self._knobs.gravity_gate_mps2:
            return
        dx, dy, dz = self.rotation[2]
        ex, ey, ez = (fz * dy - fy * dz) / norm, (fx * dz - fz * dx) / norm, (fy * dx - fx * dy) / norm
        gain = dt_s / min(self._knobs.tilt_time_s, self._age_s)
        self._rotate(gain * ex, gain * ey, gain * ez)
        gain *= 1.0 / self._knobs.bias_time_s
        bx, by, bz = self.bias_radps
        self.bias_radps = (bx - gain * ex, by - gain * ey, bz - gain * ez)

    def steer(self, angle_rad: float, bias_radps: float) -> None:
        """Correct heading, and the bias about the vertical."""
        dx, dy, dz = self.rotation[2]
        self._rotate(angle_rad * dx, angle_rad * dy, angle_rad * dz)
        bx, by, bz = self.bias_radps
        self.bias_radps = (bx + bias_radps * dx, by + bias_radps * dy, bz + bias_radps * dz)

    @property
    def heading_rad(self) -> float:
        """Heading, clockwise from north."""
        (r11, _, _), (r21, _, _), _ = self.rotation
        return math.atan2(r21, r11)

    @property
    def euler_rad(self) -> Vec3:
        """Roll, pitch, yaw."""
        (r11, _, _), (r21, _, _), (r31, r32, r33) = self.rotation
        return (math.atan2(r32, r33), math.asin(min(1.0, max(-1.0, -r31))), math.atan2(r21, r11))

    def _rotate(self, x: float, y: float, z: float) -> None:
        """Turn by a rotation vector in body axes, to the third order of its length."""
        square = 0.25 * (x * x + y * y + z * z)
        if square > 0.01:
            half = math.sqrt(square)
            cos, scale = math.cos(half), 0.5 * math.sin(half) / half
        else:
            cos, scale = 1.0 - 0.5 * square, 0.5 - square / 12.0
        x, y, z = scale * x, scale * y, scale * z
        a, b, c, d = self.q
        w = a * cos - b * x - c * y - d * z
        i = b * cos + a * x + c * z - d * y
        j = c * cos + a * y + d * x - b * z
        k = d * cos + a * z + b * y - c * x
        unit = 1.5 - 0.5 * (w * w + i * i + j * j + k * k)
        self._set((w * unit, i * unit, j * unit, k * unit))

    def _set(self, q: Quaternion) -> None:
        self.q = q
        w, x, y, z = q
        self.rotation = (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
