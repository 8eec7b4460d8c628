"""From the record of an axis to the results of its motions, part by part."""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess import assessment as module
from hindrax_ident.assess.assessment import (
    Assessment,
    DraftFit,
    _next_step,
    _with_noise,
    assess,
    combine_drafts,
    draft,
    numbers_of,
    result_of,
    unidentified,
)
from hindrax_ident.assess.axis_fit import AxisFit
from hindrax_ident.assess.influences import DIFFERENCES, GAIN, INFLUENCES, LAG, LATENCY, MODEL, RUN, Influence
from hindrax_ident.assess.objections import Code, Objection, objection, unnamed
from hindrax_ident.assess.quality import Evidence, excitation, measured_speed, measurement_noise
from hindrax_ident.assess.results import Contribution, NextStep
from hindrax_ident.assess.uncertainty_budget import Budget, budget_of
from hindrax_ident.fit.output_error import OutputErrorFit, refine
from hindrax_ident.fit.plateaus import fit as fit_plateaus
from hindrax_ident.fit.plateaus import measure
from hindrax_ident.fit.scores import slow_force_ratio
from hindrax_ident.fit.whitening import Noise
from hindrax_ident.model.model_parameters import Prior, wide_prior
from hindrax_ident.model.motion_model import MOTIONS, Model, model_of
from hindrax_ident.records.axis_record import Record, Series, Stretch
from hindrax_ident.remedies import FLY_TWICE, Remedy
from hindrax_ident.testing.synthetic_runs import back_and_forth, fly
from hindrax_ident.tuning import Tuning

SURGE = array(np.array([66.48, 1.25, 0.3, 27.3]))
HEAVE = array(np.array([93.52, 5.26, 56.57, 11.84, 0.7845, 37.7]))
ONLINE = {"rls": (array(SURGE * 0.9), array(np.eye(4))), "ekf": (array(SURGE * 1.1), array(2.0 * np.eye(4)))}
PLAIN = Tuning()


def record_of(vehicle: Vehicle, axis: int, theta: Array, levels: tuple[float, ...], end_s: float = 40.0) -> Record:
    model = model_of(vehicle, axis)
    flight = fly(model, theta, back_and_forth(levels, 5.0, end_s), 0.15)
    t = flight.grid.times_s[::20]
    v = flight.path.v[::20] + 0.004 * np.random.default_rng(4).standard_normal(len(t))
    return Record(
        Series(t, v), Series(flight.times_s, flight.commands), (Stretch(0.0, end_s - 0.1),), lag_s=0.15, latency_s=0.01
    )


@pytest.fixture(scope="module")
def surge(vehicle: Vehicle) -> DraftFit:
    model = model_of(vehicle, 0)
    record, prior = record_of(vehicle, 0, SURGE, (4.0, 13.0)), wide_prior(vehicle, model)
    return DraftFit(record, refine(model, record, SURGE, prior), prior, ONLINE, moved=False)


@pytest.fixture(scope="module")
def heave(vehicle: Vehicle) -> DraftFit:
    model = model_of(vehicle, 2)
    record, prior = record_of(vehicle, 2, HEAVE, (8.0, 25.0)), wide_prior(vehicle, model)
    return DraftFit(record, refine(model, record, HEAVE, prior), prior, {}, moved=False)


@pytest.fixture(scope="module")
def assessed(vehicle: Vehicle, surge: DraftFit, heave: DraftFit) -> dict[int, Assessment]:
    found, failed = assess(vehicle, {0: surge, 2: heave}, tuning=PLAIN)
    assert failed == {}
    return found


def test_an_assessment_comes_from_another_process_as_it_was(assessed: dict[int, Assessment]) -> None:
    there = pickle.loads(pickle.dumps(assessed))
    for axis, one in assessed.items():
        assert np.array_equal(there[axis].calibrated, one.calibrated)
        motion = MOTIONS["surge" if axis == 0 else "heave_down"]
        assert result_of(motion, there[axis]).to_json() == result_of(motion, one).to_json()


# ---- drafts


