"""What one unit of each influence does to a record, by hand: a made-up motion of two stretches, and thrust at once."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hindrax_core.signals import Supply
from hindrax_core.vehicle import AxisGain, Mount, Vehicle
from hindrax_ident.arrays import Array, Flags, array
from hindrax_ident.assess.axis_fit import MOST_RUNS, AxisFit
from hindrax_ident.assess.influences import GAIN, INFLUENCES, LOSSES, MODEL, OTHER_AXES, RUN, Influence, _coasts, acting
from hindrax_ident.assess.posterior import root
from hindrax_ident.assess.thrust_calibration import thrust_shares, usual_losses
from hindrax_ident.fit.delay import lag_impulse, latency_impulse
from hindrax_ident.fit.output_error import OutputErrorFit, refine
from hindrax_ident.model.model_parameters import wide_prior
from hindrax_ident.model.motion_model import Model, model_of
from hindrax_ident.model.simulation import Grid, Trajectory
from hindrax_ident.records.axis_record import Record, Series, Stretch, ThrusterForces
from hindrax_ident.remedies import Remedy
from hindrax_ident.testing.synthetic_runs import back_and_forth, fly
from hindrax_ident.tuning import Tuning

THETA = array(np.array([66.0, 1.5, 0.0, 27.0]))
TIMES = array(np.concatenate([np.linspace(0.0, 2.0, 21), np.linspace(5.0, 6.0, 11)]))
STARTS = np.isin(np.arange(32), (0, 21))
V = array(0.4 * np.sin(1.7 * TIMES + 0.3))
S = array(0.1 + 0.3 * np.cos(TIMES))
COMMANDS = Series(array(np.array([0.0, 0.45, 1.2, 4.0, 5.5])), array(np.array([6.0, -9.0, 0.5, 12.0, -3.0])))
NOTHING = Series(array(np.zeros(0)), array(np.zeros(0)))
STEPS = np.where(STARTS, 0.0, np.diff(TIMES, prepend=0.0))
THRUST = np.array([6.0, -9.0, 0.5, 12.0, -3.0])[np.searchsorted([0.0, 0.45, 1.2, 4.0, 5.5], TIMES + 1e-9) - 1]
PULL, SPEED = float(np.percentile([6.0, 9.0, 0.5, 12.0, 3.0], 98.0)), float(np.percentile(np.abs(V), 98.0))
TOP = 66.0 * SPEED**2 + 1.5 * SPEED
SLOPE = 2.0 * 66.0 * np.abs(V) + 1.5


@pytest.fixture(scope="module")
def fit(vehicle: Vehicle) -> OutputErrorFit:
    model = model_of(vehicle, 0)
    flight = fly(model, THETA, back_and_forth((8.0,), 2.0, 6.0), 0.0)
    measured = Series(flight.grid.times_s[::20], flight.path.v[::20])
    record = Record(measured, Series(flight.times_s, flight.commands), (Stretch(0.0, 6.0),))
    return refine(model, record, THETA, wide_prior(vehicle, model))


def moved(
    fit: OutputErrorFit, v: Array = V, s: Array = S, times: Array = TIMES, starts: Flags = STARTS
) -> OutputErrorFit:
    """The fit as if it had moved like that."""
    grid = Grid(times, starts, array(np.zeros(len(times))))
    return replace(
        fit, theta=THETA, problem=replace(fit.problem, grid=grid), linear=replace(fit.linear, path=Trajectory(v, s))
    )


@pytest.fixture
def case(vehicle: Vehicle, fit: OutputErrorFit) -> AxisFit:
    record = Record(NOTHING, COMMANDS, (Stretch(0.0, 2.0), Stretch(5.0, 6.0)))
    return AxisFit(vehicle, record, moved(fit), Tuning())


def on_axis(case: AxisFit, model: Model, theta: Array) -> AxisFit:
    return replace(case, fit=replace(case.fit, model=model, theta=theta))


def row(name: str) -> Influence:
    (found,) = (one for one in INFLUENCES if one.name == name)
    return found


def of_force(*forces: Array) -> Array:
    """Impulses over each step, by the trapezoid."""
    return array(np.stack([STEPS * 0.5 * (one + np.append(0.0, one[:-1])) for one in forces], axis=1))


def of_commands(*commands: list[float] | Array, at_s: Array = COMMANDS.t) -> Array:
    """Impulses over each step of thrust that holds between commands."""
    fine = np.linspace(0.0, 6.0, 60_001)[:-1] + 5e-5
    held = np.searchsorted(at_s, fine, side="right") - 1
    totals = [np.append(0.0, np.cumsum(np.asarray(one)[held]) * 1e-4) for one in commands]
    ends = np.round(TIMES / 1e-4).astype(int)
    return array(np.stack([np.where(STARTS, 0.0, np.diff(one[ends], prepend=0.0)) for one in totals], axis=1))


def assert_effect(case: AxisFit, name: str, wanted: Array) -> None:
    found = row(name).effect(case)
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() < 1e-9 * max(1.0, float(np.abs(wanted).max()))


# ---- the case


def test_a_case_has_the_largest_thrust_and_speed_of_its_record(case: AxisFit) -> None:
    assert case.pull == pytest.approx(PULL)
    assert case.speed == pytest.approx(SPEED)
    assert case.thrust.tolist() == THRUST.tolist()
    assert case.steps_s == pytest.approx(STEPS)
    assert case.top_drag == pytest.approx(TOP)
    assert case.mass == 27.0
    assert case.drag(V) == pytest.approx(66.0 * np.abs(V) * V + 1.5 * V)
    s = S - np.median(S)
    assert case.position == pytest.approx(s / np.percentile(np.abs(s), 98.0))
    still = replace(case, record=replace(case.record, thrust=NOTHING))
    assert still.pull == 0.0
    braking = on_axis(case, case.fit.model, array(np.array([-66.0, 1.5, 0.0, 27.0])))
    assert braking.top_drag == pytest.approx(66.0 * SPEED**2 - 1.5 * SPEED)


def test_thrust_acts_after_its_lag_and_on_velocities_that_come_late(case: AxisFit) -> None:
    late = replace(case, record=replace(case.record, lag_s=0.2, latency_s=0.3))
    at = int(np.searchsorted(TIMES, 1.0))
    # From 6 N to -9 N at 0.45 s, seen at 1 s of stamps that are 0.3 s late.
    assert late.thrust[at] == pytest.approx(-9.0 + 15.0 * math.exp(-(0.7 - 0.45) / 0.2))
    inflow = replace(late, record=replace(late.record, forces=of_one([1.0, 2.0, 3.0, 4.0, 5.0])))
    assert inflow.inflow[at] == pytest.approx(math.sqrt(2.0 - math.exp(-(0.7 - 0.45) / 0.2)))
    # One that turns round passes zero.
    turned = replace(late, record=replace(late.record, forces=of_one([4.0, -4.0, 0.0, 0.0, 0.0])))
    assert turned.inflow[at] == pytest.approx(math.sqrt(abs(-4.0 + 8.0 * math.exp(-(0.7 - 0.45) / 0.2))))
    gain = row("gain of the wrench").effect(late)[at, 0]
    from_s, to_s = 0.6 - 0.45, 0.7 - 0.45
    fading = 15.0 * 0.2 * (math.exp(-from_s / 0.2) - math.exp(-to_s / 0.2))
    assert gain == pytest.approx(-9.0 * 0.1 + fading)


def test_changes_that_are_seen_late_each_by_its_own_part_of_a_look_have_a_mean_that_is_off(case: AxisFit) -> None:
    """Simulated: so many changes of one size, each up to 20 ms late, and one small one that does not count."""
    thrust = array([0.0, *np.cumsum([5.0, -5.0, 5.0, 5.0, -5.0, -5.0, 5.0, -5.0, 0.01])])
    record = replace(case.record, thrust=Series(array(np.arange(10.0)), thrust))
    behind = replace(case.vehicle, output=replace(case.vehicle.output, device="ardusub"))
    late_s = np.random.default_rng(1).uniform(0.0, 0.02, (20_000, 8)).mean(axis=1)
    seen = replace(case, record=record, vehicle=behind)
    assert row("looks at the pulses").sigma(seen) == pytest.approx(float(np.std(late_s)), rel=0.02)
    assert row("looks at the pulses").sigma(replace(case, record=record)) == 0.0
    assert row("looks at the pulses").sigma(replace(seen, record=replace(record, thrust=NOTHING))) == 0.0


def test_what_follows_late_begins_with_each_stretch(case: AxisFit) -> None:
    found, value = case.delayed(0.5), 0.0
    for at, v in enumerate(V.tolist()):
        value = v if STARTS[at] else v + (value - v) * math.exp(-STEPS[at] / 0.5)
        assert found[at] == pytest.approx(value)


@pytest.mark.parametrize(
    ("tuning", "found", "sigma_s"),
    [
        (Tuning(timing_sigma_s=0.004), False, 0.004),
        (Tuning(timing_sigma_s=0.004, lag_doubt_s=0.02), False, 0.02),
        (Tuning(timing_sigma_s=0.004, lag_doubt_s=0.02), True, 0.1),
        (Tuning(lag_doubt_s=0.2), True, 0.2),
    ],
)
def test_a_delay_that_was_found_is_doubted_more(case: AxisFit, tuning: Tuning, found: bool, sigma_s: float) -> None:
    doubted = replace(case, tuning=tuning, delay_found=found)
    assert doubted.delay_sigma_s == sigma_s
    assert row("thrust lag").sigma(doubted) == row("latency of the velocity").sigma(doubted) == sigma_s
    assert not replace(case, tuning=tuning).delay_found


@pytest.mark.parametrize(
    ("gain", "signs"),
    [
        ({}, ()),
        ({"surge": (0.9, 1.1)}, (1.0, -1.0)),
        ({"surge": (0.9, None)}, (1.0,)),
        ({"surge": (None, 1.1)}, (-1.0,)),
        ({"sway": (0.9, 1.1)}, ()),
    ],
)
def test_a_known_weight_measures_its_axis_and_direction(
    case: AxisFit, gain: dict[str, tuple[float | None, float | None]], signs: tuple[float, ...]
) -> None:
    weighed = weighed_by(case, {axis: AxisGain(10.0, 0.004, 0.01, *both) for axis, both in gain.items()})
    assert weighed.weighed == signs
    assert row("gain by a known weight").sigma(weighed) == float(bool(signs))
    assert row("losses between thrusters and hull").sigma(weighed) == (0.06 if len(signs) < 2 else 0.0)


def weighed_by(case: AxisFit, gains: dict[str, AxisGain]) -> AxisFit:
    return replace(case, vehicle=replace(case.vehicle, thrust_gain=gains))


def inflow_by_rule(case: AxisFit, held_N: float) -> Array:
    shares, holding = thrust_shares(case.vehicle, case.axis), thrust_shares(case.vehicle, 2)
    total = np.zeros(len(TIMES))
    for index, (per_newton, share) in shares.items():
        total += per_newton**2 * np.sqrt(np.abs(share * case.thrust + holding[index][1] * held_N))
    return array(total)


def test_without_a_record_of_inflow_each_thruster_has_its_share(case: AxisFit) -> None:
    heavy = replace(case, vehicle=replace(case.vehicle, volume_m3=0.0163))
    assert heavy.vehicle.net_buoyancy_N > 5.0
    # Vertical thrusters hold the net buoyancy, but they do not push ahead.
    assert heavy.inflow == pytest.approx(inflow_by_rule(heavy, heavy.vehicle.net_buoyancy_N))
    rolling = on_axis(heavy, Model(3, 0.483, restores=True), array(np.array([1.0, 0.1, 0.0, 3.0, 0.7])))
    assert rolling.inflow == pytest.approx(inflow_by_rule(rolling, heavy.vehicle.net_buoyancy_N))
    assert rolling.inflow != pytest.approx(inflow_by_rule(rolling, 0.0))
    diving = on_axis(heavy, Model(2, 15.22, split=True), array(np.array([90.0, 5.0, 60.0, 10.0, 0.0, 37.0])))
    assert diving.inflow == pytest.approx(inflow_by_rule(diving, 0.0))


def test_thrusters_that_hold_and_turn_at_once_have_the_sum_of_both(case: AxisFit) -> None:
    heavy = replace(case, vehicle=replace(case.vehicle, volume_m3=0.0163, thrusters=case.vehicle.thrusters[:-1]))
    rolling = on_axis(heavy, Model(3, 0.483, restores=True), array(np.array([1.0, 0.1, 0.0, 3.0, 0.7])))
    held_N = heavy.vehicle.net_buoyancy_N
    assert rolling.inflow == pytest.approx(inflow_by_rule(rolling, held_N))
    assert rolling.inflow != pytest.approx(inflow_by_rule(rolling, -held_N))


@pytest.mark.parametrize(
    "name", ["sag under load", "dead band of the thrust", "exponent of the thrust", "dead bands that differ"]
)
def test_a_small_thrust_errs_like_a_great_one(case: AxisFit, name: str) -> None:
    doubted = replace(case, tuning=Tuning(thrust_doubt=0.3))
    small = replace(doubted, record=replace(case.record, thrust=Series(COMMANDS.t, array(0.001 * COMMANDS.y))))
    assert_effect(small, name, array(0.001 * row(name).effect(doubted)))


def test_water_that_was_dragged_along_does_not_push_what_rests(case: AxisFit) -> None:
    stopping = array(np.where(TIMES > 1.0, 0.0, -np.abs(V)))
    at_rest = replace(case, fit=moved(case.fit, stopping))
    late = at_rest.delayed(4.0)
    assert late[20] < 0.0
    assert not row("own wake").effect(at_rest).any()


def test_a_vehicle_without_thrusters_pushes_at_its_center(case: AxisFit) -> None:
    bare = replace(case, vehicle=replace(case.vehicle, thrusters=()))
    assert bare.inflow == pytest.approx(np.sqrt(np.abs(THRUST)))
    wanted = -math.sqrt(PULL) * np.sqrt(np.abs(THRUST)) * V / 0.5
    assert_effect(bare, "inflow loss", of_force(wanted))
    assert row("thrust calibration").sigma(bare) == 0.0
    turning = on_axis(bare, Model(5, 0.4), array(np.array([0.6, 1.4, 0.0, 0.8])))
    lever = 0.5 * case.vehicle.characteristic_length_m
    inflow = lever**2 * np.sqrt(np.abs(THRUST / lever))
    assert turning.inflow == pytest.approx(inflow)
    assert_effect(turning, "inflow loss", of_force(-math.sqrt(PULL / lever) * inflow * V / 0.5))


# ---- effects


def test_a_gain_is_a_share_of_the_command(case: AxisFit) -> None:
    assert_effect(case, "gain of the wrench", of_commands(COMMANDS.y))
    assert_effect(case, "losses between thrusters and hull", of_commands(-COMMANDS.y))
    sigma = case.vehicle.curves["main"].gain_sigma
    found = row("thrust calibration").effect(case)
    assert found.shape == (32, 1)
    assert np.abs(found) == pytest.approx(np.abs(of_commands(sigma * COMMANDS.y)))


def test_the_root_of_a_covariance_is_a_root() -> None:
    C = np.array([[4.0, 1.0, 0.0], [1.0, 2.0, -0.5], [0.0, -0.5, 0.3]])
    assert root(array(C)) @ root(array(C)).T == pytest.approx(C)
    # Rounding may leave a variance slightly below nothing.
    assert root(array(np.diag([-1e-18, 4.0]))) @ np.ones(2) == pytest.approx([0.0, 2.0])


@pytest.mark.parametrize(("both", "known"), [((0.9, 1.1), (1.0, -1.0)), ((0.9, None), (1.0,)), ((None, 0.9), (-1.0,))])
def test_what_a_known_weight_showed_at_its_load_is_no_error_any_more(
    case: AxisFit, both: tuple[float | None, float | None], known: tuple[float, ...]
) -> None:
    """Of an error e(T), e(10 N) T / 10 N is in the gain that it measured."""
    gain = AxisGain(10.0, 0.004, 0.01, *both)
    weighed = weighed_by(case, {"surge": gain})
    y = COMMANDS.y
    measured = np.isin(np.sign(y), known)
    assert_effect(weighed, "gain by a known weight", of_commands(0.004 * y * measured, 0.01 * np.abs(y) * measured))
    assert_effect(weighed, "losses between thrusters and hull", of_commands(np.where(measured, 0.0, -y)))
    shown = np.isin(np.sign(THRUST), known) * THRUST / 10.0 * -(10.0**2) / PULL
    assert_effect(weighed, "sag under load", of_force(-THRUST * np.abs(THRUST) / PULL - shown))
    # At the load nothing is left.
    edges = -0.01 * PULL * np.clip(y / (0.1 * PULL), -1.0, 1.0)
    assert_effect(weighed, "dead bands that differ", of_commands(edges - measured * y / 10.0 * -0.01 * PULL))


def of_one(forces_N: list[float], per_newton: float = 1.0) -> ThrusterForces:
    """Forces of a single thruster, at the times of the commands."""
    return ThrusterForces(COMMANDS.t, array(np.array([per_newton])), array(np.array([forces_N]).T))


def test_inflow_takes_ten_newtons_at_half_a_meter_per_second(case: AxisFit) -> None:
    forces_N = [1.0, 4.0, -0.25, 0.0, 9.0]
    known = replace(case, record=replace(case.record, forces=of_one(forces_N, 0.5)))
    held = 0.25 * np.sqrt(np.abs(forces_N))[np.searchsorted(COMMANDS.t, TIMES + 1e-9) - 1]
    assert known.inflow == pytest.approx(held)
    assert_effect(known, "inflow loss", of_force(-math.sqrt(10.0) * held * V / 0.5))


def test_the_supply_sags_from_the_start_of_each_run(case: AxisFit, fit: OutputErrorFit) -> None:
    assert_effect(case, "sag over the run", of_force(-THRUST * TIMES / 900.0))
    times = array(np.where(TIMES < 3.0, TIMES + 100.0, TIMES + 1000.0))
    pooled = replace(case, fit=moved(fit, times=times))
    thrust = pooled.thrust
    # The first from the beginning of the session, the next from its own.
    since = np.where(TIMES < 3.0, TIMES + 100.0, TIMES - 5.0)
    assert thrust.tolist() == [-3.0] * 32
    found = row("sag over the run").effect(pooled)
    assert found == pytest.approx(of_force(3.0 * since / 900.0))
    # Less than a quarter of an hour later the battery is the same.
    for pause_s, begins_s in ((899.5, 0.0), (900.5, 5.0 + 897.5)):
        later = array(np.where(TIMES < 3.0, TIMES, TIMES + pause_s - 3.0))
        paused = replace(case, fit=moved(fit, times=later))
        assert row("sag over the run").effect(paused)[-1, 0] == pytest.approx(
            0.3 * (later[-1] - 0.05 - begins_s) / 900.0
        )


def test_sag_under_load_grows_with_the_square(case: AxisFit) -> None:
    for name in ("sag under load", "losses that change with the load"):
        assert_effect(case, name, of_force(-THRUST * np.abs(THRUST) / PULL))


def test_dead_bands_take_thrust_at_their_edges(case: AxisFit) -> None:
    y = COMMANDS.y
    assert_effect(case, "dead bands that differ", of_commands(-0.01 * PULL * np.clip(y / (0.1 * PULL), -1.0, 1.0)))
    doubted = replace(case, tuning=Tuning(thrust_doubt=0.3))
    band = 0.3 * PULL
    wanted = of_commands(-band * np.clip(y / band, -1.0, 1.0), np.where(np.abs(y) < band, -0.5 * y, 0.0))
    assert_effect(doubted, "dead band of the thrust", wanted)


def by_thrusters(case: AxisFit, forces: Array) -> AxisFit:
    """The case with these forces (5, k) of its thrusters at the times of the commands."""
    per_newton = array(effectiveness_of(case.vehicle, 0))
    return replace(case, record=replace(case.record, forces=ThrusterForces(COMMANDS.t, per_newton, forces)))


def effectiveness_of(vehicle: Vehicle, axis: int) -> list[float]:
    return [per_newton for per_newton, _ in thrust_shares(vehicle, axis).values()]


def test_each_thruster_loses_by_its_own_dead_band(case: AxisFit) -> None:
    """Two that work: one of 3 N, where 5 us are 0.19 N, and one just beyond the edge, where they are all of its 1.3."""
    forces = np.zeros((5, len(case.vehicle.thrusters)))
    forces[:, 0], forces[:, 1] = 3.0, 1.25 * np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    working = by_thrusters(case, array(forces))
    found = row("dead bands that differ").effect(working)
    lost = [usual_losses(case.vehicle)[i](array(forces[:, i])) for i in (0, 1)]
    assert lost[0] == pytest.approx(-0.19, abs=0.02)
    assert np.abs(lost[1]).min() > 0.4
    wanted = of_commands(*(d * one for d, one in zip(effectiveness_of(case.vehicle, 0), lost, strict=False)))
    # Independent unknowns of one deviation each may be rotated: what they make together is the same.
    assert found @ found.T == pytest.approx(wanted @ wanted.T, abs=1e-9)


def test_a_weighing_shows_what_dead_bands_take_from_thrusters_that_push_together(case: AxisFit) -> None:
    """At its load nothing is left."""
    y = array(10.0 * np.sign(COMMANDS.y))
    shares = np.array([share for _, share in thrust_shares(case.vehicle, 0).values()])
    at_load = by_thrusters(case, array(np.outer(y, shares)))
    at_load = replace(at_load, record=replace(at_load.record, thrust=Series(COMMANDS.t, y)))
    weighed = weighed_by(at_load, {"surge": AxisGain(10.0, 0.004, 0.01, 1.0, 1.0)})
    free, left = (np.abs(row("dead bands that differ").effect(one)).max() for one in (at_load, weighed))
    assert free > 0.01
    assert left < 1e-9


def test_another_exponent_of_the_thrust_leaves_the_largest_as_it_is(case: AxisFit) -> None:
    x = np.abs(COMMANDS.y) / PULL
    assert_effect(case, "exponent of the thrust", of_commands(PULL * np.sign(COMMANDS.y) * x * np.log(x)))
    still = replace(case, record=replace(case.record, thrust=Series(COMMANDS.t, array(np.zeros(5)))))
    for name in ("exponent of the thrust", "dead bands that differ", "sag under load", "dead band of the thrust"):
        assert not row(name).effect(still).any()


def test_delays_are_those_of_the_fit(case: AxisFit) -> None:
    grid = case.fit.problem.grid
    assert np.array_equal(row("thrust lag").effect(case), lag_impulse(case.record, grid))
    assert np.array_equal(row("stamps of the record").effect(case), lag_impulse(case.record, grid))
    assert np.array_equal(row("looks at the pulses").effect(case), lag_impulse(case.record, grid))
    assert np.array_equal(row("latency of the velocity").effect(case), latency_impulse(case.record, grid))


def test_a_current_pushes_by_the_slope_of_the_drag(case: AxisFit) -> None:
    assert_effect(case, "current", of_force(SLOPE))


def test_a_seiche_swings_in_a_pool_and_takes_the_water_along(case: AxisFit) -> None:
    """Merian 1828: half a wave along 10 m of water 1.8 m deep."""
    rate = math.pi / 10.0 * math.sqrt(9.80665 * 1.8)
    own = 27.0 - case.vehicle.mass_kg + 15.3
    sin, cos = np.sin(rate * TIMES), np.cos(rate * TIMES)
    found = row("seiche").effect(case)
    assert found == pytest.approx(
        of_force(SLOPE * cos - own * rate * sin, SLOPE * sin + own * rate * cos), rel=1e-3, abs=1e-4
    )


def test_runs_that_are_pooled_have_a_seiche_and_half_of_a_current_each(case: AxisFit, fit: OutputErrorFit) -> None:
    """Two flights of one session had seiches that cancelled as one: the pool seemed still, and its losses gone."""
    times = array(np.where(TIMES < 3.0, TIMES, TIMES + 1000.0))
    pooled, first = replace(case, fit=moved(fit, times=times)), (TIMES < 3.0)[:, None]
    assert pooled.run.tolist() == [0] * 21 + [1] * 11
    found = row("seiche").effect(pooled)
    assert found[:, :2] == pytest.approx(np.where(first, row("seiche").effect(case), 0.0))
    assert np.all(found[:21, 2:] == 0.0)
    # Of another phase, and as strong.
    assert np.linalg.norm(found[21:, 2:]) == pytest.approx(np.linalg.norm(row("seiche").effect(case)[21:]), rel=0.1)
    flowing = row("current").effect(pooled)
    whole = of_force(SLOPE)
    assert flowing == pytest.approx(math.sqrt(0.5) * np.hstack([whole, whole * first, whole * ~first]))
    assert np.sum(flowing**2, axis=1) == pytest.approx(whole[:, 0] ** 2), "as much as in a run alone"


def test_the_longest_of_many_runs_have_unknowns_of_their_own(case: AxisFit, fit: OutputErrorFit) -> None:
    many = array(TIMES + 1000.0 * np.minimum(np.floor(TIMES / 0.2), 9.0))
    pooled = replace(case, fit=moved(fit, times=many))
    assert len(set(pooled.run.tolist())) == 10
    assert row("seiche").effect(pooled).shape == (len(TIMES), 2 * MOST_RUNS)


def test_a_tether_pulls_back_and_drags_and_sticks(case: AxisFit) -> None:
    assert_effect(case, "tether", of_force(array(-case.position)))
    x = V / SPEED
    assert_effect(case, "drag of the tether", of_force(array(-np.abs(x) * x)))
    assert_effect(case, "drag of the tether with its length", of_force(array(-np.abs(x) * x * case.position)))
    assert_effect(case, "friction of the tether", of_force(array(-np.tanh(V / (0.02 * SPEED)))))
    turning = on_axis(case, Model(5, 0.4), array(np.array([0.6, 1.4, 0.0, 0.8])))
    heading = np.cumsum(V * STEPS)
    assert_effect(turning, "tether", of_force(array(-np.sin(heading)), array(-np.cos(heading))))


def test_a_tether_brakes_by_its_own_speed(case: AxisFit) -> None:
    """A share of the thrust was 11 % of the drag of pitch, 8 of heave: that also holds against moment and buoyancy."""
    sigma = row("drag of the tether").sigma
    assert sigma(case) == pytest.approx(2.0 * (SPEED / 0.5) ** 2 / math.sqrt(3.0))
    assert sigma(on_axis(case, Model(2, 15.0), THETA)) == sigma(case)
    length, _, height = case.vehicle.envelope_m
    for axis, lever_m in ((3, 0.5 * height), (4, 0.5 * math.hypot(length, height)), (5, 0.5 * length)):
        turning = on_axis(case, Model(axis, 0.4, restores=True), array(np.array([0.6, 1.4, 0.0, 3.0, 0.8])))
        greatest_N = 0.4 * (lever_m * SPEED / 0.5) ** 2
        assert sigma(turning) == pytest.approx(greatest_N * lever_m / math.sqrt(3.0))
        assert sigma(replace(turning, tuning=Tuning(thrust_doubt=0.1))) == pytest.approx(0.1 * PULL)
    assert sigma(replace(case, tuning=Tuning(thrust_doubt=0.01))) == pytest.approx(0.04 * PULL)


def test_flow_follows_late(case: AxisFit) -> None:
    late, behind = case.delayed(1.0), case.delayed(4.0)
    left = 66.0 * (np.abs(V) * V - np.abs(late) * late) + 1.5 * (V - late)
    assert_effect(case, "fluid memory", of_force(array(-27.0 * (V - late)), array(left)))
    assert_effect(case, "own wake", of_force(array(np.where(behind * V < 0.0, SLOPE * behind, 0.0))))
    assert np.any(behind * V < 0.0)


def test_other_laws_of_the_drag_leave_that_at_the_highest_speed(case: AxisFit) -> None:
    x = np.abs(V) / SPEED
    asymmetry, exponent = TOP * x**2, TOP * np.sign(V) * x**2 * np.log(np.maximum(1e-9, x))
    assert_effect(case, "fore/aft asymmetry", of_force(array(-asymmetry)))
    assert_effect(case, "exponent of the drag", of_force(array(-exponent)))
    for name, force in (("fore/aft asymmetry", asymmetry), ("exponent of the drag", exponent)):
        drag = row(name).drag
        assert drag is not None
        assert drag(case, V) == pytest.approx(force[:, None])
        assert not drag(case, array(np.zeros(1))).any()
    assert [one.name for one in INFLUENCES if one.drag] == ["fore/aft asymmetry", "exponent of the drag"]
    assert row("fore/aft asymmetry").sigma(case) == 0.05
    diving = on_axis(case, Model(2, 15.22, split=True), array(np.array([90.0, 5.0, 60.0, 10.0, 0.0, 37.0])))
    assert row("fore/aft asymmetry").sigma(diving) == 0.0


def test_masses_of_other_axes_err_by_their_own_columns(case: AxisFit) -> None:
    errors = tuple(
        Series(COMMANDS.t, array(np.array(one))) for one in ([1.0, 2.0, 0.0, -1.0, 4.0], [0.5, 0.0, 1.0, 1.0, 0.0])
    )
    known = replace(case, record=replace(case.record, coriolis_errors=errors))
    halfway = np.concatenate([COMMANDS.t[:1], 0.5 * (COMMANDS.t[1:] + COMMANDS.t[:-1])])
    assert_effect(known, "masses of other axes", of_commands(*(one.y for one in errors), at_s=array(halfway)))
    assert (row("masses of other axes").sigma(case), row("masses of other axes").sigma(known)) == (0.0, 1.0)
    assert row("masses of other axes").shown(known), "as large as the thrust: the record tells them"
    small = tuple(Series(one.t, array(1e-4 * one.y)) for one in errors)
    assert not row("masses of other axes").shown(replace(case, record=replace(case.record, coriolis_errors=small)))


def with_others(case: AxisFit, **moved: Array) -> AxisFit:
    """The case beside velocities of other axes."""
    still = array(np.zeros(len(TIMES)))
    others = tuple(Series(TIMES, moved.get(name, still)) for name in "uvwpqr")
    return replace(case, record=replace(case.record, others=others))


def test_the_other_axes_act_by_a_tenth_of_the_own_mass_and_drag_and_by_the_whole_speed(case: AxisFit) -> None:
    """Of one axis at constant speed across: no acceleration; two columns, in any rotation."""
    across = array(np.full(len(TIMES), 0.4))
    found = row(OTHER_AXES).effect(with_others(case, v=across))
    k_q = TOP / SPEED**2
    whole = -0.5 * k_q * (np.hypot(V, 0.4) - np.abs(V)) * V
    wanted = of_force(array(whole), array(0.1 * k_q * 0.16 * np.ones(len(TIMES))))
    assert found @ found.T == pytest.approx(wanted @ wanted.T, abs=1e-9)
    # A turn by the length of the vehicle, and its acceleration by a tenth of the own mass.
    turning = replace(with_others(case, r=array(np.where(TIMES < 3.0, 0.5 * TIMES, 0.0))), vehicle=case.vehicle)
    pushed = row(OTHER_AXES).effect(turning)[5]
    assert abs(pushed[0]) == pytest.approx(0.1 * 27.0 * 0.5 * 0.1 * case.vehicle.characteristic_length_m, rel=0.1)


def test_a_weighing_of_yaw_shows_no_losses_between_thrusters(case: AxisFit) -> None:
    """Held against a small load they idle against each other, and lose alike on both sides; in a turn all lose."""
    gain = {name: AxisGain(load=2.0, sigma=0.005, positive=1.0, negative=1.0) for name in ("surge", "yaw")}
    weighed = replace(case, vehicle=replace(case.vehicle, thrust_gain=gain))
    assert row("losses between thrusters and hull").sigma(weighed) == 0.0
    turning = on_axis(weighed, replace(case.fit.model, axis=5), THETA)
    assert row("losses between thrusters and hull").sigma(turning) == LOSSES
    assert_effect(turning, "losses between thrusters and hull", of_commands(array(-COMMANDS.y)))


def test_momentum_across_by_an_off_diagonal_mass_turns_with_the_body(case: AxisFit) -> None:
    """At a constant turn nothing accelerates, but a mass of sway and yaw pushes along surge: M_vr r^2 (Fossen 6.42).

    Its size: a tenth of the own mass, by the length of the vehicle where it turns.
    """
    turning = with_others(case, r=array(np.full(len(TIMES), 0.6)))
    length = case.vehicle.characteristic_length_m
    found = turning._off_diagonal_masses()
    wanted = of_force(array(np.full(len(TIMES), 0.1 * 27.0 * length * 0.6**2)))[:, 0]
    distance = np.abs(np.abs(found) - np.abs(wanted)[:, None]).max(axis=0)
    assert float(distance.min()) < 1e-9
    assert int(np.sum(np.abs(found).max(axis=0) > 1e-9)) == 2, "beside it M_uv, by u' = 0 and r u of its own velocity"


def test_without_motion_beside_it_nothing_acts_from_the_other_axes(case: AxisFit) -> None:
    assert row(OTHER_AXES).sigma(case) == 0.0
    assert row(OTHER_AXES).sigma(with_others(case)) == 0.0
    assert row(OTHER_AXES).sigma(with_others(case, v=array(np.full(len(TIMES), 1e-4)))) == 0.0


def test_a_hull_at_an_angle_has_the_drag_of_the_area_it_turns_to_the_flow(case: AxisFit) -> None:
    """By 1.2 x 0.4 x 0.3 m: beside it 1.2 x 0.3 of 0.4 x 0.3, three times the own area; below it four times."""
    across = with_others(case, v=array(np.full(len(TIMES), 0.2)), w=array(np.full(len(TIMES), 0.1)))
    model = replace(case.fit.model, crossed=True)
    theta = np.array([66.0, 1.5, 0.0, 30.0, 27.0])
    long = replace(on_axis(across, model, array(theta)), vehicle=replace(case.vehicle, envelope_m=(1.2, 0.4, 0.3)))
    turned = np.sqrt(V**2 + (3.0 * 0.2) ** 2 + (4.0 * 0.1) ** 2)
    k_q = TOP / SPEED**2
    assert_effect(long, "drag by incidence", of_force(array(-k_q * (turned - np.abs(V)) * V)))
    assert (row("drag by incidence").sigma(case), row("drag by incidence").sigma(long)) == (0.0, 2.0)
    # Sway of the same hull has the largest area but one: only heave turns more to the flow, 1.2 x 0.4 of 1.2 x 0.3.
    swaying = on_axis(long, replace(model, axis=1), array(theta))
    turned = np.sqrt(V**2 + (4.0 / 3.0 * 0.1) ** 2 + 0.2**2)
    sway_others = replace(
        swaying,
        record=replace(long.record, others=(long.record.others[1], long.record.others[0], *long.record.others[2:])),
    )
    assert_effect(sway_others, "drag by incidence", of_force(array(-k_q * (turned - np.abs(V)) * V)))


def test_a_fit_that_has_the_drag_by_the_speed_across_does_not_fear_it_as_well(case: AxisFit) -> None:
    """What is left of constant motion across: a tenth of the own drag, as a constant force."""
    across = with_others(case, v=array(np.full(len(TIMES), 0.4)))
    known = on_axis(across, replace(case.fit.model, crossed=True), array(np.array([66.0, 1.5, 0.0, 30.0, 27.0])))
    found = row(OTHER_AXES).effect(known)
    wanted = of_force(array(0.1 * TOP / SPEED**2 * 0.16 * np.ones(len(TIMES))))
    assert found @ found.T == pytest.approx(wanted @ wanted.T, abs=1e-9)


def test_a_tilt_is_a_share_of_the_net_buoyancy_or_of_the_stiffness(case: AxisFit) -> None:
    for name in ("tilt of the accelerometer", "tilt of the mount"):
        assert_effect(case, name, of_force(np.full(32, case.vehicle.net_buoyancy_N)))
        rolling = on_axis(case, Model(3, 0.483, restores=True), array(np.array([1.0, 0.1, 0.0, 3.0, 0.7])))
        assert_effect(rolling, name, of_force(array(3.0 * np.cos(S))))


@pytest.mark.parametrize(
    ("axis", "restores", "acts"), [(0, 0, 1), (1, 0, 1), (2, 0, 0), (3, 1, 1), (4, 1, 1), (5, 0, 0)]
)
def test_a_tilt_acts_where_weight_or_buoyancy_do(case: AxisFit, axis: int, restores: int, acts: int) -> None:
    one = on_axis(case, Model(axis, 10.0, restores=bool(restores)), THETA)
    assert (row("tilt of the accelerometer").sigma(one) > 0.0) is bool(acts)
    assert row("tilt of the mount").sigma(one) == 0.02 * acts
    for name, sigma in (("current", 0.02), ("seiche", 0.006)):
        assert row(name).sigma(one) == (sigma if axis < 2 else 0.0)


def test_an_accelerometer_that_was_calibrated_is_trusted_more(case: AxisFit) -> None:
    assert row("tilt of the accelerometer").sigma(case) == 0.0125
    mount = case.vehicle.sensors["icm20948"]
    for key, sigma in (("accel_bias", 0.003), ("gyro_bias", 0.0125)):
        sensors = {**case.vehicle.sensors, "icm20948": replace(mount, calibration={key: (0.0, 0.0, 0.0)})}
        assert isinstance(mount, Mount)
        assert (
            row("tilt of the accelerometer").sigma(replace(case, vehicle=replace(case.vehicle, sensors=sensors)))
            == sigma
        )


def test_a_gain_of_the_velocity_scales_every_reading(case: AxisFit) -> None:
    index, channel = np.array([0, 3, 3, 30]), np.array([0, 0, 1, 1])
    read = replace(case.fit, problem=replace(case.fit.problem, index=index, channel=channel))
    found = row("gain of the velocity").effect(replace(case, fit=read))
    assert found[:, 0] == pytest.approx([V[0], V[3], S[3], S[30]])
    assert row("gain of the velocity").of_readings
    of_ranges = {"speed of sound of the sonar", "angle of sonar and wall", "wander of the heading"}
    of_velocities = {"gain of the velocity", "filter of the velocity", "averaging of the velocity"}
    assert {one.name for one in INFLUENCES if one.of_readings} == {*of_velocities, *of_ranges}


def test_a_filter_that_was_undone_too_far_enlarges_what_changes_and_no_place(case: AxisFit) -> None:
    found = row("filter of the velocity")
    assert found.sigma(case) == 0.0
    filtered = replace(case, record=replace(case.record, smoothing_s=2.0))
    assert found.sigma(filtered) == pytest.approx(0.1)
    index, channel = np.array([0, 3, 3, 30]), np.array([0, 0, 1, 0])
    read = replace(case.fit, problem=replace(case.fit.problem, index=index, channel=channel))
    means = replace(case, fit=read, record=replace(case.record, means=((1.0, 0.5),)))
    assert found.sigma(means) == pytest.approx(0.025)
    apart = 0.5 * (case.v - case.delayed(2.0))
    effect = found.effect(replace(filtered, fit=read))
    assert effect[:, 0] == pytest.approx([0.0, apart[3], 0.0, apart[30]])
    assert abs(apart[30]) > 0.01


def test_means_of_an_even_change_are_its_values_and_of_one_that_bends_they_are_not(case: AxisFit) -> None:
    """Of a sine a mean over T leaves sin(w T / 2) / (w T / 2); where a record begins or ends it is a shorter one."""
    row_of_it, index = row("averaging of the velocity"), np.array([0, 400, 700, 800, 1000])
    times, starts = array(np.linspace(0.0, 10.0, 1001)), np.arange(1001) == 0
    for v, left in ((array(0.2 + 0.1 * times), 1.0), (array(np.sin(3.0 * times)), math.sin(0.45) / 0.45)):
        way = array(np.concatenate([[0.0], np.cumsum(0.005 * (v[1:] + v[:-1]))]))
        fit = moved(case.fit, v, way, times, starts)
        read = replace(fit.problem, t=times[index], index=index, channel=np.array([0, 0, 1, 0, 0]))
        found = row_of_it.effect(replace(case, fit=replace(fit, problem=read)))[:, 0]
        assert found[1:4] == pytest.approx([(left - 1.0) * v[400], 0.0, (left - 1.0) * v[800]], abs=1e-4)


def test_only_an_instrument_that_nobody_describes_may_average(case: AxisFit) -> None:
    found, foreign = row("averaging of the velocity"), replace(case, tuning=Tuning(lag_doubt_s=0.1))
    assert (found.sigma(case), found.sigma(foreign)) == (0.0, 1.0)
    for known in (replace(case.record, smoothing_s=0.5), replace(case.record, means=((1.0, 0.5),))):
        assert found.sigma(replace(foreign, record=known)) == 0.0


def test_a_longer_lag_of_what_goes_or_turns_round_keeps_what_it_takes_longer(case: AxisFit) -> None:
    """All of a change to less, and of one to the other side all that there was, for a second each."""
    times = array(np.linspace(0.0, 40.0, 401))
    commands = Series(array(np.arange(0.0, 40.0, 5.0)), array(np.array([0.0, 6.0, 2.0, 8.0, -4.0, -10.0, 0.0, 0.0])))
    record = replace(case.record, thrust=commands, lag_s=0.2)
    still = array(np.zeros(401))
    flown = replace(case, record=record, fit=moved(case.fit, still, still, times, np.arange(401) == 0))
    found = np.cumsum(row("lags that differ").effect(flown), axis=0)
    ends = np.searchsorted(times, np.arange(4.9, 40.0, 5.0))
    assert found[ends, 0] == pytest.approx([0.0, 0.0, 4.0, 4.0, 4.0, 4.0, -6.0, -6.0], abs=0.02)
    assert found[ends, 1] == pytest.approx([0.0, 0.0, 0.0, 0.0, 8.0, 8.0, 8.0, 8.0], abs=0.02)
    # A change of D is late by D of the largest command.
    squares = np.cumsum([0.0, 36.0, -16.0, 36.0, -144.0, -36.0, 100.0, 0.0]) / flown.pull
    assert found[ends, 2] == pytest.approx(-squares, abs=0.02)


# ---- coasts


def coasting(case: AxisFit, off_s: float, speed: float = 0.3, begin_s: float = 2.0) -> AxisFit:
    """Thrust at 12 N, taken away at this speed for a while."""
    times = array(np.linspace(0.0, 6.0, 121))
    starts = np.arange(121) == 0
    v = np.where(times < begin_s, 0.4, speed * np.exp(-0.2 * (times - begin_s)))
    commands = Series(
        array(np.array([0.0, begin_s - 0.01, begin_s - 0.01 + off_s])), array(np.array([12.0, 1.0, 12.0]))
    )
    record = replace(case.record, thrust=commands)
    return replace(case, record=record, fit=moved(case.fit, array(v), array(np.zeros(121)), times, starts))


@pytest.mark.parametrize(
    ("off_s", "speed", "shown"),
    [(1.2, 0.3, True), (0.9, 0.3, False), (1.2, 0.21, True), (1.2, 0.19, False), (1.2, -0.3, True)],
)
def test_a_coast_begins_at_half_the_speed_and_lasts_a_second(
    case: AxisFit, off_s: float, speed: float, shown: bool
) -> None:
    assert _coasts(coasting(case, off_s, speed)) is shown
    assert row("inflow loss").shown(coasting(case, off_s, speed)) is shown
    assert row("lags that differ").common == 0.01
    # Without coasts, lags that differ look like inflow.
    assert row("lags that differ").or_else(coasting(case, off_s, speed)) == ("" if shown else "inflow loss")
    assert not row("sag over the run").shown(case)


def test_a_swing_is_a_coast_that_becomes_fast(case: AxisFit) -> None:
    slow = coasting(case, 1.2, 0.05)
    assert not _coasts(slow)
    times, v = slow.fit.problem.grid.times_s, slow.fit.linear.path.v.copy()
    v[(times > 2.5) & (times < 2.8)] = -0.3
    swung = moved(slow.fit, array(v), array(np.zeros(121)), times, slow.fit.problem.grid.starts)
    assert _coasts(replace(slow, fit=swung))


def test_averages_hide_drag_of_what_changes(case: AxisFit) -> None:
    """Of an even acceleration the mean of the square is more than the square of the mean, by a^2 T^2 / 12."""
    times = array(np.linspace(0.0, 6.0, 121))
    v = 0.5 + 0.1 * times
    moving = replace(case, fit=moved(case.fit, array(v), array(np.zeros(121)), times, np.arange(121) == 0))
    found = row("averaging of the table")
    inside = slice(15, -15)
    hidden = -0.05 * 66.0 * 0.1**2 / 12.0
    assert found.effect(moving)[inside, 0] == pytest.approx(hidden, rel=0.01)
    steady = replace(case, fit=moved(case.fit, np.full(121, 0.4), array(np.zeros(121)), times, np.arange(121) == 0))
    assert found.effect(steady) == pytest.approx(0.0, abs=1e-9)


def test_only_records_of_other_stacks_may_be_averages(case: AxisFit) -> None:
    found = row("averaging of the table")
    assert found.sigma(case) == 0.0
    assert found.sigma(replace(case, tuning=Tuning(lag_doubt_s=0.2))) == 0.5
    assert (found.scope, found.considered, found.near, found.loss) == (RUN, False, 1.0, False)


def test_a_coast_is_within_one_stretch(case: AxisFit) -> None:
    whole = coasting(case, 1.2)
    grid = whole.fit.problem.grid
    cut = replace(grid, starts=grid.starts | (np.abs(grid.times_s - 2.6) < 1e-6))
    assert not _coasts(replace(whole, fit=replace(whole.fit, problem=replace(whole.fit.problem, grid=cut))))
    # From the start of a stretch on it counts as well.
    begun = replace(grid, starts=np.abs(grid.times_s - 2.05) < 1e-6)
    assert _coasts(replace(whole, fit=replace(whole.fit, problem=replace(whole.fit.problem, grid=begun))))
    strong = replace(
        whole, record=replace(whole.record, thrust=replace(whole.record.thrust, y=array(np.array([12.0, 1.3, 12.0]))))
    )
    assert not _coasts(strong)


# ---- priors

PRIORS: dict[str, tuple[str, float, bool, float, str, bool]] = {
    "thrust calibration": (GAIN, 1.0, True, 1.0, "", False),
    "losses between thrusters and hull": (GAIN, 0.06, True, 0.16, "losses", True),
    "losses that change with the load": (MODEL, 0.03, False, 0.03, "losses", False),
    "gain of the wrench": (GAIN, 0.02, True, 1.0, "", False),
    "inflow loss": (GAIN, 0.3 / math.sqrt(3.0), True, 0.005, "inflow", True),
    "sag over the run": (GAIN, 1.2 * 0.1 / math.sqrt(3.0), False, 0.03, "", True),
    "sag under load": (MODEL, 1.2 * 0.03 / math.sqrt(3.0), False, 0.03, "", True),
    "dead bands that differ": (MODEL, 1.0, False, 0.03, "", False),
    "dead band of the thrust": (MODEL, 1.0, False, 1.0, "", False),
    "exponent of the thrust": (MODEL, 0.05, False, 0.03, "", False),
    "lags that differ": (MODEL, 0.05, False, 1.0, "", False),
    "thrust lag": (RUN, 0.003, False, 1.0, "", False),
    "latency of the velocity": (RUN, 0.003, False, 1.0, "", False),
    "stamps of the record": (RUN, 0.002, True, 1.0, "", False),
    "current": (MODEL, 0.02, False, 1.0, "", False),
    "seiche": (MODEL, 0.006, False, 0.03, "", False),
    "tether": (MODEL, 0.04 * PULL, False, 0.03, "", False),
    "drag of the tether": (MODEL, 0.04 * PULL, False, 0.03, "", True),
    "drag of the tether with its length": (MODEL, 0.04 * PULL, False, 0.03, "", False),
    "friction of the tether": (MODEL, 0.02 * PULL, False, 0.03, "", False),
    "fluid memory": (MODEL, 0.06, False, 0.03, "", True),
    "own wake": (MODEL, 0.12, False, 0.03, "", True),
    "fore/aft asymmetry": (MODEL, 0.05, False, 0.2, "", False),
    "exponent of the drag": (MODEL, 0.17, False, 0.03, "", False),
    "tilt of the accelerometer": (RUN, 0.0125, True, 1.0, "", False),
    "tilt of the mount": (MODEL, 0.02, True, 1.0, "", False),
    "gain of the velocity": (GAIN, 0.005, True, 1.0, "", False),
}
"""Deviation in a pool as the worlds have it, whether the record may not judge it, and what near water leaves of it."""


def test_every_influence_that_acts_has_the_prior_of_a_usual_pool(case: AxisFit) -> None:
    tuning = Tuning(velocity_gain_sigma=0.005, thrust_doubt=0.02, wrench_gain_sigma=0.02, stamp_doubt_s=0.002)
    found = acting(replace(case, tuning=tuning))
    losses = "losses that change with the load"
    assert [one.name for one, _ in found] == [one.name for one in INFLUENCES if one.name in PRIORS.keys() - {losses}]
    for one, sigma in found:
        scope, wanted, considered, near, alone, loss = PRIORS[one.name]
        assert sigma == pytest.approx(wanted), one.name
        assert (one.scope, one.considered, one.near, one.usual_cause, one.loss) == (
            scope,
            considered,
            near,
            alone,
            loss,
        )
    of_tables = "averaging of the table", "averaging of the velocity"
    others = [one for one in INFLUENCES if one.name not in (*PRIORS, OTHER_AXES, *of_tables)]
    assert all(one.considered for one in others)
    plain = {one.name for one, _ in acting(case)}
    doubts = {"dead band of the thrust", "exponent of the thrust", "friction of the tether", "stamps of the record"}
    assert row(losses).sigma(case) == PRIORS[losses][1]
    assert PRIORS.keys() - plain == doubts | {"gain of the wrench", "gain of the velocity"}


def test_thrusters_that_idle_against_each_other_leave_a_constant_force(case: AxisFit) -> None:
    """Eight that put 0.7 N each on the axis, and up to ten times that in a tenth of the flight's commands."""
    name, each_N = "differences between idle thrusters", 0.7
    effort = np.full(101, 8 * each_N**2)
    effort[::9] *= 100.0
    reported = replace(case, record=replace(case.record, effort=Series(array(np.arange(101.0)), array(effort))))
    assert row(name).sigma(reported) == 0.06
    assert_effect(reported, name, of_force(np.full(len(TIMES), math.sqrt(8.0) * each_N)))
    # Most of the time all of them rest: nothing is left over then.
    turning = np.array([1.0, 0.0, 0.0, 1.0, 0.0])
    rested = replace(
        reported, record=replace(reported.record, effort=Series(COMMANDS.t, array(8 * each_N**2 * turning)))
    )
    assert_effect(rested, name, of_commands(math.sqrt(8.0) * each_N * turning))
    idle = replace(reported, record=replace(reported.record, effort=Series(COMMANDS.t, array(np.zeros(5)))))
    assert row(name).sigma(idle) == row(name).sigma(case) == 0.0
    assert (row(name).scope, row(name).considered, row(name).near, row(name).loss) == (MODEL, True, 0.37, False)


