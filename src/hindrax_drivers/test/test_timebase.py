"""The map from a device's clock to ROS time: laws first, then each kind of break."""

import random
from collections.abc import Iterator
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.events import NS_PER_S, Stamp
from hindrax_drivers.timebase import BLOCK_ns, Break, Timebase, _slope_under

START = 1_700_000_000 * NS_PER_S
MS = 1_000_000


def journey(
    seed: int, drift_ppm: float, period_s: tuple[float, float], count: int, jitter_ms: float
) -> Iterator[tuple[int, int, Stamp]]:
    """Samples of a device whose ticks (1 us) are too long by the drift: (ticks, truth, arrival), delays uniform."""
    dice = random.Random(seed)
    ticks, truth, arrival = dice.randrange(10**12), START, START
    for _ in range(count):
        step = round(dice.uniform(*period_s) * 1e6)
        ticks += step
        truth += round(step * 1000 * (1.0 + drift_ppm * 1e-6))
        arrival = max(arrival, truth + round(dice.uniform(0.0, jitter_ms) * MS))
        yield ticks, truth, Stamp(arrival)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    drift_ppm=st.floats(-200.0, 200.0),
    jitter_ms=st.floats(0.0, 20.0),
    slow=st.floats(0.05, 0.1),
)
def test_stamps_are_true_ordered_and_never_in_the_future(
    seed: int, drift_ppm: float, jitter_ms: float, slow: float
) -> None:
    base = Timebase(1e-6)
    last = Stamp(0)
    for index, (ticks, truth, arrival) in enumerate(journey(seed, drift_ppm, (0.05, slow), 1200, jitter_ms)):
        stamp = base.map(ticks, arrival)
        assert last <= stamp <= arrival
        last = stamp
        if index > 500:
            assert abs(stamp - truth) <= 2 * MS, f"sample {index}: {(stamp - truth) / MS} ms off"


def test_jitter_does_not_show_in_the_distances_of_stamps() -> None:
    base = Timebase(1e-6)
    stamps = [base.map(t, a) for t, _, a in journey(3, 120.0, (0.05, 0.05), 4000, 20.0)][2000:]
    steps = [later - earlier for earlier, later in pairwise(stamps)]
    wrong = [abs(step - 50_006_000) for step in steps]
    assert sorted(wrong)[int(0.97 * len(wrong))] < 5_000
    assert base.drift_ppm == pytest.approx(120.0, abs=30.0)


def test_a_batch_that_arrives_at_once_is_spread_over_the_time_it_was_taken() -> None:
    base = Timebase(1.0 / 225.0)
    for batch in range(600):
        arrival = Stamp(START + round((batch * 10 + 9) * NS_PER_S / 225.0) + 300_000)
        stamps = [base.map(batch * 10 + i, arrival) for i in range(10)]
    steps = [later - earlier for earlier, later in pairwise(stamps)]
    assert all(abs(step - NS_PER_S / 225.0) < 2_000 for step in steps)


@pytest.mark.parametrize("drift_ppm", [-30_000.0, 30_000.0])
def test_a_clock_off_by_percents_is_followed_when_the_knob_allows_it(drift_ppm: float) -> None:
    base = Timebase(1e-6, drift_ppm=50_000.0)
    late = [base.map(t, a) - truth for t, truth, a in journey(5, drift_ppm, (1 / 225, 1 / 225), 9000, 5.0)]
    assert max(abs(one) for one in late[2500:]) < 2 * MS


def test_known_latency_is_taken_off() -> None:
    base = Timebase(1e-6, latency_s=0.006)
    assert base.map(1000, Stamp(START)) == START - 6 * MS


def test_the_rate_is_never_assumed_beyond_its_bound() -> None:
    base = Timebase(1e-6, drift_ppm=50.0)
    for ticks, _, arrival in journey(1, 400.0, (0.05, 0.05), 1000, 1.0):
        base.map(ticks, arrival)
    assert base.drift_ppm == pytest.approx(50.0)


def run_then(ticks: int, arrival: int) -> tuple[list[Break], Stamp]:
    """Let 200 samples at 10 Hz from tick 10^6 pass (the last at 20.9e6 ticks, START + 19.9 s), then one more."""
    breaks: list[Break] = []
    base = Timebase(1e-6, on_break=breaks.append)
    for index in range(200):
        base.map(1_000_000 + index * 100_000, Stamp(START + index * 100 * MS))
    return breaks, base.map(ticks, Stamp(arrival))


def test_a_plain_successor_breaks_nothing() -> None:
    breaks, stamp = run_then(21_000_000, START + 20_003 * MS)
    assert breaks == []
    assert stamp == START + 20_000 * MS


