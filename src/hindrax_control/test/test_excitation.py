"""Excitation: bounded, seeded, rich, and kept in its room."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_control.maneuver.excitation import Bounds, Excite, signal
from hindrax_control.maneuver.goal import EXCITATIONS
from hindrax_control.prior_dynamics import PriorDynamics
from hindrax_core.vehicle import Drag

SURGE = PriorDynamics(27.3, Drag(66.48, 1.25))
BOUNDS = Bounds(force=16.0, rate=0.45, middle=5.0, room=3.9, inertia=27.3)
kinds = st.sampled_from(EXCITATIONS)
seeds = st.integers(0, 2**32 - 1)


@given(kinds, seeds, st.floats(-10.0, 100.0))
def test_signals_are_bounded(kind: str, seed: int, t: float) -> None:
    assert -1.0 <= signal(kind, seed, 60.0, 0.05)(t) <= 1.0


@given(kinds, seeds)
def test_same_seed_same_signal_other_seed_other_signal(kind: str, seed: int) -> None:
    times = np.linspace(0.0, 59.9, 300)
    one, again, other = (signal(kind, value, 60.0, 0.05) for value in (seed, seed, seed + 1))
    values = [one(t) for t in times]
    assert values == [again(t) for t in times]
    assert kind == "steps" or values != [other(t) for t in times]


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_signals_push_both_ways_and_hold_several_frequencies(kind: str) -> None:
    wave = signal(kind, 3, 60.0, 0.05)
    values = np.array([wave(t) for t in np.arange(0.0, 60.0, 0.05).tolist()])
    assert values.max() > 0.5
    assert values.min() < -0.5
    assert abs(values.mean()) < 0.1
    power = np.abs(np.fft.rfft(values)) ** 2
    # At least five lines hold a hundredth of the power or more: enough to tell inertia from drag.
    assert np.sum(power > 0.01 * power.sum()) >= 5


SLOWEST_Hz = 0.05
TICK_S = 0.01


def pieces(kind: str, seed: int, seconds: float) -> list[tuple[float, float]]:
    """Values of a signal of constant pieces, each with how long it lasts, from its start to its end."""
    wave = signal(kind, seed, seconds, SLOWEST_Hz)
    grouped = itertools.groupby(wave(TICK_S * (index + 0.5)) for index in range(round(seconds / TICK_S)))
    return [(value, TICK_S * len(list(same))) for value, same in grouped]


def test_steps_take_every_level_once_each_way_and_so_come_back() -> None:
    orders = set()
    for seed in range(4):
        values, lengths_s = zip(*pieces("steps", seed, 60.0), strict=True)
        there, back = values[::2], values[1::2]
        assert back == tuple(-value for value in there)
        assert sorted(map(abs, there)) == pytest.approx([(index + 1) / len(there) for index in range(len(there))])
        assert lengths_s == pytest.approx([60.0 / len(values)] * len(values), abs=2.0 * TICK_S)
        assert 2.0 * max(lengths_s) < 1.0 / SLOWEST_Hz
        orders.add(tuple(map(abs, there)))
    assert len(orders) > 1
    assert {abs(signal("steps", seed, 1.0, SLOWEST_Hz)(0.0)) for seed in range(9)} == {1.0}


def test_doublets_come_back_and_pause_before_the_next() -> None:
    found = pieces("doublets", 1, 600.0)
    assert signal("doublets", 1, 600.0, SLOWEST_Hz)(-1.0) == 0.0
    sizes, widths_s = [], []
    for (there, there_s), (back, back_s), (pause, pause_s) in list(zip(*(found[k::3] for k in range(3)), strict=False))[
        :-1
    ]:
        assert (back, pause) == (-there, 0.0)
        assert (back_s, pause_s) == pytest.approx((there_s, there_s), abs=2.0 * TICK_S)
        sizes.append(there)
        widths_s.append(there_s)
    assert 2.0 * max(widths_s) <= 1.0 / SLOWEST_Hz
    assert max(widths_s) > 2.0 * min(widths_s)
    assert min(sizes) < 0.0 < max(sizes)
    assert max(map(abs, sizes)) <= 1.0


def test_a_chirp_rises_evenly_from_the_slowest_frequency_by_three_octaves_and_a_half() -> None:
    wave = signal("chirp", 1, 60.0, SLOWEST_Hz)
    crossings = np.array([t for t in np.arange(0.0, 60.0, TICK_S).tolist() if wave(t) * wave(t + TICK_S) < 0.0])
    frequencies_Hz = 0.5 / np.diff(crossings)
    rise, begin_Hz = np.polyfit(0.5 * (crossings[1:] + crossings[:-1]), frequencies_Hz, 1)
    assert begin_Hz == pytest.approx(SLOWEST_Hz, rel=0.1)
    assert (begin_Hz + 60.0 * rise) / SLOWEST_Hz == pytest.approx(2.0**3.5, rel=0.05)


def test_a_multisine_is_lines_of_one_height_evenly_apart_and_reaches_its_peak() -> None:
    wave, seconds = signal("multisine", 1, 200.0, SLOWEST_Hz), 200.0
    values = np.array([wave(t) for t in np.arange(0.0, seconds, 0.1).tolist()])
    lines = np.abs(np.fft.rfft(values)) / len(values)
    at = np.flatnonzero(lines > 0.5 * lines.max())
    assert at[0] / seconds == pytest.approx(SLOWEST_Hz)
    assert np.diff(at) / seconds == pytest.approx([0.9 * SLOWEST_Hz] * 8)
    assert lines[at] == pytest.approx([lines[at].mean()] * len(at), rel=0.02)
    assert np.abs(values).max() == pytest.approx(1.0, abs=0.02)


def test_a_multisine_goes_on_after_its_time_and_is_cut_where_it_would_leave_its_bounds() -> None:
    # Its lines come round after 200 s, and after 20 s the highest peak is still to come.
    waves = [signal("multisine", seed, 20.0, SLOWEST_Hz) for seed in range(6)]
    values = [wave(0.1 * index) for wave in waves for index in range(2000)]
    assert (min(values), max(values)) == (-1.0, 1.0)


def test_a_swing_at_full_rate_and_the_slowest_frequency_fills_half_of_the_room() -> None:
    assert BOUNDS.rate / (math.tau * BOUNDS.slowest_Hz) == pytest.approx(0.5 * BOUNDS.room)


def pushed(off_m: float, rate_mps: float = 0.0, wanted: float = 0.0) -> float:
    """Force at a place off the middle of the room while the signal has a value [N]."""
    return Excite(lambda _t: wanted, BOUNDS, 60.0).step(BOUNDS.middle + off_m, rate_mps, 100.0).force


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_signal_rules_alone_in_the_inner_half_of_the_room(side: float) -> None:
    for wanted in (-1.0, 0.3, 1.0):
        assert pushed(0.49 * side * BOUNDS.room, 0.4 * side, wanted) == BOUNDS.force * wanted
    assert pushed(0.5001 * side * BOUNDS.room, 0.0, side) == pytest.approx(side * BOUNDS.force, rel=0.01)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_in_the_outer_half_a_spring_pulls_back_and_a_critical_damper_takes_the_speed_off(side: float) -> None:
    outer_m = 0.5 * BOUNDS.room
    halfway, end = (-side * pushed(side * (outer_m + share * outer_m)) for share in (0.5, 1.0))
    assert end == pytest.approx(1.5 * BOUNDS.force)
    assert halfway == pytest.approx(0.5 * end)
    at_m, stiffness = side * 1.2 * outer_m, end / outer_m
    damping = side * (pushed(at_m) - pushed(at_m, side * 0.01)) / 0.01
    assert damping**2 == pytest.approx(4.0 * stiffness * BOUNDS.inertia)
    assert pushed(at_m, -side * 0.01) == pushed(at_m)
    assert -side * pushed(side * BOUNDS.room, side * 5.0) == pytest.approx(end)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_in_the_outer_half_the_signal_may_push_inward_only(side: float) -> None:
    at_m = side * 0.8 * BOUNDS.room
    assert pushed(at_m, wanted=side) == pushed(at_m)
    assert pushed(at_m, wanted=-0.3 * side) == pytest.approx(pushed(at_m) - 0.3 * side * BOUNDS.force)
    outer_m = 0.5 * BOUNDS.room
    for way, left in ((0.0625, 0.75), (0.125, 0.5), (0.1875, 0.25), (0.25, 0.0)):
        at_m = side * (1.0 + way) * outer_m
        assert side * (pushed(at_m, wanted=side) - pushed(at_m)) == pytest.approx(left * BOUNDS.force)


def test_an_excitation_lasts_as_long_as_asked_from_its_first_step_and_names_its_room() -> None:
    driver = Excite(lambda t: t / 60.0, BOUNDS, 60.0)
    assert driver.ends == pytest.approx((BOUNDS.middle - BOUNDS.room, BOUNDS.middle + BOUNDS.room))
    for elapsed_s in (0.0, 30.0, 60.0):
        output = driver.step(BOUNDS.middle, 0.0, 100.0 + elapsed_s)
        assert output.force == pytest.approx(BOUNDS.force * elapsed_s / 60.0)
        assert output.finished is (elapsed_s == 60.0)


@pytest.mark.parametrize("kind", EXCITATIONS)
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("drift", [0.0, 0.15])
def test_vehicle_stays_in_its_room(kind: str, seed: int, drift: float) -> None:
    """Surge of the Hindrax, with a current that carries it away."""
    driver = Excite(signal(kind, seed, 60.0, BOUNDS.slowest_Hz), BOUNDS, 60.0)
    x, u, thrust, dt = 5.0, 0.0, 0.0, 0.02
    furthest = fastest = 0.0
    for index in range(3001):
        drive = driver.step(x, u + drift, index * dt)
        thrust += (drive.force - thrust) * (1.0 - math.exp(-dt / 0.15))
        u += (thrust - SURGE.drag_force(u)) / SURGE.inertia * dt
        x += (u + drift) * dt
        furthest, fastest = max(furthest, abs(x - 5.0)), max(fastest, abs(u))
    assert furthest < BOUNDS.room
    assert fastest > 0.6 * BOUNDS.rate
    assert drive.finished