class Stand:
    """In the place of fits and budgets: what was asked, and answers of the test's choice."""

    def __init__(self, patch: pytest.MonkeyPatch, fit: OutputErrorFit, *found: float) -> None:
        self.starts: list[list[float]] = []
        self.searched: list[tuple[list[float], float]] = []
        self._fit, self._found = fit, found or (0.0, 1.0, 0.0, 1.0)
        self.uneven, self.searched_lags, self.rows = False, 0, set[str]()
        patch.setattr(module, "lags_differ", lambda *_: self.uneven)
        patch.setattr(module, "fit_with_uneven_lag", self.fit_with_uneven_lag)
        patch.setattr(module, "refine", self.refine)
        patch.setattr(module, "fit_with_delays", self.fit_with_delays)
        patch.setattr(module, "budget_of", self.budget_of)

    def refine(self, _model: Model, _record: Record, start: Array, _belief: Prior) -> OutputErrorFit:
        self.starts.append(start.tolist())
        return replace(self._fit, theta=array(self._fit.theta + 1.0))

    def fit_with_delays(
        self, record: Record, start: Array, _model: Model, _belief: Prior, sigma_s: float
    ) -> tuple[Record, OutputErrorFit]:
        self.searched.append((start.tolist(), sigma_s))
        return replace(record, lag_s=0.2, latency_s=-0.01), self._fit

    def fit_with_uneven_lag(
        self, record: Record, fit: OutputErrorFit, _belief: Prior, sigma_s: float
    ) -> tuple[Record, OutputErrorFit]:
        assert sigma_s == 0.1
        self.searched_lags += 1
        return replace(record, later_s=(0.1, 0.2)), fit

    def budget_of(self, _case: AxisFit, rows: Iterable[Influence]) -> Stand:
        self.rows = {one.name for one in rows}
        return self

    def found(self, name: str) -> tuple[float, float]:
        lag_s, lag_sigma, late_s, late_sigma = self._found
        return {LAG: (lag_s, lag_sigma), LATENCY: (late_s, late_sigma)}[name]


@pytest.fixture
def patch() -> Iterator[pytest.MonkeyPatch]:
    with pytest.MonkeyPatch.context() as one:
        yield one


def draft_of(vehicle: Vehicle, one: DraftFit, online: Any = ONLINE, tuning: Tuning = PLAIN) -> DraftFit:
    return draft(vehicle, one.fit.model, one.record, one.prior, online, tuning=tuning)


def test_a_draft_starts_from_the_last_online_estimate_or_from_the_prior(
    vehicle: Vehicle, surge: DraftFit, patch: pytest.MonkeyPatch
) -> None:
    stand = Stand(patch, surge.fit)
    online = {"first": ONLINE["rls"], **ONLINE}
    found = draft_of(vehicle, surge, online)
    assert (found.record, found.prior, found.online, found.moved) == (surge.record, surge.prior, online, False)
    assert found.fit.theta.tolist() == (surge.fit.theta + 1.0).tolist()
    draft_of(vehicle, surge, {})
    assert stand.starts == [(SURGE * 1.1).tolist(), surge.prior.values.tolist()]
    assert not stand.searched


@pytest.mark.parametrize(
    ("found", "contradicts"),
    [
        # By five deviations, and by 5 ms.
        ((0.049, 0.01, 0.049, 0.01), False),
        ((0.051, 0.01, 0.049, 0.01), True),
        ((0.049, 0.01, -0.051, 0.01), True),
        ((0.0049, 0.0001, -0.0049, 0.0001), False),
        ((0.0051, 0.0001, 0.0, 0.0001), True),
        ((math.nan, math.nan, math.nan, math.nan), False),
    ],
)
def test_delays_that_contradict_the_vehicle_file_are_fitted(
    vehicle: Vehicle, surge: DraftFit, patch: pytest.MonkeyPatch,
    found: tuple[float, float, float, float], contradicts: bool,
) -> None:  # fmt: skip
    stand = Stand(patch, surge.fit, *found)
    one = draft_of(vehicle, surge)
    assert one.moved is contradicts
    # From the fit of before, with the prior deviation that the budget has of them.
    assert stand.searched == ([((surge.fit.theta + 1.0).tolist(), 0.1)] if contradicts else [])
    assert (one.record.lag_s, one.record.latency_s) == ((0.2, -0.01) if contradicts else (0.15, 0.01))


