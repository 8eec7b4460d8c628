"""Hard and soft iron: what was put in is found, and data that cannot tell is refused."""

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.readings import Vec3
from hindrax_drivers.imu_calibration import IDENTITY, Correction, correction, fit_sphere, roundness

RADIUS = 45e-6


def directions(count: int, seed: int) -> list[Vec3]:
    draw = np.random.default_rng(seed).standard_normal((count, 3))
    return [tuple(one) for one in (draw / np.linalg.norm(draw, axis=1)[:, None]).tolist()]


def distort(points: list[Vec3], wanted: Correction, noise: float, seed: int) -> list[Vec3]:
    """Raw vectors that the wanted correction puts onto a sphere of RADIUS."""
    back = np.linalg.inv(np.array(wanted.matrix).reshape(3, 3))
    draw = random.Random(seed)
    raw = RADIUS * np.array(points) @ back.T + np.array(wanted.offset)
    return [tuple(one + draw.gauss(0.0, noise) for one in row) for row in raw.tolist()]


@settings(max_examples=50)
@given(
    st.tuples(*[st.floats(-100e-6, 100e-6)] * 3),
    st.tuples(*[st.floats(0.7, 1.4)] * 3),
    st.tuples(*[st.floats(-0.15, 0.15)] * 3),
    st.integers(0, 100),
)
def test_what_distorts_is_found(offset: Vec3, scale: Vec3, shear: Vec3, seed: int) -> None:
    a, b, c = shear
    wanted = Correction(offset, (scale[0], a, b, a, scale[1], c, b, c, scale[2]))
    raw = distort(directions(400, seed), wanted, 0.0, seed)
    found = fit_sphere(raw, RADIUS)
    assert found.offset == pytest.approx(offset, abs=1e-9)
    assert found.matrix == pytest.approx(wanted.matrix, abs=1e-6)
    assert roundness(raw, found) < 1e-6


def test_noise_as_of_the_sensor_leaves_a_heading_of_half_a_degree() -> None:
    wanted = Correction((30e-6, -20e-6, 10e-6), (1.1, 0.05, 0.0, 0.05, 0.9, 0.0, 0.0, 0.0, 1.0))
    raw = distort(directions(500, 1), wanted, 0.3e-6, 1)
    found = fit_sphere(raw, RADIUS)
    assert np.linalg.norm(np.subtract(found.offset, wanted.offset)) < RADIUS * math.radians(0.5)
    assert roundness(raw, found) < 0.02


def test_without_a_radius_the_volume_is_kept() -> None:
    raw = distort(directions(300, 2), Correction(matrix=(1.5, 0.0, 0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 1.0)), 0.0, 2)
    found = fit_sphere(raw)
    assert np.linalg.det(np.array(found.matrix).reshape(3, 3)) == pytest.approx(1.0)
    assert roundness(raw, found) < 1e-6


def ring(count: int) -> list[Vec3]:
    angles = [math.tau * index / count for index in range(count)]
    return [(math.cos(one), math.sin(one), -0.4) for one in angles]


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (directions(49, 3), "found 49 points, wanted at least 50"),
        (ring(400), "turn the vehicle about each axis"),
        ([(1.0, 2.0, 3.0)] * 100, "differ by .* in length"),
        ([one for one in directions(4000, 4) if one[2] > 0.97], "turn the vehicle about each axis"),
    ],
)
def test_data_without_information_is_refused(points: list[Vec3], words: str) -> None:
    noisy = distort(points, Correction(), 0.1e-6, 3)
    with pytest.raises(HindraxError, match=words):
        fit_sphere(noisy)


def test_a_correction_survives_the_vehicle_file() -> None:
    wanted = Correction((1.0, 2.0, 3.0), (1.0, 0.1, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0, 1.0))
    assert correction(wanted.entries("mag", "T"), "mag", "T") == wanted
    assert correction({}, "mag", "T").idle
    assert correction({"accel_scale": (2.0, 1.0, 1.0)}, "accel", "mps2").apply(1.0, 1.0, 1.0) == (2.0, 1.0, 1.0)
    assert Correction(matrix=IDENTITY).apply(1.0, 2.0, 3.0) == (1.0, 2.0, 3.0)
    with pytest.raises(UsageError, match=r"calibration.mag_offset_T: found 2 values, wanted 3"):
        correction({"mag_offset_T": (1.0, 2.0)}, "mag", "T")
