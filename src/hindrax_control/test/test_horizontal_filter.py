"""The horizontal filter against a Kalman filter in matrices, and its memory of the path against closed forms."""

import copy
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from hindrax_control.navigation.horizontal_filter import HorizontalFilter, HorizontalKnobs, PredictedInterval
from hindrax_core.readings import Vec3

DT_S = 0.02
STILL: Vec3 = (0.0, 0.0, 0.0)
NOW = PredictedInterval(0.0, 0.0, 0.0, STILL)
"""An interval that ends now and has no length."""


def rested(seconds: float, knobs: HorizontalKnobs) -> HorizontalFilter:
    """A filter that was told of rest for some time, ten times a second."""
    ours = HorizontalFilter(knobs)
    for tick in range(1, round(seconds / DT_S) + 1):
        ours.predict((0.0, 0.0), STILL, tick * DT_S, DT_S)
        if tick % 5 == 0:
            assert ours.fuse(0.0, 0.0, 0.01, NOW)
    return ours


@pytest.mark.parametrize(("from_s", "to_s"), [(1.0, 1.1), (1.213, 1.287), (1.9, 2.0), (1.95, 2.04), (1.51, 1.515)])
def test_what_happened_in_an_interval_is_reported_whole(from_s: float, to_s: float) -> None:
    # A growing acceleration: the velocity is a parabola, its mean known in closed form.
    ours, jerk = HorizontalFilter(HorizontalKnobs()), (0.4, -0.7)
    for tick in range(1, 101):
        middle_s = (tick - 0.5) * DT_S
        angle: Vec3 = (0.1 * DT_S, -0.2 * DT_S, 0.3 * DT_S)
        ours.predict((jerk[0] * middle_s, jerk[1] * middle_s), angle, tick * DT_S, DT_S)
    way, end_s = ours.way(from_s, to_s), min(to_s, 2.0)
    assert way is not None
    mean_of_squares = (end_s**3 - from_s**3) / (3.0 * (end_s - from_s))
    assert way.du_mps == pytest.approx(0.5 * jerk[0] * (4.0 - mean_of_squares), abs=4e-3)
    assert way.dv_mps == pytest.approx(0.5 * jerk[1] * (4.0 - mean_of_squares), abs=4e-3)
    assert way.delay_s == pytest.approx(2.0 - 0.5 * (from_s + end_s))
    assert way.rate_radps == pytest.approx((0.1, -0.2, 0.3))


def test_a_turn_is_reported_as_it_was_in_the_interval() -> None:
    ours = HorizontalFilter(HorizontalKnobs())
    for tick in range(1, 41):
        ours.predict((0.0, 0.0), (0.0, 0.0, 0.5 * DT_S if tick > 20 else 0.0), tick * DT_S, DT_S)
    before, after, over = ours.way(0.1, 0.4), ours.way(0.4, 0.8), ours.way(0.38, 0.42)
    assert before is not None
    assert after is not None
    assert over is not None
    assert [way.rate_radps[2] for way in (before, after, over)] == pytest.approx([0.0, 0.5, 0.25], abs=1e-9)


def test_intervals_that_are_forgotten_to_come_or_empty_are_not_given() -> None:
    ours = rested(5.0, HorizontalKnobs(memory_s=1.0))
    assert ours.way(4.1, 4.2) is not None
    assert ours.way(3.9, 4.2) is None
    assert ours.way(5.1, 5.2) is None
    assert ours.way(4.5, 4.5) is None
    assert ours.way(4.5, 4.4) is None


class Reference:
    """Velocity and offset of one axis."""

    def __init__(self, knobs: HorizontalKnobs) -> None:
        self.knobs = knobs
        self.x: NDArray[np.float64] = np.zeros(2)
        self.P: NDArray[np.float64] = np.diag([1.0, knobs.offset_mps2**2])
        self.times, self.path = [0.0], [0.0]

    def predict(self, acceleration: float, now_s: float, dt: float) -> None:
        F = np.array([[1.0, dt], [0.0, 1.0]])
        gained = dt * (acceleration + float(self.x[1]))
        self.x = F @ self.x + np.array([acceleration * dt, 0.0])
        self.P = F @ self.P @ F.T + dt * np.diag([self.knobs.accelerometer_noise**2, self.knobs.offset_walk**2])
        self.times.append(now_s)
        self.path.append(self.path[-1] + gained)

    def expected(self, from_s: float, to_s: float) -> float:
        """Mean velocity over an interval, by what was predicted since."""
        fine = np.linspace(from_s, to_s, 2001)
        was = np.interp(fine, self.times, self.path)
        return float(self.x[0] - self.path[-1] + np.trapezoid(was, fine) / (to_s - from_s))

    def row(self, from_s: float, to_s: float) -> NDArray[np.float64]:
        return np.array([1.0, -(self.times[-1] - 0.5 * (from_s + to_s))])

    def variance(self, sigma_mps: float, H: NDArray[np.float64]) -> float:
        return float(H @ self.P @ H) + sigma_mps**2

    def fuse(self, off: float, sigma_mps: float, H: NDArray[np.float64]) -> None:
        gain = self.P @ H / self.variance(sigma_mps, H)
        self.x = self.x + gain * off
        self.P = self.P - np.outer(gain, H @ self.P)