def test_lags_that_differ_are_fitted_with_the_delays(
    vehicle: Vehicle, surge: DraftFit, patch: pytest.MonkeyPatch
) -> None:
    """Whether delays contradict the file is asked with one lag, behind which no latency can hide."""
    stand = Stand(patch, surge.fit, 0.051, 0.01, 0.0, 0.01)
    for uneven, later_s in ((False, (0.0, 0.0)), (True, (0.1, 0.2))):
        stand.uneven = uneven
        found = draft_of(vehicle, surge)
        assert found.moved
        assert (found.record.lag_s, found.record.later_s, stand.searched_lags) == (0.2, later_s, uneven)
    assert {one.name for one in INFLUENCES} - stand.rows == {DIFFERENCES}


@pytest.mark.parametrize(("sigmas", "contradicts"), [(2.9, False), (3.1, True)])
def test_a_mass_below_that_of_the_body_contradicts_the_delays_too(
    vehicle: Vehicle, surge: DraftFit, patch: pytest.MonkeyPatch, sigmas: float, contradicts: bool
) -> None:
    stand = Stand(patch, surge.fit)
    light = surge.fit.model.rigid - sigmas * math.sqrt(surge.fit.covariance[-1, -1])
    patch.setattr(module, "refine", lambda *_: replace(surge.fit, theta=array([*surge.fit.theta[:-1], light])))
    assert draft_of(vehicle, surge).moved is contradicts
    assert bool(stand.searched) is contradicts


@pytest.mark.parametrize("seed", [1, 2])
def test_a_mass_of_the_file_that_is_too_large_and_a_lag_that_is_not_there_are_told_apart(
    vehicle: Vehicle, seed: int
) -> None:
    """Heave by coarse depths: as a step at a time, delays went to -0.2 s, or the mass to half of the body's."""
    body = model_of(vehicle, 2)
    theta = array([69.0, 0.0, 69.0, 0.0, -0.7, 0.78 * body.rigid])
    rng = np.random.default_rng(50 + seed)
    flight = fly(body, theta, back_and_forth((4.0, 8.0, 14.0), 3.0, 60.0), 0.0, 0.02 * rng.standard_normal(4000))
    t, s = flight.grid.times_s[::20], flight.path.s[::20]
    coarse = Series(t, array(s + 0.02 * np.random.default_rng(seed).standard_normal(len(t))))
    record = replace(
        Record(Series(t[:0], t[:0]), Series(flight.times_s, flight.commands), (Stretch(0.0, 59.9),), lag_s=0.15),
        position=coarse, prior_delays_s=(0.15, 0.0),
    )  # fmt: skip
    found = draft(vehicle, body, record, wide_prior(vehicle, body), {}, tuning=PLAIN)
    assert found.moved
    assert found.record.lag_s + found.record.latency_s == pytest.approx(0.0, abs=0.03)
    assert found.record.latency_s > -0.1
    one = assess(vehicle, {2: found}, tuning=PLAIN)[0][2]
    assert (np.abs(one.fit.theta - theta) / np.sqrt(np.diag(one.fit.covariance))).max() < 3.0
    told = {one.code: one for one in result_of(MOTIONS["heave_down"], one).warnings}[Code.OTHER_MASS]
    assert "mass_kg" in told
    assert f"{body.rigid:.3g} kg" in told


def test_doubted_delays_are_fitted_together_with_the_rest(vehicle: Vehicle, surge: DraftFit) -> None:
    """And not moved again: they are in the band."""
    short = replace(surge, record=surge.record.with_stretches((Stretch(0.0, 15.0),)))
    found = draft_of(vehicle, short, {}, Tuning(lag_doubt_s=0.1))
    assert not found.moved
    assert found.record.lag_s == pytest.approx(0.15, abs=0.05)
    assert (found.record.lag_s, found.record.latency_s) != (0.15, 0.01)
    assert found.fit.problem.lag_s == found.record.lag_s