def test_a_reset_is_reported_and_the_map_starts_anew() -> None:
    breaks, stamp = run_then(50_000, START + 22_000 * MS)
    assert [(one.kind, one.ticks) for one in breaks] == [("reset", 50_000)]
    assert breaks[0].shift_s == pytest.approx(-20.85)
    assert stamp == START + 22_000 * MS


def test_a_leap_ahead_is_reported_and_never_stamped_in_the_future() -> None:
    breaks, stamp = run_then(81_000_000, START + 20_000 * MS)
    assert [one.kind for one in breaks] == ["jump"]
    assert breaks[0].shift_s == pytest.approx(60.0, abs=1e-3)
    assert stamp == START + 20_000 * MS


def test_after_a_leap_the_map_goes_on_from_the_new_count() -> None:
    breaks: list[Break] = []
    base = Timebase(1e-6, on_break=breaks.append)
    for index in range(400):
        leap = 5_000_000 if index >= 200 else 0
        stamp = base.map(index * 100_000 + leap, Stamp(START + index * 100 * MS))
        assert stamp == START + index * 100 * MS
    assert len(breaks) == 1


def test_time_the_device_lost_is_found_within_two_seconds() -> None:
    breaks: list[Break] = []
    base = Timebase(1e-6, on_break=breaks.append)
    for index in range(400):
        pause = 30_000 * MS if index >= 200 else 0
        arrival = Stamp(START + index * 100 * MS + pause)
        stamp = base.map(index * 100_000, arrival)
        assert index < 220 or breaks
        if breaks:
            assert stamp == arrival
    assert [one.kind for one in breaks] == ["jump"]
    assert breaks[0].shift_s == pytest.approx(-30.0, abs=1e-3)


@pytest.mark.parametrize("lost_s", [0.12, 0.55, 1.9])
def test_stamps_catch_up_with_lost_time_without_a_gap(lost_s: float) -> None:
    breaks: list[Break] = []
    base, dice = Timebase(1e-6, on_break=breaks.append), random.Random(1)
    last, arrival = Stamp(START), Stamp(START)
    for number in range(1200):
        taken = START + number * 10 * MS + (round(lost_s * NS_PER_S) if number >= 300 else 0)
        late_ms = 0.0 if number % 3 == 0 else dice.uniform(0.0, 40.0)
        arrival = Stamp(max(arrival, taken + round(late_ms * MS)))
        stamp = base.map(number * 10_000, arrival)
        assert number < 100 or 0 < stamp - last <= 20 * MS + 1_000, f"sample {number}"
        if number > 300 + 100 * (lost_s + 1.2):
            assert abs(stamp - taken) <= MS
        last = stamp
    assert [one.kind for one in breaks] == ["jump"]
    assert breaks[0].shift_s == pytest.approx(-lost_s, abs=1e-3)


def test_a_single_arrival_that_is_too_early_makes_no_other_late() -> None:
    """A process that waited for the processor between the clock and the bus made all stamps of 24 s too early."""
    base = Timebase(1e-6, even_s=0.01)
    for number in range(600):
        taken = Stamp(START + number * 20 * MS)
        arrival = Stamp(taken - (18 * MS if number == 300 else 0))
        stamp = base.map(number * 20_000, arrival)
        assert stamp == arrival, f"sample {number}"


def test_arrivals_that_stay_earlier_are_followed() -> None:
    base = Timebase(1e-6, even_s=0.01)
    for number in range(600):
        arrival = Stamp(START + number * 20 * MS - (18 * MS if number >= 300 else 0))
        # The step is a drift as well, as far as that may go.
        assert 0 <= arrival - base.map(number * 20_000, arrival) <= 3 * MS, f"sample {number}"


def test_backlogs_are_not_taken_for_lost_time() -> None:
    breaks: list[Break] = []
    base = Timebase(1e-6, on_break=breaks.append)
    for index in range(400):
        due = START + index * 100 * MS
        arrival = due
        for begin in (200, 300):
            if begin <= index <= begin + 30:
                arrival = START + (begin + 30) * 100 * MS
        assert base.map(index * 100_000, Stamp(arrival)) == due
    assert breaks == []