def ride(knobs: HorizontalKnobs, ticks: int) -> tuple[HorizontalFilter, tuple[Reference, Reference]]:
    """Both after a ride with a late, noisy DVL."""
    ours, theirs, rng = HorizontalFilter(knobs), (Reference(knobs), Reference(knobs)), np.random.default_rng(4)
    for tick in range(1, ticks + 1):
        dt = DT_S if tick % 3 else 0.03
        now_s = theirs[0].times[-1] + dt
        acceleration = (0.3 * math.sin(0.05 * tick) + 0.1, 0.2 * math.cos(0.03 * tick) - 0.05)
        ours.predict(acceleration, STILL, now_s, dt)
        for axis in (0, 1):
            theirs[axis].predict(acceleration[axis], now_s, dt)
        if tick % 6 == 0 and tick > 20:
            begin_s, end_s = theirs[0].times[-10], theirs[0].times[-5]
            way = ours.way(begin_s, end_s)
            assert way is not None
            measured = [one.expected(begin_s, end_s) + 0.02 * rng.standard_normal() for one in theirs]
            assert ours.fuse(measured[0], measured[1], 0.02, way)
            for one, value in zip(theirs, measured, strict=True):
                one.fuse(value - one.expected(begin_s, end_s), 0.02, one.row(begin_s, end_s))
    return ours, theirs


@pytest.mark.parametrize("ticks", [30, 600])
def test_it_agrees_with_a_kalman_filter_in_matrices_over_a_ride(ticks: int) -> None:
    ours, (surge, sway) = ride(HorizontalKnobs(gate=100.0), ticks)
    assert (ours.u_mps, ours.v_mps) == pytest.approx((surge.x[0], sway.x[0]), abs=1e-5)
    assert ours.sigma_mps == pytest.approx(math.sqrt(surge.P[0, 0]), rel=1e-6)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_gate_stands_where_the_variance_of_the_innovation_puts_it(axis: int, sign: float) -> None:
    ours, theirs = ride(HorizontalKnobs(gate=10.0), 300)
    begin_s, end_s = theirs[0].times[-20], theirs[0].times[-15]
    way = ours.way(begin_s, end_s)
    assert way is not None
    expected = [one.expected(begin_s, end_s) for one in theirs]
    edge = sign * 10.0 * math.sqrt(theirs[axis].variance(0.03, theirs[axis].row(begin_s, end_s)))
    for share, used in ((0.99, True), (1.01, False)):
        measured = expected.copy()
        measured[axis] += share * edge
        assert copy.deepcopy(ours).fuse(measured[0], measured[1], 0.03, way) is used


def test_the_first_velocity_is_taken_whatever_it_is() -> None:
    ours = HorizontalFilter(HorizontalKnobs())
    ours.predict((0.0, 0.0), STILL, DT_S, DT_S)
    assert not ours.known
    assert (ours.u_mps, ours.v_mps, ours.refused) == (0.0, 0.0, 0)
    assert ours.fuse(9.0, -8.0, 0.01, NOW)
    assert ours.known
    assert (ours.u_mps, ours.v_mps) == pytest.approx((9.0, -8.0), abs=0.01)
    assert ours.sigma_mps == pytest.approx(0.01, rel=0.01)


@pytest.mark.parametrize("off", [(2.0, 0.0), (0.0, -2.0)])
def test_after_its_patience_it_lets_go_of_its_velocity(off: tuple[float, float]) -> None:
    ours = rested(2.0, HorizontalKnobs(patience=5))
    taken = [ours.fuse(*off, 0.01, NOW) for _ in range(6)]
    assert taken == [False] * 5 + [True]
    assert (ours.u_mps, ours.v_mps) == pytest.approx(off, abs=0.05)
    assert ours.refused == 4, "five refused, one accepted"
    ours.fuse(*off, 0.01, NOW)
    assert ours.refused == 3
    for _ in range(10):
        ours.fuse(*off, 0.01, NOW)
    assert ours.refused == 0


def test_an_accepted_velocity_renews_its_patience() -> None:
    ours = rested(2.0, HorizontalKnobs(patience=3))
    for velocity_mps in (2.0, 2.0, 0.0, 2.0, 2.0, 0.0):
        assert ours.fuse(velocity_mps, 0.0, 0.01, NOW) is (velocity_mps == 0.0)


def test_each_time_that_it_lets_go_takes_its_whole_patience() -> None:
    ours = rested(2.0, HorizontalKnobs(patience=3, gate=1.0))
    assert [ours.fuse(off, 0.0, 0.01, NOW) for off in (2.0, 2.0, 2.0, 50.0, 50.0, 50.0, 50.0)] == [False] * 6 + [True]


def test_one_and_the_same_velocity_is_refused_for_ever() -> None:
    ours = rested(2.0, HorizontalKnobs(patience=3))
    assert not any(ours.fuse(2.0, 0.0, 0.01, NOW, repeated=True) for _ in range(20))
    assert ours.refused == 20


def test_a_dvl_that_hung_for_long_is_assumed_again_within_seconds() -> None:
    ours = rested(2.0, HorizontalKnobs())
    for _ in range(1000):
        ours.fuse(2.0, 0.0, 0.01, NOW, repeated=True)
    assert ours.refused >= 20
    assert all(ours.fuse(0.0, 0.0, 0.01, NOW) for _ in range(100))
    assert ours.refused == 0
