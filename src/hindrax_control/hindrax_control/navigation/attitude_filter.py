"""Attitude from rates and gravity: a Kalman filter of tilt and gyroscope offset that knows how sure it is.

The correction is that of the explicit complementary filter (Mahony, Hamel and Pflimlin 2008, eq. 32) on a quaternion;
its gains are not constants but follow from what is not known yet. The errors of tilt and of the offset across the
vertical are each one complex number (x + iy in level axes that turn with the body): a turn about the vertical is a
factor, and one covariance serves both axes.

    error of tilt:  d/dt e = -b - i r e + gyroscope noise      error of the offset:  d/dt b = walk

e is fixed to the earth, so in axes that turn with the body at r it turns backwards; b is fixed to the body. Gravity
measures e, with the accelerations of the vehicle as noise: white, of density R [rad^2 s]. Variances in the code:
`_p_tilt` E|e|^2 and `_p_bias` E|b|^2, both real, for either axis; `_p_cross` E[e b*], complex once the vehicle turned.
Once settled, the gains are those of the two time constants. Heading is corrected from outside, see `heading_filter.py`.

Vectors are in body axes (SNAME): d is "down", the last row of the rotation; f the specific force, -g d at rest.

The vehicle need not stand still at its start: it floats, rocks and is carried about. So the mean rate over a
window counts only as far as the rates are alike, the forces are alike, and gravity keeps its direction: a vehicle in
the middle of its swing turns steadily, but gravity turns with it.
"""

import cmath
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.knobs import knob
from hindrax_core.readings import Quaternion, Vec3
from hindrax_core.rotation import IDENTITY, Matrix3

SMOOTHED_S = 0.25
"""A gyroscope that jumps by 40 deg/s is detected in 0.75 s; full thrust of the strongest vehicle, back and forth, stays
below the limit of the health check by a tenth."""
SPANS = 5
"""Spans in a window."""
Span: TypeAlias = tuple[Vec3, Vec3]
"""Mean rate [rad/s] and mean specific force [m/s^2] of one span."""
FINEST_radps = math.radians(0.02)
"""Noise of a gyroscope in a mean over a second."""


@dataclass(frozen=True)
class AttitudeKnobs:
    """Trust in gravity."""

    tilt_time_s: float = knob(20.0, 0.5, 1000.0, "time constant with which tilt follows gravity, once settled [s]")
    bias_time_s: float = knob(80.0, 1.0, 10000.0, "time constant of the gyroscope bias across the vertical [s]")
    gravity_noise: float = knob(0.28, 0.001, 10.0, "accelerations of the vehicle as noise of gravity [m/s^2*sqrt(s)]")
    gravity_gate_mps2: float = knob(1.0, 0.05, 10.0, "specific force this far from one g is no gravity [m/s^2]")
    offset_dps: float = knob(10.0, 0.1, 90.0, "largest plausible gyroscope offset: two standard deviations [deg/s]")


