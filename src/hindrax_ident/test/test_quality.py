"""The verdict on a motion: every reason against it has its line, and the evidence is that of the record."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.objections import Code, Objection, objection
from hindrax_ident.assess.prediction import Prediction
from hindrax_ident.assess.quality import (
    Evidence,
    Excitation,
    Validation,
    excitation,
    held_out,
    measured_speed,
    measurement_noise,
    reasons_against,
    validation,
    whiteness,
)
from hindrax_ident.assess.results import Contribution
from hindrax_ident.fit.output_error import OutputErrorFit, refine
from hindrax_ident.model.model_parameters import Prior, wide_prior
from hindrax_ident.model.motion_model import axis_units, model_of
from hindrax_ident.model.simulation import Grid, Trajectory
from hindrax_ident.records.axis_record import Record, Series, Stretch, side_of
from hindrax_ident.testing.synthetic_runs import Plan, back_and_forth, fly

SURGE = np.array([66.48, 1.25, 0.0, 27.3])
DRAG_N = 66.48 * 0.45**2 + 1.25 * 0.45
WELL = Evidence(
    k=array(SURGE[:2]),
    covariance=array(np.diag([1.0, 0.1])),
    excitation=Excitation(0.1, 0.45, 0.3),
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


def judged(**changes: Any) -> list[Objection]:
    """Reasons against a result that is well, but for some changes of its evidence or excitation."""
    moved = {name: changes.pop(name) for name in ("high", "share_at_one_speed") if name in changes}
    return reasons_against(replace(WELL, excitation=replace(WELL.excitation, **moved), **changes))


def uncertain(k_q: float, k_l: float) -> Array:
    """Covariance of drag coefficients whose forces at 0.45 m/s are this uncertain, as a share of the drag."""
    return array(np.diag([(k_q * DRAG_N / 0.45**2) ** 2, (k_l * DRAG_N / 0.45) ** 2]))


def predicted(fit: float, excess: float) -> Validation:
    one = array(np.zeros(1))
    return Validation(Prediction(0, "m/s", one, one, one, one, one, np.zeros(1, int)), fit, excess)


LEAST_SHARE = {"wanted": 0.2, "influence": "current", "remedy": "wait until the water is still"}


@pytest.mark.parametrize(
    ("passed", "failed", "code", "numbers"),
    [
        ({}, {"converged": False}, Code.NOT_CONVERGED, {}),
        (
            {"effective_samples": 10.0},
            {"effective_samples": 9.9},
            Code.FEW_SAMPLES,
            {"found": 9.9, "wanted": 10.0},
        ),
        (
            {"drag_std": 0.199 * DRAG_N},
            {"drag_std": 0.21 * DRAG_N},
            Code.POORLY_KNOWN_DRAG,
            {"share": pytest.approx(0.21), **LEAST_SHARE},
        ),
        (
            {"drag_std": 0.199 * DRAG_N},
            {"drag_std": 9e10 * DRAG_N},
            Code.UNKNOWN_DRAG,
            {"share": pytest.approx(9e10), **LEAST_SHARE},
        ),
        (
            {"current": 0.055},
            {"current": 0.06},
            Code.CURRENT,
            {"speed": 0.45, "unit": "m/s", "current": 0.06, "share": pytest.approx(0.2667, rel=1e-3)},
        ),
        ({"share_at_one_speed": 0.69}, {"share_at_one_speed": 0.71}, Code.ONE_SPEED, {"share": 0.71}),
        (
            {"covariance": uncertain(0.24, 0.24)},
            {"covariance": uncertain(0.26, 0.01)},
            Code.NOT_SEPARATED,
            {"low": 0.1, "high": 0.45, "unit": "m/s", "share": pytest.approx(0.26)},
        ),
        (
            {"covariance": uncertain(0.01, 0.24)},
            {"covariance": uncertain(0.01, 0.31)},
            Code.NOT_SEPARATED,
            {"low": 0.1, "high": 0.45, "unit": "m/s", "share": pytest.approx(0.31)},
        ),
        (
            {"k": array(np.array([-5.9, 40.0])), "covariance": array(np.diag([4.0, 0.1]))},
            {"k": array(np.array([-6.1, 40.0])), "covariance": array(np.diag([4.0, 0.1]))},
            Code.NEGATIVE_DRAG,
            {"name": "k_q", "shown": "-6.1 +- 2.0"},
        ),
        (
            {"k": array(np.array([80.0, -2.0]))},
            {"k": array(np.array([80.0, -8.0]))},
            Code.NEGATIVE_DRAG,
            {"name": "k_l", "shown": "-8.00 +- 0.32"},
        ),
        (
            {"k": array(np.array([80.0, -8.0])), "covariance": array(np.diag([1.0, 9.0]))},
            {"k": array(np.array([80.0, -8.0])), "covariance": array(np.diag([1.0, 4.0]))},
            Code.NEGATIVE_DRAG,
            {"name": "k_l", "shown": "-8.0 +- 2.0"},
        ),
        ({"added_mass_sigmas": -2.9}, {"added_mass_sigmas": -3.1}, Code.MASS_BELOW_BODY, {"sigmas": 3.1}),
        (
            {"offset": 0.19 * DRAG_N},
            {"offset": 0.21 * DRAG_N},
            Code.CONSTANT_FORCE,
            {"force_N": 0.21 * DRAG_N, "share": pytest.approx(0.21)},
        ),
        (
            {"validation": predicted(0.51, 1.6)},
            {"validation": predicted(0.49, 1.6)},
            Code.POOR_PREDICTION,
            {"fit": 0.49},
        ),
        (
            {"validation": predicted(0.49, 1.4)},
            {"validation": predicted(0.49, 1.6)},
            Code.POOR_PREDICTION,
            {"fit": 0.49},
        ),
    ],
)
def test_every_reason_against_a_result_has_its_limit(
    passed: dict[str, Any], failed: dict[str, Any], code: Code, numbers: dict[str, object]
) -> None:
    assert judged(**passed) == []
    (reason,) = judged(**failed)
    assert (reason.code, reason.numbers) == (code, numbers)


def test_a_turn_has_the_units_of_a_turn() -> None:
    (reason,) = judged(units=axis_units(5), covariance=uncertain(0.26, 0.01))
    assert (reason.code, reason.numbers["unit"]) == (Code.NOT_SEPARATED, "rad/s")
    (reason,) = judged(units=axis_units(5), k=array(-SURGE[:2]))
    assert (reason.code, reason.numbers["unit"], reason.numbers["force_unit"]) == (Code.NO_DRAG, "rad/s", "N m")


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"high": 0.009}, objection(Code.HARDLY_MOVED, speed=0.012, unit="m/s")),
        (
            {"high": 0.009, "measured_speed": 0.27},
            objection(Code.UNEXPLAINED_MOTION, speed=0.27, unit="m/s", explained=0.009),
        ),
        (
            {"k": array(-SURGE[:2])},
            objection(Code.NO_DRAG, speed=0.45, unit="m/s", drag=-DRAG_N, force_unit="N"),
        ),
    ],
)
def test_without_motion_or_drag_nothing_else_is_judged_but_what_was_reported_before(
    changes: dict[str, Any], expected: Objection
) -> None:
    poor = {"drag_std": 100.0, "offset": 100.0, "effective_samples": 3.0, "converged": False}
    (reason,) = judged(**changes)
    assert (reason.code, reason) == (expected.code, expected)
    codes = [one.code for one in judged(**poor, **changes)]
    assert codes == [Code.NOT_CONVERGED, Code.FEW_SAMPLES, expected.code]


def runs(*spans: tuple[float, float]) -> tuple[Stretch, ...]:
    return tuple(Stretch(start_s, end_s) for start_s, end_s in spans)


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
        (
            runs((10.0, 50.0), (60.0, 100.0), (100.0, 120.0)),
            runs((10.0, 50.0), (60.0, 95.0)),
            runs((95.0, 100.0), (100.0, 120.0)),
        ),
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
    prior = wide_prior(vehicle, model)
    return record, refine(model, record, prior.values, prior), prior


def test_excitation_is_that_of_the_motion_and_of_each_direction(vehicle: Vehicle) -> None:
    _, fit, _ = fitted(vehicle)
    fast, slow = 0.433, 0.236  # where 66.48 v^2 + 1.25 v makes 13 N and 4 N
    both, ahead, back = (excitation(fit, side) for side in (0, 1, -1))
    for one in (both, ahead, back):
        assert one.high == pytest.approx(fast, rel=0.02)
        assert 0.0 < one.low < slow
    assert both.share_at_one_speed == pytest.approx(0.45, abs=0.07)
    onward = fitted(vehicle, AHEAD_ONLY)[1]
    assert excitation(onward, 0).share_at_one_speed > 0.75
    never = excitation(onward, -1)
    assert (never.high, never.share_at_one_speed) == (0.0, 0.0)


def test_white_residuals_pass_for_white_and_colored_ones_do_not(vehicle: Vehicle) -> None:
    white, colored = (whiteness(fitted(vehicle, color=color)[1]) for color in (0.0, 0.9))
    assert white.autocorrelation[0] == colored.autocorrelation[0] == pytest.approx(1.0)
    assert np.abs(white.autocorrelation[1:]).max() < 0.1
    assert 0.5 * white.expected < white.statistic < 2.0 * white.expected


def test_a_record_of_the_model_is_predicted_and_one_that_changes_its_ways_is_not(vehicle: Vehicle) -> None:
    record, fit, prior = fitted(vehicle)
    found = validation(record, fit, prior)
    assert found is not None
    assert found.fit > 0.95
    assert found.excess == pytest.approx(1.0, abs=0.2)
    thrust = Series(record.thrust.t, array(np.where(record.thrust.t > 60.0, 1.6, 1.0) * record.thrust.y))
    changed = validation(replace(record, thrust=thrust), fit, prior)
    assert changed is not None
    assert changed.fit < 0.8
    assert changed.excess > 3.0
    assert validation(record.with_stretches((Stretch(0.0, 0.2),)), fit, prior) is None
    short = validation(record.with_stretches((Stretch(0.0, 30.0),)), fit, prior)
    assert short is not None
    assert short.prediction.t[-1] - short.prediction.t[0] == pytest.approx(9.95, abs=0.2), "shorter than a window"


def flown(fit: OutputErrorFit, v: list[float], step_s: float = 0.1) -> OutputErrorFit:
    """The fit as if it had moved like that."""
    times, starts = step_s * np.arange(len(v)), np.arange(len(v)) == 0
    grid = Grid(array(times), starts, array(np.zeros(len(v))))
    path = Trajectory(array(np.array(v)), array(np.zeros(len(v))))
    return replace(fit, problem=replace(fit.problem, grid=grid), linear=replace(fit.linear, path=path))


@pytest.fixture(scope="module")
def ahead(vehicle: Vehicle) -> OutputErrorFit:
    return fitted(vehicle, AHEAD_ONLY)[1]


def test_excitation_counted_by_hand(ahead: OutputErrorFit) -> None:
    """Speeds from 0 to 1 m/s in steps of a hundredth, of which those above 0.098 m/s count."""
    speeds = [0.01 * k for k in range(101)]
    found = excitation(flown(ahead, speeds), 0)
    assert (found.low, found.high) == pytest.approx((0.1 + 0.05 * 0.9, 0.98))
    # From 0.82 to 1 m/s is within a tenth of 0.91 m/s: 19 of 91.
    assert found.share_at_one_speed == pytest.approx(19 / 91)
    assert excitation(flown(ahead, [-v for v in speeds]), -1) == found
    assert excitation(flown(ahead, [-v for v in speeds]), 0) == found
    brief = excitation(flown(ahead, speeds, 0.001), 0)
    assert brief.share_at_one_speed == pytest.approx(19 / 91)
    still = excitation(flown(ahead, [0.0] * 5), 0)
    assert (still.low, still.high, still.share_at_one_speed) == (0.0, 0.0, 0.0)


def test_a_share_at_one_speed_is_of_the_time_not_of_the_samples(ahead: OutputErrorFit) -> None:
    fit = flown(ahead, [1.0, 1.0, 0.5, 0.5, 1.0])
    times = array(np.array([0.0, 1.0, 1.2, 1.4, 1.6]))
    grid = replace(fit.problem.grid, times_s=times)
    found = excitation(replace(fit, problem=replace(fit.problem, grid=grid)), 0)
    assert found.share_at_one_speed == pytest.approx(1.2 / 1.6)


def seen(v: list[float]) -> Record:
    series = Series(array(0.5 * np.arange(len(v))), array(np.array(v)))
    thrust = Series(array(np.zeros(1)), array(np.zeros(1)))
    return Record(series, thrust, (Stretch(0.0, 0.5 * len(v)),))


def test_the_speed_in_a_record_is_of_its_means_and_of_its_direction() -> None:
    """Means over half a second of 0.01 m/s, 0.02 m/s and so on, alternating."""
    velocities = [0.02 * (k // 2) * (1.0 if k % 4 < 2 else -1.0) for k in range(204)]
    record = seen(velocities)
    means = 0.5 * (np.array(velocities[1:-1]) + np.array(velocities[:-2]))
    for side, own in ((0, np.abs(means)), (1, np.maximum(0.0, means)), (-1, np.maximum(0.0, -means))):
        assert measured_speed(record, side) == pytest.approx(float(np.percentile(own, 98.0)))
    assert measured_speed(seen([-0.3] * 9), 1) == 0.0
    assert measured_speed(seen([-0.3] * 9), -1) == pytest.approx(0.3)
    assert measured_speed(record.with_stretches(()), 0) == 0.0


def test_an_axis_that_moves_for_a_hundredth_of_a_record_has_its_speeds(ahead: OutputErrorFit) -> None:
    """By the percentile of the whole it would be at rest, and hardly have moved."""
    brief = [0.0] * 900 + [0.4] * 5 + [-0.3] * 5
    assert excitation(flown(ahead, brief), 0).high == pytest.approx(0.4)
    assert excitation(flown(ahead, brief), -1).high == pytest.approx(0.3)
    assert measured_speed(seen(brief), 1) == pytest.approx(0.4)
    assert [side_of(seen(one)) for one in (brief, brief[:905], [-v for v in brief[:905]])] == [0, 1, -1]


def test_the_noise_of_a_velocity_is_that_of_its_changes() -> None:
    """A difference of two has twice the variance."""
    assert measurement_noise(seen([0.1, 0.3] * 40)) == pytest.approx(0.2 / math.sqrt(2.0), rel=1e-3)
    assert measurement_noise(seen([0.2 * k for k in range(9)])) == pytest.approx(0.0, abs=1e-12)
    assert measurement_noise(replace(seen([]), position=seen([0.0, 1.0, 5.0]).velocity)) == 0.0


def test_what_nobody_measured_is_no_evidence() -> None:
    plain = Evidence(
        WELL.k, WELL.covariance, WELL.excitation, 200.0, 0.01, 1.0, True, None, 0.5, WELL.largest,
    )  # fmt: skip
    assert (plain.current, plain.offset, plain.measured_speed, plain.measurement_noise) == (0.0,) * 4
    assert plain.units == ("m/s", "N")
    assert Excitation(0.1, 0.2).share_at_one_speed == 0.0


def test_a_small_drag_is_a_drag() -> None:
    """That of a small vehicle, known as well as a great one."""
    small: dict[str, Any] = {"covariance": array(WELL.covariance / 1e4), "drag_std": 0.005}
    assert judged(k=array(SURGE[:2] / 100.0), **small) == []
    (reason,) = judged(k=array(np.array([-0.1, 0.5])), **small)
    assert reason.startswith("k_q is negative (-0.100 +- 0.010)")
    (reason,) = judged(k=array(np.array([1.5, -0.1])), **small)
    assert reason.startswith("k_l is negative (-0.1000 +- 0.0032)")


def test_moving_at_twice_the_noise_of_a_velocity_is_no_motion() -> None:
    (hardly,), (moved,) = (judged(high=0.009, measured_speed=speed) for speed in (0.0199, 0.0201))
    assert hardly.startswith("it hardly moved: ")
    assert moved.startswith("it moved at up to 0.02 m/s")


def test_a_prediction_is_shown_in_windows_of_ten_seconds(vehicle: Vehicle) -> None:
    found = validation(*fitted(vehicle))
    assert found is not None
    assert found.prediction.windows == 2
    assert found.prediction.t[-1] - found.prediction.t[0] == pytest.approx(20.0, abs=0.1)


def test_without_motion_there_is_no_fit(ahead: OutputErrorFit, vehicle: Vehicle) -> None:
    rest = Record(
        Series(array(np.arange(0.0, 20.0, 0.1)), array(np.zeros(200))),
        Series(array(np.zeros(1)), array(np.zeros(1))), (Stretch(0.0, 20.0),),
    )  # fmt: skip
    found = validation(rest, ahead, wide_prior(vehicle, ahead.model))
    assert found is not None
    assert found.fit == 0.0


def test_depths_are_predicted_in_the_noise_of_depths(vehicle: Vehicle) -> None:
    model, rng = model_of(vehicle, 2), np.random.default_rng(3)
    theta = np.array([93.52, 5.26, 56.57, 11.84, 0.78, 37.7])
    flight = fly(model, theta, back_and_forth((20.0, 8.0), 4.0, 60.0), 0.15)
    t, s = flight.grid.times_s[::20], flight.path.s[::20]
    depth = Series(t, array(s + 0.002 * rng.standard_normal(len(t))))
    nothing, thrust = Series(array(np.zeros(0)), array(np.zeros(0))), Series(flight.times_s, flight.commands)
    record = Record(nothing, thrust, (Stretch(0.0, 59.0),), position=depth, lag_s=0.15)
    prior = wide_prior(vehicle, model)
    found = validation(record, refine(model, record, theta, prior), prior)
    assert found is not None
    assert found.excess == pytest.approx(1.0, abs=0.3)
    assert found.fit > 0.95