def test_lumps_of_three_tenths_of_a_second_are_no_lost_time_though_their_first_samples_are_late() -> None:
    breaks: list[Break] = []
    base = Timebase(1e-6, on_break=breaks.append)
    for number in range(600):
        truth = START + number * 10 * MS
        arrival = truth if number < 100 else START + (number // 30 * 30 + 29) * 10 * MS
        stamp = base.map(number * 10_000, Stamp(arrival))
        assert stamp == truth
    assert not breaks


def test_lateness_before_a_reset_does_not_count_after_it() -> None:
    breaks: list[Break] = []
    base = Timebase(1e-6, on_break=breaks.append)
    for index in range(200):
        base.map(1_000_000 + index * 100_000, Stamp(START + index * 100 * MS))
    base.map(21_000_000, Stamp(START + 21_000 * MS))  # a second late
    for index in range(100):
        held = 1 <= index < 6
        due = START + 22_000 * MS + index * 100 * MS
        arrival = START + 22_600 * MS if held else due
        assert base.map(1_000 + index * 100_000, Stamp(arrival)) == due
    assert [one.kind for one in breaks] == ["reset"]


@pytest.mark.parametrize(
    ("points", "slope"),
    [
        ([(5.0, 7.0)], 0.0),
        ([(10.0, 3.0), (11.0, 9.0), (12.0, 4.0)], 0.5),
        ([(10.0, 0.0), (11.0, 1.0), (12.0, 4.0)], 1.0),
        ([(10.0, 0.0), (11.0, -1.0), (12.0, 5.0), (13.0, 4.0)], 2.5),
        ([(10.0, 8.0), (11.0, 2.0), (12.0, 2.5), (13.0, 0.0)], -1.0),
    ],
)
def test_the_rate_is_that_of_the_lower_hull_below_the_middle(points: list[tuple[float, float]], slope: float) -> None:
    assert _slope_under(points) == pytest.approx(slope)


def test_a_host_clock_set_back_is_reported() -> None:
    breaks, stamp = run_then(21_000_000, START + 5_000 * MS)
    assert [one.kind for one in breaks] == ["host step"]
    assert stamp == START + 5_000 * MS


@pytest.mark.parametrize("ticks", [21_000_000, 50_000], ids=["host", "device and host"])
def test_after_a_host_clock_set_back_stamps_go_on_from_the_new_time(ticks: int) -> None:
    base = Timebase(1e-6, latency_s=0.006)
    for index in range(200):
        base.map(1_000_000 + index * 100_000, Stamp(START + index * 100 * MS))
    for index in range(100):
        arrival = START - 3_600 * NS_PER_S + index * 100 * MS
        assert base.map(ticks + index * 100_000, Stamp(arrival)) == arrival - 6 * MS


def test_a_restart_forgets_offset_but_keeps_the_rate() -> None:
    base = Timebase(1e-6)
    for ticks, _, arrival in journey(2, 150.0, (0.05, 0.05), 1000, 1.0):
        base.map(ticks, arrival)
    drift = base.drift_ppm
    base.restart()
    assert base.map(7, Stamp(START + 3600 * NS_PER_S)) == START + 3600 * NS_PER_S
    assert base.drift_ppm == drift


def test_after_a_restart_delays_from_before_count_no_more() -> None:
    base = Timebase(1e-6, latency_s=0.0)
    for index in range(100):
        base.map(index * 100_000, Stamp(START + index * 100 * MS + (10 * MS if index == 0 else 0)))
    base.restart()
    for index in range(100, 200):
        arrival = Stamp(START + (index + 1) * 100 * MS)
        assert base.map(index * 100_000, arrival) == arrival


def test_no_drift_is_reported_before_one_is_found() -> None:
    timebase = Timebase(1e-6)
    assert timebase.drift_ppm == 0.0
    for index in range(3):
        timebase.map(index * 50_000, Stamp(START + index * 50 * MS))
        assert timebase.drift_ppm == 0.0


@pytest.mark.parametrize(
    ("ticks", "arrival_s", "kind", "shift_s"), [(5_001_000, 9.0, "host step", 1.0), (2_000_000, 10.1, "reset", -3.0)]
)
def test_a_step_back_of_either_clock_is_reported_with_its_size(
    ticks: int, arrival_s: float, kind: str, shift_s: float
) -> None:
    breaks: list[Break] = []
    timebase = Timebase(1e-6, on_break=breaks.append)
    timebase.map(5_000_000, Stamp(START + 10 * NS_PER_S))
    timebase.map(ticks, Stamp(START + round(arrival_s * NS_PER_S)))
    (found,) = breaks
    assert found.kind == kind
    assert found.shift_s == pytest.approx(shift_s)


def test_the_least_delay_so_far_is_what_later_ones_are_counted_from() -> None:
    timebase = Timebase(1e-6, latency_s=0.0)
    taken = [timebase.map(ms * 1000, Stamp(START + (ms + late) * MS)) for ms, late in ((0, 10), (100, 0), (200, 5))]
    assert taken == [START + 10 * MS, START + 100 * MS, START + 200 * MS]


def test_a_drift_is_found_in_less_than_half_a_block() -> None:
    timebase = Timebase(1e-6)
    for index in range(round(0.45 * BLOCK_ns / (10 * MS))):
        timebase.map(index * 10_000, Stamp(START + round(index * 10 * MS * (1.0 + 100e-6))))
    assert timebase.drift_ppm == pytest.approx(100.0, abs=1.0)