def test_drafts_of_motions_that_know_their_thrusters_share_their_noise(
    surge: DraftFit, heave: DraftFit, patch: pytest.MonkeyPatch
) -> None:
    asked = []

    def common(fits: dict[int, OutputErrorFit]) -> dict[int, Noise]:
        asked.append(sorted(fits))
        return {0: Noise(2.0, 3.0, 4.0, 5.0)} if fits else {}

    patch.setattr(module, "common_noise", common)
    patch.setattr(module, "reweighted", lambda fit, noise, prior: (fit, noise, prior))
    reported = replace(surge, record=replace(surge.record, effort=surge.record.thrust))
    found = combine_drafts({0: reported, 2: heave})
    assert asked == [[0]]
    again: Any = found[0].fit
    assert again == (surge.fit, Noise(2.0, 3.0, 4.0, 5.0), surge.prior)
    assert replace(found[0], fit=surge.fit) == reported
    assert found[2] is not None
    assert found[2].fit is heave.fit


# ---- bands


def test_bands_are_the_noise_and_what_the_influences_of_their_scopes_do(
    vehicle: Vehicle, surge: DraftFit, heave: DraftFit, assessed: dict[int, Assessment]
) -> None:
    budgets = {axis: budget_of(AxisFit(vehicle, one.record, one.fit, PLAIN)) for axis, one in ((0, surge), (2, heave))}
    water = array(budgets[0].evidence + budgets[2].evidence)
    budget, found = budgets[0].told_by([budgets[2]]).in_water(water), assessed[0]
    assert found.noise == pytest.approx(surge.fit.covariance)
    assert found.fit.covariance == pytest.approx(surge.fit.covariance + budget.band_of_run())
    assert found.calibrated == pytest.approx(surge.fit.covariance + budget.band((GAIN, RUN, MODEL)))
    assert found.separable == pytest.approx(surge.fit.covariance + budget.band((RUN, MODEL)))
    assert found.calibrated[0, 0] > found.separable[0, 0] > found.noise[0, 0]
    for name, (theta, covariance) in ONLINE.items():
        assert found.online[name][0] is theta
        assert found.online[name][1] == pytest.approx(covariance + budget.band_of_run())
    assert found.record is surge.record
    assert found.validation is not None
    assert found.budget.case.delay_found is False


def test_forces_that_wander_widen_the_noise_of_a_doubted_thrust(vehicle: Vehicle, surge: DraftFit) -> None:
    found, _ = assess(vehicle, {0: surge}, tuning=Tuning(thrust_doubt=0.02))
    ratio = slow_force_ratio(surge.fit)
    assert found[0].noise == pytest.approx(ratio * surge.fit.covariance)
    wandering = replace(surge.fit, linear=replace(surge.fit.linear, r=array(surge.fit.linear.r + 0.5)))
    moved, _ = assess(vehicle, {0: replace(surge, fit=wandering, moved=True)}, tuning=PLAIN)
    assert moved[0].budget.case.delay_found
    assert moved[0].noise is wandering.covariance


def test_a_motion_without_bands_states_why_and_the_others_have_theirs(
    vehicle: Vehicle, surge: DraftFit, heave: DraftFit, patch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object) -> None:
        raise ValueError("too short")

    patch.setattr(module, "measure", lambda record: fails() if record is heave.record else measure(record))
    found, failed = assess(vehicle, {0: surge, 2: heave}, tuning=PLAIN)
    assert (set(found), {axis: str(error) for axis, error in failed.items()}) == ({0}, {2: "too short"})
    patch.setattr(module, "budget_of", fails)
    found, failed = assess(vehicle, {0: surge}, tuning=PLAIN)
    assert (found, {axis: str(error) for axis, error in failed.items()}) == ({}, {0: "too short"})


