"""The paper's way: means over plateaus, batch least squares."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from hindrax_ident.fit.plateaus import Plateaus, detected, fit, measure
from hindrax_ident.records.axis_record import Record, Series, Stretch


def plateaus(v: ArrayLike, noise: float = 0.0, seed: int = 0) -> Plateaus:
    v = np.array(v, np.float64)
    force = 66.48 * np.abs(v) * v + 1.25 * v - 0.02 + noise * np.random.default_rng(seed).standard_normal(len(v))
    return Plateaus(v, force, np.full(len(v), 10.0))


def test_exact_plateaus_give_the_coefficients_back() -> None:
    found = fit(plateaus([-0.4, -0.3, -0.2, 0.2, 0.3, 0.4]))
    assert found is not None
    assert found.theta == pytest.approx([66.48, 1.25, -0.02])


def test_standard_deviations_are_those_of_equation_7() -> None:
    table = plateaus(np.linspace(-0.45, 0.45, 12), noise=0.3, seed=4)
    X = np.stack([np.abs(table.v) * table.v, table.v, np.ones(12)], axis=1)
    theta = np.linalg.inv(X.T @ X) @ X.T @ table.force
    s2 = np.sum((table.force - X @ theta) ** 2) / (12 - 3)
    found = fit(table)
    assert found is not None
    assert found.theta == pytest.approx(theta)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(np.sqrt(np.diag(np.linalg.inv(X.T @ X)) * s2))


@pytest.mark.parametrize("v", [[0.1, 0.2, 0.3], [0.3] * 8, [0.2, 0.4] * 4])
def test_what_does_not_determine_three_coefficients_gives_none(v: list[float]) -> None:
    assert fit(plateaus(v)) is None


def test_sides_are_distinguished() -> None:
    table = plateaus([-0.4, -0.2, 0.1, 0.3])
    assert table.on_side(1).v.tolist() == [0.1, 0.3]
    assert table.on_side(-1).v.tolist() == [-0.4, -0.2]
    assert len(table.on_side(0).v) == 4


def record() -> Record:
    t = np.arange(0.0, 40.0, 0.05, dtype=np.float64)
    thrust = np.where(t < 20.0, 4.0, -6.0)
    v = np.where(t < 20.0, 0.2, -0.3)
    return Record(Series(t, v), Series(t, thrust), (Stretch(0.0, 39.9),), lag_s=0.0)


def test_plateaus_are_found_where_the_thrust_holds_still() -> None:
    spans = detected(record())
    assert [(span.start_s, span.end_s) for span in spans] == [(10.0, 20.0), (pytest.approx(29.95), 39.9)]


def test_means_are_over_the_plateaus_that_the_maneuver_names() -> None:
    reported = measure(replace(record(), plateaus=(Stretch(5.0, 15.0), Stretch(25.0, 35.0))))
    assert reported.v == pytest.approx([0.2, -0.3])
    assert reported.force == pytest.approx([4.0, -6.0])
    assert reported.duration_s == pytest.approx([10.0, 10.0])


def test_without_a_velocity_the_position_serves() -> None:
    t = np.arange(0.0, 40.0, 0.05, dtype=np.float64)
    position = np.where(t < 20.0, 0.2 * t, 4.0 - 0.3 * (t - 20.0))
    empty = Series(np.zeros(0), np.zeros(0))
    reported = measure(
        replace(
            record(), velocity=empty, position=Series(t, position), plateaus=(Stretch(5.0, 15.0), Stretch(25.0, 35.0))
        )
    )
    assert reported.v == pytest.approx([0.2, -0.3])


def test_a_plateau_without_measurements_is_left_out() -> None:
    assert len(measure(replace(record(), plateaus=(Stretch(100.0, 110.0),))).v) == 0
