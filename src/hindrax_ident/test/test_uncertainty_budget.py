"""What a budget says of its influences: bands, contributions, remedies and warnings, computed by hand beside it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from synthetic_runs import back_and_forth, fly

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.influences import GAIN, MODEL, RUN, Case, Influence
from hindrax_ident.assess.uncertainty_budget import ALL, ODDS, Budget, budget_of
from hindrax_ident.fit.output_error import refine
from hindrax_ident.fit.score_test import score
from hindrax_ident.model.motion_model import model_of
from hindrax_ident.model.prior import wide_prior
from hindrax_ident.model.simulation import sensitivities
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.tuning import Tuning

SURGE = np.array([66.48, 1.25, 0.0, 27.3])


def to_and_fro(case: Case) -> Array:
    """Impulses of a force that comes and goes every nine seconds, which no parameter can explain."""
    return array((case.steps_s * np.sin(0.7 * np.cumsum(case.steps_s)))[:, None])


CURRENT = Influence("current", "m/s", RUN, lambda _case: 0.5, lambda case: np.ones((len(case.v), 2)), "wait")
GAINS = Influence(
    "gain", "%", GAIN, lambda _case: 2.0, lambda case: np.ones((len(case.v), 1)), "weigh",
    drag=lambda _case, v: array(v[:, None] ** 2),
)  # fmt: skip
LAW = Influence("law", "N", MODEL, lambda _case: 0.1, to_and_fro, "wait")
SHIFTS = array(np.array([[1.0, 0.5, 2.0, -1.0], [0.2, -0.3, 0.4, 0.6]]))
MEAN = array(np.array([0.2, -0.5, -3.0, 1.5]))
COVARIANCE = array(
    np.array([[0.9, 0.1, 0.05, 0.2], [0.1, 0.8, -0.1, 0.0], [0.05, -0.1, 0.25, 0.02], [0.2, 0.0, 0.02, 0.16]])
)
COLUMNS = {RUN: [0, 1], GAIN: [2], MODEL: [3]}
MOMENT = array(COVARIANCE + np.outer(MEAN, MEAN))


@pytest.fixture(scope="module")
def case(vehicle: Vehicle) -> Case:
    model = model_of(vehicle, 0)
    flight = fly(model, SURGE, back_and_forth((4.0, 13.0), 8.0, 32.0), 0.15)
    t = flight.grid.times_s[::10]
    v = flight.path.v[::10] + 0.004 * np.random.default_rng(4).standard_normal(len(t))
    record = Record(Series(t, v), Series(flight.times_s, flight.commands), (Stretch(0.0, 31.9),), lag_s=0.15)
    belief = wide_prior(vehicle, model)
    return Case(vehicle, record, refine(model, record, belief.values, belief), Tuning())


@pytest.fixture
def budget(case: Case) -> Budget:
    return Budget(
        case=case,
        influences=(CURRENT, GAINS, LAW),
        sigmas=(0.5, 2.0, 0.1),
        rows=(slice(0, 2), slice(2, 3), slice(3, 4)),
        shifts=SHIFTS,
        mean=MEAN,
        covariance=COVARIANCE,
        evidence=array(np.zeros(3)),
        told=budget_of(case, ()).told,
    )


def sandwich(moment: Array, columns: list[int]) -> Array:
    kept = SHIFTS[:, columns]
    return array(kept @ moment[np.ix_(columns, columns)] @ kept.T)


@pytest.mark.parametrize("scopes", [(RUN,), (GAIN,), (RUN, MODEL), ALL])
def test_a_band_is_the_second_moment_of_what_its_scopes_do(budget: Budget, scopes: tuple[str, ...]) -> None:
    columns = [column for scope in (RUN, GAIN, MODEL) if scope in scopes for column in COLUMNS[scope]]
    assert budget.band(scopes) == pytest.approx(sandwich(MOMENT, columns))
    sensitivity = array(np.vstack([SHIFTS, SHIFTS[0] + SHIFTS[1]]))
    of_both = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    wanted = np.diag(of_both @ sandwich(MOMENT, columns) @ of_both.T)
    assert budget.variance(sensitivity, scopes) == pytest.approx(wanted)


def test_the_band_of_a_run_has_what_differs_in_each_and_what_this_one_shows_beyond_chance(budget: Budget) -> None:
    # The gain is six deviations from nothing, of which three may be chance; the law just under four; others less.
    beyond = [1.0 - (3.0 / 6.0) ** 2, 1.0 - (3.0 / 3.75) ** 2]
    shown = beyond[0] * MEAN[2] * SHIFTS[:, 2] + beyond[1] * MEAN[3] * SHIFTS[:, 3]
    assert budget.band_of_run() == pytest.approx(sandwich(COVARIANCE, [0, 1]) + np.outer(shown, shown))


def test_before_the_record_every_influence_has_its_prior(budget: Budget) -> None:
    assert [budget.prior(name) for name in ("current", "gain", "law", "none")] == [0.5, 2.0, 0.1, 0.0]
    assert budget.prior_band("current") == pytest.approx(SHIFTS[:, :2] @ SHIFTS[:, :2].T)
    assert not budget.prior_band("none").any()


def test_an_influence_that_is_drag_of_the_hull_is_no_error_of_the_drag(budget: Budget) -> None:
    v = array(np.array([0.4, -0.2]))
    gradient = array(np.stack([v * np.abs(v), v], axis=1))
    wanted = gradient @ SHIFTS
    wanted[:, 2] -= 2.0 * np.array([0.4**2, -(0.2**2)])
    assert budget.drag_sensitivity(gradient, v) == pytest.approx(wanted)


def left_if_known(sensitivity: Array, known: list[int]) -> tuple[float, float]:
    """Variance of a quantity once some unknowns are known (Schur complement), and its shift by the mean of the rest."""
    rest = [at for at in range(4) if at not in known]
    inner = COVARIANCE[np.ix_(known, known)]
    cross = COVARIANCE[np.ix_(rest, known)]
    remaining = COVARIANCE[np.ix_(rest, rest)] - cross @ np.linalg.inv(inner) @ cross.T
    return float(sensitivity[rest] @ remaining @ sensitivity[rest]), float(MEAN[rest] @ sensitivity[rest])


def test_a_remedy_leaves_what_the_others_do(budget: Budget) -> None:
    sensitivity = SHIFTS[0]
    left = budget.variance_without(sensitivity)
    assert left.keys() == {"wait", "weigh"}
    for remedy, known in (("wait", [0, 1, 3]), ("weigh", [2])):
        variance, shift = left_if_known(sensitivity, known)
        assert left[remedy] == pytest.approx(variance + shift**2)


def test_a_contribution_is_what_would_be_lost_if_it_were_known_and_what_is_shown(budget: Budget) -> None:
    sensitivity = SHIFTS[0]
    told = budget.contributions(sensitivity)
    whole = float(sensitivity @ COVARIANCE @ sensitivity)
    wanted = {}
    for name, known in (("current", [0, 1]), ("gain", [2]), ("law", [3])):
        shown = float(MEAN[known] @ sensitivity[known])
        wanted[name] = math.sqrt(whole - left_if_known(sensitivity, known)[0] + shown**2)
    assert {one.influence: one.std for one in told} == pytest.approx(wanted)
    assert [one.std for one in told] == pytest.approx(sorted(wanted.values(), reverse=True))
    assert [one.remedy for one in told if one.influence == "gain"] == ["weigh"]
    (gain,) = budget.contributions(sensitivity, (GAIN,))
    assert gain.std == pytest.approx(abs(sensitivity[2]) * math.hypot(math.sqrt(COVARIANCE[2, 2]), MEAN[2]))


def test_what_was_found_is_in_the_unit_of_the_influence(budget: Budget) -> None:
    assert budget.found("gain") == pytest.approx((2.0 * -3.0, 2.0 * 0.5))
    assert all(math.isnan(value) for value in budget.found("none"))


def test_warnings_name_what_the_record_shows_clearest_first(budget: Budget) -> None:
    gain, law = budget.warnings()
    assert gain == "the record shows gain (-6 +- 1 %): weigh"
    assert law == "the record shows law (0.15 +- 0.04 N): wait"
    # Two deviations, or clearly seen but within what a pool has: no word.
    assert replace(budget, mean=array(np.array([0.0, 0.0, -1.4, 0.0]))).warnings() == ()
    assert replace(budget, mean=array(np.array([0.0, 0.0, 0.0, 0.9])), covariance=0.01 * COVARIANCE).warnings() == ()
    second = replace(budget, mean=array(np.array([0.0, 5.0, 0.0, 0.0])))
    assert second.warnings() == ("the record shows current (2.5 +- 0.4 m/s): wait",)


@pytest.mark.parametrize("loss", [False, True])
def test_what_a_record_may_not_judge_keeps_its_prior(case: Case, loss: bool) -> None:
    """A loss is on one side of nothing, but as far from it on the average."""
    hidden = replace(LAW, sigma=lambda _case: 3.0, considered=True, loss=loss)
    found = budget_of(case, (hidden,))
    assert found.band() == pytest.approx(found.prior_band("law"), rel=1e-3)
    assert bool(found.mean[0] > 0.5) is loss
    shown = budget_of(case, (replace(hidden, shown=lambda _case: True),))
    assert shown.found("law")[1] < 0.5 * found.found("law")[1]


def test_in_water_that_may_be_near_the_model_an_influence_is_a_little_less(case: Case) -> None:
    hidden = replace(LAW, sigma=lambda _case: 3.0, considered=True, near=0.2)
    found = budget_of(case, (hidden,))
    assert 0.9 < found.band()[0, 0] / found.prior_band("law")[0, 0] < 1.0


def test_a_loss_is_weighed_against_its_prior_as_bayes_says(case: Case) -> None:
    """Normal about 0.87 with deviation 0.5: the root mean square of anything between nothing and its greatest is 1."""
    loss = replace(LAW, sigma=lambda _case: 0.02, loss=True)
    told = score(case.fit, 0.02 * to_and_fro(case))
    mean, variance = math.sqrt(0.75), 0.25
    weight = 1.0 / (1.0 / variance + told.information[0, 0])
    found = budget_of(case, (loss,))
    assert 0.1 < weight / variance < 0.9
    assert found.found("law") == pytest.approx(
        (0.02 * weight * (mean / variance + told.gradient[0]), 0.02 * math.sqrt(weight)), rel=1e-6
    )


def test_other_motions_tell_how_near_the_water_is_to_the_model(case: Case) -> None:
    hidden = replace(LAW, sigma=lambda _case: 3.0, considered=True, near=0.2, loss=True)
    shares = []
    for near, usual in ((50.0, 0.0), (0.0, 50.0), (-ODDS[0], -ODDS[2])):
        found = budget_of(case, (hidden,)).in_water(array([near, -1e3, usual]))
        shares.append(found.band()[0, 0] / found.prior_band("law")[0, 0])
    # Near, usual, and as likely the one as the other.
    assert shares == pytest.approx([0.2**2, 1.0, 0.5 * (0.2**2 + 1.0)], rel=1e-3)
    shown = replace(hidden, considered=False)
    alone = budget_of(case, (shown,))
    assert alone.in_water(alone.evidence).found("law") == pytest.approx(alone.found("law"))


def test_a_record_that_shows_an_influence_tells_that_the_water_is_usual(case: Case) -> None:
    def told(size_N: float) -> float:
        """How much more likely usual water is than water near the model, by a force that was or was not there."""
        row = replace(LAW, sigma=lambda _case: 1.0, near=0.05)
        fit = case.fit
        grid_v = sensitivities(fit.model, fit.theta, fit.problem.grid, fit.linear.path, size_N * row.effect(case))
        t = fit.problem.t
        moved = grid_v[fit.problem.index, fit.problem.channel, -1]
        velocity = Series(t, case.record.velocity.between(t[0], t[-1]).y + moved)
        record = replace(case.record, velocity=velocity)
        again = refine(fit.model, record, fit.theta, wide_prior(case.vehicle, fit.model))
        found = budget_of(replace(case, record=record, fit=again), (row,))
        assert found.found("law")[0] == pytest.approx(size_N, abs=4.0 * found.found("law")[1])
        near, _, usual = found.evidence
        return float(usual - near)

    assert told(0.0) < 0.0 < told(2.0)


def test_an_influence_that_cannot_act_is_no_row(case: Case) -> None:
    assert budget_of(case, (replace(LAW, sigma=lambda _case: 0.0), GAINS)).influences == (GAINS,)
    nothing = budget_of(case, ())
    assert not nothing.band().any()
    assert nothing.warnings() == ()
