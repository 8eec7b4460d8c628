"""The vertical filter that is written out gives what filterpy's Kalman filter gives over the same measurements."""

import copy

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from hindrax_control.navigation.vertical_filter import Matrix, VerticalFilter, VerticalKnobs

KNOBS = VerticalKnobs(gate=1000.0)
DEPTH_DELAY_S, ALTITUDE_DELAY_S = 0.02, 0.05
DEPTH_SIGMA_m, ALTITUDE_SIGMA_m = 0.004, 0.03


def depth_row(delay_s: float) -> Matrix:
    """First row of the transition by a negative time: the depth of then, but for the measured acceleration."""
    return np.array([[1.0, -delay_s, 0.5 * delay_s**2, 0.0]])


def altitude_row(delay_s: float) -> Matrix:
    return np.array([[0.0, 0.0, 0.0, 1.0]]) - depth_row(delay_s)


DEPTH_ROW, ALTITUDE_ROW = depth_row(DEPTH_DELAY_S), altitude_row(ALTITUDE_DELAY_S)


class Reference:
    """Depth, rate, bias of the accelerometer, depth of the floor, by filterpy."""

    def __init__(self) -> None:
        self.kalman = KalmanFilter(dim_x=4, dim_z=1, dim_u=1)
        self.kalman.P = np.diag([1e4, 0.25, KNOBS.heave_bias_mps2**2, 1e4])
        self.kalman.x = np.zeros((4, 1))
        self.bend = 0.0

    def predict(self, acceleration: float, dt: float) -> None:
        self.bend = 0.5 * acceleration
        noise = KNOBS.accelerometer_noise**2
        Q = np.diag([noise * dt**3 / 3, noise * dt, KNOBS.heave_bias_walk**2 * dt, KNOBS.floor_walk**2 * dt])
        Q[0, 1] = Q[1, 0] = noise * dt * dt / 2
        F = np.eye(4)
        F[0, 1] = F[1, 2] = dt
        F[0, 2] = dt * dt / 2
        self.kalman.predict(np.array([[acceleration]]), np.array([[dt * dt / 2], [dt], [0.0], [0.0]]), F, Q)

    def expected_depth(self) -> float:
        return float((DEPTH_ROW @ self.kalman.x).item()) + self.bend * DEPTH_DELAY_S**2

    def expected_altitude(self) -> float:
        return float((ALTITUDE_ROW @ self.kalman.x).item()) - self.bend * ALTITUDE_DELAY_S**2

    def depth(self, measured: float) -> None:
        self.kalman.update(measured - self.bend * DEPTH_DELAY_S**2, DEPTH_SIGMA_m**2, DEPTH_ROW)

    def altitude(self, measured: float) -> None:
        self.kalman.update(measured + self.bend * ALTITUDE_DELAY_S**2, ALTITUDE_SIGMA_m**2, ALTITUDE_ROW)


def test_it_agrees_with_filterpy_over_a_dive() -> None:
    ours, theirs, rng = VerticalFilter(KNOBS), Reference(), np.random.default_rng(3)
    ours.depth(0.5, DEPTH_SIGMA_m, DEPTH_DELAY_S)
    theirs.kalman.x[0] = 0.5
    # Before the first tick the accelerometer has said nothing, and the path back is straight.
    theirs.kalman.update(0.5, DEPTH_SIGMA_m**2, np.array([[1.0, -DEPTH_DELAY_S, 0.0, 0.0]]))
    for tick in range(2000):
        acceleration = 0.3 * np.sin(0.02 * tick) + 0.05 * rng.standard_normal()
        dt = 0.005 if tick % 7 else 0.01
        ours.predict(acceleration, dt)
        theirs.predict(acceleration, dt)
        if tick % 4 == 0:
            depth = 0.5 + 0.1 * np.sin(0.01 * tick) + DEPTH_SIGMA_m * rng.standard_normal()
            assert ours.depth(depth, DEPTH_SIGMA_m, DEPTH_DELAY_S)
            theirs.depth(depth)
        if tick % 20 == 10:
            altitude = 1.3 - 0.1 * np.sin(0.01 * tick) + ALTITUDE_SIGMA_m * rng.standard_normal()
            if not ours.has_floor:
                theirs.kalman.x[3] = altitude + theirs.kalman.x[0]
            assert ours.altitude(altitude, ALTITUDE_SIGMA_m, ALTITUDE_DELAY_S)
            theirs.altitude(altitude)
    x, P = theirs.kalman.x[:, 0], theirs.kalman.P
    assert ours.depth_m == pytest.approx(x[0], abs=1e-9)
    assert ours.rate_mps == pytest.approx(x[1], abs=1e-9)
    assert ours.altitude_m == pytest.approx(x[3] - x[0], abs=1e-9)
    assert ours.rate_variance == pytest.approx(P[1, 1], rel=1e-9)