class AttitudeFilter:
    """Quaternion and gyroscope bias; angles in radians, body in SNAME axes."""

    def __init__(self, knobs: AttitudeKnobs) -> None:
        self._knobs = knobs
        # Noise densities for which the gains settle at k = 1 / tilt_time of e and l = 1 / (tilt_time * bias_time) of b:
        # with all rates of change zero, the Riccati equation says q_b = R l^2 and q_e = R (k^2 - 2 l).
        self._gravity = (knobs.gravity_noise / GRAVITY_mps2) ** 2
        slow = 1.0 / (knobs.tilt_time_s * knobs.bias_time_s)
        self._bias_walk = self._gravity * slow * slow
        self._gyro_noise = self._gravity * max(0.0, knobs.tilt_time_s**-2 - 2.0 * slow)
        self._p_tilt, self._p_cross, self._p_bias = math.pi**2, 0j, 0.0
        self.bias_radps: Vec3 = (0.0, 0.0, 0.0)
        self.gravity_off_rad = 0.0
        """Angle between gravity as measured and as estimated, smoothed: a vehicle in water accelerates shortly."""
        self.q: Quaternion = (1.0, 0.0, 0.0, 0.0)
        self.rotation: Matrix3 = IDENTITY

    def align(self, specific_force_mps2: Vec3, span_s: float, heading_rad: float = 0.0) -> None:
        """Start level with gravity as it was over a span.

        Parameters
        ----------
        specific_force_mps2 : (3,) [m/s^2]
            Mean over the span, in body axes.
        span_s : [s]
            Its length: the mean is as sure as that allows.
        heading_rad : [rad]
            From north.
        """
        fx, fy, fz = specific_force_mps2
        roll, pitch = math.atan2(-fy, -fz), math.atan2(fx, math.hypot(fy, fz))
        cr, sr, cp, sp = math.cos(roll / 2), math.sin(roll / 2), math.cos(pitch / 2), math.sin(pitch / 2)
        cy, sy = math.cos(heading_rad / 2), math.sin(heading_rad / 2)
        # Yaw after pitch after roll, as a product of quaternions: first (w, x, y, z) = pitch roll, then yaw before it.
        w, x, y, z = cr * cp, sr * cp, cr * sp, -sr * sp
        self._set((cy * w - sy * z, cy * x - sy * y, cy * y + sy * x, cy * z + sy * w))
        self._p_tilt, self._p_cross = self._gravity / span_s, 0j

    def set_bias(self, bias_radps: Vec3, sigma_radps: float) -> None:
        """Start with what is known of the gyroscope's offset."""
        self.bias_radps, self._p_cross, self._p_bias = bias_radps, 0j, sigma_radps * sigma_radps

    def turn(self, angle_rad: Vec3, dt_s: float) -> None:
        """Turn by what the gyroscope has seen; what is not known grows.

        Prediction of the Kalman filter: e becomes e exp(-i r dt) - b dt, and the covariance with it. The angle about
        the vertical, r dt, is the part of the turn along d.

        Parameters
        ----------
        angle_rad : (3,) [rad]
            Turn in body axes, the bias already taken off.
        dt_s : [s]
            Its duration.
        """
        x, y, z = angle_rad
        dx, dy, dz = self.rotation[2]
        self._rotate(x, y, z)
        about = cmath.rect(1.0, -(x * dx + y * dy + z * dz))
        turned, p_bias = about * self._p_cross, self._p_bias
        self._p_tilt += dt_s * (dt_s * p_bias - 2.0 * turned.real + self._gyro_noise)
        self._p_cross = turned - dt_s * p_bias
        self._p_bias = p_bias + dt_s * self._bias_walk

    def level(self, specific_force_mps2: Vec3, dt_s: float) -> None:
        """Lean towards the measured gravity, by as much as tilt and offset are less sure than gravity is.

        Correction of the Kalman filter, gravity being a mean over `dt_s` with variance R / dt. The innovation is the
        turn d x f / |f| that would bring the estimated vertical onto the measured one (for small angles; Mahony's
        omega_mes). The offset's gain is complex: its real part turns about the same axis, its imaginary part about the
        one a quarter ahead, d x e. The real part is negative: a tilt that lags behind means that too much offset was
        taken off.

        Parameters
        ----------
        specific_force_mps2 : (3,) [m/s^2]
            f, the mean over `dt_s`, in body axes.
        dt_s : [s]
            Its duration.
        """
        fx, fy, fz = specific_force_mps2
        norm = math.sqrt(fx * fx + fy * fy + fz * fz)
        if norm == 0.0:
            return
        dx, dy, dz = self.rotation[2]
        ex, ey, ez = (fz * dy - fy * dz) / norm, (fx * dz - fz * dx) / norm, (fy * dx - fx * dy) / norm
        off_rad = math.atan2(math.sqrt(ex * ex + ey * ey + ez * ez), -(fx * dx + fy * dy + fz * dz) / norm)
        self.gravity_off_rad += min(1.0, dt_s / SMOOTHED_S) * (off_rad - self.gravity_off_rad)
        if abs(norm - GRAVITY_mps2) > self._knobs.gravity_gate_mps2:
            return  # a blow or a hand: the angle above still counts, as the health check wants to see it
        variance = self._p_tilt + self._gravity / dt_s
        gain, follow = self._p_tilt / variance, self._p_cross.conjugate() / variance
        self._rotate(gain * ex, gain * ey, gain * ez)
        k, s = follow.real, follow.imag
        bx, by, bz = self.bias_radps
        self.bias_radps = (
            bx + k * ex + s * (dy * ez - dz * ey),
            by + k * ey + s * (dz * ex - dx * ez),
            bz + k * ez + s * (dx * ey - dy * ex),
        )
        self._p_bias -= abs(self._p_cross) ** 2 / variance
        self._p_cross *= 1.0 - gain
        self._p_tilt *= 1.0 - gain

    def steer(self, angle_rad: float, bias_radps: float) -> None:
        """Correct heading, and the bias about the vertical."""
        dx, dy, dz = self.rotation[2]
        self._rotate(angle_rad * dx, angle_rad * dy, angle_rad * dz)
        bx, by, bz = self.bias_radps
        self.bias_radps = (bx + bias_radps * dx, by + bias_radps * dy, bz + bias_radps * dz)

    @property
    def tilt_sigma_rad(self) -> float:
        """Standard deviation of the tilt about each level axis."""
        return math.sqrt(self._p_tilt)

    @property
    def bias_sigma_radps(self) -> float:
        """Standard deviation of the gyroscope's offset about each level axis."""
        return math.sqrt(self._p_bias)

    @property
    def heading_rad(self) -> float:
        """Heading, clockwise from north."""
        (r11, _, _), (r21, _, _), _ = self.rotation
        return math.atan2(r21, r11)

    @property
    def ahead(self) -> complex:
        """Direction ahead over ground, north + i east, of length one; 0 where it points straight up or down."""
        ahead = complex(self.rotation[0][0], self.rotation[1][0])
        return ahead / abs(ahead) if ahead else 0j

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
        # One step of Newton's method for 1 / sqrt of a square that is nearly one: no drift, and no root.
        unit = 1.5 - 0.5 * (w * w + i * i + j * j + k * k)
        self._set((w * unit, i * unit, j * unit, k * unit))

    def _set(self, q: Quaternion) -> None:
        """Keep a quaternion of length one, w x y z, and its rotation (3, 3) from body to north-east-down."""
        self.q = q
        w, x, y, z = q
        self.rotation = (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )


