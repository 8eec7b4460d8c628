"""Values on straight lines between others were interpolated; motion, rest, steps and rounding were not."""

import numpy as np
import pytest

from hindrax_analysis.records.damage import without_damage
from hindrax_analysis.records.interpolated import measured_rows
from hindrax_analysis.records.recording import Recording
from hindrax_ident.arrays import Array, array

T = array(np.arange(0.0, 100.0, 0.05))


def moving(t: Array, noise_mps: float = 0.01) -> Array:
    return array(0.4 * np.sin(t / 2.0) + noise_mps * np.random.default_rng(1).standard_normal(len(t)))


def between(every_s: float, begin_s: float, noise_mps: float = 0.01, digits: int = 5) -> tuple[Array, Array]:
    """Times of measurements, and a table of 20 Hz made of them."""
    times = array(np.arange(begin_s, 100.0, every_s))
    return times, array(np.round(np.interp(T, times, moving(times, noise_mps)), digits))


@pytest.mark.parametrize(
    ("every_s", "begin_s"),
    [(0.1, 0.0), (0.125, 0.0), (0.2, 0.0), (0.3, 0.013), (0.5, 0.0), (0.5, 0.017), (1.0, 0.02)],
)
@pytest.mark.parametrize(("noise_mps", "digits"), [(0.01, 5), (0.002, 8), (0.01, 4)])
def test_measurements_are_found_between_the_lines(
    every_s: float, begin_s: float, noise_mps: float, digits: int
) -> None:
    times, table = between(every_s, begin_s, noise_mps, digits)
    found = measured_rows(T, table)
    assert found is not None
    assert found.sum() == pytest.approx(len(times), rel=0.12, abs=2)
    nearest_s = np.abs(T[found][:, None] - times).min(axis=1)[1:-1]
    assert np.quantile(nearest_s, 0.95) <= 0.026, "a row next to the measurement"


@pytest.mark.parametrize(
    "table",
    [
        moving(T),
        np.round(moving(T), 2),
        moving(T, 0.0),
        np.round(moving(T, 0.0), 4),
        np.round(moving(T, 0.0), 6),
        np.repeat(moving(T[::10]), 10),
        np.zeros(len(T)),
        np.where(T % 20.0 < 10.0, 0.3, -0.3),
        0.01 * T,
    ],
    ids=["noise", "coarse", "exact", "exact 4", "exact 6", "held", "rest", "steps", "ramp"],
)
def test_what_was_not_interpolated_stays(table: Array) -> None:
    assert measured_rows(T, array(table)) is None


@pytest.mark.parametrize("step_s", [0.001, 0.005])
@pytest.mark.parametrize("digits", [4, 5, 6])
def test_a_dense_motion_without_noise_bends(step_s: float, digits: int) -> None:
    t = array(np.arange(0.0, 40.0, step_s))
    assert measured_rows(t, array(np.round(moving(t, 0.0), digits))) is None


def test_a_record_is_left_with_its_measurements() -> None:
    """Nine of ten velocities on lines made a drag 22 % too small."""
    times, table = between(0.5, 0.0)
    velocity, wrench = np.full((len(T), 6), np.nan), np.full((len(T), 6), np.nan)
    velocity[:, 0], velocity[:, 5] = table, moving(T)
    wrench[:, 0] = 10.0 * np.sign(np.cos(T / 2.0))
    depth = np.column_stack([np.zeros((len(T), 2)), 3.0 + between(1.0, 0.0)[1]])
    found = without_damage(Recording("x.csv", T, velocity, T, wrench, T, array(depth)))
    assert found.assumptions == (
        f"surge: velocities lie on lines between {len(times) + 1} of 2000: these alone are used",
        "depths lie on lines between 100 of 2000: these alone are used",
    )
    known = np.isfinite(found.velocity[:, 0])
    assert found.velocity[known, 0][: len(times)] == pytest.approx(moving(times), abs=1e-5)
    assert np.isfinite(found.velocity[:, 5]).all()
    assert np.isfinite(found.attitude[:, 2]).sum() == 100
    assert np.isfinite(found.attitude[:, :2]).all()
