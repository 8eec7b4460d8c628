"""Thrust that goes by another lag than it comes, or ramps: found, and known to the fit; a lag is neither."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit.delay import fit_with_delays
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.ramping_thrust import ramping
from hindrax_ident.fit.smoothing import with_smoothing
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import Model
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.testing.synthetic_runs import Plan, fly

SURGE, THETA = Model(0, 15.22), array(np.array([66.48, 1.25, 0.0, 27.3]))
PRIOR = Prior(array(np.array([60.0, 2.0, 0.0, 25.0])), array(np.array([60.0, 30.0, 5.0, 30.0])))
DOUBT_S, FINE_S, MOST_N = 0.1, 0.02, 14.0
NOTHING = Series(array(np.zeros(0)), array(np.zeros(0)))


def followed(commands: Array, comes_s: float, goes_s: float, rate_Nps: float = math.inf) -> Array:
    """Thrust (n,) every FINE_S that follows commands by lags that differ, or at a limited rate."""
    out, now = [], 0.0
    for one in commands.tolist():
        lag_s = goes_s if abs(one) < abs(now) or one * now < 0.0 else comes_s
        after = now + (one - now) * (1.0 - math.exp(-FINE_S / lag_s)) if lag_s else one
        now += max(-rate_Nps * FINE_S, min(rate_Nps * FINE_S, after - now))
        out.append(now)
    return array(np.array(out))


def flown(comes_s: float, goes_s: float, rate_Nps: float = math.inf) -> tuple[Record, OutputErrorFit]:
    """Record of 40 s at 5 Hz, with coasts, of a thrust whose commands alone are known, and its fit with lags alone."""
    plan = Plan(array(np.arange(0.0, 40.0, 3.3)), array(np.resize([1.0, 0.0, -1.0, 0.0, 0.4, -0.4], 13) * MOST_N), 40.0)
    t = array(np.arange(0.0, 40.0, FINE_S))
    commands = array(plan.forces[np.searchsorted(plan.times_s, t + 1e-9, side="right") - 1])
    real = Plan(t, followed(commands, comes_s, goes_s, rate_Nps), 40.0)
    flight = fly(SURGE, THETA, real, 0.0)
    v = flight.path.v[::40]
    noise = 0.002 * np.random.default_rng(2).standard_normal(len(v))
    record = Record(
        Series(flight.grid.times_s[::40], array(v + noise)), Series(plan.times_s, plan.forces), (Stretch(0.5, 39.5),)
    )
    return fit_with_delays(record, PRIOR.values, SURGE, PRIOR, DOUBT_S)


def drag(fit: OutputErrorFit) -> float:
    """Share by which the drag at 0.4 m/s is off."""
    speeds = np.array([0.4**2, 0.4])
    return float(fit.theta[:2] @ speeds / (THETA[:2] @ speeds)) - 1.0


def commanded(t: list[float], y: list[float]) -> Record:
    return Record(NOTHING, Series(array(np.array(t)), array(np.array(y))), ())


def force(record: Record, at_s: float) -> float:
    return float(record.thrust.y[np.searchsorted(record.thrust.t, at_s, side="right") - 1])


def test_thrust_that_ramps_has_one_rate() -> None:
    found = ramping(commanded([0.0, 1.0, 2.0], [0.0, 10.0, -10.0]), 0.5)
    assert found.ramps_s == 0.5
    assert force(found, 1.25) == pytest.approx(5.0, abs=0.7)
    assert force(found, 1.7) == 10.0
    assert force(found, 2.5) == pytest.approx(0.0, abs=0.7)
    assert force(found, 3.3) == pytest.approx(-10.0)


@pytest.mark.parametrize(("comes_s", "goes_s"), [(0.15, 0.6), (0.1, 0.15), (0.2, 0.4), (0.4, 0.15)])
def test_lags_that_differ_are_found_and_known_to_the_fit(comes_s: float, goes_s: float) -> None:
    """An added mass of 0 +- 1.7 kg for 8 was identified, and 27 % taken off the drag."""
    record, fit = flown(comes_s, goes_s)
    found, better = with_smoothing(record, fit, SURGE, PRIOR, DOUBT_S)
    goes_later_s, turns_later_s = found.later_s
    assert goes_later_s == pytest.approx(goes_s - comes_s, abs=0.06)
    assert turns_later_s == pytest.approx(goes_s - comes_s, abs=0.07)
    assert found.lag_s == pytest.approx(comes_s, abs=0.05)
    assert (found.smoothing_s, found.means, found.ramps_s) == (0.0, (), 0.0)
    assert abs(better.theta[-1] - THETA[-1]) < 0.03 * THETA[-1]
    assert abs(drag(better)) < 0.02


def test_thrust_that_ramps_is_found_and_known_to_the_fit() -> None:
    """Of 20 N/s an added mass of 0.5 +- 0.8 kg for 8 was identified."""
    record, fit = flown(0.05, 0.05, rate_Nps=MOST_N / 0.8)
    found, better = with_smoothing(record, fit, SURGE, PRIOR, DOUBT_S)
    assert found.ramps_s == pytest.approx(0.8, rel=0.15)
    assert (found.smoothing_s, found.means, found.later_s) == (0.0, (), (0.0, 0.0))
    assert abs(better.theta[-1] - THETA[-1]) < 0.03 * THETA[-1]
    assert abs(better.theta[-1] - THETA[-1]) < 0.5 * abs(fit.theta[-1] - THETA[-1])


@pytest.mark.parametrize("lag_s", [0.1, 0.25, 0.4])
def test_a_lag_alone_is_neither(lag_s: float) -> None:
    record, fit = flown(lag_s, lag_s)
    found, same = with_smoothing(record, fit, SURGE, PRIOR, DOUBT_S)
    assert (found.later_s, found.ramps_s) == ((0.0, 0.0), 0.0)
    assert (same, replace(found, filter_hint_s=0.0)) == (fit, record)