def test_port_and_starboard_are_alike_ahead_and_astern_are_not(case: AxisFit) -> None:
    """Of a record that only tells a wrench, thrust may be weaker one way on any axis."""
    sigma, model = row("fore/aft asymmetry").sigma, case.fit.model
    yaw = on_axis(case, Model(5, 0.4), THETA)
    assert (sigma(case), sigma(yaw), sigma(on_axis(case, Model(1, model.rigid), THETA))) == (0.05, 0.0125, 0.0125)
    assert sigma(replace(yaw, tuning=Tuning(thrust_doubt=0.02))) == 0.05
    assert sigma(on_axis(case, Model(0, model.rigid, split=True), array(np.repeat(THETA, 2)[:6]))) == 0.0


def test_only_along_the_pool_a_tether_grows(case: AxisFit) -> None:
    sigma = row("drag of the tether with its length").sigma
    assert sigma(case) == pytest.approx(0.04 * PULL)
    assert sigma(on_axis(case, Model(5, 0.4), THETA)) == sigma(on_axis(case, Model(2, 15.0), THETA)) == 0.0


def test_of_a_measured_supply_a_two_hundredth_is_left(case: AxisFit) -> None:
    """Its voltage is used in steps of 0.1 V, of 14.8 V."""
    sags = "sag over the run", "sag under load"

    def left(supply: Supply) -> tuple[float, ...]:
        return tuple(row(name).sigma(replace(case, record=replace(case.record, supply=supply))) for name in sags)

    # Of the curve of this vehicle, with the power 1.2 of the voltage; evenly up to a tenth, and to three hundredths.
    over_the_run, under_load = 1.2 * 0.1 / math.sqrt(3.0), 1.2 * 0.03 / math.sqrt(3.0)
    assert left(Supply.MEASURED) == (0.005, 0.005)
    assert left(Supply.AT_REST) == pytest.approx((0.005, under_load)), "under load nobody measured it"
    assert left(Supply.ASSUMED) == pytest.approx((over_the_run, under_load))


