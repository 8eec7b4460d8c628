"""Surge and sway velocity between and beyond the DVL's samples, by the accelerometer, and the uncertainty of the way.

Per axis two states: the velocity, and an acceleration offset that stands for accelerometer bias and for gravity let in
by an error of tilt. Both axes share one covariance, since they are measured by the same sensor at the same time. A late
sample is compared with the path at its own time: the rows keep the predicted increments, which later corrections do
not touch.

Symbols, per axis: u velocity, a offset, P their covariance: `_p` of u, `_p_offset` of a, `_p_cross` of both. Predicted,
u grows by a dt, so P becomes F P F' + Q with F = [1 dt; 0 1] and Q = diag(accelerometer_noise^2, offset_walk^2) dt. At
the start P is 1 m^2/s^2 and offset_mps2^2, whatever the velocity: the first sample is taken in any case. The offset is
kept in body axes: a bias turns with the body; what tilt lets in does not, and the random walk follows it. A sample of
the past, `delay` ago, is a measurement of u - du - delay a, where du is what the rows say the velocity has changed
since; its row is h = [1, -delay].
"""

import math
from collections import deque
from dataclasses import dataclass
from typing import TypeAlias

from hindrax_control.navigation.vertical_filter import FilterKnobs
from hindrax_core.knobs import knob
from hindrax_core.readings import Vec3

Row: TypeAlias = tuple[float, float, float, float, float, float, float, float]
"""Time [s]; sums of du and dv [m/s]; their integrals [m]; angle turned about x, y, z [rad]."""

LEAST_SPAN_S = 0.001
LEAN_S, LEAN_SAMPLES = 0.5, 8
"""Time and velocities, at least, over which the mean innovation is taken."""
MOST_SURPLUS = 80
"""Refused velocities that are remembered: ten seconds of good ones make up for a DVL that hung for an hour."""


@dataclass(frozen=True)
class HorizontalKnobs(FilterKnobs):
    """Noise of the horizontal model."""

    offset_mps2: float = knob(0.3, 0.0, 5.0, "uncertainty of the acceleration offset at the start [m/s^2]")
    offset_walk: float = knob(0.02, 0.0, 1.0, "random walk of that offset [m/s^2/sqrt(s)]")
    lean_sigmas: float = knob(
        2.0, 0.5, 100.0, "mean innovation of a DVL that shows no change, above which it hangs [-]"
    )
    hung_mps: float = knob(
        0.15, 0.02, 10.0, "change in 2 s that accelerometer and thrusters show and the DVL does not, if it hangs [m/s]"
    )
    memory_s: float = knob(1.0, 0.1, 10.0, "oldest DVL sample that can still be fused [s]")


@dataclass(frozen=True, slots=True)
class PredictedInterval:
    """Prediction over an interval of the past."""

    du_mps: float
    """Change of u between the mean over the interval and now."""
    dv_mps: float
    delay_s: float
    rate_radps: Vec3


