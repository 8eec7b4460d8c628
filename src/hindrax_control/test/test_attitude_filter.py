"""The attitude filter against rotations of scipy and a Kalman filter in matrices, and the gains that it promises."""

import cmath
import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hindrax_control.navigation.attitude_filter import AttitudeFilter, AttitudeKnobs
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Vec3

DT_S = 0.02
LEVEL: Vec3 = (0.0, 0.0, -GRAVITY_mps2)
DOWN = np.array([0.0, 0.0, 1.0])
ANGLES = st.tuples(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))


def vector(values: Sequence[float] | NDArray[np.float64]) -> Vec3:
    x, y, z = (float(value) for value in values)
    return (x, y, z)


def of_euler(angles_rad: Sequence[float]) -> Rotation:
    """Rotation body to earth of roll, pitch, yaw."""
    return Rotation.from_euler("ZYX", angles_rad[::-1])


def gravity_at(attitude: Rotation) -> Vec3:
    """Specific force at rest, in body axes."""
    return vector(attitude.inv().apply(-GRAVITY_mps2 * DOWN))


def aligned(angles_rad: Sequence[float] = (0.0, 0.0, 0.0), knobs: AttitudeKnobs | None = None) -> AttitudeFilter:
    ours = AttitudeFilter(knobs or AttitudeKnobs())
    ours.align(gravity_at(of_euler(angles_rad)), 1.0, angles_rad[2])
    return ours


def angle_between(ours: AttitudeFilter, theirs: Rotation) -> float:
    return float((Rotation.from_matrix(ours.rotation).inv() * theirs).magnitude())


@given(ANGLES)
def test_it_starts_with_tilt_of_gravity_and_the_heading_that_it_is_given(angles_rad: Vec3) -> None:
    ours = aligned(angles_rad)
    assert ours.euler_rad == pytest.approx(angles_rad, abs=1e-7)
    assert ours.heading_rad == ours.euler_rad[2]
    assert np.array(ours.rotation) == pytest.approx(of_euler(angles_rad).as_matrix(), abs=1e-9)


@given(ANGLES, st.tuples(*[st.floats(-1.5, 1.5)] * 3), st.sampled_from([0.0, 0.01, 0.1, 1.0]))
def test_a_turn_is_a_rotation_about_body_axes(angles_rad: Vec3, angle_rad: Vec3, share: float) -> None:
    ours, turn = aligned(angles_rad), share * np.array(angle_rad)
    ours.turn(vector(turn), DT_S)
    assert angle_between(ours, of_euler(angles_rad) * Rotation.from_rotvec(turn)) < 1e-6


def test_it_stays_a_rotation_however_long_it_turns() -> None:
    ours, turn = aligned(), np.array([0.11, -0.1, 0.12])
    for _ in range(2000):
        ours.turn(vector(turn), DT_S)
    assert np.array(ours.rotation) @ np.array(ours.rotation).T == pytest.approx(np.eye(3), abs=1e-9)
    assert angle_between(ours, Rotation.from_rotvec(2000 * turn)) < 2e-3


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_pitch_ends_at_the_vertical(sign: float) -> None:
    for heading_rad in np.linspace(-3.0, 3.0, 50):
        ours = AttitudeFilter(AttitudeKnobs())
        ours.align((sign * GRAVITY_mps2, 0.0, 0.0), 1.0, float(heading_rad))
        assert ours.euler_rad[1] == pytest.approx(0.5 * sign * math.pi, abs=1e-7)


@given(ANGLES, st.floats(-1.5, 1.5))
def test_steering_changes_heading_and_no_tilt(angles_rad: Vec3, turn_rad: float) -> None:
    ours = aligned(angles_rad)
    ours.bias_radps = (0.01, 0.02, 0.03)
    ours.steer(turn_rad, 0.005)
    assert angle_between(ours, Rotation.from_rotvec(turn_rad * DOWN) * of_euler(angles_rad)) < 1e-6
    added = np.subtract(ours.bias_radps, (0.01, 0.02, 0.03))
    assert of_euler(angles_rad).apply(added) == pytest.approx(0.005 * DOWN, abs=1e-9)


