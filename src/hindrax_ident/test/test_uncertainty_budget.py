"""What a budget says of its influences: bands, contributions, remedies and warnings, computed by hand beside it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.axis_fit import AxisFit
from hindrax_ident.assess.influences import GAIN, INFLUENCES, LAG, LATENCY, MODEL, RUN, Influence
from hindrax_ident.assess.objections import Code
from hindrax_ident.assess.uncertainty_budget import (
    ALL,
    NEAR_ODDS,
    ODD_RECORD,
    Budget,
    BudgetRow,
    _explained,
    _Likelihood,
    _posterior,
    _Prior,
    _prior,
    _weighed,
    budget_of,
)
from hindrax_ident.fit.delay import latency_impulse
from hindrax_ident.fit.output_error import refine
from hindrax_ident.fit.scores import score
from hindrax_ident.model.model_parameters import wide_prior
from hindrax_ident.model.motion_model import Model, model_of
from hindrax_ident.model.simulation import sensitivities
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.remedies import Remedy
from hindrax_ident.testing.synthetic_runs import back_and_forth, fly
from hindrax_ident.tuning import Tuning, for_foreign_records

SURGE = np.array([66.48, 1.25, 0.0, 27.3])


def to_and_fro(case: AxisFit) -> Array:
    """Impulses of a force that comes and goes every nine seconds, which no parameter can explain."""
    return array((case.steps_s * np.sin(0.7 * np.cumsum(case.steps_s)))[:, None])


CURRENT = Influence("current", "m/s", RUN, lambda _case: 0.5, lambda case: np.ones((len(case.v), 2)), Remedy("wait"))
GAINS = Influence(
    "gain", "%", GAIN, lambda _case: 2.0, lambda case: np.ones((len(case.v), 1)), Remedy("weigh"),
    drag=lambda _case, v: array(v[:, None] ** 2),
)  # fmt: skip
LAW = Influence("law", "N", MODEL, lambda _case: 0.1, to_and_fro, Remedy("wait"))
SHIFTS = array(np.array([[1.0, 0.5, 2.0, -1.0], [0.2, -0.3, 0.4, 0.6]]))
MEAN = array(np.array([0.2, -0.5, -3.0, 1.5]))
COVARIANCE = array(
    np.array([[0.9, 0.1, 0.05, 0.2], [0.1, 0.8, -0.1, 0.0], [0.05, -0.1, 0.25, 0.02], [0.2, 0.0, 0.02, 0.16]])
)
COLUMNS = {RUN: [0, 1], GAIN: [2], MODEL: [3]}
MOMENT = array(COVARIANCE + np.outer(MEAN, MEAN))


def recorded(model: Model, hold_s: float, long_s: float) -> Record:
    """A record of surge to and fro, with the noise of a DVL."""
    flight = fly(model, SURGE, back_and_forth((4.0, 13.0), hold_s, long_s), 0.15)
    t = flight.grid.times_s[::10]
    v = flight.path.v[::10] + 0.004 * np.random.default_rng(4).standard_normal(len(t))
    return Record(Series(t, v), Series(flight.times_s, flight.commands), (Stretch(0.0, long_s - 0.1),), lag_s=0.15)


@pytest.fixture(scope="module")
def case(vehicle: Vehicle) -> AxisFit:
    model = model_of(vehicle, 0)
    record = recorded(model, hold_s=8.0, long_s=32.0)
    prior = wide_prior(vehicle, model)
    return AxisFit(vehicle, record, refine(model, record, prior.values, prior), Tuning())


def rows_with(gains: Influence) -> tuple[BudgetRow, ...]:
    """Rows of the budget, of which this is the second."""
    return ((slice(0, 2), CURRENT, 0.5), (slice(2, 3), gains, 2.0), (slice(3, 4), LAW, 0.1))


@pytest.fixture
def budget(case: AxisFit, monkeypatch: pytest.MonkeyPatch) -> Budget:
    """Numbers made up for a record of which nothing is known: whether it needs an influence is not asked."""
    monkeypatch.setattr(Budget, "_needs", lambda *_: True)
    return Budget(
        case=case,
        rows=rows_with(GAINS),
        shifts=SHIFTS,
        mean=MEAN,
        covariance=COVARIANCE,
        evidence=array(np.zeros(3)),
        likelihood=budget_of(case, ()).likelihood,
        whole=budget_of(case, ()).whole,
        explanations=budget_of(case, ()).explanations,
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
    v = array(np.array([0.4, -0.2, 0.0]))
    gradient = array(np.stack([v * np.abs(v), v], axis=1))
    wanted = gradient @ SHIFTS
    wanted[:, 2] -= 2.0 * np.array([0.4**2, -(0.2**2), 0.0])
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
    for remedy, known in ((Remedy("wait"), [0, 1, 3]), (Remedy("weigh"), [2])):
        variance, _ = left_if_known(sensitivity, known)
        assert left[remedy] == pytest.approx(variance), "the mean is corrected"


def test_a_contribution_is_what_the_band_would_lose_if_it_were_known_and_never_more_than_the_band(
    budget: Budget,
) -> None:
    sensitivity = SHIFTS[0]
    listed = budget.contributions(sensitivity)
    error, band = float(MEAN @ sensitivity), float(budget.variance(sensitivity[None])[0])
    wanted = {}
    for name, known in (("current", [0, 1]), ("gain", [2]), ("law", [3])):
        shown = float(MEAN[known] @ sensitivity[known])
        wanted[name] = math.sqrt(max(0.0, band - left_if_known(sensitivity, known)[0] - (error - shown) ** 2))
    assert {one.influence: one.std for one in listed} == pytest.approx(wanted)
    assert [one.std for one in listed] == pytest.approx(sorted(wanted.values(), reverse=True))
    assert listed[0].std <= math.sqrt(band)
    assert [one.remedy for one in listed if one.influence == "gain"] == ["weigh"]
    assert {type(one.remedy) for one in listed} == {str}, "rows are written as YAML"
    (gain,) = budget.contributions(sensitivity, (GAIN,))
    assert gain.std == pytest.approx(abs(sensitivity[2]) * math.hypot(math.sqrt(COVARIANCE[2, 2]), MEAN[2]))


def test_what_was_found_is_in_the_unit_of_the_influence(budget: Budget) -> None:
    assert budget.found("gain") == pytest.approx((2.0 * -3.0, 2.0 * 0.5))
    assert all(math.isnan(value) for value in budget.found("none"))


def test_warnings_name_what_the_record_shows_clearest_first(budget: Budget) -> None:
    gain, law = budget.warnings()
    assert (gain.code, gain.numbers["influence"], gain.numbers["shown"]) == (Code.EVIDENCE, "gain", "-6.0 +- 1.0")
    assert (law.numbers["influence"], law.numbers["unit"]) == ("law", "N")
    turning = replace(budget.case.fit, model=replace(budget.case.fit.model, axis=5))
    _, law = replace(budget, case=replace(budget.case, fit=turning)).warnings()
    assert law.numbers["unit"] == "N m"
    # Two deviations, or clearly seen but within what a pool has: no word.
    assert replace(budget, mean=array(np.array([0.0, 0.0, -1.4, 0.0]))).warnings() == ()
    assert replace(budget, mean=array(np.array([0.0, 0.0, 0.0, 0.9])), covariance=0.01 * COVARIANCE).warnings() == ()
    second = replace(budget, mean=array(np.array([0.0, 5.0, 0.0, 0.0])))
    (current,) = second.warnings()
    assert (current.code, current.numbers["influence"], current.numbers["shown"]) == (
        Code.EVIDENCE,
        "current",
        "2.50 +- 0.45",
    )


def test_what_leaves_the_same_in_a_record_is_named_with_it(budget: Budget) -> None:
    either = replace(GAINS, or_else=lambda case: "another gain" if case.axis == 0 else "")
    gain, _ = replace(budget, rows=rows_with(either)).warnings()
    assert gain.startswith("evidence of gain or another gain (-6.0 +- 1.0 %)")
    across = replace(budget.case, fit=replace(budget.case.fit, model=replace(budget.case.fit.model, crossed=True)))
    gain, _ = replace(budget, rows=rows_with(either), case=across).warnings()
    assert gain.startswith("evidence of gain or another gain or forces of the other axes (-6.0 +- 1.0 %)")
    (tether,) = (one for one in INFLUENCES if one.name == "tether")
    heaving = replace(budget.case, fit=replace(budget.case.fit, model=replace(budget.case.fit.model, axis=2)))
    assert (tether.or_else(budget.case), tether.or_else(heaving)) == ("", "a buoyancy that changes with depth")


def test_what_no_record_shows_is_named_where_it_makes_most_of_a_band(budget: Budget) -> None:
    own, sensitivity = array(np.array([0.0, 0.0, 1.0, 0.0])), SHIFTS[0]
    hidden = replace(budget, rows=rows_with(replace(GAINS, considered=True)))
    rest, total = budget.variance_without(own)[Remedy("weigh")], float(own @ COVARIANCE @ own)
    assert rest < 1e-9 * total
    expected = ("most of the uncertainty of the drag cannot be observed in the data (gain): weigh",)
    # Noise of half of the variance, and a bit less.
    assert hidden.unseen({"the drag": (own, 1.01 * total)}) == ()
    assert hidden.unseen({"the drag": (own, 0.99 * total), "the mass": (0.0 * own, 1.0)}) == expected
    both = hidden.unseen({"the drag": (own, 0.0), "the mass": (2.0 * own, 0.0)})
    assert both == ("most of the uncertainty of the drag and the mass cannot be observed in the data (gain): weigh",)
    # What the record may judge, what it was flown to show, and what was measured is no matter of belief.
    assert budget.unseen({"the drag": (own, 0.0)}) == ()
    for plain in (
        replace(GAINS, considered=True, shown=lambda _case: True),
        replace(GAINS, considered=True, measured=True),
    ):
        assert replace(budget, rows=rows_with(plain)).unseen({"the drag": (own, 0.0)}) == ()
    assert hidden.unseen({"the drag": (sensitivity, 1e9)}) == ()


@pytest.mark.parametrize("loss", [False, True])
def test_what_a_record_may_not_judge_keeps_its_prior(case: AxisFit, loss: bool) -> None:
    """A loss is on one side of nothing, but as far from it on the average."""
    hidden = replace(LAW, sigma=lambda _case: 3.0, considered=True, loss=loss)
    found = budget_of(case, (hidden,))
    assert found.band() == pytest.approx(found.prior_band("law"), rel=1e-3)
    assert bool(found.mean[0] > 0.5) is loss
    shown = budget_of(case, (replace(hidden, shown=lambda _case: True),))
    assert shown.found("law")[1] < 0.5 * found.found("law")[1]


def test_what_may_not_be_judged_moves_the_delays_that_were_fitted_with_the_rest(vehicle: Vehicle) -> None:
    """A force like a delay: lag and latency take it up, and the mass hardly moves."""
    model = model_of(vehicle, 0)
    record = recorded(model, hold_s=3.0, long_s=60.0)
    prior, tuning = wide_prior(vehicle, model), for_foreign_records(Tuning())
    fit = refine(model, record, SURGE, prior)

    def rows(*, considered: bool) -> tuple[Influence, ...]:
        late = Influence("late", "s", MODEL, lambda _case: 0.02, latency, Remedy("wait"), considered=considered)
        return (late, *(one for one in INFLUENCES if one.name in (LAG, LATENCY)))

    def latency(case: AxisFit) -> Array:
        return latency_impulse(case.record, case.fit.problem.grid)

    foreign = AxisFit(vehicle, record, fit, tuning)
    alone, together, judged = (
        budget_of(replace(foreign, tuning=one), rows(considered=hidden)).shifts[-1, 0]
        for one, hidden in ((Tuning(), True), (tuning, True), (tuning, False))
    )
    assert abs(alone) > 0.3
    assert judged == pytest.approx(alone)
    # All of it is taken up by the delays, but for what their prior of 0.1 s keeps.
    assert abs(together) < 0.05 * abs(alone)


@pytest.mark.parametrize(("delays_s", "doubt_s"), [((0.1, 0.0), 0.03), ((0.1, -0.11), 0.03), ((0.0, -0.3), 0.3)])
def test_a_motion_before_its_thrust_is_doubt_of_the_stamps(
    case: AxisFit, delays_s: tuple[float, float], doubt_s: float
) -> None:
    record = replace(case.record, lag_s=delays_s[0], latency_s=delays_s[1])
    assert replace(case, record=record, tuning=Tuning(stamp_doubt_s=0.03)).stamp_doubt_s == pytest.approx(doubt_s)


def test_in_water_that_may_be_near_the_model_an_influence_is_a_little_less(case: AxisFit) -> None:
    hidden = replace(LAW, sigma=lambda _case: 3.0, considered=True, near=0.2)
    found = budget_of(case, (hidden,))
    assert 0.9 < found.band()[0, 0] / found.prior_band("law")[0, 0] < 1.0


def test_a_loss_is_weighed_against_its_prior_as_bayes_states(case: AxisFit) -> None:
    """Normal about 0.87 with deviation 0.5: the root mean square of anything between nothing and its greatest is 1."""
    loss = replace(LAW, sigma=lambda _case: 0.02, loss=True)
    scored = score(case.fit, 0.02 * to_and_fro(case))
    mean, variance = math.sqrt(0.75), 0.25
    weight = 1.0 / (1.0 / variance + scored.information[0, 0])
    found = budget_of(case, (loss,))
    assert 0.1 < weight / variance < 0.9
    assert found.found("law") == pytest.approx(
        (0.02 * weight * (mean / variance + scored.gradient[0]), 0.02 * math.sqrt(weight)), rel=1e-6
    )


def test_other_motions_show_how_near_the_water_is_to_the_model(case: AxisFit) -> None:
    hidden = replace(LAW, sigma=lambda _case: 3.0, considered=True, near=0.2, loss=True)
    shares = []
    for near, usual in ((50.0, 0.0), (0.0, 50.0), (-NEAR_ODDS, 0.0)):
        found = budget_of(case, (hidden,)).in_water(array([near, -1e3, -1e3, usual]))
        shares.append(found.band()[0, 0] / found.prior_band("law")[0, 0])
    # Near, usual, and as likely the one as the other.
    assert shares == pytest.approx([0.2**2, 1.0, 0.5 * (0.2**2 + 1.0)], rel=1e-3)
    shown = replace(hidden, considered=False)
    alone = budget_of(case, (shown,))
    assert alone.in_water(alone.evidence).found("law") == pytest.approx(alone.found("law"))


def test_what_motions_share_one_tells_the_other_and_what_they_do_not_it_keeps(case: AxisFit) -> None:
    """As of two measurements: of one deviation each, and of what differs between them."""
    own, common = budget_of(case, (LAW,)), budget_of(case, (replace(LAW, common=0.05),))
    assert own.told_by([common]).likelihood.information.tolist() == own.likelihood.information.tolist()
    # Another one that has seen 0.2 +- 0.04 N, in units of 0.1 N and with a prior of one of them.
    precision = 1.0 / 0.4**2 + 1.0
    mean = (2.0 / 0.4**2) / precision
    other = replace(common, mean=array(np.array([mean])), covariance=array(np.array([[1.0 / precision]])))
    told = common.told_by([other, other])
    added = 1.0 / (0.4**2 + 0.5**2)
    information = told.likelihood.information - common.likelihood.information
    assert information == pytest.approx(2.0 * added, rel=1e-6)
    assert told.likelihood.gradient - common.likelihood.gradient == pytest.approx(2.0 * added * 2.0, rel=1e-6)
    # One that has seen nothing, or has no such row, tells nothing.
    blind = replace(common, mean=array(np.zeros(1)), covariance=array(np.eye(1)))
    for one in (blind, budget_of(case, (replace(LAW, name="else", common=0.05),))):
        untold = common.told_by([one]).likelihood
        assert untold.information == pytest.approx(common.likelihood.information, rel=1e-4)
        assert untold.gradient == pytest.approx(common.likelihood.gradient, abs=1e-4)


def test_one_record_speaks_against_water_near_the_model_only_as_far_as_such_a_record_is_rare(case: AxisFit) -> None:
    plain = budget_of(case, (LAW,))
    votes = [replace(plain, evidence=array([near, 0.0, 0.0, 1.0])).vote for near in (-1e3, 1.0, 8.0)]
    against, silent, for_it = (float(one[0] - one[-1]) for one in votes)
    assert against == pytest.approx(math.log(ODD_RECORD))
    assert silent == pytest.approx(0.0)
    assert for_it == pytest.approx(7.0, abs=0.03)
    assert 2.0 * against + for_it + NEAR_ODDS < 0.0, "two that do have no cause of their own"


def test_a_record_that_shows_an_influence_shows_that_the_water_is_usual(case: AxisFit) -> None:
    def log_odds(size_N: float) -> float:
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
        near, *_, usual = found.evidence
        return float(usual - near)

    assert log_odds(0.0) < 0.0 < log_odds(2.0)


def test_an_influence_that_cannot_act_is_no_row(case: AxisFit) -> None:
    ((_, only, _),) = budget_of(case, (replace(LAW, sigma=lambda _case: 0.0), GAINS)).rows
    assert only is GAINS
    nothing = budget_of(case, ())
    assert not nothing.band().any()
    assert nothing.warnings() == ()


# ---- what a record tells, by Bayes' rule


def normal(information: Array, gradient: Array, usual: Array, sigma: Array) -> tuple[float, Array, Array]:
    """Logarithm of the evidence, mean and covariance of unknowns with a normal prior, the integral written out."""
    precision = information + np.diag(sigma**-2.0)
    covariance = np.linalg.inv(precision)
    pull = gradient + usual / sigma**2
    mean = covariance @ pull
    scale = float(np.log(np.linalg.det(precision)) + 2.0 * np.sum(np.log(sigma)))
    evidence = 0.5 * (float(pull @ mean) - float(np.sum((usual / sigma) ** 2)) - scale)
    return evidence, array(mean), array(covariance)


INFORMATION = array(np.array([[4.0, 1.0, 0.5], [1.0, 3.0, -0.5], [0.5, -0.5, 2.0]]))
GRADIENT = array(np.array([2.0, -1.0, 0.7]))
WATERS = _Prior(
    array(np.array([[0.02, 0.0, 0.1], [0.0, -0.3, 0.8], [0.87, 0.0, 0.5]])),
    array(np.array([[0.1, 0.2, 0.05], [1.0, 0.3, 0.4], [0.5, 1.0, 2.0]])),
    np.zeros((3, 3), bool),
)


def test_without_tails_an_explanation_is_that_of_bayes() -> None:
    for usual, sigma, tails in zip(*WATERS, strict=True):
        evidence, mean, covariance = normal(INFORMATION, GRADIENT, usual, sigma)
        found = _explained(INFORMATION, GRADIENT, usual, sigma, tails)
        assert np.all(np.abs(found.mean - mean) < 1e-9)
        assert np.all(np.abs(found.covariance - covariance) < 1e-9)
        # Every start finds the same: together they count once. Half of each unknown is a constant.
        assert np.logaddexp.reduce(found.evidence) == pytest.approx(evidence - 1.5)


@pytest.mark.parametrize("power", [1e5, 1e7, 1e12])
def test_what_is_known_beyond_all_digits_has_its_size_and_its_evidence(power: float) -> None:
    """An hour of a record knows a lag to less than a thousandth of its prior: its size is g / H however large both."""
    seen = 7.0 / math.sqrt(power)
    information, gradient = array(np.diag([power, 2.0])), array(np.array([power * seen, 1.0]))
    usual, sigma = array(np.array([0.0, 0.3])), array(np.array([1.0, 0.5]))
    found = _explained(information, gradient, usual, sigma, np.zeros(2, bool))
    evidence, mean, _ = normal(information, gradient, usual, sigma)
    assert found.mean[0] == pytest.approx(mean, rel=1e-4)
    assert np.logaddexp.reduce(found.evidence) == pytest.approx(evidence - 1.0, rel=1e-3)


def test_what_a_record_shows_beyond_all_digits_is_as_small_as_it_shows() -> None:
    """Of the second unknown 50000 times more is known than the inverse keeps."""
    information, usual, one = array(np.array([[1e2, 1e6], [1e6, 5e10]])), array(np.array([0.8, 0.0])), array(np.ones(2))
    gradient = array(information @ np.array([0.3, 1e-6]))
    _, mean, _ = normal(information, gradient, usual, one)
    found = _explained(information, gradient, usual, one, np.array([False, True]))
    assert np.all(np.abs(found.mean - mean) < 1e-3)


@pytest.mark.parametrize("by_others", [None, np.array([-3.0, 1.0, -2.0])], ids=["alone", "with others"])
def test_the_three_waters_count_by_their_odds_and_evidence(by_others: Array | None) -> None:
    found = _posterior(_Likelihood(INFORMATION, GRADIENT, WATERS), by_others)
    own = [normal(INFORMATION, GRADIENT, usual, sigma) for usual, sigma, _ in zip(*WATERS, strict=True)]
    assert found.evidence == pytest.approx([one[0] - 1.5 for one in own])
    log_odds = np.array([one[0] for one in own]) if by_others is None else by_others
    weights = np.exp(log_odds) * np.array([0.014, 0.014, 1.0])
    weights /= weights.sum()
    mean = sum(weight * one[1] for weight, one in zip(weights, own, strict=True))
    assert found.mean == pytest.approx(mean)
    second = sum(weight * (one[2] + np.outer(one[1], one[1])) for weight, one in zip(weights, own, strict=True))
    assert found.covariance == pytest.approx(second - np.outer(mean, mean))


def scale_mixture(information: float, gradient: float, begin: float) -> tuple[float, float, float]:
    """Evidence, mean and variance of one unknown with a Student prior of one degree of freedom (Tipping 2001)."""
    variance = begin
    for _ in range(20):
        spread = variance / (1.0 + variance * information)
        mean = spread * gradient
        last, variance = variance, 0.5 * (1.0 + mean**2 + spread)
    log_size = math.log(1.0 + last * information)
    return 0.5 * (mean * gradient - log_size - math.log(last) - 1.0 / last), mean, spread


@pytest.mark.parametrize(("information", "seen"), [(4.0, 0.3), (4.0, 6.0), (0.2, -8.0), (25.0, -40.0)])
def test_tails_let_a_record_show_of_something_great(information: float, seen: float) -> None:
    gradient = information * seen
    one = array(np.ones(1))
    found = _explained(array(information * np.eye(1)), gradient * one, 0.0 * one, one, np.ones(1, bool))
    wanted = [scale_mixture(information, gradient, begin) for begin in (100.0, 1.0)]
    assert found.mean[:, 0] == pytest.approx([mean for _, mean, _ in wanted])
    assert found.covariance[:, 0, 0] == pytest.approx([spread for *_, spread in wanted])
    counted = 1.0 if abs(wanted[0][1] - wanted[1][1]) >= 0.1 else 2.0
    assert found.evidence == pytest.approx([evidence - math.log(counted) for evidence, *_ in wanted])


def test_one_of_two_that_do_the_same_is_great_and_nobody_knows_which() -> None:
    """Their sum is told. Of heavy tails one great is likelier than two of medium size, but which?"""
    both = array(25.0 * np.ones((2, 2)))
    nothing, one = array(np.zeros(2)), array(np.ones(2))
    found = _explained(both, array(25.0 * 10.0 * np.ones(2)), nothing, one, np.ones(2, bool))
    first, second, middle = found.mean
    assert first == pytest.approx(second[::-1])
    assert first[0] > 8.0
    assert middle[0] == pytest.approx(middle[1])
    assert found.evidence[0] == pytest.approx(found.evidence[1])
    assert found.evidence[0] > found.evidence[2] + 0.5
    waters = _Prior(*(np.stack([table] * 3) for table in (nothing, one, np.ones(2, bool))))
    whole = _posterior(_Likelihood(both, array(25.0 * 10.0 * np.ones(2)), waters))
    assert whole.mean == pytest.approx([5.0, 5.0], abs=0.2)
    assert whole.covariance[0, 0] > 8.0
    assert whole.covariance[0, 1] < -8.0


def test_the_prior_of_each_water_is_that_of_its_row() -> None:
    rows = [
        replace(LAW, near=1.0),
        replace(LAW, near=0.03),
        replace(LAW, near=0.2),
        replace(LAW, near=0.03, usual_cause="inflow"),
        replace(LAW, near=0.03, loss=True),
        replace(LAW, near=0.03, usual_cause="losses", loss=True),
        replace(CURRENT, near=0.2),
    ]
    slices = [*(slice(at, at + 1) for at in range(6)), slice(6, 8)]
    prior = _prior([(columns, row, 1.0) for columns, row in zip(slices, rows, strict=True)])
    near = np.array([1.0, 0.03, 0.2, 0.03, 0.03, 0.03, 0.2, 0.2])
    losses = np.array([1.0, 0.03, 0.2, 0.03, 0.03, 1.0, 0.2, 0.2])
    inflow = np.array([1.0, 0.03, 0.2, 1.0, 0.03, 0.03, 0.2, 0.2])
    # A loss is anywhere between nothing and its greatest, whose root mean square is 1.
    loss = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    for at, size in enumerate((near, losses, inflow, np.ones(8))):
        assert prior.mean[at] == pytest.approx(math.sqrt(0.75) * loss * size)
        assert prior.sigma[at] == pytest.approx(np.where(loss > 0.0, 0.5, 1.0) * size)
    both_ways = loss == 0.0
    assert prior.tails.tolist() == [(both_ways & (near > 0.03)).tolist()] * 3 + [both_ways.tolist()]
    assert _prior([]).mean.shape == (4, 0)


def heave(case: AxisFit, sigma_N: float | None) -> AxisFit:
    """The case as if it were one of heave, with a weighed net buoyancy."""
    covariance = array(np.diag([1.0, 1.0, 1.0, 1.0, 0.04, 1.0]))
    theta = array(np.array([93.0, 5.0, 57.0, 12.0, 0.6, 37.0]))
    fit = replace(case.fit, model=model_of(case.vehicle, 2), theta=theta, covariance=covariance)
    return replace(case, fit=fit, tuning=Tuning(buoyancy_sigma_N=sigma_N))


def test_a_weighed_net_buoyancy_is_a_reading_of_b(case: AxisFit) -> None:
    rng = np.random.default_rng(1)
    shifts = array(rng.standard_normal((6, 3)))
    information, gradient = _weighed(heave(case, 0.3), shifts)
    variance = 0.3**2 + 0.04
    assert information == pytest.approx(np.outer(shifts[4], shifts[4]) / variance)
    assert gradient == pytest.approx(shifts[4] * (0.6 - case.vehicle.net_buoyancy_N) / variance)
    exactly, _ = _weighed(heave(case, 0.0), shifts)
    assert exactly == pytest.approx(np.outer(shifts[4], shifts[4]) / 0.04)
    for other in (heave(case, None), replace(case, tuning=Tuning(buoyancy_sigma_N=0.3))):
        assert [part.tolist() for part in _weighed(other, shifts)] == [np.zeros((3, 3)).tolist(), [0.0] * 3]


def test_a_weighed_net_buoyancy_adds_to_what_the_record_shows(vehicle: Vehicle) -> None:
    model = model_of(vehicle, 2)
    theta = array(np.array([93.52, 5.26, 56.57, 11.84, 0.9, 37.7]))
    flight = fly(model, theta, back_and_forth((6.0, 20.0), 4.0, 24.0), 0.15)
    t = flight.grid.times_s[::10]
    v = flight.path.v[::10] + 0.004 * np.random.default_rng(4).standard_normal(len(t))
    record = Record(Series(t, v), Series(flight.times_s, flight.commands), (Stretch(0.0, 23.9),), lag_s=0.15)
    bare = AxisFit(vehicle, record, refine(model, record, theta, wide_prior(vehicle, model)), Tuning())
    known = replace(bare, tuning=Tuning(buoyancy_sigma_N=0.1))
    plain, weighed = (budget_of(one, (GAINS, LAW)) for one in (bare, known))
    more, pull = _weighed(known, plain.shifts)
    assert np.trace(more) > 0.0
    one, other = plain.likelihood, weighed.likelihood
    assert other.information - one.information == pytest.approx(more, abs=1e-6 * np.trace(more))
    assert other.gradient - one.gradient == pytest.approx(pull, abs=1e-6 * np.abs(pull).max())


@pytest.mark.parametrize(("times", "explained"), [(9.5, True), (10.5, False)])
def test_ten_times_what_a_pool_has_is_no_explanation(budget: Budget, times: float, explained: bool) -> None:
    (warning,) = replace(budget, mean=array(np.array([0.0, 0.0, -times, 0.0]))).warnings()
    assert warning.code is (Code.EVIDENCE if explained else Code.UNEXPLAINED_RESIDUALS)
    assert warning.numbers["influence"] == "gain"