def test_a_motion_that_alone_contradicts_the_model_does_not_decide_the_water_of_all(
    vehicle: Vehicle, surge: DraftFit, heave: DraftFit, patch: pytest.MonkeyPatch
) -> None:
    """A curve 1.4 % wrong at the low thrust of yaw: the five other motions were corrected by 12 to 25 %."""
    evidence = {0: [20.0, 20.0, 20.0, 0.0], 2: [-140.0, -130.0, -140.0, 0.0]}

    def corrected(drafts: dict[int, DraftFit]) -> float:
        said = iter([array(np.array(evidence[axis])) for axis in drafts])
        patch.setattr(module, "budget_of", lambda case: replace(budget_of(case), evidence=next(said)))
        band = result_of(MOTIONS["surge"], assess(vehicle, drafts, tuning=PLAIN)[0][0]).drag
        assert band is not None
        assert band.correction is not None
        return band.correction

    assert corrected({0: surge, 2: heave}) == pytest.approx(corrected({0: surge}), abs=0.01)


# ---- results


def evidence_of(patch: pytest.MonkeyPatch, motion: str, one: Assessment) -> tuple[Evidence, Any]:
    said: list[Evidence] = []

    def reasons(evidence: Evidence) -> list[Objection]:
        said.append(evidence)
        return [unnamed("because")]

    patch.setattr(module, "reasons_against", reasons)
    result = result_of(MOTIONS[motion], one)
    return said[0], result


@pytest.mark.parametrize(
    ("motion", "rows"), [("surge", [0, 1, 2, 3]), ("heave_down", [0, 1, 4, 5]), ("heave_up", [2, 3, 4, 5])]
)
def test_a_result_is_that_of_the_rows_of_its_motion(
    assessed: dict[int, Assessment], patch: pytest.MonkeyPatch, motion: str, rows: list[int]
) -> None:
    axis, side = MOTIONS[motion].axis, MOTIONS[motion].side
    one = assessed[axis]
    evidence, result = evidence_of(patch, motion, one)
    fit, square = one.fit, np.ix_(rows, rows)
    assert (result.motion, result.method, result.names) == (motion, "output-error", ("k_q", "k_l", "b", "added_mass"))
    assert result.covariance == pytest.approx(fit.covariance[square])
    assert (result.samples, result.effective_samples) == (fit.samples, fit.effective_samples)
    assert (result.identifiable, result.reasons) == (False, ("because",))
    excited = excitation(fit, side)
    assert result.speeds == (excited.low, excited.high)
    shown = one.budget.warnings()
    assert result.warnings[: len(shown)] == shown
    unseen = result.warnings[len(shown)]
    assert (unseen.code, unseen.numbers["causes"]) == (
        Code.UNSEEN,
        "thrust calibration and losses between thrusters and hull",
    )
    assert evidence.k == pytest.approx(fit.theta[rows[:2]])
    assert evidence.covariance == pytest.approx(one.separable[np.ix_(rows[:2], rows[:2])])
    assert evidence.excitation == excited
    assert (evidence.effective_samples, evidence.noise) == (fit.effective_samples, fit.sigmas[0])
    body = fit.model.rigid
    assert evidence.added_mass_sigmas == pytest.approx((fit.theta[-1] - body) / math.sqrt(one.calibrated[-1, -1]))
    assert evidence.converged
    assert evidence.validation is one.validation
    assert evidence.current == (0.02 if axis == 0 else 0.0)
    assert evidence.measured_speed == measured_speed(one.record, side)
    assert evidence.measurement_noise == measurement_noise(one.record)
    assert evidence.units == ("m/s", "N")
    for name, row in zip(("k_q", "k_l", "b"), rows, strict=False):
        number = result.coefficients[name]
        assert number.value == pytest.approx(fit.theta[row], rel=1e-9)
        assert number.std == pytest.approx(math.sqrt(fit.covariance[row, row]))
        assert number.std_calibrated == pytest.approx(math.sqrt(one.calibrated[row, row]))
    assert result.coefficients["added_mass"].value == pytest.approx(fit.theta[-1] - body)
    assert set(result.budget) == {*result.names, "drag"}
    for name, row in zip(result.names, rows, strict=True):
        wanted = _with_noise(float(one.noise[row, row]), one.budget.contributions(one.budget.shifts[row]))
        assert result.budget[name] == wanted