def test_what_nobody_given_is_doubted_more(case: AxisFit) -> None:
    bare = replace(case, vehicle=replace(case.vehicle, thrusters=()), tuning=Tuning(thrust_doubt=0.1))
    assert row("exponent of the thrust").sigma(bare) == 0.15
    for name in ("tether", "drag of the tether", "friction of the tether"):
        assert row(name).sigma(bare) == pytest.approx(0.1 * PULL)
    silent = replace(case, record=replace(case.record, thrust=NOTHING), tuning=Tuning(thrust_doubt=0.1))
    assert row("dead band of the thrust").sigma(silent) == 0.0
    assert (row("thrust calibration").sigma(case), row("thrust calibration").sigma(silent)) == (1.0, 0.0)


@pytest.mark.parametrize("sigma", [0.0, -1.0, math.nan, math.inf])
def test_an_influence_without_a_deviation_does_not_act(case: AxisFit, sigma: float) -> None:
    never: Callable[[AxisFit], float] = lambda _case: sigma  # noqa: E731  # a row of one
    assert acting(case, [replace(row("own wake"), sigma=never)]) == []


def test_a_row_is_plain_unless_it_states_more(case: AxisFit) -> None:
    plain = Influence("x", "N", RUN, lambda _case: 1.0, lambda one: one.v, Remedy("wait"))
    assert (plain.of_readings, plain.considered, plain.measured, bool(plain.usual_cause), plain.loss) == (False,) * 5
    assert plain.near == 1.0
    assert plain.drag is None
    assert not plain.shown(case)