class HorizontalFilter:
    """Velocity u, v of the body origin over ground [m/s] and the acceleration offsets [m/s^2]."""

    def __init__(self, knobs: HorizontalKnobs) -> None:
        self._knobs = knobs
        self._offset = (0.0, 0.0)
        self._p, self._p_cross, self._p_offset = 1.0, 0.0, knobs.offset_mps2**2
        self._lean_u = self._lean_v = 0.0
        self._fused_s = -math.inf
        self._refused = 0
        self.refused = 0
        """Recent surplus of refused over accepted velocities."""
        self._rows: deque[Row] = deque([(0.0,) * 8])
        self.u_mps = self.v_mps = 0.0
        self.known = False

    def predict(self, acceleration_mps2: tuple[float, float], angle_rad: Vec3, now_s: float, dt_s: float) -> None:
        """Advance by a mean acceleration.

        Parameters
        ----------
        acceleration_mps2 : (2,) [m/s^2]
            By which u and v change: specific force ahead and to starboard, gravity taken off, less omega x velocity
            since the axes turn.
        angle_rad : (3,) [rad]
            What the body turned meanwhile.
        now_s, dt_s : [s]
            Filter time after the step, and its length.
        """
        knobs = self._knobs
        offset_u, offset_v = self._offset
        du, dv = dt_s * (acceleration_mps2[0] + offset_u), dt_s * (acceleration_mps2[1] + offset_v)
        self.u_mps += du
        self.v_mps += dv
        # P = F P F' + Q written out: once, for both axes share it.
        self._p += dt_s * (2.0 * self._p_cross + dt_s * self._p_offset + knobs.accelerometer_noise**2)
        self._p_cross += dt_s * self._p_offset
        self._p_offset += dt_s * knobs.offset_walk**2
        _, sum_u, sum_v, int_u, int_v, ax, ay, az = self._rows[-1]
        # Sums since the start, not increments: a span between any two rows is then one subtraction.
        new_u, new_v = sum_u + du, sum_v + dv
        int_u, int_v = int_u + 0.5 * dt_s * (sum_u + new_u), int_v + 0.5 * dt_s * (sum_v + new_v)
        ax, ay, az = ax + angle_rad[0], ay + angle_rad[1], az + angle_rad[2]
        self._rows.append((now_s, new_u, new_v, int_u, int_v, ax, ay, az))
        while self._rows[0][0] < now_s - knobs.memory_s:
            self._rows.popleft()

    def way(self, from_s: float, to_s: float) -> PredictedInterval | None:
        """Motion between two times.

        A mean of the velocity over the span is the difference of the rows' integrals, over the span; the offset was in
        all increments, so it counts for the time from the middle of the span until now.

        Parameters
        ----------
        from_s, to_s : [s]
            In filter time.

        Returns
        -------
        PredictedInterval | None
            None when they are forgotten or in the future.
        """
        oldest, now = self._rows[0], self._rows[-1]
        # A sample may be valid a moment after the last inertial one; what lies between is too short to matter.
        to_s = min(to_s, now[0])
        if from_s < oldest[0] or to_s - from_s < LEAST_SPAN_S:
            return None
        begin, end = self._at(from_s), self._at(to_s)
        span = end[0] - begin[0]
        return PredictedInterval(
            du_mps=now[1] - (end[3] - begin[3]) / span,
            dv_mps=now[2] - (end[4] - begin[4]) / span,
            delay_s=now[0] - 0.5 * (begin[0] + end[0]),
            rate_radps=((end[5] - begin[5]) / span, (end[6] - begin[6]) / span, (end[7] - begin[7]) / span),
        )

    def _at(self, time_s: float) -> Row:
        """Row at a time between two rows, searched from the newest."""
        later = self._rows[-1]
        for row in reversed(self._rows):
            if row[0] <= time_s:
                break
            later = row
        share = (time_s - row[0]) / (later[0] - row[0]) if later[0] > row[0] else 0.0
        a, b, c, d, e, f, g, h = (low + share * (high - low) for low, high in zip(row, later, strict=True))
        return (a, b, c, d, e, f, g, h)

    def fuse(
        self,
        u_mps: float,
        v_mps: float,
        sigma_mps: float,
        way: PredictedInterval,
        *,
        repeated: bool = False,
        still: bool = False,
        hangs: bool = False,
    ) -> bool:
        """Fuse a velocity of the body origin that was the mean over a way.

        Correction of the Kalman filter with h = [1, -delay]: `at_u` and `at_offset` are P h', `variance` is h P h' + R.
        Both axes have one P, so both are refused if one is off. Many refusals in a row mean that the filter is wrong,
        unless the value is `repeated`: then P grows by what they were off by, and the next one is taken.

        A sensor that hangs with live noise stays within that gate: each velocity is a little off, to the same side, and
        the offset learns the difference. So the mean innovation counts as well, where the sensor is `still`.

        Parameters
        ----------
        u_mps, v_mps : [m/s]
            Surge and sway.
        sigma_mps : [m/s]
            Standard deviation of each.
        way
            What the filter predicts of the interval.
        repeated
            Whether the sensor has repeated its last value.
        still
            Whether it shows far less change of velocity than the accelerometer.
        hangs
            Whether accelerometer and thrusters contradict it together.

        Returns
        -------
        bool
            False when it is refused.
        """
        delay = way.delay_s
        p, cross, offset = self._p, self._p_cross, self._p_offset
        # The sample is older than the state by `delay`, in which the offset has acted: so it says something of both.
        at_u, at_offset = p - delay * cross, cross - delay * offset
        variance = at_u - delay * at_offset + sigma_mps * sigma_mps
        off_u, off_v = u_mps - (self.u_mps - way.du_mps), v_mps - (self.v_mps - way.dv_mps)
        leans = self._leans(off_u / math.sqrt(variance), off_v / math.sqrt(variance))
        # The first velocity is taken as it is: nothing is known that it could contradict.
        beyond = max(off_u * off_u, off_v * off_v) > self._knobs.gate**2 * variance
        if self.known and (beyond or hangs or (still and leans)):
            return self._refuse(off_u, off_v, repeated=repeated)
        self.known = True
        self._refused, self.refused = 0, max(0, self.refused - 1)
        k, k_offset = at_u / variance, at_offset / variance
        self.u_mps += k * off_u
        self.v_mps += k * off_v
        self._offset = (self._offset[0] + k_offset * off_u, self._offset[1] + k_offset * off_v)
        self._p, self._p_cross, self._p_offset = p - k * at_u, cross - k * at_offset, offset - k_offset * at_offset
        return True

    def _leans(self, sigmas_u: float, sigmas_v: float) -> bool:
        """Whether the innovations, in deviations, have one sign for so long that their mean stands out."""
        now_s, gate = self._rows[-1][0], self._knobs.gate
        share = min(-math.expm1((self._fused_s - now_s) / LEAN_S), 1.0 / LEAN_SAMPLES) if self.known else 0.0
        self._fused_s = now_s
        # One blow or outlier is the gate's; it counts for no more than that here.
        self._lean_u += share * (min(gate, max(-gate, sigmas_u)) - self._lean_u)
        self._lean_v += share * (min(gate, max(-gate, sigmas_v)) - self._lean_v)
        return max(abs(self._lean_u), abs(self._lean_v)) > self._knobs.lean_sigmas

    def _refuse(self, off_u: float, off_v: float, *, repeated: bool) -> bool:
        self.refused = min(MOST_SURPLUS, self.refused + 1)
        # A sensor that hangs repeats one value: any number of equal ones must not outvote the filter.
        self._refused += not repeated
        if self._refused >= self._knobs.patience:
            self._refused, self._lean_u, self._lean_v = 0, 0.0, 0.0
            # Not the state jumps, its certainty ends: the next velocity then counts nearly alone.
            self._p += max(off_u * off_u, off_v * off_v)
        return False

    @property
    def sigma_mps(self) -> float:
        """Standard deviation of each velocity."""
        return math.sqrt(max(0.0, self._p))