@pytest.mark.parametrize(("fit", "named"), [(0.9, True), (0.1, False)])
def test_no_cause_is_named_of_a_fit_that_is_none_of_the_motion(
    assessed: dict[int, Assessment], patch: pytest.MonkeyPatch, fit: float, named: bool
) -> None:
    """Its residuals resemble something in any case."""
    cause = objection(
        Code.EVIDENCE, influence="tether", shown="1.0 +- 0.1", unit="N", times=2.0, remedy="leave it slack"
    )
    patch.setattr(Budget, "warnings", lambda _self: (cause,))
    one = assessed[2]
    assert one.validation is not None
    found = result_of(MOTIONS["heave_down"], replace(one, validation=replace(one.validation, fit=fit, excess=9.0)))
    assert (Code.POOR_PREDICTION in [why.code for why in found.reasons]) is not named
    assert (cause in found.warnings) is named


@pytest.mark.parametrize(
    ("motion", "rows", "sign"), [("surge", [0, 1], 1.0), ("heave_down", [0, 1], 1.0), ("heave_up", [2, 3], -1.0)]
)
def test_the_drag_over_the_speeds_has_the_bands_of_its_coefficients(
    assessed: dict[int, Assessment], patch: pytest.MonkeyPatch, motion: str, rows: list[int], sign: float
) -> None:
    one = assessed[MOTIONS[motion].axis]
    evidence, result = evidence_of(patch, motion, one)
    band, theta = result.drag, one.fit.theta
    speed = np.linspace(result.speeds[0], result.speeds[1], 21)
    gradient = np.zeros((21, len(theta)))
    gradient[:, rows[0]], gradient[:, rows[1]] = speed**2, speed
    assert band.speed == pytest.approx(speed)
    assert band.force == pytest.approx(theta[rows[0]] * speed**2 + theta[rows[1]] * speed)

    def spread(covariance: Array) -> Array:
        return array(np.diag(gradient @ covariance @ gradient.T))

    sensitivity = one.budget.drag_sensitivity(array(gradient), array(sign * speed))
    assert band.std == pytest.approx(np.sqrt(spread(one.fit.covariance)))
    wide = spread(one.noise) + one.budget.variance(sensitivity)
    assert band.std_calibrated == pytest.approx(np.sqrt(wide))
    separable = spread(one.noise)[-1] + one.budget.variance(sensitivity, (RUN, MODEL))[-1]
    assert evidence.drag_std == pytest.approx(math.sqrt(separable))
    top, noise = sensitivity[-1], float(spread(one.noise)[-1])
    largest = _with_noise(noise, one.budget.contributions(top, (RUN, MODEL)))[0]
    assert evidence.largest is not None
    assert evidence.largest.influence == largest.influence
    assert evidence.largest.std == pytest.approx(largest.std)
    assert [row.influence for row in result.budget["drag"]] == [
        row.influence for row in _with_noise(noise, one.budget.contributions(top))
    ]
    step = _next_step(noise, float(wide[-1]), one.budget.variance_without(top))
    assert (result.next_step.remedy, result.next_step.std) == (step.remedy, pytest.approx(step.std))


def test_without_a_motion_there_is_no_band_of_the_drag(assessed: dict[int, Assessment]) -> None:
    one = assessed[0]
    still = replace(one.fit.linear.path, v=array(np.zeros(len(one.fit.linear.path.v))))
    parked = replace(one, fit=replace(one.fit, linear=replace(one.fit.linear, path=still)))
    assert result_of(MOTIONS["surge"], parked).drag is None
    steady = replace(still, v=array(np.full(len(still.v), 0.3)))
    one_speed = replace(one, fit=replace(one.fit, linear=replace(one.fit.linear, path=steady)))
    assert result_of(MOTIONS["surge"], one_speed).drag is None


