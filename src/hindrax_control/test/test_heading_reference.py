"""The compass filter against an extended Kalman filter in matrices, measurement by measurement."""

import copy
import math
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from hindrax_control.navigation.heading_filter import HeadingFilter, HeadingKnobs

KNOBS = HeadingKnobs(
    gyro_noise_dps=0.2,
    gyro_walk_dps=0.03,
    gyro_bias_dps=0.4,
    compass_sigma_deg=1.5,
    compass_walk_deg=0.3,
    motor_rest_deg=0.04,
    compass_patience=6,
)
THRUSTERS = 2
RESTS = (0.0, 0.0)
FIELD_T = 18e-6


class Reference:
    """States: error of heading, bias, strength, fixed x and y, field of each thruster along x, then along y."""

    def __init__(self) -> None:
        rad = math.radians
        motors = [rad(KNOBS.motor_sigma_deg)] * 4
        fixed = rad(KNOBS.compass_fixed_deg)
        self.P: NDArray[np.float64] = np.diag(np.square([0.5, rad(KNOBS.gyro_bias_dps), 0.5, fixed, fixed, *motors]))
        self.x: NDArray[np.float64] = np.array([0.0, 0.0, 1.0, *[0.0] * 6])
        self.powers: NDArray[np.float64] = np.zeros(THRUSTERS)

    def predict(self, dt: float) -> None:
        F = np.eye(9)
        F[0, 1] = -dt
        walk = KNOBS.compass_walk_deg
        noise = np.radians([KNOBS.gyro_noise_dps, KNOBS.gyro_walk_dps, 0.0, walk, walk, 0.0, 0.0, 0.0, 0.0])
        self.P = F @ self.P @ F.T + dt * np.diag(noise**2)

    def model(self, heading: float, powers: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What the field should be, and its derivatives, at a heading of the caller."""
        cos, sin, strength = math.cos(heading), math.sin(heading), self.x[2]
        field = [[cos, 1.0, 0.0, *powers, 0.0, 0.0], [-sin, 0.0, 1.0, 0.0, 0.0, *powers]]
        H = np.column_stack([[-strength * sin, -strength * cos], [0.0, 0.0], np.array(field)])
        return np.array(field) @ self.x[2:], H

    def innovation(
        self, heading: float, forces: Sequence[float]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        powers = np.abs(forces) ** 1.5
        unsure_deg = KNOBS.motor_rest_deg * np.sum(powers)
        unsure_deg += KNOBS.motor_sigma_deg * np.sum(np.abs(powers - self.powers))
        expected, H = self.model(heading, powers)
        variance = math.radians(KNOBS.compass_sigma_deg) ** 2 + math.radians(float(unsure_deg)) ** 2
        return expected, H, H @ self.P @ H.T + variance * np.eye(2)

    def magnetic(self, field: NDArray[np.float64], heading: float, forces: Sequence[float]) -> tuple[float, float]:
        expected, H, S = self.innovation(heading, forces)
        self.powers = np.abs(forces) ** 1.5
        gain = self.P @ H.T @ np.linalg.inv(S)
        correction = gain @ (field - expected)
        self.x = self.x + correction
        self.P = self.P - gain @ H @ self.P
        return correction[0], correction[1]


def reported(
    ours: HeadingFilter, field: NDArray[np.float64], heading: float, forces: Sequence[float]
) -> tuple[float, float] | None:
    """What it says of a field in units of the first one."""
    return ours.magnetic(FIELD_T * float(field[0]), FIELD_T * float(field[1]), heading, forces)


def forces_at(tick: int) -> tuple[float, float]:
    return (4.0 * (tick // 10 % 2), -3.0 * (tick // 25 % 2))


def flown(ticks: int, *, first_rad: float = 0.2) -> tuple[HeadingFilter, Reference, float]:
    """Both after a turn with thrusters that start and stop; the heading of the caller comes last."""
    ours, theirs, rng = HeadingFilter(KNOBS, THRUSTERS), Reference(), np.random.default_rng(2)
    heading = first_rad
    assert ours.magnetic(FIELD_T * math.cos(heading), -FIELD_T * math.sin(heading), heading, RESTS) is not None
    theirs.magnetic(np.array([math.cos(heading), -math.sin(heading)]), heading, RESTS)
    forces = RESTS
    for tick in range(ticks):
        ours.predict(0.03)
        ours.predict(0.01)
        theirs.predict(0.04)
        heading += 0.02
        forces = forces_at(tick) if forces != forces_at(tick) else forces
        expected, _, _ = theirs.innovation(heading, forces)
        field = expected + 0.01 * rng.standard_normal(2)
        found = reported(ours, field, heading, forces)
        wanted = theirs.magnetic(field, heading, forces)
        assert found == pytest.approx(wanted, abs=1e-9)
        heading += wanted[0]
    return ours, theirs, heading


def test_it_agrees_with_an_extended_kalman_filter_over_a_turn_with_thrusters() -> None:
    ours, theirs, _ = flown(300)
    assert math.sqrt(ours._P[0, 0]) == pytest.approx(math.sqrt(theirs.P[0, 0]), rel=1e-6)
    assert ours.bias_sigma_radps == pytest.approx(math.sqrt(theirs.P[1, 1]), rel=1e-6)
    motors = np.degrees(theirs.x[5:])
    assert np.degrees(ours._fields[5:]) == pytest.approx(motors, abs=1e-9)


@pytest.mark.parametrize("forces", [(0.0, 0.0), (5.0, -4.0)])
@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, -1.0), (-0.6, 0.8)])
def test_a_field_five_standard_deviations_off_is_an_outlier(
    forces: tuple[float, float], direction: tuple[float, float]
) -> None:
    ours, theirs, heading = flown(60)
    expected, _, S = theirs.innovation(heading, forces)
    edge = 5.0 / math.sqrt(float(np.array(direction) @ np.linalg.inv(S) @ np.array(direction))) * np.array(direction)
    for share, used in ((0.99, True), (1.01, False)):
        assert (reported(copy.deepcopy(ours), expected + share * edge, heading, forces) is not None) is used


def test_a_field_that_stays_elsewhere_is_that_of_the_vehicle_and_not_another_heading() -> None:
    ours, theirs, heading = flown(60)
    powered = forces_at(59)
    expected, _, _ = theirs.innovation(heading, powered)
    moved = expected + np.array([0.8, -0.5])
    found = [reported(ours, moved, heading, powered) for _ in range(KNOBS.compass_patience + 1)]
    assert found[:-1] == [None] * KNOBS.compass_patience
    assert found[-1] is not None
    assert abs(found[-1][0]) < 0.02
    found = [reported(ours, moved, heading, powered) for _ in range(KNOBS.compass_patience)]
    assert None not in found


def test_each_time_that_the_field_moves_takes_its_whole_patience() -> None:
    ours, theirs, heading = flown(60)
    powered = forces_at(59)
    expected, _, _ = theirs.innovation(heading, powered)
    for moved in ([0.8, -0.5], [-20.0, -1.5], [-20.0, -60.0], [200.0, -60.0]):
        for _ in range(KNOBS.compass_patience):
            assert reported(ours, expected + np.array(moved), heading, powered) is None
    assert reported(ours, expected + np.array([200.0, -60.0]), heading, powered) is not None


def test_outliers_now_and_then_are_none_in_a_row() -> None:
    ours, theirs, heading = flown(60)
    powered = forces_at(59)
    expected, _, _ = theirs.innovation(heading, powered)
    for number in range(5 * KNOBS.compass_patience):
        off = np.array([0.8, 0.0]) if number % 3 else np.zeros(2)
        assert (reported(ours, expected + off, heading, powered) is None) is bool(number % 3)


def test_a_heading_given_outright_is_fused_as_one_number() -> None:
    ours, theirs, _ = flown(60)
    ours.predict(2.0)
    theirs.predict(2.0)
    gain = theirs.P[0] / (theirs.P[0, 0] + math.radians(3.0) ** 2)
    assert ours.heading(0.05, 3.0) == pytest.approx((0.05 * gain[0], 0.05 * gain[1]), abs=1e-12)
    theirs.P -= np.outer(gain, theirs.P[0])
    assert math.sqrt(ours._P[0, 0]) == pytest.approx(math.sqrt(theirs.P[0, 0]), rel=1e-9)
    motors = np.degrees(theirs.x[5:] + 0.05 * gain[5:])
    assert np.degrees(ours._fields[5:]) == pytest.approx(motors, abs=1e-9)


def test_after_a_heading_given_outright_it_is_as_sure_as_that() -> None:
    ours = HeadingFilter(KNOBS, 0)
    assert not ours.known
    ours.predict(100.0)
    ours.heading(0.7, 4.0)
    assert ours.known
    assert math.sqrt(ours._P[0, 0]) == pytest.approx(math.radians(4.0))


def test_a_compass_after_a_heading_given_outright_does_not_turn_it_at_once() -> None:
    ours = HeadingFilter(KNOBS, THRUSTERS)
    ours.heading(0.7, 1.0)
    found = ours.magnetic(FIELD_T * math.cos(0.75), -FIELD_T * math.sin(0.75), 0.7, RESTS)
    assert found is not None
    assert 0.0 < found[0] < 0.03


def test_a_first_field_that_contradicts_a_heading_given_outright_is_an_outlier() -> None:
    ours = HeadingFilter(KNOBS, THRUSTERS)
    ours.heading(0.7, 1.0)
    field_T = (FIELD_T * math.cos(2.7), -FIELD_T * math.sin(2.7))
    found = [ours.magnetic(*field_T, 0.7, RESTS) is None for _ in range(KNOBS.compass_patience + 1)]
    assert found == [True] * KNOBS.compass_patience + [False]


def test_a_doubt_of_the_bias_only_widens() -> None:
    ours = HeadingFilter(KNOBS, 0)
    before = ours.bias_sigma_radps
    ours.widen_bias(0.5 * before)
    assert ours.bias_sigma_radps == before
    ours.widen_bias(3.0 * before)
    assert ours.bias_sigma_radps == pytest.approx(3.0 * before)


def test_forces_of_another_number_of_thrusters_are_not_used() -> None:
    ours, theirs, heading = flown(60)
    expected, _, _ = theirs.innovation(heading, RESTS)
    few, none = copy.deepcopy(ours), copy.deepcopy(ours)
    assert reported(few, expected, heading, (9.0,)) == reported(none, expected, heading, RESTS)


def test_thrusters_of_which_nothing_is_reported_are_at_rest() -> None:
    silent, reported = HeadingFilter(KNOBS, THRUSTERS), HeadingFilter(KNOBS, THRUSTERS)
    for x, y in ((1.0, -0.1), (1.0, -0.2), (0.98, -0.15)):
        assert silent.magnetic(x, y, 0.1, ()) == reported.magnetic(x, y, 0.1, [0.0] * THRUSTERS)
