"""The sampled posterior is that of the budget where both are linear, and the sampler finds what is simple."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hindrax_bringup.share_files import share_folder
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.assessment import Assessment, DraftFit, assess
from hindrax_ident.fit.output_error import refine
from hindrax_ident.model.model_parameters import wide_prior
from hindrax_ident.model.motion_model import model_of
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.testing.synthetic_runs import back_and_forth, fly
from hindrax_ident.tuning import Tuning
from hindrax_tools.uncertainty.sampled_posterior import Target, compared, shape_of

TRUE = array(np.array([66.5, 1.3, 0.3, 27.3]))


@pytest.fixture(scope="module")
def assessment() -> Assessment:
    """Surge of half a minute, of a vehicle in water that is that of the model."""
    vehicle = load_vehicle(share_folder("vehicles") / "hindrax.yaml")
    model = model_of(vehicle, 0)
    flight = fly(model, TRUE, back_and_forth((4.0, 9.0, 13.0), 5.0, 30.0), 0.15)
    t = flight.grid.times_s[::20]
    v = flight.path.v[::20] + 0.01 * np.random.default_rng(1).standard_normal(len(t))
    thrust = Series(flight.times_s, flight.commands)
    record = Record(Series(t, array(v)), thrust, (Stretch(0.0, 29.9),), lag_s=0.15, prior_delays_s=(0.15, 0.0))
    prior = wide_prior(vehicle, model)
    draft = DraftFit(record, refine(model, record, TRUE, prior), prior, {}, moved=False)
    return assess(vehicle, {0: draft}, tuning=Tuning())[0][0]


def small(assessment: Assessment, name: str, size: float) -> Array:
    """Influences (m,) of which one has this size, in its prior deviation."""
    out = np.zeros(assessment.budget.shifts.shape[1])
    for row, influence, _ in assessment.budget.rows:
        if influence.name == name:
            out[row] = size
    return array(out)


@pytest.mark.parametrize(
    "name",
    ["thrust lag", "latency of the velocity", "exponent of the drag", "own wake", "losses between thrusters and hull"],
)
def test_a_small_influence_moves_the_fit_as_the_budget_says(assessment: Assessment, name: str) -> None:
    target, u = Target(assessment), small(assessment, name, 0.02)
    moved = target.refitted(assessment.fit.theta, u) - target.refitted(assessment.fit.theta, 0.0 * u)
    forecast = -assessment.budget.shifts @ u
    assert moved == pytest.approx(forecast, rel=0.1, abs=0.02 * float(np.abs(forecast).max()))


def test_about_the_fit_the_density_of_the_parameters_has_their_covariance(assessment: Assessment) -> None:
    target, fit = Target(assessment), assessment.fit
    u = np.zeros(len(target.judged))
    plain = array(np.linalg.inv(fit.linear.information + fit.prior_information))
    for column in np.linalg.cholesky(plain).T:
        gained = [target.log_likelihood(array(fit.theta + side * 0.3 * column), u) for side in (-1.0, 0.0, 1.0)]
        assert gained[1] > max(gained[0], gained[2])
        assert gained[0] + gained[2] - 2.0 * gained[1] == pytest.approx(-(0.3**2) / target.size, rel=0.05)


def test_a_loss_is_no_gain_and_water_near_the_model_has_little_of_anything(assessment: Assessment) -> None:
    target = Target(assessment)
    judged = target.judged
    usual = target.prior[0][-1]
    loss = usual > 0.0
    one = np.eye(len(judged))[int(np.flatnonzero(loss & judged)[0])]
    within, beyond = (target.waters(array(usual + off * one), judged)[-1] for off in (0.0, 4.0))
    assert within - beyond > 5.0
    nothing = target.waters(array(np.zeros(len(judged))), judged)
    much = target.waters(array(np.where(loss, usual, 1.0)), judged)
    assert nothing[0] > nothing[-1]
    assert much[-1] > much[0]


def test_moments_are_weighted() -> None:
    shape = shape_of(array(np.array([0.0, 1.0, 9.0])), array(np.array([0.5, 0.5, 0.0])))
    assert (shape.center, shape.width, shape.skew) == pytest.approx((0.5, 0.5, 0.0))
    assert shape_of(array(np.array([0.0, 1.0])), array(np.array([0.9, 0.1]))).skew > 2.0


def test_a_record_without_surprises_is_sampled_as_its_budget_has_it(assessment: Assessment) -> None:
    pytest.importorskip("emcee")
    row = compared("surge", assessment, steps=40)
    assert math.isfinite(row.effective)
    drag = row.quantities[-1]
    assert abs(drag.off) < 0.5
    assert 0.7 < drag.linear.width / drag.sampled.width < 1.4
    assert replace(drag, record="").quantity == "drag at the highest speed"