@pytest.mark.parametrize(("b", "offset"), [(0.5, 0.2), (-0.5, 0.2), (0.25, 0.0), (-0.25, 0.0)])
def test_an_offset_is_what_is_left_of_b_after_three_deviations(
    assessed: dict[int, Assessment], patch: pytest.MonkeyPatch, b: float, offset: float
) -> None:
    def with_b(one: Assessment, at: int) -> Assessment:
        theta, calibrated = one.fit.theta.copy(), one.calibrated.copy()
        theta[at], calibrated[at, :], calibrated[:, at], calibrated[at, at] = b, 0.0, 0.0, 0.1**2
        return replace(one, fit=replace(one.fit, theta=theta), calibrated=calibrated)

    evidence, _ = evidence_of(patch, "surge", with_b(assessed[0], 2))
    assert evidence.offset == pytest.approx(offset)
    # In heave it is the net buoyancy.
    evidence, _ = evidence_of(patch, "heave_up", with_b(assessed[2], 4))
    assert evidence.offset == 0.0


def test_a_turn_is_judged_as_one(assessed: dict[int, Assessment], patch: pytest.MonkeyPatch) -> None:
    one = assessed[0]
    positions = replace(one.fit, model=Model(5, 0.4), sigmas=(math.nan, 0.03))
    evidence, result = evidence_of(patch, "yaw", replace(one, fit=positions))
    assert evidence.units == ("rad/s", "N m")
    assert evidence.noise == 0.0
    assert result.quality["residual_std"] == 0.03
    evidence, _ = evidence_of(patch, "roll", replace(one, fit=replace(one.fit, model=Model(3, 0.4))))
    assert evidence.units == ("rad/s", "N m")


# ---- numbers

C = array(np.diag([4.0, 1.0, 0.01, 9.0]))


def test_numbers_are_the_parameters_and_their_deviations() -> None:
    model, theta = Model(0, 15.0), array(np.array([60.0, 2.0, 0.1, 27.0]))
    found = numbers_of(model, MOTIONS["surge"], theta, C, array(4.0 * C))
    assert {name: (one.value, one.std, one.std_calibrated) for name, one in found.items()} == {
        "k_q": (60.0, 2.0, 4.0), "k_l": (2.0, 1.0, 2.0), "b": (0.1, 0.1, 0.2), "added_mass": (12.0, 3.0, 6.0),
    }  # fmt: skip
    assert [one.unit for one in found.values()] == ["N s^2/m^2", "N s/m", "N", "kg"]
    assert theta.tolist() == [60.0, 2.0, 0.1, 27.0]
    assert all(math.isnan(one.std_calibrated) for one in numbers_of(model, MOTIONS["surge"], theta, C).values())
    rounded = array(np.diag([-1e-18, 1.0, 0.01, 9.0]))
    assert numbers_of(model, MOTIONS["surge"], theta, rounded)["k_q"].std == 0.0


@pytest.mark.parametrize(("sigma", "known"), [(8.0, True), (8.2, False), (0.0, False)])
def test_a_mass_that_is_known_to_less_than_three_tenths_is_left_out(sigma: float, known: bool) -> None:
    spread = array(np.diag([4.0, 1.0, 0.01, sigma**2]))
    found = numbers_of(Model(0, 15.0), MOTIONS["surge"], array(np.array([60.0, 2.0, 0.1, 27.0])), spread)
    assert ("added_mass" in found) is known


@pytest.mark.parametrize(("k_q", "reported"), [(-5.9, 0.0), (-6.1, -6.1)])
def test_a_value_is_within_its_bounds_unless_it_clearly_is_not(k_q: float, reported: float) -> None:
    theta = array(np.array([k_q, 2.0, 0.1, 27.0]))
    assert numbers_of(Model(0, 15.0), MOTIONS["surge"], theta, C)["k_q"].value == reported


# ---- budgets


def test_the_next_step_leaves_least() -> None:
    """Variance 10, of which 4 are noise: flown twice, 8 are left; without the others what they leave, and the noise."""
    weigh, wait = Remedy("weigh"), Remedy("wait")
    assert _next_step(4.0, 10.0, {weigh: 5.0, wait: 6.0}) == NextStep(FLY_TWICE, math.sqrt(8.0))
    assert _next_step(4.0, 10.0, {weigh: 5.0, wait: 3.0}) == NextStep(wait, math.sqrt(7.0))
    assert _next_step(4.0, 10.0, {}) == NextStep(FLY_TWICE, math.sqrt(8.0))
    assert _next_step(0.0, 10.0, {wait: -1e-12}) == NextStep(wait, 0.0)


