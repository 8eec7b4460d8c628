"""Live bands hold whatever the thrusters' lag and the latency of the velocities are: nobody has to know either."""

import math

import numpy as np
import pytest

from hindrax_core.events import Stamped, after
from hindrax_core.signals import Attitude, IdentEvent, Velocity
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.results import truth_of
from hindrax_ident.model.model_parameters import wide_prior
from hindrax_ident.model.motion_model import model_of, motions_of
from hindrax_ident.online.axis_session import AxisSession
from hindrax_ident.online.filtered_regression import found_delays
from hindrax_ident.online.session import Session
from hindrax_ident.records.feed import Feed
from hindrax_ident.testing.synthetic_runs import back_and_forth, events, fly, sensors_of

LEVELS = ((3.2, 6.0, 13.5), (4.0, 9.0, 20.0), (5.0, 12.0, 30.0), (0.5, 0.9, 1.4), (0.6, 1.0, 1.7), (0.6, 1.2, 2.8))
DELAYS_S = ((0.05, 0.0), (0.12, 0.2), (0.25, 0.1))


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize(("lag_s", "latency_s"), DELAYS_S)
def test_live_bands_hold_for_every_delay_of_every_axis(
    vehicle: Vehicle, axis: int, lag_s: float, latency_s: float
) -> None:
    truth, model, motions = truth_of(vehicle), model_of(vehicle, axis), motions_of(axis)
    ends = (truth[motions[0].name], truth[motions[-1].name])[: 1 + model.split]
    drag = [one[name] for one in ends for name in ("k_q", "k_l")]
    flush = [ends[0]["k_r"]] if model.restores else []
    theta = np.array([*drag, ends[0]["b"], *flush, model.rigid + ends[0]["added_mass"]])
    flight = fly(model, theta, back_and_forth(LEVELS[axis], 5.0, 50.0), lag_s)
    received: list[Stamped[IdentEvent]] = [
        Stamped(after(one.stamp, latency_s), one.reading) if isinstance(one.reading, (Velocity, Attitude)) else one
        for one in events(flight, axis, motions[0].name, sensors_of(axis), np.random.default_rng(1))
    ]
    session = Session(vehicle, every_s=math.inf)
    for event in Feed(vehicle, session.tuning).all(sorted(received, key=lambda one: one.stamp)):
        session.step(event)
    found, covariance = session._axes[axis].estimator.estimate()
    sigmas = np.sqrt(np.diag(covariance))
    assert np.abs((found - theta) / sigmas).max() < 3.0
    # They are bands of a measurement: a prior is 60 to 100 %.
    assert sigmas[-1] < 0.4 * theta[-1]


def test_a_new_axis_begins_with_the_delays_of_the_vehicle_file(vehicle: Vehicle) -> None:
    model = model_of(vehicle, 5)
    estimator = AxisSession(vehicle, model, wide_prior(vehicle, model), Session(vehicle).tuning).estimator
    assert estimator.regression.lag_s == pytest.approx(0.15)


@pytest.mark.parametrize(("lag_s", "delay_s"), [(0.05, 0.0), (0.3, 0.0), (0.1, 0.07), (0.2, -0.04)])
def test_two_coefficients_give_lag_and_delay(lag_s: float, delay_s: float) -> None:
    # Taylor series of exp(-s d) (1 + s T) / (1 + s L) in u = s / (1 + s T), by differences on a circle about 0.
    T, n = 0.15, 64
    u = 0.5 * np.exp(2j * math.pi * np.arange(n) / n)
    s = u / (1.0 - u * T)
    series = np.fft.fft(np.exp(-s * delay_s) * (1.0 + s * T) / (1.0 + s * lag_s)) / n
    first, second = (float((series[order] / 0.5**order).real) for order in (1, 2))
    assert found_delays((first, second), T) == pytest.approx((lag_s, delay_s), abs=1e-6)
