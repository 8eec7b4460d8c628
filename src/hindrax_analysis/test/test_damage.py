"""What third-party sensors leave behind is left out and told; what only looks like it stays."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hindrax_analysis.records.damage import without_damage
from hindrax_analysis.records.recording import Recording
from hindrax_ident.arrays import Array, array

PERIOD_S, NOISE_mps = 0.1, 0.01
T = array(PERIOD_S * np.arange(800))
PUSH_N = np.where(np.sin(2.0 * np.pi * T / 20.0) > 0.0, 10.0, -10.0)


def moving() -> Array:
    """Velocities (n,) [m/s] of a mass of 30 kg with drag, back and forth under `PUSH_N`, with noise."""
    v = np.zeros(len(T))
    for i in range(1, len(T)):
        v[i] = v[i - 1] + PERIOD_S / 30.0 * (PUSH_N[i - 1] - 60.0 * abs(v[i - 1]) * v[i - 1])
    return array(v + NOISE_mps * np.random.default_rng(5).standard_normal(len(T)))


def recorded(*columns: Array, t: Array = T) -> Recording:
    """A record with surge and, if given, sway."""
    velocity, wrench = np.full((len(T), 6), np.nan), np.full((len(T), 6), np.nan)
    velocity[:, : len(columns)] = np.array(columns).T
    wrench[:, 0] = PUSH_N
    return Recording("x.csv", array(t), velocity, array(T), wrench, np.zeros(0), np.zeros((0, 3)))


def between(start_s: float, end_s: float) -> slice:
    return slice(round(start_s / PERIOD_S), round(end_s / PERIOD_S))


def test_zeros_of_a_dvl_without_lock_are_left_out_on_all_its_axes() -> None:
    surge, sway = moving(), 0.1 * moving()
    for part in (between(12.0, 14.0), between(40.0, 43.0)):
        surge[part] = sway[part] = 0.0
    found = without_damage(recorded(surge, sway))
    lost = np.isnan(found.velocity[:, 0])
    assert lost.sum() == 50
    assert (np.isnan(found.velocity[:, 1]) == lost).all()
    assert any("50 velocities of exactly 0" in one and "2 stretches, the first after 12 s" in one
               for one in found.assumptions)  # fmt: skip


@pytest.mark.parametrize("none", [-32.768, 9999.0])
def test_a_number_that_stands_for_no_velocity_is_none(none: float) -> None:
    """Kept, it refused a record for "a dead band of the thrust"; a Doppler log without lock has -32768 mm/s."""
    surge = moving()
    lost = np.isin(np.arange(len(T)) % 40, (3, 4, 5))
    damaged = np.where(lost, none, surge)
    damaged[between(50.0, 53.0)] = none
    found = without_damage(recorded(array(damaged)))
    absent = lost.copy()
    absent[between(50.0, 53.0)] = True
    assert (np.isnan(found.velocity[:, 0]) == absent).all()
    assert (found.velocity[~absent, 0] == surge[~absent]).all()
    assert any(f"{absent.sum()} velocities of exactly {none:g}" in one for one in found.assumptions)


def test_two_numbers_stand_for_no_velocity() -> None:
    surge = moving()
    surge[::50], surge[1::50] = 99.0, -99.0
    assert np.isnan(without_damage(recorded(surge)).velocity[:, 0]).sum() == 32


def test_a_rest_before_the_first_thrust_is_no_damage() -> None:
    rest = recorded(array(np.concatenate((np.zeros(100), moving()[:700] - moving()[0]))))
    rest.wrench[:, 0] = np.concatenate((np.zeros(100), PUSH_N[:700]))
    assert without_damage(rest).assumptions == ()


def test_a_rest_in_the_last_digit_is_no_lost_lock() -> None:
    """Velocities in steps of 1 cm/s of an axis that was held: 151 of its zeros were left out."""
    still = array(0.01 * np.round(np.random.default_rng(5).normal(0.0, 0.4, len(T))))
    assert without_damage(recorded(moving(), still)).assumptions == ()


def test_a_rest_under_the_thrust_that_holds_it_is_no_lost_lock() -> None:
    """A vehicle that floats is held down by a constant thrust, and rests."""
    moves = (T > 20.0) & (T < 50.0)
    rest = recorded(array(0.01 * np.round(np.where(moves, 40.0 * np.sin(np.pi * (T - 20.0) / 15.0), 0.0))))
    rest.wrench[:, 0] = np.where(moves, PUSH_N, 0.0) + 6.0
    assert not any("lock" in one for one in without_damage(rest).assumptions)


def dived(above_m: float) -> Recording:
    """A record of heave by velocity and depth, pressed against the surface for 30 s and then moved as `moving`."""
    pressed = 300
    w = np.concatenate((np.zeros(pressed), moving()[:-pressed]))
    depth = above_m + np.cumsum(PERIOD_S * w) + 0.004 * np.random.default_rng(7).standard_normal(len(T))
    velocity, wrench = np.full((len(T), 6), np.nan), np.full((len(T), 6), np.nan)
    velocity[:, 2] = w + NOISE_mps * np.random.default_rng(8).standard_normal(len(T))
    wrench[:, 2] = np.concatenate((np.full(pressed, -4.0), PUSH_N[:-pressed]))
    attitude = np.column_stack([np.zeros((len(T), 2)), depth])
    return Recording("x.csv", T, array(velocity), T, array(wrench), T, array(attitude))


def test_a_vehicle_that_is_pressed_against_the_surface_is_not_free() -> None:
    """Heave was "not identifiable: fly longer" where the water above carried the thrust of half a minute."""
    found = without_damage(dived(0.1))
    rest = (T > 2.0) & (T < 29.0)
    assert np.isnan(found.velocity[rest, 2]).mean() > 0.95
    assert np.isnan(found.attitude[rest, 2]).mean() > 0.95
    assert np.isfinite(found.velocity[T > 35.0, 2]).all()
    assert any("at the surface, while the thrust pushes up" in one for one in found.assumptions)


def test_a_vehicle_that_holds_its_weight_below_the_surface_is_free() -> None:
    assert without_damage(dived(3.0)).assumptions == ()


def test_an_axis_that_was_never_measured_is_not_damaged() -> None:
    assert without_damage(recorded(moving(), array(np.zeros(len(T))))).assumptions == ()


def test_a_frozen_sensor_is_reported() -> None:
    surge = moving()
    surge[between(31.0, 33.0)] = surge[between(31.0, 33.0)][0]
    found = without_damage(recorded(surge))
    assert np.isnan(found.velocity[between(31.0, 33.0), 0]).all()
    assert any("repeat" in one and "one stretch, after 31 s" in one for one in found.assumptions)


@pytest.mark.parametrize("step_mps", [0.01, 0.05])
def test_a_coarse_resolution_is_no_frozen_sensor(step_mps: float) -> None:
    assert without_damage(recorded(array(step_mps * np.round(moving() / step_mps)))).assumptions == ()


def test_a_table_that_repeats_a_slow_sensor_in_fast_rows_is_no_damage() -> None:
    assert without_damage(recorded(array(np.repeat(moving()[::4], 4)))).assumptions == ()


def test_flat_tops_are_left_out_whole() -> None:
    surge = moving()
    found = without_damage(recorded(array(np.clip(surge, -0.3, 0.3))))
    assert (np.isnan(found.velocity[:, 0]) == (np.abs(surge) >= 0.3)).all()
    assert sum("saturated" in one for one in found.assumptions) == 2


@pytest.mark.parametrize("share", [0.06, 0.15])
def test_outliers_that_stand_alone_may_be_many(share: float) -> None:
    """Four motions that were right were refused: what was held out of the fit held them too."""
    rng = np.random.default_rng(3)
    wild = rng.random(len(T)) < share
    surge = moving() + wild * rng.choice([-1.0, 1.0], len(T)) * rng.uniform(0.5, 2.0, len(T))
    found = np.isnan(without_damage(recorded(array(surge))).velocity[:, 0])
    assert found[wild].mean() > 0.95
    assert found[~wild].sum() <= 2


@pytest.mark.parametrize("period_s", [1.0, 1.6])
def test_a_short_swing_of_an_axis_that_mostly_rests_is_no_spike(period_s: float) -> None:
    """A surge record lost 36 of its yaw rates: the vehicle swung twice, and rested else."""
    swings = sum(
        np.where(begin <= T, np.exp(-(T - begin) / 3.0) * np.sin(2.0 * np.pi * (T - begin) / period_s), 0.0)
        for begin in (20.0, 55.0)
    )
    rate = array(swings + NOISE_mps * np.random.default_rng(5).standard_normal(len(T)))
    assert without_damage(recorded(moving(), rate)).assumptions == ()
    rate[150:152] = 0.6
    assert np.flatnonzero(np.isnan(without_damage(recorded(moving(), rate)).velocity[:, 1])).tolist() == [150, 151]


@pytest.mark.parametrize("samples", [2, 3])
def test_many_short_pulses_are_the_motion(samples: int) -> None:
    pulses = np.where(np.arange(len(T)) % 20 < samples, 0.5, 0.0)
    found = without_damage(recorded(array(pulses + NOISE_mps * np.random.default_rng(5).standard_normal(len(T)))))
    assert not np.isnan(found.velocity[:, 0]).any()


def test_outliers_are_left_out_and_a_reversal_is_none() -> None:
    surge = moving()
    wild = np.arange(17, 800, 61)
    surge[wild] += 2.0
    found = without_damage(recorded(surge))
    assert np.flatnonzero(np.isnan(found.velocity[:, 0])).tolist() == wild.tolist()
    assert f"surge: {len(wild)} velocities far from all neighbors: left out" in found.assumptions
    surge = moving()
    surge[17] += 2.0
    assert "surge: 1 velocity far from all neighbors: left out" in without_damage(recorded(surge)).assumptions


def test_bursts_are_spread_evenly() -> None:
    ends = T[4::5]
    late = np.repeat(ends, 5) + 1e-3 * np.tile(np.arange(-4, 1), len(ends))
    found = without_damage(recorded(moving(), t=array(late)))
    assert np.abs(found.velocity_t - T)[5:].max() < 1e-9
    assert any("bursts of about 5" in one for one in found.assumptions)


@pytest.mark.parametrize("pause_s", [600.0, 3.2e7])
def test_a_pause_is_no_time_between_bursts(pause_s: float) -> None:
    """Two dives of one record, or a clock that was set: their times were stretched over the pause."""
    late = array(T + np.where(T > 30.0, pause_s, 0.0))
    found = without_damage(recorded(moving(), t=late))
    assert found.velocity_t.tolist() == late.tolist()
    assert not any("bursts" in one for one in found.assumptions)


def test_bursts_on_both_sides_of_a_pause_are_spread() -> None:
    late = np.repeat(T[4::5], 5) + 1e-3 * np.tile(np.arange(-4, 1), len(T) // 5)
    moved = np.where(T > 30.05, 600.0, 0.0)
    found = without_damage(recorded(moving(), t=array(late + np.repeat(moved[4::5], 5))))
    apart = np.abs(found.velocity_t - T - np.repeat(moved[4::5], 5))
    assert np.flatnonzero(apart > 1e-9).tolist() == [0, 1, 2, 3, 300, 301, 302, 303]
    assert apart.max() < 0.5


def test_two_sensors_that_take_turns_are_no_bursts() -> None:
    record = recorded(moving(), moving(), t=array(T + np.where(np.arange(800) % 2, -0.099, 0.0)))
    record.velocity[::2, 1] = record.velocity[1::2, 0] = np.nan
    assert without_damage(record).assumptions == ()


@pytest.mark.parametrize("later_s", [0.003, 0.04])
@pytest.mark.parametrize("trials", [2, 3])
def test_lines_of_several_trials_are_no_bursts(later_s: float, trials: int) -> None:
    """Sorted by time, those of two trials looked like bursts of two, and were spread evenly."""
    part = np.arange(len(T)) % trials
    t = array(np.repeat(T[::trials], trials)[: len(T)] + later_s / trials * part)
    mixed = np.choose(part, [moving(), -moving(), 0.5 + 0.2 * moving()])
    found = without_damage(recorded(array(mixed), t=t))
    assert f"surge: velocities alternate between {trials} courses" in found.assumptions[0]
    assert not any("bursts" in one for one in found.assumptions)
    assert found.velocity_t.tolist() == t.tolist()


def test_gaps_are_reported() -> None:
    keep = (T < 20.0) | (T > 32.0)
    whole = recorded(moving())
    found = without_damage(replace(whole, velocity_t=T[keep], velocity=whole.velocity[keep]))
    (reported,) = found.assumptions
    assert reported.startswith("no velocity for 12.2 s in 1 gap, the longest of 12.2 s after 19.9 s")


def placed(way: Array) -> Recording:
    """A record of places along surge, with a little noise of the others."""
    around = 0.002 * np.random.default_rng(3).standard_normal((len(T), 2))
    return replace(recorded(np.full(len(T), np.nan)), way_t=T, way=array(np.column_stack([way, around])))


def way_of(v: Array) -> Array:
    return array(np.cumsum(v) * PERIOD_S + 0.002 * np.random.default_rng(4).standard_normal(len(T)))


def held(record: Recording, *spans: tuple[float, float]) -> Recording:
    """The record with the place before each span in all of it."""
    way = record.way.copy()
    for begin, end in spans:
        rows = np.flatnonzero((record.way_t >= begin) & (record.way_t < end))
        way[rows] = way[rows[0]]
    return replace(record, way=array(way))


def test_places_that_a_tracker_repeats_are_none() -> None:
    """While the markers are hidden the last pose comes again: a vehicle that stops and leaps, "not identifiable"."""
    clean = placed(way_of(moving()))
    assert without_damage(clean).assumptions == ()
    found = without_damage(held(clean, (10.0, 10.8), (25.0, 27.0), (float(T[-1]) - 2.0, math.inf)))
    (note,) = found.assumptions
    assert "places repeat the one before, as of a tracker that does not see the vehicle" in note
    assert "left out (3 stretches, the first after 10.1 s)" in note
    kept = np.isin(clean.way_t, found.way_t)
    assert found.way == pytest.approx(clean.way[kept])
    gone = clean.way_t[~kept]
    assert len(gone) == pytest.approx(4.8 / PERIOD_S, abs=6)


@pytest.mark.parametrize("digits", [2, 3, 4])
def test_a_coarse_range_comes_to_rest_and_stays(digits: int) -> None:
    """Slow motion and rest repeat coarse values, and neither begins nor ends at once."""
    resting = np.where(
        (T > 20.0) & (T < 40.0), 0.0, np.sin((T - 20.0) / 5.0) * np.minimum(1.0, np.abs(T - 30.0) - 10.0)
    )
    way = np.cumsum(0.2 * resting) * PERIOD_S
    record = placed(way_of(moving()))
    record.wrench[:, 0] = 10.0 * resting
    rested = replace(record, way=array(np.column_stack([np.round(way, digits), np.zeros((len(T), 2))])))
    assert without_damage(rested).assumptions == ()


def test_depths_that_repeat_are_of_a_sensor_that_hangs() -> None:
    depth = 3.0 + way_of(moving())
    record = replace(recorded(moving()), attitude_t=T, attitude=array(np.column_stack([np.zeros((len(T), 2)), depth])))
    assert without_damage(record).assumptions == ()
    hung = record.attitude.copy()
    hung[between(30.0, 32.0), 2] = hung[round(30.0 / PERIOD_S), 2]
    found = without_damage(replace(record, attitude=hung))
    (note,) = found.assumptions
    assert note.startswith(
        "19 depths repeat the one before, as of a sensor that hangs, or measures less often: left out"
    )
    assert np.flatnonzero(np.isnan(found.attitude[:, 2])).tolist() == list(range(301, 320))
    assert np.isfinite(found.attitude[:, :2]).all()


def test_a_coarse_depth_repeats_by_chance() -> None:
    """Whole millimeters with noise of two: three in a row are the same now and then, and the next ones are not."""
    rng = np.random.default_rng(6)
    depth = np.round(1.0 + way_of(moving()) + 0.002 * rng.standard_normal(len(T)), 3)
    still = np.round(1.0 + 0.002 * rng.standard_normal(len(T)), 3)
    for seen in (depth, still):
        attitude = np.column_stack([np.zeros((len(T), 2)), seen])
        record = replace(recorded(moving()), attitude_t=T, attitude=array(attitude))
        assert without_damage(record).assumptions == ()