class Reference:
    """Rotation by scipy; errors of tilt and of the offset across the vertical as one complex number each."""

    def __init__(self, knobs: AttitudeKnobs, angles_rad: Vec3, bias_radps: Vec3, bias_sigma_radps: float) -> None:
        self.attitude, self.bias = of_euler(angles_rad), np.array(bias_radps)
        self.noise = (knobs.gravity_noise / GRAVITY_mps2) ** 2
        # Riccati's equation at rest for gains of 1 / T of the tilt and 1 / (T T_b) of the offset.
        slow = 1.0 / (knobs.tilt_time_s * knobs.bias_time_s)
        self.Q = np.diag([self.noise * (knobs.tilt_time_s**-2 - 2.0 * slow), self.noise * slow**2])
        self.P = np.diag([self.noise, bias_sigma_radps**2]).astype(complex)

    def step(self, angle: NDArray[np.float64], force: NDArray[np.float64], dt: float) -> None:
        down = self.attitude.inv().apply(DOWN)
        F = np.array([[cmath.exp(-1j * float(angle @ down)), -dt], [0.0, 1.0]])
        self.attitude = self.attitude * Rotation.from_rotvec(angle)
        self.P = F @ self.P @ F.conj().T + self.Q * dt
        down = self.attitude.inv().apply(DOWN)
        error = np.cross(down, force) / np.linalg.norm(force)
        gain = self.P[:, 0] / (self.P[0, 0] + self.noise / dt)
        self.P = self.P - np.outer(gain, self.P[0])
        across = np.cross(down, error)
        self.bias = self.bias + gain[1].real * error + gain[1].imag * across
        self.attitude = self.attitude * Rotation.from_rotvec(gain[0].real * error + gain[0].imag * across)


def test_it_agrees_with_a_kalman_filter_in_matrices_over_a_wild_ride() -> None:
    knobs, rng = AttitudeKnobs(gravity_gate_mps2=10.0), np.random.default_rng(7)
    start: Vec3 = (0.3, -0.2, 0.5)
    ours, theirs = aligned(start, knobs), Reference(knobs, start, (0.02, -0.01, 0.03), 0.05)
    ours.set_bias((0.02, -0.01, 0.03), 0.05)
    for tick in range(1500):
        dt = 0.02 if tick % 5 else 0.03
        rates = np.array([0.5 * math.sin(0.02 * tick), 0.4 * math.cos(0.013 * tick), 0.8])
        force = theirs.attitude.inv().apply(-GRAVITY_mps2 * DOWN) + 0.3 * rng.standard_normal(3)
        ours.turn(vector(rates * dt), dt)
        ours.level(vector(force), dt)
        theirs.step(rates * dt, force, dt)
    assert angle_between(ours, theirs.attitude) < 1e-5
    assert ours.bias_radps == pytest.approx(theirs.bias, abs=1e-6)
    assert ours.tilt_sigma_rad == pytest.approx(math.sqrt(theirs.P[0, 0].real), rel=1e-6)
    assert ours.bias_sigma_radps == pytest.approx(math.sqrt(theirs.P[1, 1].real), rel=1e-6)


def rest(ours: AttitudeFilter, seconds: float, force_mps2: Vec3 = LEVEL, offset_radps: Vec3 = (0.0, 0.0, 0.0)) -> None:
    """Let it lie still, with a gyroscope of this offset."""
    for _ in range(round(seconds / DT_S)):
        ours.turn(vector(DT_S * np.subtract(offset_radps, ours.bias_radps)), DT_S)
        ours.level(force_mps2, DT_S)


def test_settled_it_follows_gravity_with_its_two_time_constants() -> None:
    # de/dt = -e / T - b, db/dt = e / (T T_b): with T_b = 4 T both poles lie at -1 / (2 T).
    knobs = AttitudeKnobs(tilt_time_s=20.0, bias_time_s=80.0)
    ours = aligned(knobs=knobs)
    rest(ours, 600.0)
    ours.turn((0.05, 0.0, 0.0), 1e-9)
    for t in (10.0, 20.0, 30.0, 40.0, 50.0, 60.0):
        rest(ours, 10.0)
        assert ours.euler_rad[0] == pytest.approx(0.05 * (1.0 - t / 40.0) * math.exp(-t / 40.0), abs=2e-4)


def test_a_short_time_constant_of_the_offset_leaves_a_filter_that_follows_gravity() -> None:
    ours = aligned(knobs=AttitudeKnobs(tilt_time_s=50.0, bias_time_s=60.0))
    ours.turn((0.05, 0.0, 0.0), DT_S)
    rest(ours, 400.0)
    assert abs(ours.euler_rad[0]) < 0.01


