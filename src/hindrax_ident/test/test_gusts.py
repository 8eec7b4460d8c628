"""Gusts of the thrust: what one motion can hardly see, another shows, and one that contradicts is left out."""

import numpy as np
import pytest

from hindrax_core.vehicle import Vehicle
from hindrax_ident.fit.disturbance_noise import common_noise
from hindrax_ident.fit.output_error import OutputErrorFit, refine, reweighted
from hindrax_ident.model.model_parameters import wide_prior
from hindrax_ident.model.motion_model import model_of
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.testing.synthetic_runs import COMMAND_S, STEP_S, back_and_forth, fly

SURGE = np.array([66.48, 1.25, 0.0, 27.3])
YAW = np.array([0.55, 1.47, 0.0, 0.76])
DENSITY_S = 4e-5
"""2 % of the thrust, drawn ten times a second."""


def fitted(vehicle: Vehicle, axis: int, seed: int, density_s: float = DENSITY_S) -> OutputErrorFit:
    """Fit of a flight through gusts: surge by a poor log, yaw by a gyroscope."""
    rng = np.random.default_rng(seed)
    theta, levels, sigma = (SURGE, (4.0, 12.0), 0.02) if axis == 0 else (YAW, (1.0, 2.0), 0.001)
    model, plan = model_of(vehicle, axis), back_and_forth(levels, 6.0, 120.0)
    held = round(0.1 / COMMAND_S)
    noise = np.repeat(np.sqrt(density_s / 0.1) * rng.standard_normal(len(plan.commands()[0]) // held + 1), held)
    flight = fly(model, theta, plan, 0.15, noise)
    every = round(0.05 / STEP_S)
    t, v = flight.grid.times_s[::every], flight.path.v[::every]
    measured = Series(t, v + sigma * rng.standard_normal(len(t)))
    record = Record(measured, Series(flight.times_s, flight.commands), (Stretch(1.0, 119.0),), lag_s=0.15)
    return refine(model, record, theta, wide_prior(vehicle, model))


def test_a_motion_that_hardly_sees_gusts_learns_of_them_from_one_that_does(vehicle: Vehicle) -> None:
    seeing = fitted(vehicle, 5, 1)
    blind = fitted(vehicle, 0, 2)
    found = common_noise({0: blind, 5: seeing})
    assert found[0].thrust == found[5].thrust == pytest.approx(DENSITY_S, rel=0.4)
    assert found[0].velocity == blind.noise.velocity
    again = reweighted(blind, found[0], wide_prior(vehicle, blind.model))
    assert again.noise == found[0]
    assert np.all(np.abs(again.theta - SURGE) < 4.0 * np.sqrt(np.diag(again.covariance)))


def test_a_motion_that_contradicts_keeps_its_own(vehicle: Vehicle) -> None:
    fits = {
        5: fitted(vehicle, 5, 1),
        3: fitted(vehicle, 5, 3),
        0: fitted(vehicle, 5, 4, density_s=400.0 * DENSITY_S),
    }
    assert set(common_noise(fits)) == {3, 5}


def test_one_motion_has_nothing_to_share(vehicle: Vehicle) -> None:
    assert common_noise({5: fitted(vehicle, 5, 1)}) == {}