@pytest.mark.parametrize("bias_mps2", [-0.25, 0.25])
@pytest.mark.parametrize("first", ["altitude", "depth"])
def test_readings_that_waited_for_a_busy_start_are_all_taken(first: str, bias_mps2: float) -> None:
    """At rest, with an accelerometer that is off: the estimate rose to 8 m/s, against pressure, sonar and DVL."""
    ours, rng = VerticalFilter(VerticalKnobs()), np.random.default_rng(5)
    truth_m, sigma_m = {"depth": 0.2, "altitude": 1.6}, {"depth": 0.003, "altitude": 0.012}

    def take(source: str, delay_s: float) -> bool:
        noise_m = sigma_m[source] * rng.standard_normal()
        return bool(getattr(ours, source)(truth_m[source] + noise_m, sigma_m[source], delay_s))

    sources = (first, *(truth_m.keys() - {first}))
    ours.predict(bias_mps2, 0.04)
    taken = [take(source, delay_s) for source in sources for delay_s in (1.0, 0.7, 0.4, 0.2, 0.05)]
    for tick in range(100):
        ours.predict(bias_mps2, 0.04)
        taken += [take(source, 1.0 if tick in (3, 7) else 0.05) for source in sources]
        assert abs(ours.rate_mps) < 0.1
    assert all(taken)


@pytest.mark.parametrize(("jump_m", "counted"), [(0.1, 10), (0.2, 30)])
def test_a_depth_that_jumps_is_not_assumed_again_so_soon(jump_m: float, counted: int) -> None:
    ours = VerticalFilter(VerticalKnobs())
    for number in range(210):
        ours.predict(0.0, 0.02)
        ours.depth(0.5 + (jump_m if number >= 200 else 0.0), 0.003, 0.0)
    assert ours.refused_depths == counted
    assert ours.depth(0.5 + jump_m, 0.003, 0.0)
    assert ours.refused_depths == counted - 1


def test_a_pressure_that_jumped_about_for_long_is_assumed_again_within_seconds() -> None:
    """A surplus that grew by three with every refusal kept a vehicle from arming for minutes after a bad one."""
    ours = VerticalFilter(VerticalKnobs())
    for number in range(1500):
        ours.predict(0.0, 0.05)
        wild = number < 1200 and number // 20 % 2
        ours.depth(1.5 if wild else 0.5, 0.003, 0.0)
        assert number != 1199 or ours.refused_depths >= 100
    assert ours.refused_depths == 0


def dived(knobs: VerticalKnobs) -> tuple[VerticalFilter, Reference]:
    """Both filters after two seconds of a dive from rest, with measurements that are exactly as expected."""
    ours, theirs = VerticalFilter(knobs), Reference()
    theirs.kalman.x[0], theirs.kalman.x[3] = 0.5, 1.5
    for tick in range(400):
        ours.predict(0.2, 0.005)
        theirs.predict(0.2, 0.005)
        if tick % 4 == 0:
            depth = theirs.expected_depth()
            assert ours.depth(depth, DEPTH_SIGMA_m, DEPTH_DELAY_S)
            theirs.depth(depth)
        if tick % 20 == 10:
            altitude = theirs.expected_altitude()
            assert ours.altitude(altitude, ALTITUDE_SIGMA_m, ALTITUDE_DELAY_S)
            theirs.altitude(altitude)
    return ours, theirs


