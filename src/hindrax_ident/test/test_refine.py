"""Output error: the bound is reached, the bands are honest, and what does not belong shows."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.output_error import OutputErrorFit, refine
from hindrax_ident.fit.output_error_problem import build_problem
from hindrax_ident.model.model_parameters import crossed, wide_prior
from hindrax_ident.model.motion_model import Model, model_of
from hindrax_ident.model.simulation import trajectory
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.testing.synthetic_runs import DVL, Flight, back_and_forth, events, fly

SURGE = np.array([66.48, 1.25, 0.0, 27.3])
PLAN = back_and_forth((3.2, 6.0, 9.5, 13.5), 10.0, 80.0)


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly(Model(0, 15.22), SURGE, PLAN, 0.15)


def record_of(flight: Flight, seed: int, *, velocity: Callable[[Array, Array], Array] | None = None) -> Record:
    inputs = list(events(flight, 0, "surge", DVL, np.random.default_rng(seed)))
    pairs = [(one.stamp / 1e9, one.reading.nu[0]) for one in inputs if hasattr(one.reading, "nu")]
    t, v = (np.array(part) for part in zip(*pairs, strict=True))
    v = v if velocity is None else velocity(t, v)
    return Record(Series(t, v), Series(flight.times_s, flight.commands), (Stretch(0.0, 80.0),), lag_s=0.15)


def fit(vehicle: Vehicle, record: Record) -> OutputErrorFit:
    model = model_of(vehicle, 0)
    return refine(model, record, np.array([50.0, 5.0, 0.1, 30.0]), wide_prior(vehicle, model))


def test_bands_cover_and_the_bound_is_reached(vehicle: Vehicle, flight: Flight) -> None:
    fits = [fit(vehicle, record_of(flight, seed)) for seed in range(24)]
    errors = np.array([one.theta - SURGE for one in fits])
    sigmas = np.array([np.sqrt(np.diag(one.covariance)) for one in fits])
    assert np.abs(errors / sigmas).max() < 4.5
    covered = np.mean(np.abs(errors) < 1.96 * sigmas)
    assert 0.88 <= covered <= 0.995
    # The reported sigma is the Cramer-Rao bound for noise of 10 mm/s and rounding to 1 mm in 50 ms.
    noise = np.hypot(0.01, 0.02 / np.sqrt(12.0))
    bound = np.sqrt(np.diag(np.linalg.inv(fits[0].linear.information * fits[0].noise.velocity / noise**2)))
    assert sigmas.mean(axis=0) == pytest.approx(bound, rel=0.1)
    ratio = np.sqrt(np.mean(errors**2, axis=0)) / bound
    assert np.all(ratio < 1.5)


def moving_across(flight: Flight, fastest_mps: float, k_w: float) -> tuple[Record, Series]:
    """A record of a body that also moves across, and its speed across."""
    across = fastest_mps * np.sin(0.9 * flight.grid.times_s + 0.2)
    model, theta = Model(0, 15.22, crossed=True), np.insert(SURGE, 3, k_w)
    path = trajectory(model, theta, replace(flight.grid, across=np.abs(across)), flight.path)
    assert path is not None
    rng, every = np.random.default_rng(4), 10
    t = array(flight.grid.times_s[::every])
    sway = Series(t, array(across[::every] + 0.01 * rng.standard_normal(len(t))))
    record = Record(
        Series(t, path.v[::every] + 0.01 * rng.standard_normal(len(t))),
        Series(flight.times_s, flight.commands),
        (Stretch(0.0, 80.0),),
        across=Series(t, array(np.abs(sway.y))),
        lag_s=0.15,
    )
    return record, sway


def test_drag_by_the_speed_across_is_not_taken_for_that_along(vehicle: Vehicle, flight: Flight) -> None:
    record, sway = moving_across(flight, 0.35, SURGE[0])
    middle = sway.t[20:-20]
    assert record.speed_across(middle) == pytest.approx(np.abs(0.35 * np.sin(0.9 * middle + 0.2)), abs=0.05)
    plain_model = model_of(vehicle, 0)
    theta, C = np.array([50.0, 5.0, 0.1, 30.0]), np.diag([4.0, 3.0, 2.0, 1.0])
    model, prior, online = crossed(vehicle, plain_model, wide_prior(vehicle, plain_model), {"rls": (theta, C)})
    same = wide_prior(vehicle, model)
    assert (prior.values.tolist(), prior.sigmas.tolist()) == (same.values.tolist(), same.sigmas.tolist())
    assert online["rls"][0].tolist() == [50.0, 5.0, 0.1, 0.0, 30.0]
    assert np.diag(online["rls"][1]).tolist() == [4.0, 3.0, 2.0, prior.sigmas[3] ** 2, 1.0]
    found = refine(model, record, prior.values, prior)
    sigma = np.sqrt(np.diag(found.covariance))
    assert np.abs((found.theta - np.insert(SURGE, 3, SURGE[0])) / sigma).max() < 3.0
    assert sigma[0] < 0.1 * SURGE[0]
    # The drag at 0.4 m/s without it: off by more than a tenth, and sure of it.
    gradient = np.array([0.16, 0.4])
    plain = fit(vehicle, record)
    off, spread = gradient @ (plain.theta - SURGE)[:2], np.sqrt(gradient @ plain.covariance[:2, :2] @ gradient)
    assert off > 0.1 * gradient @ SURGE[:2]
    assert off > 4.0 * spread


def test_where_the_water_has_no_drag_by_the_speed_across_none_is_found(vehicle: Vehicle, flight: Flight) -> None:
    """As in most simulators, whose drag is that of each axis alone."""
    record, _ = moving_across(flight, 0.35, 0.0)
    model = replace(model_of(vehicle, 0), crossed=True)
    prior = wide_prior(vehicle, model)
    found = refine(model, record, prior.values, prior)
    sigma = np.sqrt(np.diag(found.covariance))
    assert np.abs((found.theta - np.insert(SURGE, 3, 0.0)) / sigma).max() < 3.0
    assert sigma[3] < 0.3 * SURGE[0]


def test_how_much_a_record_moves_across(flight: Flight) -> None:
    record, sway = moving_across(flight, 0.35, SURGE[0])
    along = float(np.mean(record.velocity.y**2))
    assert record.crossing() == pytest.approx(0.5 * 0.35**2 / along, rel=0.15)
    assert replace(record, across=Series(sway.t[:0], sway.y[:0])).crossing() == 0.0
    resting = Series(sway.t, array(np.zeros(len(sway.t))))
    assert replace(record, velocity=resting).crossing() == 0.0


def test_the_start_does_not_matter(vehicle: Vehicle, flight: Flight) -> None:
    model, record = model_of(vehicle, 0), record_of(flight, 3)
    prior = wide_prior(vehicle, model)
    near, far = (
        refine(model, record, np.array(start), prior) for start in ([66.0, 1.0, 0.0, 27.0], [20.0, 20.0, 2.0, 60.0])
    )
    sigma = np.sqrt(np.diag(near.covariance))
    assert np.abs((near.theta - far.theta) / sigma).max() < 1e-2


def test_same_record_gives_the_same_bits(vehicle: Vehicle, flight: Flight) -> None:
    first, second = (fit(vehicle, record_of(flight, 3)) for _ in range(2))
    assert first.theta.tobytes() == second.theta.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()


def test_outliers_are_left_out(vehicle: Vehicle, flight: Flight) -> None:
    def spoil(_: Array, v: Array) -> Array:
        v = v.copy()
        v[::40] += np.where(np.arange(len(v[::40])) % 2, 0.5, -0.4)
        return v

    clean, spoiled = fit(vehicle, record_of(flight, 5)), fit(vehicle, record_of(flight, 5, velocity=spoil))
    sigma = np.sqrt(np.diag(clean.covariance))
    assert np.abs((spoiled.theta - clean.theta) / sigma).max() < 1.5
    assert spoiled.samples == len(record_of(flight, 5).velocity) - 40


def test_slow_errors_of_the_velocity_widen_the_band(vehicle: Vehicle, flight: Flight) -> None:
    def wander(t: Array, v: Array) -> Array:
        return v + 0.01 * np.sin(0.7 * t) + 0.008 * np.sin(0.23 * t + 1.0)

    clean, wandering = fit(vehicle, record_of(flight, 5)), fit(vehicle, record_of(flight, 5, velocity=wander))
    assert np.sqrt(wandering.covariance[0, 0]) > 2.0 * np.sqrt(clean.covariance[0, 0])
    assert abs(wandering.theta[0] - 66.48) < 3.0 * np.sqrt(wandering.covariance[0, 0])


def test_what_is_reported_beforehand_has_an_error_too(vehicle: Vehicle, flight: Flight) -> None:
    model, white = model_of(vehicle, 0), np.random.default_rng(1)
    record = record_of(
        flight, 5, velocity=lambda t, v: v + np.convolve(white.standard_normal(len(t)), [0.01] * 4, "same")
    )
    prior = wide_prior(vehicle, model)
    prior.values[0], prior.sigmas[0] = SURGE[0], 0.02
    reported = refine(model, record, SURGE, prior)
    assert reported.covariance[0, 0] ** 0.5 == pytest.approx(0.02, rel=0.05)


def test_a_drag_of_another_form_widens_the_band(vehicle: Vehicle) -> None:
    # What drags like |v|^2.6 is not k_q |v| v + k_l v: blocks of different speed disagree.
    model = Model(0, 15.22)

    class Other(Model):
        def columns(self, v: Array, position: Array, across: Array | float = 0.0) -> Array:
            table = super().columns(v, position, across)
            table[:, 0] = np.abs(v) ** 1.6 * v * 2.0
            return table

    flight = fly(Other(0, 15.22), SURGE, PLAN, 0.15)
    found = fit(vehicle, record_of(flight, 2))
    assert np.sqrt(found.covariance[0, 0]) > 0.8
    assert model.names == found.model.names


def test_too_few_samples_are_refused(vehicle: Vehicle) -> None:
    short = Record(
        Series(np.linspace(0.0, 0.2, 5, dtype=np.float64), np.zeros(5)),
        Series(np.zeros(1), np.zeros(1)),
        (Stretch(0.0, 1.0),),
    )
    with pytest.raises(ValueError, match="enough samples"):
        build_problem(model_of(vehicle, 0), short)