@pytest.mark.parametrize("axis", [0, 1])
def test_an_offset_across_the_vertical_is_found_and_one_about_it_is_not(axis: int) -> None:
    offset = [0.0, 0.0, 0.02]
    offset[axis] = 0.01
    ours = aligned()
    ours.set_bias((0.0, 0.0, 0.0), 0.05)
    rest(ours, 60.0, offset_radps=vector(offset))
    assert ours.bias_radps[axis] == pytest.approx(0.01, abs=5e-4)
    assert ours.bias_radps[1 - axis] == pytest.approx(0.0, abs=5e-4)
    assert ours.bias_radps[2] == pytest.approx(0.0, abs=1e-3)


def test_its_uncertainty_after_alignment_is_that_of_gravity_over_the_span() -> None:
    ours = AttitudeFilter(AttitudeKnobs(gravity_noise=0.3))
    assert ours.tilt_sigma_rad > 3.0
    ours.align(LEVEL, 4.0)
    assert ours.tilt_sigma_rad == pytest.approx(0.3 / GRAVITY_mps2 / 2.0)
    assert ours.heading_rad == 0.0, "north, when nobody tells it"
    ours.set_bias((0.0, 0.0, 0.1), 0.02)
    assert (ours.bias_radps, ours.bias_sigma_radps) == ((0.0, 0.0, 0.1), 0.02)


@pytest.mark.parametrize(("norm_mps2", "leans"), [(0.91, True), (1.09, True), (0.89, False), (1.11, False)])
def test_what_is_far_from_one_g_is_no_gravity_but_shows_an_angle(norm_mps2: float, leans: bool) -> None:
    ours = AttitudeFilter(AttitudeKnobs(gravity_gate_mps2=0.1 * GRAVITY_mps2))
    ours.align(LEVEL, 1.0)
    tilted = vector(norm_mps2 * np.array(gravity_at(of_euler((0.2, 0.0, 0.0)))))
    ours.level(tilted, DT_S)
    assert (ours.euler_rad[0] > 0.0) is leans
    assert ours.gravity_off_rad > 0.0


def test_without_any_force_it_goes_on() -> None:
    ours = aligned((0.1, 0.2, 0.3))
    ours.level((0.0, 0.0, 0.0), DT_S)
    assert ours.euler_rad == pytest.approx((0.1, 0.2, 0.3), abs=1e-9)
    assert ours.gravity_off_rad == 0.0


@pytest.mark.parametrize("off", [(0.3, 0.0, 0.0), (0.0, -0.5, 0.0), (2.0, 0.4, 0.0)])
@pytest.mark.parametrize("angles_rad", [(0.0, 0.0, 0.0), (0.3, -0.4, 1.0)])
def test_the_angle_of_gravity_is_reported_whole_when_it_lasts(angles_rad: Vec3, off: Vec3) -> None:
    ours = AttitudeFilter(AttitudeKnobs(gravity_noise=10.0))  # so it hardly leans
    ours.align(gravity_at(of_euler(angles_rad)), 1e9, angles_rad[2])
    measured = (of_euler(angles_rad) * of_euler(off)).inv().apply(-GRAVITY_mps2 * DOWN)
    wanted = math.acos(float(measured @ np.array(gravity_at(of_euler(angles_rad)))) / GRAVITY_mps2**2)
    ours.level(vector(measured), DT_S)
    assert ours.gravity_off_rad < 0.2 * wanted
    for _ in range(150):
        ours.level(vector(measured), DT_S)
    assert ours.gravity_off_rad == pytest.approx(wanted, rel=1e-3)
    ours.level(gravity_at(of_euler(angles_rad)), 10.0)
    assert ours.gravity_off_rad == pytest.approx(0.0, abs=0.01)


def test_by_default_the_offset_of_the_gyroscope_is_known() -> None:
    ours = AttitudeFilter(AttitudeKnobs())
    ours.align((0.0, 0.0, -GRAVITY_mps2), 1.0)
    for _ in range(10):
        ours.turn((0.0, 0.0, 0.0), 0.02)
        ours.level((0.3, 0.2, -GRAVITY_mps2), 0.02)
    assert ours.bias_radps == pytest.approx((0.0, 0.0, 0.0), abs=1e-4)
