"""The session: events in, estimates and results out; the same from any order, honest about what it does not know."""

import math
import random
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hindrax_core.events import Stamped, after, stamp_from_s
from hindrax_core.signals import Attitude, Estimate, IdentEvent, Phase, Supply, Thrust, Velocity
from hindrax_core.text.coded import Coded
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array
from hindrax_ident.assess.objections import Code
from hindrax_ident.assess.results import Results, truth_of, with_truth
from hindrax_ident.model.motion_model import Model, model_of, motions_of, unit_wrench
from hindrax_ident.online.sample_verdict import NotLearned, not_learned
from hindrax_ident.online.session import Session
from hindrax_ident.records.feed import Feed
from hindrax_ident.testing.synthetic_runs import back_and_forth, events, fly, sensors_of
from hindrax_ident.tuning import Tuning

pytestmark = pytest.mark.long
LEVELS = {0: (3.2, 6.0, 9.5, 13.5), 1: (4.0, 9.0, 14.0, 20.0), 2: (5.0, 12.0, 20.0, 30.0), 3: (0.5, 0.9, 1.2, 1.4),
          4: (0.6, 1.0, 1.4, 1.7), 5: (0.6, 1.2, 2.0, 2.8)}  # fmt: skip
SPANS_S = {0: 10.0, 1: 10.0, 2: 4.0, 3: 5.0, 4: 5.0, 5: 8.0}
NAMES = ("surge", "sway", "heave", "roll", "pitch", "yaw")
Followed = tuple[Session, list[Stamped[Estimate]]]


def theta_of(vehicle: Vehicle, axis: int) -> tuple[Model, Array]:
    truth, model = truth_of(vehicle), model_of(vehicle, axis)
    first, last = truth[motions_of(axis)[0].name], truth[motions_of(axis)[-1].name]
    drag = [first["k_q"], first["k_l"], *([last["k_q"], last["k_l"]] if model.split else [])]
    flush = [first["k_r"]] if model.restores else []
    return model, np.array([*drag, first["b"], *flush, model.rigid + first["added_mass"]])


def received(vehicle: Vehicle, axis: int, seed: int = 1, end_s: float = 80.0, **options: Any) -> list[Any]:
    model, theta = theta_of(vehicle, axis)
    flight = fly(model, theta, back_and_forth(LEVELS[axis], SPANS_S[axis], end_s), 0.15)
    motion = motions_of(axis)[0].name
    rng = np.random.default_rng(seed)
    return list(events(flight, axis, motion, options.pop("sensors", sensors_of(axis)), rng, **options))


def run(
    vehicle: Vehicle,
    inputs: list[Stamped[IdentEvent]],
    tuning: Tuning | None = None,
) -> Followed:
    session = Session(vehicle, tuning)
    feed = Feed(vehicle, session.tuning)
    estimates = [estimate for event in feed.all(inputs) for estimate in session.step(event)]
    return session, estimates


def learned(vehicle: Vehicle, inputs: list[Stamped[IdentEvent]], tuning: Tuning | None = None) -> Session:
    """A session without the estimates of `run`: it learns the same."""
    session = Session(vehicle, tuning, every_s=math.inf)
    for event in Feed(vehicle, session.tuning).all(inputs):
        session.step(event)
    return session


@pytest.fixture(scope="module")
def surge(vehicle: Vehicle) -> list[Any]:
    return received(vehicle, 0, plateau_s=6.0)


@pytest.fixture(scope="module")
def followed(vehicle: Vehicle, surge: list[Any]) -> Followed:
    """Session and estimates of `surge` as it is, only looked at: many tests compare with them."""
    return run(vehicle, surge)


@pytest.fixture(scope="module")
def refined(followed: Followed) -> Results:
    """Results of `surge` as it is."""
    return followed[0].finalize().results


def test_a_record_knows_what_each_thruster_did_unless_one_thrust_does_not_tell(
    vehicle: Vehicle, surge: list[Any]
) -> None:
    forces = tuple(float(n) for n in range(-4, 4))

    def reported(first: tuple[float, ...]) -> list[Any]:
        thrusts = [one for one in surge if isinstance(one.reading, Thrust)]
        parts = {id(one): Thrust(one.reading.wrench, forces if one is not thrusts[0] else first) for one in thrusts}
        return [Stamped(one.stamp, parts.get(id(one), one.reading)) for one in surge]

    record = learned(vehicle, reported(forces)).finalize().assessments[0].record
    ahead = np.array([unit_wrench(vehicle, one)[0] for one in vehicle.thrusters])
    assert record.effort.y == pytest.approx(float(np.sum((ahead * forces) ** 2)))
    inflow = record.forces.inflow(record.forces.t, record.lag_s)
    assert inflow == pytest.approx(float(np.sum(ahead**2 * np.sqrt(np.abs(forces)))))
    unknown = learned(vehicle, reported(())).finalize().assessments[0].record
    assert len(unknown.effort) == len(unknown.forces) == 0