@dataclass(frozen=True)
class PositionKnobs:
    """Prior of the errors of the DVL."""

    dvl_bias_mps: float = knob(0.003, 0.0, 1.0, "standard deviation of a constant bias of the DVL, each axis [m/s]")
    dvl_share: float = knob(0.027, 0.0, 1.0, "error by scale, mount and heading, as a fraction of the distance [-]")


class PositionUncertainty:
    """Uncertainty of dead reckoning: standard deviation of north and of east since the position was last known.

    A bias b of the DVL is constant in body axes, so it adds the integral of R(heading) b: a vehicle that turns around
    takes it back. A wrong speed of sound and a wrong angle of mount or heading scale and turn the whole way, so their
    error is a share of the distance from where the position was known. Noise of the single velocities is a random walk.
    A velocity that is not measured errs the same way all the time.

        sigma^2 = bias^2 |integral of R(heading) dt|^2 + share^2 distance^2 + sum of (sigma_v interval)^2 + unmeasured^2

    ADR 37 says where the priors of bias and share come from.
    """

    def __init__(self, knobs: PositionKnobs) -> None:
        self._knobs = knobs
        self.known()

    def known(self) -> None:
        """Restart: the position is known now."""
        self._ahead_s = self._aside_s = self._north_m = self._east_m = 0.0
        self._noise_m2 = self._unmeasured_m = 0.0

    def move(self, heading_rad: float, north_m: float, east_m: float, dt_s: float) -> None:
        """Count a step of dead reckoning.

        Parameters
        ----------
        heading_rad : [rad]
            Meanwhile.
        north_m, east_m : [m]
            Way of the step.
        dt_s : [s]
            Its length.
        """
        self._ahead_s += dt_s * math.cos(heading_rad)
        self._aside_s += dt_s * math.sin(heading_rad)
        self._north_m += north_m
        self._east_m += east_m

    def measured(self, sigma_mps: float, interval_s: float) -> None:
        """Count the noise of one velocity, the mean over an interval."""
        self._noise_m2 += (sigma_mps * interval_s) ** 2

    def unmeasured(self, sigma_mps: float, dt_s: float) -> None:
        """Count a time in which the velocity was only predicted, or not known at all."""
        self._unmeasured_m += sigma_mps * dt_s

    @property
    def sigma_m(self) -> float:
        """Standard deviation of each coordinate [m]."""
        bias_m = self._knobs.dvl_bias_mps * math.hypot(self._ahead_s, self._aside_s)
        share_m = self._knobs.dvl_share * math.hypot(self._north_m, self._east_m)
        return math.hypot(bias_m, share_m, math.sqrt(self._noise_m2), self._unmeasured_m)