def test_a_noisy_record_is_best_flown_twice(assessed: dict[int, Assessment]) -> None:
    noisy = replace(assessed[0], noise=array(1e6 * assessed[0].noise))
    result = result_of(MOTIONS["surge"], noisy)
    assert result.next_step is not None
    assert result.drag is not None
    top = np.array([result.speeds[1] ** 2, result.speeds[1], 0.0, 0.0])
    left = result.drag.std_calibrated[-1] ** 2 - 0.5 * float(top @ noisy.noise @ top)
    assert result.next_step.remedy == FLY_TWICE
    # All but the noise is little here, and its mean is corrected.
    assert result.next_step.std == pytest.approx(math.sqrt(left), rel=1e-3)


def test_rows_of_less_than_a_hundredth_of_the_largest_are_left_out() -> None:
    rows = [
        Contribution("a", 0.5, "x"),
        Contribution("b", 2.0, "y"),
        Contribution("c", 0.019, "z"),
        Contribution("d", 0.021, "z"),
    ]
    found = _with_noise(1.0, rows)
    assert [(row.influence, row.std) for row in found] == [
        ("b", 2.0),
        ("noise of the record", 1.0),
        ("a", 0.5),
        ("d", 0.021),
    ]
    assert found[1].remedy == "fly longer, or more runs"
    assert _with_noise(-1e-18, []) == [Contribution("noise of the record", 0.0, "fly longer, or more runs")]


def test_plateaus_have_the_batch_fit_of_their_side(assessed: dict[int, Assessment]) -> None:
    for motion in ("heave_down", "heave_up", "surge"):
        one = assessed[MOTIONS[motion].axis]
        plateaus = measure(one.record)
        batch = fit_plateaus(plateaus.on_side(MOTIONS[motion].side))
        found = result_of(MOTIONS[motion], one).methods
        assert ("plateaus" in found) is (batch is not None)
        if batch is None:
            continue
        for at, name in enumerate(("k_q", "k_l", "b")):
            number = found["plateaus"][name]
            assert (number.value, number.std) == (batch.theta[at], math.sqrt(batch.covariance[at, at]))
        assert [number.unit for number in found["plateaus"].values()] == ["N s^2/m^2", "N s/m", "N"]
    found = result_of(MOTIONS["surge"], assessed[0]).methods
    assert found["ekf"]["k_q"].value == pytest.approx(1.1 * 66.48)
    assert found["rls"]["k_l"].std == pytest.approx(math.sqrt(assessed[0].online["rls"][1][1, 1]))


def test_quality_states_what_it_rests_on(assessed: dict[int, Assessment]) -> None:
    one = assessed[0]
    found = result_of(MOTIONS["surge"], one).quality
    assert found["residual_std"] == one.fit.sigmas[0]
    assert (found["ljung_box"], found["ljung_box_expected"]) == (one.whiteness.statistic, one.whiteness.expected)
    assert found["largest_inflation"] == one.fit.inflation.max()
    assert found["plateaus"] == len(one.plateaus.v) == 8
    assert (found["lag_s"], found["latency_s"]) == (0.15, 0.01)
    assert (found["current_mps"], found["current_sigma_mps"]) == one.budget.found("current")
    assert one.validation is not None
    assert (found["held_out_fit"], found["held_out_excess"]) == (one.validation.fit, one.validation.excess)
    errors = one.validation.prediction.errors
    assert {name: found[f"held_out_{name}"] for name in errors} == errors
    bare = result_of(MOTIONS["heave_up"], replace(assessed[2], validation=None)).quality
    assert "current_mps" not in bare
    assert "held_out_fit" not in bare


def test_a_motion_without_data_is_not_identified() -> None:
    found = unidentified(MOTIONS["roll"], unnamed("nothing moved"))
    assert (found.motion, found.method, found.names, found.coefficients) == ("roll", "none", (), {})
    assert (found.identifiable, found.reasons, found.drag) == (False, ("nothing moved",), None)
    assert (found.samples, found.effective_samples, found.speeds) == (0, 0.0, (0.0, 0.0))
    assert found.covariance.shape == (0, 0)