@pytest.mark.parametrize("axis", range(6), ids=NAMES)
def test_truth_lies_within_three_standard_deviations(vehicle: Vehicle, axis: int) -> None:
    session = learned(vehicle, received(vehicle, axis, plateau_s=3.0))
    begun: list[str] = []
    results = with_truth(session.finalize(begun.append).results, truth_of(vehicle))
    assert begun == [f"{step} of {NAMES[axis]}, 1 of 1" for step in ("fit", "uncertainty")]
    assert set(results.motions) == {motion.name for motion in motions_of(axis)}
    for result in results.motions.values():
        assert result.identifiable, result.reasons
        for name, number in result.coefficients.items():
            assert number.truth is not None
            assert abs(number.value - number.truth) < 3.5 * number.std, (name, number)
            assert number.std_calibrated >= number.std
        high = result.speeds[1]
        force, _ = result.drag_force(high)
        k_q, k_l = (result.coefficients[name].truth for name in ("k_q", "k_l"))
        assert k_q is not None
        assert k_l is not None
        truth = k_q * high**2 + k_l * high
        assert force == pytest.approx(truth, rel=0.02)


def test_an_estimate_follows_every_sample_and_states_what_became_of_it(surge: list[Any], followed: Followed) -> None:
    _, estimates = followed
    samples = sum(isinstance(event.reading, Velocity) for event in surge)
    assert len(estimates) > samples - 20
    first, last = estimates[0].reading, estimates[-1].reading
    assert not first.learning
    assert first.reason == not_learned(NotLearned.FIRST_VELOCITY)
    assert last.learning
    assert last.reason == ""
    assert last.names == ("k_q", "k_l", "b", "added_mass")
    assert last.units == ("N s^2/m^2", "N s/m", "N", "kg")
    assert 0 < last.effective_samples <= 5.0 * last.samples
    stamps = [estimate.stamp for estimate in estimates]
    assert stamps == sorted(stamps)
    assert all(sigma > 0.0 for sigma in last.sigmas)


def test_online_estimate_is_close_to_the_refined_one(followed: Followed, refined: Results) -> None:
    numbers = refined.motions["surge"].coefficients
    last = followed[1][-1].reading
    for name, value, sigma in zip(last.names, last.values, last.sigmas, strict=True):
        assert abs(value - numbers[name].value) < 5.0 * sigma


def test_the_joint_filter_is_an_online_estimator_too(vehicle: Vehicle, surge: list[Any]) -> None:
    session, estimates = run(vehicle, surge, Tuning(estimator="ekf"))
    truth = truth_of(vehicle)["surge"]
    last = estimates[-1].reading
    for name, value, sigma in zip(last.names, last.values, last.sigmas, strict=True):
        assert abs(value - truth[name]) < 5.0 * sigma
    assert set(session.finalize().results.motions["surge"].methods) == {"ekf", "plateaus"}


def test_same_events_give_the_same_bits(
    vehicle: Vehicle, surge: list[Any], followed: Followed, refined: Results
) -> None:
    session, estimates = run(vehicle, surge)
    # Text, because the innovation of a sample that was not learned from is not a number.
    assert repr(estimates) == repr(followed[1])
    assert session.finalize().results.to_json() == refined.to_json()


def test_estimates_that_nobody_wants_so_often_are_left_out_and_the_same_is_learned(
    vehicle: Vehicle, surge: list[Any], followed: Followed
) -> None:
    session, every = followed
    for every_s in (2.0, math.inf):
        seldom = Session(vehicle, every_s=every_s)
        found = [one for event in Feed(vehicle, seldom.tuning).all(surge) for one in seldom.step(event)]
        assert {(one.stamp, one.reading.values) for one in found} <= {(one.stamp, one.reading.values) for one in every}
        assert len(found) == pytest.approx(80.0 / every_s, abs=2)
        assert min(np.diff([one.stamp for one in found]), default=2e9) >= 2e9
        learned, there = (one._axes[0].estimator.estimate() for one in (seldom, session))
        assert all(np.array_equal(one, other) for one, other in zip(learned, there, strict=True))


def test_who_listens_earlier_learns_the_same_bits(vehicle: Vehicle, surge: list[Any], followed: Followed) -> None:
    """As the identifier hears the vehicle before the recorder is up, and a replay has what was recorded."""
    t0, thrust = surge[0].stamp, next(one for one in surge if isinstance(one.reading, Thrust))
    before = [
        Stamped(after(t0, -7.3), Velocity((0.1,) * 6, "dvl75")),
        Stamped(after(t0, -3.1), thrust.reading),
    ]
    assert repr(run(vehicle, before + surge)[1]) == repr(followed[1])


