"""The regression without derivatives: exact identity without noise, whatever the filter does."""

from __future__ import annotations

import numpy as np
import pytest
from synthetic_runs import STEP_S, Flight, back_and_forth, fly

from hindrax_ident.arrays import Array
from hindrax_ident.model.motion_model import Model
from hindrax_ident.online.filtered_regression import FilteredRegression, Sample, physical, scaled
from hindrax_ident.online.rls import Rls

THETA = np.array([66.48, 1.25, 0.3, 27.3])
ROLL = np.array([1.29, 0.05, 0.02, 3.0, 0.733])
HEAVE = np.array([93.52, 5.26, 56.57, 11.84, 0.7845, 37.7])


def rows(
    model: Model, flight: Flight, lag: float, *, rate: float = 1.0, wander: bool = False, every: int = 4
) -> list[Sample]:
    """Every row of the regression over a flight seen without noise, every 20 ms or so."""
    regression = FilteredRegression(model, lag, rate)
    commands = list(zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True))
    out = []
    for k in range(0, len(flight.path.v), every):
        t = float(flight.grid.times_s[k])
        while commands and commands[0][0] <= t:
            regression.thrust(*commands.pop(0))
        if model.restores:
            regression.position(t, float(flight.path.s[k]))
        sample = regression.velocity(t, float(flight.path.v[k]))
        if sample is not None:
            out.append(sample)
        if wander:
            regression.rate = 1.0 + 0.8 * np.sin(0.7 * t)
    return out


@pytest.mark.parametrize("wander", [False, True], ids=["fixed pole", "moving pole"])
@pytest.mark.parametrize(
    ("model", "theta", "levels"),
    [
        (Model(0, 15.22), THETA, (4.0, 12.0)),
        (Model(2, 15.22, split=True), HEAVE, (10.0, 30.0)),
        (Model(3, 0.483, restores=True), ROLL, (0.5, 1.2)),
    ],
    ids=["surge", "heave", "roll"],
)
def test_identity_holds_without_noise(model: Model, theta: Array, levels: tuple[float, float], wander: bool) -> None:
    flight = fly(model, theta, back_and_forth(levels, 4.0, 40.0), 0.15)
    q = scaled(theta.tolist(), np.eye(len(theta)))[0]
    samples = rows(model, flight, 0.15, wander=wander)
    errors = [sample.y - float(np.dot(sample.x, q)) for sample in samples]
    size = np.std([sample.y for sample in samples])
    assert np.abs(errors).max() < 2e-3 * size


def test_least_squares_on_it_gives_the_parameters_back() -> None:
    model = Model(0, 15.22)
    flight = fly(model, THETA, back_and_forth((4.0, 12.0), 6.0, 60.0), 0.15)
    rls = Rls([0.0] * 4, [1e6] * 4)
    for sample in rows(model, flight, 0.15):
        rls.update(sample.x, sample.y)
    theta, _ = physical(rls.values, rls.covariance)
    assert theta == pytest.approx(THETA, rel=2e-3, abs=2e-3)


def test_a_neglected_lag_shows_in_the_mass() -> None:
    model = Model(0, 15.22)
    flight = fly(model, THETA, back_and_forth((4.0, 12.0), 6.0, 60.0), 0.15)
    rls = Rls([0.0] * 4, [1e6] * 4)
    for sample in rows(model, flight, 0.0):
        rls.update(sample.x, sample.y)
    assert physical(rls.values, rls.covariance)[0][-1] > 29.0


def test_samples_say_when_the_start_is_forgotten() -> None:
    model = Model(0, 15.22)
    flight = fly(model, THETA, back_and_forth((4.0,), 6.0, 12.0), 0.15)
    samples = rows(model, flight, 0.15, rate=2.0)
    settled = [sample.settled for sample in samples]
    # exp(-2 t) falls below 0.05 after 1.5 s, which is sample 75 at 50 Hz.
    assert settled == sorted(settled)
    assert settled.index(True) == pytest.approx(75, abs=1)


def test_asynchronous_thrust_and_velocity_make_no_difference() -> None:
    model = Model(0, 15.22)
    plan = back_and_forth((4.0, 12.0), 5.0, 30.0)
    flight = fly(model, THETA, plan, 0.15)
    q = scaled(THETA.tolist(), np.eye(4))[0]
    rng = np.random.default_rng(2)
    index = np.flatnonzero(rng.random(len(flight.path.v)) < 0.15)
    regression = FilteredRegression(model, 0.15, 1.0)
    commands = list(zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True))
    errors = []
    for k in index.tolist():
        t = float(flight.grid.times_s[k])
        while commands and commands[0][0] <= t:
            regression.thrust(*commands.pop(0))
        sample = regression.velocity(t, float(flight.path.v[k]))
        if sample is not None:
            errors.append(sample.y - float(np.dot(sample.x, q)))
    assert np.abs(errors).max() < 3e-3


def test_scaling_and_back_changes_nothing() -> None:
    C = np.diag([4.0, 0.1, 0.01, 0.2]) + 0.01
    theta, covariance = physical(*[part if k else part.tolist() for k, part in enumerate(scaled(THETA.tolist(), C))])
    assert theta == pytest.approx(THETA)
    assert covariance == pytest.approx(C)


def test_at_rest_the_sign_of_the_noise_gives_neither_direction_a_speed() -> None:
    model, rng = Model(2, 15.22, split=True), np.random.default_rng(6)
    regression = FilteredRegression(model, 0.15, 1.0)
    regression.noise_variance = 1e-4
    regression.thrust(0.0, HEAVE[4])
    samples = [regression.velocity(0.1 * k, v) for k, v in enumerate(0.01 * rng.standard_normal(600))]
    speeds = np.mean([sample.x[:4] for sample in samples[100:]], axis=0)
    # By its own sign each direction would be at 0.01 / sqrt(2 pi) = 0.004 m/s.
    assert np.abs(speeds[[1, 3]]).max() < 0.0015
    assert np.abs(speeds[[0, 2]]).max() < 2e-5


def test_means_over_a_span_are_compared_with_means_of_the_thrust() -> None:
    model, span_s = Model(0, 15.22), 0.2
    flight = fly(model, THETA, back_and_forth((4.0, 12.0), 2.0, 60.0), 0.15)
    means = np.diff(flight.path.s[:: round(span_s / STEP_S)]) / span_s

    def mass(spread_s2: float) -> float:
        regression, rls = FilteredRegression(model, 0.15, 1.0), Rls([0.0] * 4, [1e6] * 4)
        commands = list(zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True))
        for k, v in enumerate(means.tolist()):
            t = (k + 0.5) * span_s
            while commands and commands[0][0] <= t:
                regression.thrust(*commands.pop(0))
            sample = regression.velocity(t, v, spread_s2)
            if sample is not None and sample.settled:
                rls.update(sample.x, sample.y)
        return float(physical(rls.values, rls.covariance)[0][-1])

    assert abs(mass(span_s**2 / 12.0) - THETA[3]) < 0.4 * abs(mass(0.0) - THETA[3])
