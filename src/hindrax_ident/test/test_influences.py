"""Every row of the uncertainty budget, made to act on a record: what it does is in the band."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hindrax_core.vehicle import AxisGain, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.axis_fit import AxisFit
from hindrax_ident.assess.influences import GAIN, INFLUENCES, LAG, LATENCY, MODEL, RUN, Influence, acting
from hindrax_ident.assess.uncertainty_budget import ALL, Budget, _Likelihood, _posterior, _prior, budget_of
from hindrax_ident.fit.output_error import refine
from hindrax_ident.model.model_parameters import wide_prior
from hindrax_ident.model.motion_model import model_of, speed_across
from hindrax_ident.model.simulation import sensitivities
from hindrax_ident.records.axis_record import Record, Series, Stretch, ThrusterForces
from hindrax_ident.remedies import WEIGH_THRUST
from hindrax_ident.testing.synthetic_runs import back_and_forth, fly
from hindrax_ident.tuning import Tuning

SURGE = np.array([66.48, 1.25, 0.0, 27.3])
TUNING = Tuning(velocity_gain_sigma=0.005, thrust_doubt=0.02, wrench_gain_sigma=0.02, stamp_doubt_s=0.002)
GREAT, PLAIN = 3.0, 6.0
OF_RANGES = ("speed of sound of the sonar", "angle of sonar and wall", "wander of the heading")
OF_OTHERS = ("masses of other axes", "gain by a known weight", *OF_RANGES)
ACTING = [row for row in INFLUENCES if row.name not in OF_OTHERS]
TOLD = ("tether", "fluid memory", "own wake")
"""Rows that no other row can explain."""


@pytest.fixture(scope="module")
def flown(vehicle: Vehicle) -> AxisFit:
    """A run of surge without noise and its fit, about which the rows act; the noise comes later."""
    return flight_of(replace(vehicle, output=replace(vehicle.output, device="ardusub")), 0, SURGE)


@pytest.fixture(scope="module")
def across(vehicle: Vehicle) -> AxisFit:
    """The same with the drag by the speed across among the parameters, of which the water has none."""
    return flight_of(vehicle, 0, SURGE, by_speed_across=True)


def flight_of(
    vehicle: Vehicle, axis: int, theta: Array, *, by_speed_across: bool = False, seconds: float = 63.9
) -> AxisFit:
    model = model_of(vehicle, axis)
    flight = fly(model, theta, back_and_forth((3.2, 6.0, 9.5, 13.5), 4.0, 64.0), 0.15)
    rng = np.random.default_rng(4)
    t, v = flight.grid.times_s[::10], flight.path.v[::10]
    flown = t <= seconds
    measured = Series(t[flown], (v + 0.004 * rng.standard_normal(len(t)))[flown])
    thrust = Series(flight.times_s, flight.commands)
    idling = Series(thrust.t, thrust.y**2 + 8.0)
    others = tuple(Series(t, array((one != axis) * 0.1 * np.sin((0.3 + 0.1 * one) * t))) for one in range(6))
    record = Record(measured, thrust, (Stretch(0.0, seconds),), effort=idling, others=others, lag_s=0.15)
    if by_speed_across:
        record = replace(record, across=Series(t, speed_across(vehicle, axis, [one.y for one in others])))
        model = replace(model, crossed=True)
    prior = wide_prior(vehicle, model)
    return AxisFit(vehicle, record, refine(model, record, prior.values, prior), TUNING)


def with_influence(case: AxisFit, row: Influence, size: float) -> AxisFit:
    """The run with an influence of this size in its record, fitted again."""
    column, clean = size * row.effect(case)[:, :1], case.fit
    problem = clean.problem
    if row.of_readings:
        moved = column[:, 0]
    else:
        response = sensitivities(clean.model, clean.theta, problem.grid, clean.linear.path, column)
        moved = response[problem.index, problem.channel, -1]
    t = problem.t
    acted = replace(case.record, velocity=Series(t, case.record.velocity.between(t[0], t[-1]).y + moved))
    return replace(
        case, record=acted, fit=refine(clean.model, acted, clean.theta, wide_prior(case.vehicle, clean.model))
    )


@pytest.mark.parametrize("row", ACTING, ids=lambda row: row.name)
def test_what_a_row_does_is_within_the_band(flown: AxisFit, across: AxisFit, row: Influence) -> None:
    truth = SURGE
    if row.name == "drag by incidence":
        flown, truth = across, np.insert(SURGE, 3, 0.0)
    if row.name == "filter of the velocity":
        flown = replace(flown, record=replace(flown.record, smoothing_s=2.0))
    if row.name in ("averaging of the table", "averaging of the velocity"):
        flown = replace(flown, tuning=replace(flown.tuning, lag_doubt_s=0.1))
    size = row.sigma(replace(flown, tuning=Tuning()) if row.name == "losses that change with the load" else flown)
    assert size > 0.0
    # What cannot be told is as great as is believed; the rest is far greater.
    size *= 1.0 if row.scope == GAIN or row.considered else PLAIN if row.name in TOLD else GREAT
    case = with_influence(flown, row, size)
    budget = budget_of(case)
    sigmas = np.sqrt(np.diag(case.fit.covariance + budget.band()))
    assert np.all(np.abs(case.fit.theta - truth) < 3.0 * sigmas)
    if row.name in TOLD:
        assert any(row.name in warning for warning in budget.warnings())
        # Such water is not that of the model: it may have what no record shows.
        assert math.hypot(*budget.found("inflow loss")) > 1.4 * math.hypot(*budget_of(flown).found("inflow loss"))


def test_a_known_weight_takes_what_it_measured_off_the_budget(flown: AxisFit) -> None:
    gain = AxisGain(load=13.5, sigma=0.004, positive=1.0, negative=1.0)
    weighed = budget_of(replace(flown, vehicle=replace(flown.vehicle, thrust_gain={"surge": gain})))
    before = budget_of(flown)
    assert weighed.prior("losses between thrusters and hull") == 0.0
    # A gain that is wrong by a standard deviation scales every coefficient by it.
    band = np.sqrt(np.diag(weighed.prior_band("gain by a known weight")))
    assert band[[0, 3]] == pytest.approx(0.004 * SURGE[[0, 3]], rel=0.1)
    of_drag = np.array([flown.speed**2, flown.speed, 0.0, 0.0])
    for name in ("thrust calibration", "sag under load", "dead bands that differ"):
        drags = [of_drag @ budget.prior_band(name) @ of_drag for budget in (weighed, before)]
        assert drags[0] < 0.1 * drags[1]
    pool = array([-1e3, -1e3, -1e3, 0.0])
    wide, narrow = (of_drag @ one.in_water(pool).band() @ of_drag for one in (before, weighed))
    assert narrow < 0.5 * wide


def test_a_weight_on_one_side_leaves_the_losses_of_the_other(flown: AxisFit) -> None:
    half = AxisGain(load=13.5, sigma=0.004, positive=1.0)
    both = replace(half, negative=1.0)
    bands = [
        budget_of(replace(flown, vehicle=replace(flown.vehicle, thrust_gain=gain))).band()[3, 3]
        for gain in ({}, {"surge": half}, {"surge": both}, {"sway": both})
    ]
    assert bands[0] == bands[3] > bands[1] > bands[2]


def test_a_tether_turns_a_vehicle_that_turns(vehicle: Vehicle) -> None:
    """Its moment goes with the sine of the heading, and is told from all that goes with speed or time."""
    (tether,) = (row for row in INFLUENCES if row.name == "tether")
    theta = np.array([2.0, 0.1, 0.0, 0.9])
    case = with_influence(flight_of(vehicle, 5, theta), tether, 1.0)
    assert any("tether" in warning for warning in budget_of(case).warnings())


def test_thrusters_that_oppose_each_other_damp_by_inflow_however_little_they_push(flown: AxisFit) -> None:
    """The allocator holds idle thrusters against each other, out of their dead bands."""

    def shift(case: AxisFit) -> Array:
        budget = budget_of(case)
        (at,) = (columns.start for columns, row, _ in budget.rows if row.name == "inflow loss")
        return np.abs(budget.shifts[:, at])

    times = flown.record.thrust.t
    forces_N = np.full((len(times), 4), 2.0) * [1.0, 1.0, -1.0, -1.0]
    opposed = replace(flown.record, forces=ThrusterForces(times, array(np.full(4, 0.57)), array(forces_N)))
    (_, before, *_), (k_q, k_l, *_) = shift(flown), shift(replace(flown, record=opposed))
    top = flown.speed
    assert k_l > 2.0 * before
    assert k_l * top > 5.0 * k_q * top**2


def test_what_is_far_beyond_any_pool_is_no_explanation(flown: AxisFit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Budget, "_needs", lambda *_: True)
    budget = budget_of(flown)
    (at,) = (columns.start for columns, row, _ in budget.rows if row.name == "sag over the run")
    for times, words in ((-5.0, "sag over the run (-0.3464 +- 0.0069 in"), (-59.0, "no influence explains")):
        mean = np.zeros(len(budget.mean))
        mean[at] = times
        covariance = 0.01 * np.eye(len(mean))
        (informative,) = replace(budget, mean=mean, covariance=covariance).warnings()
        assert words in informative
    assert "59 times the size in a pool" in informative


@pytest.mark.parametrize(("lag_s", "named"), [(0.3, {LAG, LATENCY}), (-0.1, set())])
def test_a_thrust_before_its_command_is_no_lag_and_leaves_no_latency(
    flown: AxisFit, monkeypatch: pytest.MonkeyPatch, lag_s: float, named: set[str]
) -> None:
    """A PX4 log was told to set 0.1 s of latency, for a lag of -0.1 s."""
    monkeypatch.setattr(Budget, "_needs", lambda *_: True)
    budget = budget_of(flown)
    mean = np.zeros(len(budget.mean))
    for row, one, sigma in budget.rows:
        if one.name in (LAG, LATENCY):
            mean[row] = (lag_s - flown.record.lag_s if one.name == LAG else 0.1) / sigma
    warnings = replace(budget, mean=mean, covariance=0.01 * np.eye(len(mean))).warnings()
    assert {str(one.numbers["influence"]).partition(" or ")[0] for one in warnings} == named


def test_what_may_not_be_judged_and_explains_a_record_as_well_leaves_no_cause(flown: AxisFit) -> None:
    """Inflow loss, in the place of which a sag would be named."""
    (inflow,) = (one for one in INFLUENCES if one.name == "inflow loss")
    budget = budget_of(with_influence(flown, inflow, 3.0 * inflow.sigma(flown)))
    mean = np.zeros(len(budget.mean))
    for row, one, _ in budget.rows:
        mean[row] = 6.0 * (one.name == "sag under load")
    assert replace(budget, mean=mean, covariance=0.01 * np.eye(len(mean))).warnings() == ()


def test_a_loss_that_a_record_hardly_shows_is_never_greater_than_the_thrust() -> None:
    # The thrust seems to rise by a factor of three: what no row knows looks like that in a short record.
    far, spread = -22.0, 7.0
    for name, is_loss in (("sag over the run", True), ("tether", False)):
        (row,) = (one for one in INFLUENCES if one.name == name)
        information = np.full((1, 1), spread**-2)
        found = _posterior(_Likelihood(information, far * information[0], _prior([(slice(0, 1), row, 1.0)])))
        assert bool(found.mean[0] > -1.0) is is_loss
        assert bool(found.covariance[0, 0] < 1.0) is is_loss


def test_a_plant_without_losses_is_not_corrected_for_any(flown: AxisFit) -> None:
    """Such as a simulator: its raw fit was right to a percent, and reported 10 to 29 % too low."""
    simulated = replace(flown, vehicle=replace(flown.vehicle, losses=False))
    named = [{row.name for row, _ in acting(one)} for one in (flown, simulated)]
    # Its thrusters are alike as well: dead bands of a SITL, which has none, took 3 to 5 % off a yaw that was right.
    alike = {row.name for row in INFLUENCES if row.of_each}
    assert alike == {"dead bands that differ", "differences between idle thrusters"}
    assert named[0] - named[1] == {row.name for row in INFLUENCES if row.loss} | alike
    (load,) = (
        replace(row, sigma=lambda _: 0.03) for row in INFLUENCES if row.name == "losses that change with the load"
    )
    assert [bool(acting(one, (load,))) for one in (flown, simulated)] == [True, False]
    assert named[1] < named[0]
    pool = array([-1e3, -1e3, -1e3, 0.0])
    of_drag = np.array([flown.speed**2, flown.speed, 0.0, 0.0])
    corrections = []
    for case in (flown, simulated, replace(simulated, vehicle=replace(simulated.vehicle, thrusters=()))):
        budget = budget_of(case).in_water(pool)
        draws = budget.draws(case.fit.covariance)
        corrections.append(float(draws.weight @ draws.influences @ budget.shifts.T @ of_drag) / flown.top_drag)
    assert corrections[0] > 0.1
    assert corrections[1:] == pytest.approx([0.0, 0.0], abs=0.02)


@pytest.mark.parametrize("shown", [0.0, 1.0])
def test_inflow_that_one_motion_shows_counts_for_those_that_cannot_show_it(shown: float) -> None:
    """It is a number of the thrusters; the rest of the water stays near the model all the same."""
    rows = [one for one in INFLUENCES if one.name in ("inflow loss", "sag under load")]
    at = {row.name: index for index, row in enumerate(rows)}
    prior = _prior([(slice(index, index + 1), row, 1.0) for index, row in enumerate(rows)])
    informative, silent, seen = 25.0 * np.eye(2), np.zeros((2, 2)), np.zeros(2)
    seen[at["inflow loss"]] = shown
    by_other_rows = array([0.0, -5.0, 0.0, -10.0])
    evidence = [_posterior(_Likelihood(one, one @ seen, prior)).evidence for one in (informative, silent)]
    found = _posterior(_Likelihood(silent, np.zeros(2), prior), array(sum(evidence, by_other_rows)))
    moment = np.diag(found.covariance) + found.mean**2
    assert bool(moment[at["inflow loss"]] > 0.3) is bool(shown)
    assert bool(moment[at["inflow loss"]] < 0.1) is not bool(shown)
    assert moment[at["sag under load"]] < 0.1


@pytest.mark.parametrize(
    ("name", "tuning", "sigma"),
    [
        ("thrust lag", Tuning(lag_doubt_s=0.3), 0.3),
        ("latency of the velocity", Tuning(lag_doubt_s=0.3), 0.3),
        ("thrust lag", Tuning(timing_sigma_s=0.04), 0.04),
        ("dead band of the thrust", Tuning(), 0.0),
        ("dead band of the thrust", Tuning(thrust_doubt=0.01), 1.0),
        ("stamps of the record", Tuning(stamp_doubt_s=0.007), 0.007),
        ("gain of the wrench", Tuning(wrench_gain_sigma=0.03), 0.03),
        ("gain of the velocity", Tuning(velocity_gain_sigma=0.01), 0.01),
        ("current", Tuning(current_sigma_mps=0.02), 0.02),
    ],
)
def test_what_the_tuning_doubts_is_the_deviation_of_its_row(
    flown: AxisFit, name: str, tuning: Tuning, sigma: float
) -> None:
    (row,) = (row for row in INFLUENCES if row.name == name)
    assert row.sigma(replace(flown, tuning=tuning)) == sigma


def test_a_doubted_thrust_may_be_the_pull_of_a_tether(flown: AxisFit) -> None:
    (row,) = (row for row in INFLUENCES if row.name == "tether")
    known, doubted = (replace(flown, tuning=Tuning(thrust_doubt=doubt)) for doubt in (0.0, 0.1))
    assert 0.0 < row.sigma(known) < row.sigma(doubted) == pytest.approx(0.1 * doubted.pull)


def test_names_are_distinct_and_every_row_has_a_remedy() -> None:
    assert len({row.name for row in INFLUENCES}) == len(INFLUENCES)
    assert all(row.remedy and row.unit for row in INFLUENCES)


def test_contributions_of_independent_rows_are_sensitivity_times_deviation(flown: AxisFit) -> None:
    rows = [row for row in INFLUENCES if row.name in ("thrust calibration", "tilt of the mount")]
    budget = budget_of(flown, rows)
    total = np.sqrt(sum(one.std**2 for one in budget.contributions(budget.shifts[0])))
    assert total == pytest.approx(np.sqrt(budget.band()[0, 0]))
    assert budget.contributions(budget.shifts[0])[0].influence == "thrust calibration"


def test_what_a_remedy_leaves_is_the_band_without_its_rows(flown: AxisFit) -> None:
    rows = {row.name: row for row in INFLUENCES}
    gains, delays = (
        ("thrust calibration", "losses between thrusters and hull"),
        ("thrust lag", "latency of the velocity"),
    )
    gradient = np.array([[flown.speed**2, flown.speed, 0.0, 0.0]])
    v = np.array([flown.speed])
    every, rest = (budget_of(flown, tuple(rows[name] for name in names)) for names in (gains + delays, delays))
    sensitivity = every.drag_sensitivity(gradient, v)
    left = every.variance_without(sensitivity[0])
    assert left.keys() == {rows[name].remedy for name in gains + delays}
    without = rest.drag_sensitivity(gradient, v)[0]
    assert left[WEIGH_THRUST] == pytest.approx(without @ rest.covariance @ without)
    assert min(left.values()) < every.variance(sensitivity)[0]


def test_a_motion_that_was_cut_off_at_once_has_a_budget(vehicle: Vehicle) -> None:
    """Shorter than what the velocities of the other axes are smoothed over."""
    case = flight_of(vehicle, 0, SURGE, seconds=0.4)
    assert case.others.shape == (len(case.v), 6)
    assert np.all(np.isfinite(budget_of(case).mean))


def test_contributions_of_some_scopes_leave_the_others_out(flown: AxisFit) -> None:
    budget = budget_of(flown)
    sensitivity = budget.drag_sensitivity(np.array([[flown.speed**2, flown.speed, 0.0, 0.0]]), np.array([flown.speed]))
    every, some = (
        {row.influence for row in budget.contributions(sensitivity[0], scopes)} for scopes in (ALL, (RUN, MODEL))
    )
    assert every - some == {row.name for _, row, _ in budget.rows if row.scope == GAIN} != set()


def test_ranges_to_a_wall_have_rows_of_their_own(flown: AxisFit) -> None:
    def names(case: AxisFit) -> set[str]:
        return {row.name for row, _ in acting(case)}

    ranged = replace(flown, record=replace(flown.record, ranged=True))
    assert names(ranged) - names(flown) == set(OF_RANGES)
