"""Heading from a compass that learns what the thrusters do to it.

The current of every thruster makes a field of its own in the vehicle (COB-2023-1394 names it as the trouble of its yaw
tests). A thruster that starts changes the field at once, the heading not: so the two can be separated in flight. An
extended Kalman filter holds the error of heading, the gyroscope's bias about the vertical, the strength of the earth's
field, a field fixed in the vehicle, and for each thruster the field of its current, which follows its power:

    x:  H cos(heading) + h_x + sum k_x |F|^1.5        y: -H sin(heading) + h_y + sum k_y |F|^1.5

All fields are in units of the first one measured. While the vehicle leans, the axes are those of the leveled body, and
what is fixed in the vehicle is right to the cosine of its tilt. The power 1.5 is that of momentum theory: thrust goes
with the square of the speed of the propeller, power with its cube, and at one voltage the current with the power.

State, by the indices below: heading, bias, H (`STRENGTH`), h_x, h_y, then k_x and k_y of the n thrusters. `_P`: its
covariance (5 + 2n, 5 + 2n). `_fields`: its estimate, of which only the fields are read: heading and bias are kept by
the caller, who adds the corrections. `_H`: derivative of the measurement (x, y), (2, 5 + 2n); the columns of heading
and H follow the heading, the rest holds ones and powers.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hindrax_core.knobs import knob

HEADING, BIAS, STRENGTH, FIXED_X, FIXED_Y, FIRST = range(6)
UNKNOWN_rad = 0.5
"""Standard deviation before the first measurement, which is taken as it is."""
OUTLIER = 5.0

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class HeadingKnobs:
    """Trust in gyroscope and compass."""

    gyro_noise_dps: float = knob(0.03, 1e-4, 10.0, "heading random walk of the gyroscope [deg/sqrt(s)]")
    gyro_walk_dps: float = knob(0.0005, 0.0, 1.0, "random walk of the gyroscope bias [deg/s/sqrt(s)]")
    gyro_bias_dps: float = knob(0.1, 0.001, 20.0, "uncertainty of the bias after alignment [deg/s]")
    compass_sigma_deg: float = knob(2.0, 0.1, 180.0, "noise of a compass heading, thrusters at rest [deg]")
    compass_fixed_deg: float = knob(3.0, 0.0, 90.0, "effect of the vehicle's own field on the heading [deg]")
    compass_walk_deg: float = knob(0.1, 0.0, 10.0, "drift of that effect, and of the local field [deg/sqrt(s)]")
    motor_sigma_deg: float = knob(0.3, 0.0, 100.0, "effect of a thruster, before it is learned [deg/N^1.5]")
    motor_rest_deg: float = knob(0.01, 0.0, 10.0, "effect of a thruster that stays unexplained [deg/N^1.5]")
    compass_patience: int = knob(250, 1, 100_000, "outliers in a row after which the field has really changed [-]")


class HeadingFilter:
    """Says by how much heading and bias must be corrected; the caller keeps both.

    `thrusters` is how many forces `magnetic` is given.
    """

    def __init__(self, knobs: HeadingKnobs, thrusters: int) -> None:
        self._knobs = knobs
        size = FIRST + 2 * thrusters
        fixed, motor = math.radians(knobs.compass_fixed_deg), math.radians(knobs.motor_sigma_deg)
        sigmas = [UNKNOWN_rad, math.radians(knobs.gyro_bias_dps), UNKNOWN_rad, fixed, fixed] + [motor] * (2 * thrusters)
        self._P = np.diag(np.square(sigmas))
        self._fields = np.zeros(size)
        self._fields[STRENGTH] = 1.0
        self._thrusters = thrusters
        self._unit = 0.0
        self._outliers = 0
        self.known = False
        self._forces_N: Sequence[float] = ()
        self._powers = [0.0] * thrusters
        self._power = 0.0
        self._H = np.zeros((2, size))
        self._H[0, FIXED_X] = self._H[1, FIXED_Y] = 1.0
        self._passed_s = 0.0

    def widen_bias(self, sigma_radps: float) -> None:
        """Widen the prior of the gyroscope bias: alignment could not separate offset and motion."""
        self._P[BIAS, BIAS] = max(float(self._P[BIAS, BIAS]), sigma_radps * sigma_radps)

    def predict(self, dt_s: float) -> None:
        """Let time pass; the caller turns the heading by the gyroscope."""
        self._passed_s += dt_s

    def _catch_up(self) -> None:
        """Let uncertainty grow by the time that has passed since the last measurement: once for many predictions.

        F P F' + Q, where F is the unit matrix but for -dt from bias to heading: a bias that is too large turns back.
        """
        dt_s, self._passed_s = self._passed_s, 0.0
        P, knobs = self._P, self._knobs
        P[HEADING] -= dt_s * P[BIAS]
        P[:, HEADING] -= dt_s * P[:, BIAS]
        P[HEADING, HEADING] += dt_s * math.radians(knobs.gyro_noise_dps) ** 2
        P[BIAS, BIAS] += dt_s * math.radians(knobs.gyro_walk_dps) ** 2
        walk = dt_s * math.radians(knobs.compass_walk_deg) ** 2
        P[FIXED_X, FIXED_X] += walk
        P[FIXED_Y, FIXED_Y] += walk

    def heading(self, off_rad: float, sigma_deg: float) -> tuple[float, float]:
        """Fuse a heading.

        The row of the measurement has a single one, at the heading, so H P is that row of P. The fields learn too, by
        what their errors have in common with the heading's.

        Parameters
        ----------
        off_rad : [rad]
            Measured less the caller's.
        sigma_deg : [deg]
            Standard deviation of the measurement.

        Returns
        -------
        tuple[float, float]
            Corrections of heading [rad] and of the bias of the rate [rad/s].
        """
        self._catch_up()
        if not self.known:
            self.known = True
            self._P[HEADING, HEADING] = math.radians(sigma_deg) ** 2
            return off_rad, 0.0
        gain = self._P[HEADING] / (self._P[HEADING, HEADING] + math.radians(sigma_deg) ** 2)
        self._P -= np.outer(gain, self._P[HEADING])
        self._fields += gain * off_rad
        return float(gain[HEADING]) * off_rad, float(gain[BIAS]) * off_rad

    def magnetic(self, x: float, y: float, heading_rad: float, forces_N: Sequence[float]) -> tuple[float, float] | None:
        """Fuse a field in leveled body axes.

        Parameters
        ----------
        x, y : [T]
            Ahead and to starboard.
        heading_rad : [rad]
            The caller's.
        forces_N : (thrusters,) [N]
            Of the thrusters, whose currents have fields.

        Returns
        -------
        tuple[float, float] | None
            Corrections of heading [rad] and bias [rad/s]; None for an outlier.
        """
        self._catch_up()
        turn = 0.0
        if not self._unit:
            self._unit = math.hypot(x, y)
        if not self.known:
            self.known = True
            turn = math.remainder(math.atan2(-y, x) - heading_rad, math.tau)
        found = self._fuse(x / self._unit, y / self._unit, heading_rad + turn, forces_N)
        return None if found is None else (turn + found[0], found[1])

    def _fuse(self, x: float, y: float, heading_rad: float, forces_N: Sequence[float]) -> tuple[float, float] | None:
        """Correction of the extended Kalman filter by a field in units of the first; None for an outlier.

        `off` is the innovation: the state is linear in the fields, so the columns from `STRENGTH` on times the estimate
        are the expected field. Its covariance is 2 by 2, and inverted by hand. A thruster's learned effect is never
        quite right: what stays of it is noise in proportion to the powers.
        """
        cos, sin, H, knobs = math.cos(heading_rad), math.sin(heading_rad), self._H, self._knobs
        change = self._set_powers(forces_N)
        strength = float(self._fields[STRENGTH])
        H[0, HEADING], H[1, HEADING] = -strength * sin, -strength * cos
        H[0, STRENGTH], H[1, STRENGTH] = cos, -sin
        off = np.array([x, y]) - H[:, STRENGTH:] @ self._fields[STRENGTH:]
        # While a force changes, thrust reported and field measured do not belong to the same instant.
        rest_deg = knobs.motor_rest_deg * self._power + knobs.motor_sigma_deg * change
        variance = math.radians(knobs.compass_sigma_deg) ** 2 + math.radians(rest_deg) ** 2
        HP = H @ self._P
        (a, b), (_, c) = (HP @ H.T).tolist()
        a, c = a + variance, c + variance
        inverse = np.array([[c, -b], [-b, a]]) / (a * c - b * b)
        gain = HP.T @ inverse
        if not float(off @ inverse @ off) <= OUTLIER**2:  # so written, NaN is an outlier too
            self._refuse(off)
            return None
        self._outliers = 0
        correction = gain @ off
        self._fields += correction
        self._P -= gain @ HP
        return float(correction[HEADING]), float(correction[BIAS])

    def _set_powers(self, forces_N: Sequence[float]) -> float:
        """Put the powers of the thrusters into the model; returns by how much they have changed."""
        if forces_N is self._forces_N:
            return 0.0
        self._forces_N, n = forces_N, self._thrusters
        before, self._powers = self._powers, [math.pow(abs(force), 1.5) for force in forces_N]
        if len(self._powers) != n:
            self._powers = [0.0] * n
        self._H[0, FIRST : FIRST + n] = self._H[1, FIRST + n :] = self._powers
        self._power = sum(self._powers)
        return sum(abs(now - then) for now, then in zip(self._powers, before, strict=True))

    def _refuse(self, off: Vector) -> None:
        """Drop an outlier; after many in a row the field of the place or the vehicle has changed, not the heading.

        Then the fixed field is made as unknown as the outlier is large: the next measurement moves it, and the heading
        hardly, which the gyroscope has carried over the change.
        """
        self._outliers += 1
        if self._outliers >= self._knobs.compass_patience:
            self._outliers = 0
            self._P[FIXED_X, FIXED_X] += off[0] ** 2
            self._P[FIXED_Y, FIXED_Y] += off[1] ** 2

    @property
    def bias_sigma_radps(self) -> float:
        """Standard deviation of the gyroscope's offset about the vertical."""
        return math.sqrt(max(0.0, float(self._P[BIAS, BIAS])))