@pytest.mark.parametrize("seed", range(2))
def test_the_order_of_arrival_does_not_matter(vehicle: Vehicle, surge: list[Any], refined: Results, seed: int) -> None:
    rng = random.Random(seed)
    mixed = sorted(surge, key=lambda event: event.stamp / 1e9 + rng.uniform(0.0, 0.2))
    assert mixed != surge
    assert learned(vehicle, mixed).finalize().results.to_json() == refined.to_json()


def test_nothing_is_learned_in_other_phases(vehicle: Vehicle, surge: list[Any]) -> None:
    parked = [
        Stamped(event.stamp, Phase("surge", "settle")) if isinstance(event.reading, Phase) else event for event in surge
    ]
    session, estimates = run(vehicle, parked)
    assert {estimate.reading.reason for estimate in estimates} == {not_learned(NotLearned.PHASE, phase="settle")}
    assert estimates[-1].reading.samples == 0
    result = session.finalize().results.motions["surge"]
    assert not result.identifiable
    assert result.reasons[0].code is Code.UNUSABLE


def test_without_a_motion_there_is_nothing(vehicle: Vehicle, surge: list[Any]) -> None:
    session, estimates = run(vehicle, [event for event in surge if not isinstance(event.reading, Phase)])
    assert estimates == []
    assert session.finalize().results.motions == {}


def test_a_gap_and_a_stale_thrust_are_held_and_named(vehicle: Vehicle, surge: list[Any]) -> None:
    def kept(event: Any) -> bool:
        seconds = event.stamp / 1e9
        return not (isinstance(event.reading, Velocity) and 30.0 < seconds < 33.0) and not (
            isinstance(event.reading, Thrust) and 50.0 < seconds < 55.0
        )

    _, estimates = run(vehicle, [event for event in surge if kept(event)])
    reasons = {estimate.reading.reason for estimate in estimates}
    codes = {reason.code for reason in reasons if isinstance(reason, Coded)}
    assert codes >= {NotLearned.GAP, NotLearned.OLD_THRUST, NotLearned.SETTLING}


def test_an_outlier_is_refused(vehicle: Vehicle, surge: list[Any], refined: Results) -> None:
    spoiled = list(surge)
    index = next(k for k, event in enumerate(surge) if isinstance(event.reading, Velocity) and event.stamp > 40e9)
    nu = (5.0, *surge[index].reading.nu[1:])
    spoiled[index] = Stamped(surge[index].stamp, Velocity(nu, "dvl75"))
    session, estimates = run(vehicle, spoiled)
    assert [estimate.reading.reason for estimate in estimates].count(not_learned(NotLearned.OUTLIER)) == 1
    a, b = (one.motions["surge"].coefficients["k_q"] for one in (session.finalize().results, refined))
    assert a.value == pytest.approx(b.value, abs=0.2 * b.std)


def test_values_that_no_vehicle_has_do_no_harm(vehicle: Vehicle, surge: list[Any], refined: Results) -> None:
    dirty = list(surge)
    for at_s, value in {20.0: math.nan, 33.0: math.inf, 47.0: -1e200, 61.0: 60.0}.items():
        dirty += [Stamped(stamp_from_s(at_s + 0.005), Velocity((value,) * 6, "dvl75")),
                  Stamped(stamp_from_s(at_s + 0.006), Thrust((value * 1e5,) * 6))]  # fmt: skip
    dirty.sort(key=lambda event: event.stamp)
    assert learned(vehicle, dirty).finalize().results.to_json() == refined.to_json()


@pytest.fixture(scope="module")
def heave(vehicle: Vehicle) -> tuple[list[Any], Results]:
    """Events of heave, and the results of them."""
    inputs = received(vehicle, 2, end_s=40.0)
    return inputs, learned(vehicle, inputs).finalize().results


def test_depths_that_no_vehicle_has_do_no_harm(vehicle: Vehicle, heave: tuple[list[Any], Results]) -> None:
    inputs, expected = heave
    depths_m = {12.005: math.nan, 20.005: math.inf, 26.005: 1e200, 33.005: -2e4}
    wrong = [Stamped(stamp_from_s(at_s), Attitude((math.nan,) * 3, depth_m)) for at_s, depth_m in depths_m.items()]
    dirty = sorted([*inputs, *wrong], key=lambda event: event.stamp)
    assert learned(vehicle, dirty).finalize().results.to_json() == expected.to_json()


def test_an_instrument_wins_over_the_navigator(vehicle: Vehicle, surge: list[Any], refined: Results) -> None:
    def navigator(event: Any) -> Stamped[Any]:
        nu = (event.reading.nu[0] + 0.3, *event.reading.nu[1:])
        return Stamped(after(event.stamp, 0.001), Velocity(nu, "navigation"))

    doubled = [
        one
        for event in surge
        for one in ([event, navigator(event)] if isinstance(event.reading, Velocity) else [event])
    ]
    assert learned(vehicle, doubled).finalize().results.to_json() == refined.to_json()


