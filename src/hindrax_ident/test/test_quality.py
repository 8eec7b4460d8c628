"""The verdict on a motion: every reason against it has its line, and the evidence is that of the record."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from synthetic_runs import Plan, back_and_forth, fly

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.prediction import Prediction
from hindrax_ident.assess.quality import (
    OTHER_LAW,
    Evidence,
    Excitation,
    Validation,
    excitation,
    held_out,
    reasons_against,
    validation,
    whiteness,
)
from hindrax_ident.assess.results import Contribution
from hindrax_ident.fit.output_error import OutputErrorFit, refine
from hindrax_ident.model.motion_model import model_of
from hindrax_ident.model.prior import Prior, wide_prior
from hindrax_ident.records.axis_record import Record, Series, Stretch

SURGE = np.array([66.48, 1.25, 0.0, 27.3])
DRAG_N = 66.48 * 0.45**2 + 1.25 * 0.45
WELL = Evidence(
    k=array(SURGE[:2]),
    covariance=array(np.diag([1.0, 0.1])),
    excitation=Excitation(0.1, 0.45, 30.0, 0.1, 0.3),
    effective_samples=200.0,
    noise=0.01,
    added_mass_sigmas=1.0,
    converged=True,
    validation=None,
    drag_std=0.5,
    largest=Contribution("current", 0.4, "wait until the water is still"),
    measured_speed=0.012,
    measurement_noise=0.01,
)


def judged(**changes: Any) -> list[str]:
    """Reasons against a result that is well, but for some changes of its evidence or excitation."""
    moved = {name: changes.pop(name) for name in ("high", "share_at_one_speed") if name in changes}
    return reasons_against(replace(WELL, excitation=replace(WELL.excitation, **moved), **changes))


def uncertain(k_q: float, k_l: float) -> Array:
    """Covariance of drag coefficients whose forces at 0.45 m/s are this uncertain, as a share of the drag."""
    return array(np.diag([(k_q * DRAG_N / 0.45**2) ** 2, (k_l * DRAG_N / 0.45) ** 2]))


def predicted(fit: float, excess: float) -> Validation:
    one = array(np.zeros(1))
    return Validation(Prediction(0, "m/s", one, one, one, one, one, np.zeros(1, int)), fit, excess)


@pytest.mark.parametrize(
    ("passed", "failed", "sentence"),
    [
        ({}, {"converged": False}, "the fit did not converge"),
        ({"effective_samples": 10.0}, {"effective_samples": 9.9}, "9.9 independent samples, wanted 10"),
        (
            {"drag_std": 0.199 * DRAG_N},
            {"drag_std": 0.21 * DRAG_N},
            "the drag at the highest speed is known to 21.0% only, wanted 20%, the gain",
        ),
        (
            {"current": 0.055},
            {"current": 0.06},
            "at speeds up to 0.45 m/s a current of 0.06 m/s changes the drag by 27%: k_q and k_l cannot be separated",
        ),
        (
            {"share_at_one_speed": 0.69},
            {"share_at_one_speed": 0.71},
            "71% of the motion was at nearly one speed: only the transients separate k_q from k_l",
        ),
        (
            {"covariance": uncertain(0.24, 0.24)},
            {"covariance": uncertain(0.26, 0.01)},
            "speeds of 0.1 to 0.45 m/s do not separate k_q from k_l (either is uncertain by 26% of the drag)",
        ),
        (
            {"covariance": uncertain(0.01, 0.24)},
            {"covariance": uncertain(0.01, 0.31)},
            "speeds of 0.1 to 0.45 m/s do not separate k_q from k_l (either is uncertain by 31% of the drag)",
        ),
        (
            {"k": array(np.array([-5.9, 40.0])), "covariance": array(np.diag([4.0, 0.1]))},
            {"k": array(np.array([-6.1, 40.0])), "covariance": array(np.diag([4.0, 0.1]))},
            "k_q is negative (-6.1 +- 2): other forces than drag act, or the thrust obeys another law than the record",
        ),
        (
            {"k": array(np.array([80.0, -2.0]))},
            {"k": array(np.array([80.0, -8.0]))},
            "k_l is negative (-8 +- 0.32): other forces than drag act, or the thrust obeys another law than the record",
        ),
        (
            {"k": array(np.array([80.0, -8.0])), "covariance": array(np.diag([1.0, 9.0]))},
            {"k": array(np.array([80.0, -8.0])), "covariance": array(np.diag([1.0, 4.0]))},
            "k_l is negative (-8 +- 2): other forces than drag act, or the thrust obeys another law than the record",
        ),
        (
            {"added_mass_sigmas": -2.9},
            {"added_mass_sigmas": -3.1},
            "the total mass is 3.1 standard deviations below the body's own: check the units of force and velocity,",
        ),
        (
            {"offset": 0.19 * DRAG_N},
            {"offset": 0.21 * DRAG_N},
            "a constant force of 2.9 N or more, 21% of the largest drag, acts as well: a current, the tether,",
        ),
        (
            {"validation": predicted(0.51, 1.6)},
            {"validation": predicted(0.49, 1.6)},
            "the held-out part of the run is predicted with a fit of only 49%",
        ),
        (
            {"validation": predicted(0.49, 1.4)},
            {"validation": predicted(0.49, 1.6)},
            "the held-out part of the run is predicted with a fit of only 49%",
        ),
    ],
)
def test_every_reason_against_a_result_has_its_line(
    passed: dict[str, Any], failed: dict[str, Any], sentence: str
) -> None:
    assert judged(**passed) == []
    (reason,) = judged(**failed)
    assert reason.startswith(sentence)


def test_a_turn_has_the_units_of_a_turn() -> None:
    (reason,) = judged(turns=True, covariance=uncertain(0.26, 0.01))
    assert reason.startswith("speeds of 0.1 to 0.45 rad/s do")
    (reason,) = judged(turns=True, k=array(-SURGE[:2]))
    assert reason.startswith("the drag at 0.45 rad/s is -14 N m,")


def test_a_drag_that_is_poorly_known_says_by_what_and_what_to_do() -> None:
    assert judged(drag_std=DRAG_N)[0].endswith("; most by current: wait until the water is still")


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"high": 0.009}, "it hardly moved: speed at most 0.012 m/s, no more than the noise of one measurement"),
        (
            {"high": 0.009, "measured_speed": 0.27},
            f"it moved at up to 0.27 m/s, and this force explains 0.009 m/s of it: {OTHER_LAW}",
        ),
        (
            {"k": array(-SURGE[:2])},
            "the drag at 0.45 m/s is -14 N, wanted above 0: check the sign of the wrench",
        ),
    ],
)
def test_without_motion_or_drag_nothing_else_is_judged_but_what_was_said_before(
    changes: dict[str, Any], sentence: str
) -> None:
    poor = {"drag_std": 100.0, "offset": 100.0, "effective_samples": 3.0, "converged": False}
    assert judged(**changes) == [sentence]
    assert judged(**poor, **changes) == ["the fit did not converge", "3.0 independent samples, wanted 10", sentence]


def runs(*spans: tuple[float, float]) -> tuple[Stretch, ...]:
    return tuple(Stretch(start_s, end_s, "surge", "plateau") for start_s, end_s in spans)


@pytest.mark.parametrize(
    ("stretches", "first", "last"),
    [
        (runs((10.0, 110.0)), runs((10.0, 85.0)), runs((85.0, 110.0))),
        (
            runs((0.0, 40.0), (50.0, 90.0), (100.0, 120.0)),
            runs((0.0, 40.0), (50.0, 85.0)),
            runs((85.0, 90.0), (100.0, 120.0)),
        ),
        (runs((0.0, 75.0), (80.0, 105.0)), runs((0.0, 75.0)), runs((80.0, 105.0))),
        (runs((0.0, 60.0), (361.0, 401.0)), runs((0.0, 60.0)), runs((361.0, 401.0))),
        (
            runs((0.0, 60.0), (359.0, 399.0)),
            runs((0.0, 60.0), (359.0, 374.0)),
            runs((374.0, 399.0)),
        ),
        (
            runs((0.0, 40.0), (1000.0, 1060.0)),
            runs((0.0, 40.0), (1000.0, 1035.0)),
            runs((1035.0, 1060.0)),
        ),
        (
            runs((0.0, 40.0), (1000.0, 1040.0), (2000.0, 2030.0), (2040.0, 2050.0)),
            runs((0.0, 40.0), (1000.0, 1040.0)),
            runs((2000.0, 2030.0), (2040.0, 2050.0)),
        ),
    ],
)
def test_the_last_run_of_several_or_the_last_quarter_of_the_time_is_held_out(
    stretches: tuple[Stretch, ...], first: tuple[Stretch, ...], last: tuple[Stretch, ...]
) -> None:
    assert held_out(stretches) == (first, last)


BACK_AND_FORTH = back_and_forth((13.0, 4.0), 10.0, 80.0)
AHEAD_ONLY = Plan(array(np.array([0.0])), array(np.array([13.0])), 20.0)


def fitted(
    vehicle: Vehicle, plan: Plan = BACK_AND_FORTH, *, color: float = 0.0
) -> tuple[Record, OutputErrorFit, Prior]:
    """Surge seen at 20 Hz with 5 mm/s of noise, colored or white."""
    model, rng = model_of(vehicle, 0), np.random.default_rng(3)
    flight, end_s = fly(model, SURGE, plan, 0.15), plan.end_s
    t, v = flight.grid.times_s[::10], flight.path.v[::10].copy()
    white, noise = 0.005 * rng.standard_normal(len(t)), 0.0
    for index, fresh in enumerate(white.tolist()):
        noise = color * noise + math.sqrt(1.0 - color * color) * fresh
        v[index] += noise
    thrust = Series(flight.times_s, flight.commands)
    record = Record(Series(t, v), thrust, (Stretch(0.0, end_s - 0.1),), lag_s=0.15)
    belief = wide_prior(vehicle, model)
    return record, refine(model, record, belief.values, belief), belief


def test_excitation_is_that_of_the_motion_and_of_each_direction(vehicle: Vehicle) -> None:
    _, fit, _ = fitted(vehicle)
    fast, slow = 0.433, 0.236  # where 66.48 v^2 + 1.25 v makes 13 N and 4 N
    both, ahead, back = (excitation(fit, side) for side in (0, 1, -1))
    for one in (both, ahead, back):
        assert one.high == pytest.approx(fast, rel=0.02)
        assert 0.0 < one.low < slow
    assert both.moving_s == pytest.approx(80.0, rel=0.05)
    assert ahead.moving_s + back.moving_s == pytest.approx(both.moving_s, abs=0.5)
    assert ahead.moving_s == pytest.approx(40.0, rel=0.1)
    assert both.share_at_one_speed == pytest.approx(0.45, abs=0.07)
    v, t = fit.linear.path.v, np.cumsum(fit.problem.grid.steps_s)
    assert both.acceleration == pytest.approx(np.sqrt(np.mean(np.gradient(v, t) ** 2)), rel=0.1)
    onward = fitted(vehicle, AHEAD_ONLY)[1]
    assert excitation(onward, 0).share_at_one_speed > 0.75
    never = excitation(onward, -1)
    assert (never.high, never.moving_s, never.share_at_one_speed) == (0.0, 0.0, 0.0)


def test_white_residuals_pass_for_white_and_colored_ones_do_not(vehicle: Vehicle) -> None:
    white, colored = (whiteness(fitted(vehicle, color=color)[1]) for color in (0.0, 0.9))
    assert white.autocorrelation[0] == colored.autocorrelation[0] == pytest.approx(1.0)
    assert np.abs(white.autocorrelation[1:]).max() < 0.1
    assert 0.5 * white.expected < white.statistic < 2.0 * white.expected


def test_a_record_of_the_model_is_predicted_and_one_that_changes_its_ways_is_not(vehicle: Vehicle) -> None:
    record, fit, belief = fitted(vehicle)
    found = validation(record, fit, belief)
    assert found is not None
    assert found.fit > 0.95
    assert found.excess == pytest.approx(1.0, abs=0.2)
    thrust = Series(record.thrust.t, array(np.where(record.thrust.t > 60.0, 1.6, 1.0) * record.thrust.y))
    changed = validation(replace(record, thrust=thrust), fit, belief)
    assert changed is not None
    assert changed.fit < 0.8
    assert changed.excess > 3.0
    assert validation(record.with_stretches((Stretch(0.0, 0.2),)), fit, belief) is None
    short = validation(record.with_stretches((Stretch(0.0, 30.0),)), fit, belief)
    assert short is not None
    assert short.prediction.t[-1] - short.prediction.t[0] == pytest.approx(7.5, abs=0.2)
