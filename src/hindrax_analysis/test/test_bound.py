"""The Cramer-Rao bound: in closed form where there is one, and what the Monte Carlo makes of it."""

import numpy as np
import pytest

from hindrax_analysis.identification.montecarlo import trial_of
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.results import truth_of
from hindrax_ident.fit.cramer_rao import bound_of
from hindrax_ident.fit.output_error import refine
from hindrax_ident.model.model_parameters import parameters_of, wide_prior
from hindrax_ident.model.motion_model import model_of
from hindrax_ident.online.session import Session
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.testing.synthetic_runs import DVL, back_and_forth, events, fly

SURGE = np.array([66.48, 1.25, 0.0, 27.3])


def test_parameters_of_the_truth_are_in_the_order_of_the_model(vehicle: Vehicle) -> None:
    truth = truth_of(vehicle)
    assert parameters_of(model_of(vehicle, 0), truth) == pytest.approx([66.48, 1.25, 0.0, 27.3])
    heave = parameters_of(model_of(vehicle, 2), truth)
    assert heave == pytest.approx([93.52, 5.26, 56.57, 11.84, vehicle.net_buoyancy_N, 15.22 + 22.48])
    assert parameters_of(model_of(vehicle, 3), truth)[3] == pytest.approx(3.0008, abs=1e-3)


def test_long_plateaus_have_the_bound_of_a_linear_regression(vehicle: Vehicle) -> None:
    # On plateaus dv/dtheta = -[v|v|, v, 1] / slope: the bound is that of the plateau means.
    model = model_of(vehicle, 0)
    flight = fly(model, SURGE, back_and_forth((4.0, 9.0, 13.0), 40.0, 240.0), 0.15)
    t = flight.grid.times_s[::10]
    rng = np.random.default_rng(0)
    spans = tuple(Stretch(40.0 * k + 15.0, 40.0 * k + 39.9) for k in range(6))
    velocity = Series(t, flight.path.v[::10] + 0.01 * rng.standard_normal(len(t)))
    record = Record(velocity, Series(flight.times_s, flight.commands), spans, lag_s=0.15)
    fit = refine(model, record, SURGE, wide_prior(vehicle, model))
    v = np.array([np.interp(span.end_s, flight.grid.times_s, flight.path.v) for span in spans])
    slope = 2.0 * 66.48 * np.abs(v) + 1.25
    count = len(t) / 240.0 * 24.9
    # The initial velocity of each stretch is unknown: it costs one time constant of 27.3 / slope twice over.
    J = np.stack([np.abs(v) * v, v, np.ones(6)], axis=1) / slope[:, None] * np.sqrt(count)
    expected = 0.01 * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    found = np.sqrt(np.diag(bound_of(fit, SURGE)))[:3]
    assert found == pytest.approx(expected, rel=0.12)


def test_a_trial_holds_every_coefficient_of_every_method(vehicle: Vehicle) -> None:
    flight = fly(model_of(vehicle, 0), SURGE, back_and_forth((4.0, 9.0, 13.0), 8.0, 64.0), 0.15)
    session = Session(vehicle)
    for event in events(flight, 0, "surge", DVL, np.random.default_rng(2), plateau_s=5.0):
        session.step(event)
    trial = trial_of(7, session.finalize(), truth_of(vehicle), lambda _motion, v: 66.48 * abs(v) * v + 1.25 * v)
    keys = {(one.coefficient, one.method) for one in trial.found}
    assert {("k_q", "output-error"), ("added_mass", "output-error"), ("k_q", "rls"), ("k_q", "plateaus")} <= keys
    assert all(one.bound > 0.0 for one in trial.found)
    refined = [one for one in trial.found if one.method == "output-error"]
    assert all(abs(one.error) < 4.0 * one.bound for one in refined)
    assert [one.share for one in trial.drag] == [0.25, 0.25, 0.5, 0.5, 1.0, 1.0]
    assert abs(trial.drag[-1].error) < 0.02


def test_the_true_gusts_count_in_the_bound_whatever_was_found(vehicle: Vehicle) -> None:
    flight = fly(model_of(vehicle, 0), SURGE, back_and_forth((4.0, 9.0, 13.0), 8.0, 64.0), 0.15)
    session = Session(vehicle)
    for event in events(flight, 0, "surge", DVL, np.random.default_rng(2)):
        session.step(event)
    fit = session.finalize().assessments[0].fit
    sigmas = [np.sqrt(np.diag(bound_of(fit, SURGE, thrust_s))) for thrust_s in (0.0, 4e-5, 4e-3)]
    assert np.all(sigmas[0] < sigmas[1])
    assert np.all(2.0 * sigmas[1] < sigmas[2])


def test_who_does_not_know_the_delays_knows_less_of_the_mass(vehicle: Vehicle) -> None:
    flight = fly(model_of(vehicle, 0), SURGE, back_and_forth((4.0, 9.0, 13.0), 8.0, 64.0), 0.15)
    session = Session(vehicle)
    for event in events(flight, 0, "surge", DVL, np.random.default_rng(2)):
        session.step(event)
    outcome = session.finalize()
    found = outcome.assessments[0]
    known = np.sqrt(np.diag(bound_of(found.fit, SURGE, 4e-5)))
    not_known = np.sqrt(np.diag(bound_of(found.fit, SURGE, 4e-5, delayed=found.budget.case.record)))
    assert not_known[:3] == pytest.approx(known[:3], rel=0.1)
    assert 1.5 * known[3] < not_known[3] < 5.0 * known[3]
    trial = trial_of(2, outcome, truth_of(vehicle), lambda _motion, v: 66.48 * abs(v) * v + 1.25 * v, thrust_s=4e-5)
    bounds = {one.method: one.bound for one in trial.found if one.coefficient == "added_mass"}
    assert bounds["output-error"] == pytest.approx(known[3])
    assert bounds["rls"] == pytest.approx(not_known[3])
    # The live estimate says what it does not know, and that is not much more than nobody could.
    live = next(one for one in trial.found if (one.coefficient, one.method) == ("added_mass", "rls"))
    assert abs(live.error) < 2.0 * live.std
    assert live.std < 2.5 * live.bound