@dataclass(frozen=True, slots=True)
class Offset:
    """An offset of the gyroscope and its standard deviation per axis [rad/s]."""

    rate_radps: Vec3
    sigma_radps: float

    def combined(self, other: "Offset") -> "Offset":
        """Fusion of two sources; one that contradicts this one adds nothing."""
        variance = self.sigma_radps**2
        off = tuple(b - a for a, b in zip(self.rate_radps, other.rate_radps, strict=True))
        total = variance + other.sigma_radps**2
        if max(map(abs, off)) > 3.0 * math.sqrt(total):
            return self
        # The mean weighted by 1 / variance; `share` is the weight of the other.
        share = variance / total
        x, y, z = (a + share * d for a, d in zip(self.rate_radps, off, strict=True))
        return Offset((x, y, z), math.sqrt(share) * other.sigma_radps)


def offset_at_rest(spans: Sequence[Span], span_s: float) -> Offset:
    """The offset of a gyroscope that spans at rest show.

    It is sure only as far as the rates are alike and gravity keeps its direction: the turn of gravity from the first
    span to the last, over the time between their middles, is a rate that the vehicle itself may have had.

    Parameters
    ----------
    spans
        Means of rates and specific forces, one after the other.
    span_s : [s]
        Length of each.

    Returns
    -------
    Offset
        (3,) [rad/s] with its standard deviation.
    """
    rates = [rate for rate, _ in spans]
    offset = mean(rates)
    scatter = math.sqrt(sum(math.dist(rate, offset) ** 2 for rate in rates) / len(rates))
    turned_rad = math.dist(spans[0][1], spans[-1][1]) / GRAVITY_mps2
    turning = turned_rad / ((len(rates) - 1) * span_s)
    return Offset(offset, math.hypot(scatter, turning, FINEST_radps))


def mean(vectors: Iterable[Vec3]) -> Vec3:
    """Mean of vectors, axis by axis."""
    rows = list(vectors)
    x, y, z = (sum(column) / len(rows) for column in zip(*rows, strict=True))
    return (x, y, z)
