"""Velocities that a filter has smoothed: its time constant is found and undone, and a slow thruster is no filter."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from hindrax_ident.arrays import Array, array
from hindrax_ident.fit import smoothing
from hindrax_ident.fit.delay import fit_with_delays
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.fit.smoothing import unsmoothed, with_smoothing
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import Model
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.testing.synthetic_runs import STEP_S, back_and_forth, fly

SURGE, THETA = Model(0, 15.22), array(np.array([66.48, 1.25, 0.0, 27.3]))
PRIOR = Prior(array(np.array([60.0, 2.0, 0.0, 25.0])), array(np.array([60.0, 30.0, 5.0, 30.0])))
DOUBT_S = 0.1
MEAN = round(1.0 / STEP_S) | 1
"""Samples of a moving mean."""


def smoothed(v: Array, step_s: float, time_s: float) -> Array:
    """Velocities (n,) behind a first-order filter that begins with the first."""
    kept, out = math.exp(-step_s / time_s) if time_s else 0.0, [float(v[0])]
    for one in v[1:].tolist():
        out.append(one + (out[-1] - one) * kept)
    return array(np.array(out))


def flown(
    smoothing: float | Callable[[Array], Array], lag_s: float, late_s: float = 0.0
) -> tuple[Record, OutputErrorFit]:
    """Record of 30 s at 5 Hz behind a filter (its time constant) or other smoothing, and its fit with lags alone."""
    flight = fly(SURGE, THETA, back_and_forth((4.0, 14.0), 5.0, 30.0), lag_s)
    v = (smoothed(flight.path.v, STEP_S, smoothing) if isinstance(smoothing, float) else smoothing(flight.path.v))[::40]
    t, noise = flight.grid.times_s[::40] + late_s, 0.002 * np.random.default_rng(2).standard_normal(len(v))
    record = Record(Series(t, array(v + noise)), Series(flight.times_s, flight.commands), (Stretch(0.5, 29.5),))
    return fit_with_delays(record, PRIOR.values, SURGE, PRIOR, DOUBT_S)


def moving_mean(v: Array) -> Array:
    return array(np.convolve(v, np.ones(MEAN) / MEAN, "same"))


def flat(v: Array) -> Array:
    """Savitzky and Golay: each the value of a cubic through its neighbors (1964), here over 2.5 s."""
    return array(signal.savgol_filter(v, round(2.5 / STEP_S) | 1, 3))


def both_ways(v: Array) -> Array:
    return array(signal.sosfiltfilt(signal.butter(2, 0.8, fs=1.0 / STEP_S, output="sos"), v))


def drag(fit: OutputErrorFit) -> float:
    """Share by which the drag at 0.4 m/s is off."""
    speeds = np.array([0.4**2, 0.4])
    return float(fit.theta[:2] @ speeds / (THETA[:2] @ speeds)) - 1.0


def test_a_filter_is_found_and_undone() -> None:
    """Six times the added mass was identified, and an inflow loss that was none."""
    filter_s = 1.0
    record, fit = flown(filter_s, 0.1)
    assert fit.theta[-1] > 1.2 * THETA[-1]
    found, better = with_smoothing(record, fit, SURGE, PRIOR, DOUBT_S)
    assert found.smoothing_s == pytest.approx(filter_s, rel=0.1)
    assert better.theta[-1] == pytest.approx(THETA[-1], rel=0.1)
    assert abs(drag(better)) < 0.03


@pytest.mark.parametrize(("smooth", "late_s"), [(moving_mean, 0.0), (moving_mean, 0.5), (flat, 0.0), (both_ways, 0.0)])
def test_a_mean_is_found_and_known_to_the_fit(smooth: Callable[[Array], Array], late_s: float) -> None:
    """Of a filter of 1 Hz forward and backward a drag 35 % too low was identified, with an inflow loss that was none.

    A latency makes it a mean of the past, as of a moving average that does not wait.
    """
    record, fit = flown(smooth, 0.1, late_s)
    found, better = with_smoothing(record, fit, SURGE, PRIOR, DOUBT_S)
    assert len(found.means) == (1 if smooth is moving_mean else 2)
    assert better.theta[-1] == pytest.approx(THETA[-1], rel=0.1)
    assert abs(drag(better)) < 0.03
    assert abs(better.theta[-1] - THETA[-1]) < abs(fit.theta[-1] - THETA[-1])


@pytest.mark.parametrize("lag_s", [0.1, 0.4])
def test_a_slow_thruster_is_no_filter(lag_s: float) -> None:
    record, fit = flown(0.0, lag_s)
    assert with_smoothing(record, fit, SURGE, PRIOR, DOUBT_S) == (record, fit)


def test_a_filter_without_which_the_body_could_not_be_is_a_doubt() -> None:
    """The velocities of a pilot are smoothed on all axes; those across make the fit of one too light."""
    record, fit = flown(1.0, 0.1)
    heavy = Model(0, 1.2 * THETA[-1])
    found, same = with_smoothing(record, fit, heavy, PRIOR, DOUBT_S)
    assert same == fit
    assert found.smoothing_s == 0.0
    assert found.filter_doubt_s == pytest.approx(1.0, rel=0.1)
    assert replace(found, filter_doubt_s=0.0) == record


def test_a_filter_that_explains_little_is_no_more_than_a_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    record, fit = flown(1.0, 0.1)
    monkeypatch.setattr(smoothing, "NEARER", 0.0)
    found, same = with_smoothing(record, fit, SURGE, PRIOR, DOUBT_S)
    assert (same, found.smoothing_s, found.filter_doubt_s) == (fit, 0.0, 0.0)
    assert found.filter_hint_s == 1.0
    monkeypatch.setattr(smoothing, "HINT", 0.0)
    assert with_smoothing(record, fit, SURGE, PRIOR, DOUBT_S) == (record, fit)


def test_what_a_filter_did_is_undone_exactly() -> None:
    v, step_s = array(np.random.default_rng(1).normal(size=50)), 0.1
    t = array(step_s * np.arange(50))
    record = Record(Series(t, smoothed(v, step_s, 0.7)), Series(t, v), ())
    assert unsmoothed(record, 0.7).velocity.y == pytest.approx(v)


def test_a_motion_that_the_thrust_does_not_explain_shows_no_smoothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pitch of a BlueROV2 that no thruster drives took 40 s each time, and had thrust that ramps."""
    flight = fly(SURGE, THETA, back_and_forth((4.0, 14.0), 5.0, 30.0), 0.4)
    t = flight.grid.times_s[::40]
    waves = 0.9 * np.sin(1.7 * t) + 0.02 * np.random.default_rng(4).standard_normal(len(t))
    still = array(0.3 * flight.path.v[::40] + waves)
    record = Record(Series(t, still), Series(flight.times_s, flight.commands), (Stretch(0.5, 29.5),))
    late, fit = fit_with_delays(record, PRIOR.values, SURGE, PRIOR, DOUBT_S)
    suspect = replace(late, lag_s=max(late.lag_s, smoothing.SUSPECT_LAG_S))
    tried: list[float] = []
    monkeypatch.setattr(smoothing, "search_delay", lambda *_arguments: tried.append(1.0))
    assert with_smoothing(suspect, fit, SURGE, PRIOR, DOUBT_S) == (suspect, fit)
    assert not tried