@pytest.mark.parametrize("delay_s", [0.05, 1.5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_gate_stands_where_the_variance_of_the_innovation_puts_it(sign: float, delay_s: float) -> None:
    knobs = VerticalKnobs(gate=3.0)
    ours, theirs = dived(knobs)
    x, P, sigma_m = theirs.kalman.x, theirs.kalman.P, 1e-4
    bent_m = theirs.bend * delay_s**2
    depth, altitude = depth_row(delay_s), altitude_row(delay_s)
    for name, expected_m, H in (
        ("depth", float((depth @ x).item()) + bent_m, depth),
        ("altitude", float((altitude @ x).item()) - bent_m, altitude),
    ):
        edge_m = sign * knobs.gate * float(np.sqrt(H @ P @ H.T + sigma_m**2).item())
        for share, used in ((0.999, True), (1.001, False)):
            assert getattr(copy.deepcopy(ours), name)(expected_m + share * edge_m, sigma_m, delay_s) is used


@pytest.mark.parametrize("source", ["depth", "altitude"])
def test_each_time_that_it_lets_go_takes_its_whole_patience(source: str) -> None:
    ours, theirs = dived(VerticalKnobs(patience=4, gate=1.0))
    expected_m = theirs.expected_depth() if source == "depth" else theirs.expected_altitude()
    taken = [getattr(ours, source)(expected_m + off_m, 0.003, 0.02) for off_m in [3.0] * 4 + [90.0] * 5]
    assert taken == [False] * 8 + [True]


def test_it_keeps_no_more_than_a_thousand_lengths_of_ticks() -> None:
    ours = VerticalFilter(VerticalKnobs())
    for number in range(2100):
        ours.predict(0.0, 0.01 + 1e-5 * number)
        assert ours._model_of.cache_info().currsize == min(number + 1, 1000)


def test_before_the_first_depth_and_echo_nothing_is_known() -> None:
    ours = VerticalFilter(VerticalKnobs())
    assert ours.refused_depths == 0
    ours.predict(0.0, 0.02)
    assert np.isnan([ours.depth_m, ours.altitude_m]).all()
    ours.altitude(1.2, 0.03, 0.0)
    assert np.isnan(ours.depth_m)
    assert ours.altitude_m == pytest.approx(1.2, abs=1e-3)
    ours.depth(0.7, 0.003, 0.0)
    assert ours.depth_m == pytest.approx(0.7, abs=1e-3)


@pytest.mark.parametrize("off_m", [0.1, 20.0])
@pytest.mark.parametrize("source", ["depth", "altitude"])
def test_after_its_patience_it_lets_go_of_the_state_that_is_contradicted_and_of_no_other(
    source: str, off_m: float
) -> None:
    knobs = VerticalKnobs(patience=7)
    ours, theirs = dived(knobs)
    before_m = {"depth": ours.depth_m, "altitude": ours.altitude_m}
    expected_m = theirs.expected_depth() if source == "depth" else theirs.expected_altitude()
    taken = [getattr(ours, source)(expected_m + off_m, 0.003, DEPTH_DELAY_S) for _ in range(8)]
    assert taken == [False] * 7 + [True]
    after_m = {"depth": ours.depth_m, "altitude": ours.altitude_m}
    assert after_m[source] - before_m[source] == pytest.approx(off_m, abs=0.02)
    if source == "altitude":
        assert after_m["depth"] == pytest.approx(before_m["depth"], abs=0.002)
