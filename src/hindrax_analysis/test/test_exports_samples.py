"""Vehicles drawn from the uncertainty of a result have its mean, its covariance, and drags within its bands."""

import csv
import io
from typing import Any

import numpy as np
import pytest

from hindrax_analysis.coefficients_file import SavedCoefficients, coefficients_of
from hindrax_analysis.exports.samples import Posterior, sample_table, sampled_models
from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import Drag, Hydrodynamics, Vehicle

NAMES = ["k_q", "k_l", "b", "added_mass"]
CALIBRATED = np.array([[9.0, -2.4, 0.0, 0.6], [-2.4, 1.0, 0.0, -0.1], [0.0, 0.0, 0.04, 0.0], [0.6, -0.1, 0.0, 0.25]])
VEHICLE = Vehicle(
    "v",
    15.22,
    0.0153,
    (0.59, 0.47, 0.40),
    hydrodynamics=Hydrodynamics(added_mass=(12.0, 19.0, 22.0, 0.2, 0.4, 0.3), heave=Drag(90.0, 5.0)),
)


def motion(k_q: float, **other: Any) -> dict[str, Any]:
    values = dict(zip(NAMES, (k_q, 8.0, 0.3, 12.0), strict=True))
    sigma = np.sqrt(np.diag(CALIBRATED))
    numbers = {
        name: {"value": value, "std": 0.1 * float(s), "std_calibrated": float(s)}
        for (name, value), s in zip(values.items(), sigma, strict=True)
    }
    rows: dict[str, Any] = {
        "names": NAMES,
        "covariance": (0.01 * CALIBRATED).tolist(),
        "covariance_calibrated": CALIBRATED.tolist(),
        "speeds": [0.2, 0.8],
        "budget": {"k_q": {"thrust calibration": 1.0, "current": 1.0}, "added_mass": {"thrust calibration": 0.1}},
    }
    return {**numbers, **rows, **other}


def saved(**motions: Any) -> SavedCoefficients:
    return coefficients_of({"motions": motions or {"surge": motion(60.0), "sway": motion(80.0)}}, "c.yaml")


def test_draws_have_the_mean_and_the_covariance_of_the_result() -> None:
    posterior = Posterior(saved())
    drawn = posterior.draw(20_000, 1)
    sigma = np.sqrt(np.diag(posterior.covariance))
    assert (drawn.mean(axis=0) - posterior.mean) / sigma == pytest.approx(np.zeros(8), abs=0.03)
    assert np.cov(drawn.T) / np.outer(sigma, sigma) == pytest.approx(
        posterior.covariance / np.outer(sigma, sigma), abs=0.03
    )
    assert posterior.covariance[:4, :4] == pytest.approx(CALIBRATED)


def test_the_gain_that_motions_share_couples_them_and_nothing_else_does() -> None:
    covariance = Posterior(saved()).covariance
    assert covariance[0, 4] == pytest.approx(1.0)
    assert covariance[3, 4] == pytest.approx(0.1)
    assert covariance[1, 5] == 0.0


def test_two_hundred_drags_cover_as_the_band_of_the_result_says() -> None:
    posterior = Posterior(saved(surge=motion(60.0)))
    speed = np.array([0.3, 0.5, 0.8])
    gradient = np.stack((speed**2, speed))
    sigma = np.sqrt(np.sum(gradient * (CALIBRATED[:2, :2] @ gradient), axis=0))
    drags = posterior.draw(200, 3)[:, :2] @ gradient
    within = np.abs(drags - posterior.mean[:2] @ gradient) < 1.96 * sigma
    assert within.mean(axis=0) == pytest.approx(0.95, abs=0.045)


def test_a_seed_repeats_its_vehicles_and_the_models_are_the_rows_of_the_table() -> None:
    rows = list(csv.reader(io.StringIO(sample_table(saved(), 3, seed=5))))
    assert rows[0][0] == "surge.k_q [N s^2/m^2]"
    assert sample_table(saved(), 3, seed=5) == sample_table(saved(), 3, seed=5) != sample_table(saved(), 3, seed=6)
    models = list(sampled_models(saved(), VEHICLE, "c.yaml", 3, seed=5, complete=True))
    assert [model.hydrodynamics.surge.k_q for model in models] == pytest.approx([float(row[0]) for row in rows[1:]])
    assert models[1].notes[0] == "sample 2 of 3 drawn from the uncertainty of the results, seed 5"


def test_no_vehicle_is_drawn_that_its_water_would_drive() -> None:
    wide = (CALIBRATED * 900.0).tolist()
    uncertain = motion(60.0, covariance_calibrated=wide)
    for name, sigma in zip(NAMES, (90.0, 30.0, 6.0, 15.0), strict=True):
        uncertain[name]["std_calibrated"] = sigma
    posterior = Posterior(saved(surge=uncertain))
    drawn = posterior.draw(500, 1)
    assert np.all(drawn[:, 0] * 0.8 + drawn[:, 1] >= 0.0)
    assert np.all(drawn[:, 3] >= 0.0)
    with pytest.raises(HindraxError, match="hardly any vehicle"):
        Posterior(saved(surge=motion(-1e6))).draw(2, 1)


def test_a_file_of_before_is_drawn_from_with_the_correlations_of_its_noise() -> None:
    old = motion(60.0)
    del old["covariance_calibrated"]
    assert Posterior(saved(surge=old)).covariance == pytest.approx(CALIBRATED)
    with pytest.raises(HindraxError, match=r"covariance_calibrated: found 1 rows, wanted 4 by 4"):
        saved(surge=motion(60.0, covariance_calibrated=[[1.0]]))