def test_a_latency_of_the_stamps_can_be_given(vehicle: Vehicle, surge: list[Any], refined: Results) -> None:
    late = [
        Stamped(after(event.stamp, 0.2), event.reading) if isinstance(event.reading, Velocity) else event
        for event in surge
    ]
    late.sort(key=lambda event: event.stamp)
    reported = (
        learned(vehicle, late, Tuning(velocity_latency_s=0.2))
        .finalize()
        .results.motions["surge"]
        .coefficients["added_mass"]
    )
    right = refined.motions["surge"].coefficients["added_mass"]
    assert reported.value == pytest.approx(right.value, abs=0.5 * right.std)


def test_a_wrong_lag_in_the_vehicle_file_is_found_and_felt(vehicle: Vehicle) -> None:
    model, theta = theta_of(vehicle, 0)
    flight = fly(model, theta, back_and_forth(LEVELS[0], 8.0, 96.0), 0.30)
    inputs = list(events(flight, 0, "surge", sensors_of(0), np.random.default_rng(4)))
    result = learned(vehicle, inputs).finalize().results.motions["surge"]
    assert result.quality["lag_s"] == pytest.approx(0.30, abs=0.03)
    assert abs(result.coefficients["added_mass"].value - 12.08) < 3.0 * result.coefficients["added_mass"].std


def test_late_stamps_are_not_taken_for_a_longer_lag(vehicle: Vehicle) -> None:
    inputs = received(vehicle, 0, end_s=160.0)
    late = [
        Stamped(after(one.stamp, 0.08), one.reading) if isinstance(one.reading, Velocity) else one for one in inputs
    ]
    result = learned(vehicle, sorted(late, key=lambda one: one.stamp)).finalize().results.motions["surge"]
    assert result.quality["latency_s"] == pytest.approx(0.08, abs=0.02)
    assert result.quality["lag_s"] == pytest.approx(0.15, abs=0.02)
    assert abs(result.coefficients["added_mass"].value - 12.08) < 3.0 * result.coefficients["added_mass"].std


def test_plateaus_only_leaves_three_coefficients(vehicle: Vehicle, surge: list[Any]) -> None:
    session, estimates = run(vehicle, surge, Tuning(plateaus_only=True))
    reasons = {estimate.reading.reason for estimate in estimates if not estimate.reading.learning}
    assert not_learned(NotLearned.PHASE, phase="transient") in reasons
    result = session.finalize().results.motions["surge"]
    assert result.coefficients["k_q"].value == pytest.approx(66.48, abs=4.0 * result.coefficients["k_q"].std)


def test_heave_in_one_direction_reports_that_direction(vehicle: Vehicle) -> None:
    model, theta = theta_of(vehicle, 2)
    plan = back_and_forth((6.0, 12.0, 20.0, 30.0), 5.0, 80.0)
    down = type(plan)(plan.times_s, np.where(plan.forces > 0.0, plan.forces, 2.0), plan.end_s)
    flight = fly(model, theta, down, 0.15)
    inputs = list(events(flight, 2, "heave_down", sensors_of(2), np.random.default_rng(1)))
    results = learned(vehicle, inputs).finalize().results
    assert list(results.motions) == ["heave_down"]
    number = results.motions["heave_down"].coefficients["k_q"]
    assert number.value == pytest.approx(93.52, abs=4.0 * number.std)


def test_only_a_record_that_moves_across_has_the_drag_by_it(vehicle: Vehicle, surge: list[Any]) -> None:
    """An undivided one: in a maneuver the other axes are held."""

    def model(inputs: list[Any], sway_mps: float) -> Model:
        moved = [
            replace(one, reading=replace(one.reading, nu=(one.reading.nu[0], sway_mps, *one.reading.nu[2:])))
            if isinstance(one.reading, Velocity)
            else one
            for one in inputs
        ]
        return learned(vehicle, moved).refined(0).fit.model

    undivided = received(vehicle, 0)
    assert model(undivided, 0.2).crossed
    assert not model(undivided, 0.02).crossed
    assert not model(surge, 0.2).crossed


@pytest.mark.parametrize("known", Supply)
def test_a_supply_that_was_measured_counts_for_the_record_of_an_axis(
    vehicle: Vehicle, surge: list[Any], known: Supply
) -> None:
    """It never did: the record was asked before it had any stretches."""
    session = Session(vehicle, every_s=math.inf)
    for event in surge:
        reading = event.reading
        told = replace(reading, supply=known) if isinstance(reading, Thrust) else reading
        session.step(Stamped(event.stamp, told))
    assert session.record(0).stretches
    assert session.record(0).supply is known
