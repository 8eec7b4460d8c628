"""The own time of an axis in a record of all axes."""

from typing import Any

import numpy as np
import pytest

from hindrax_ident.arrays import Array, array, largest
from hindrax_ident.records.axis_record import PhaseLog, Stretch
from hindrax_ident.records.excited_time import excited_stretches

T = array(np.arange(0.0, 120.0, 0.1))
WHOLE = (Stretch(0.0, 120.0),)


def flown(*pushes: tuple[int, float, float, float]) -> Array:
    """Wrenches of pushes to and fro: axis, begin, end [s], and strength [N, N m]; heave holds 2 N."""
    out = np.zeros((len(T), 6))
    out[:, 2] = 2.0
    for axis, begin_s, end_s, strength in pushes:
        own = (begin_s <= T) & (end_s > T)
        out[own, axis] += strength * np.where((T[own] // 2.5) % 2, -1.0, 1.0)
    return array(out)


def spans(wrenches: Array, axis: int, whole: tuple[Stretch, ...] = WHOLE) -> list[Any]:
    return [(round(one.start_s), round(one.end_s)) for one in excited_stretches(whole, T, wrenches, axis)]


def test_of_axes_flown_one_after_the_other_each_has_its_time() -> None:
    wrenches = flown((0, 0.0, 40.0, 30.0), (1, 40.0, 80.0, 20.0), (2, 80.0, 120.0, 25.0))
    assert spans(wrenches, 0) == [(0, 41)]
    assert spans(wrenches, 1) == [(40, 81)]
    assert spans(wrenches, 2) == [(80, 120)]


def test_what_holds_against_others_excites_nothing_and_a_slow_leg_of_its_own_does() -> None:
    holding = flown((0, 0.0, 60.0, 30.0), (1, 0.0, 60.0, 2.0), (1, 60.0, 90.0, 20.0), (1, 100.0, 120.0, 2.0))
    assert spans(holding, 1) == [(60, 92), (100, 120)]


def test_a_pause_within_a_maneuver_belongs_to_it_and_a_single_push_is_no_maneuver() -> None:
    paused = flown((0, 10.0, 20.0, 30.0), (0, 24.0, 40.0, 30.0), (0, 80.0, 80.3, 30.0))
    assert spans(paused, 0) == [(10, 42)]


def test_a_record_that_belongs_to_the_axis_is_not_cut() -> None:
    assert spans(flown((0, 0.0, 100.0, 30.0)), 0) == [(0, 120)]
    assert spans(flown(), 0) == [(0, 120)], "without any thrust nothing can be chosen"
    assert excited_stretches(WHOLE, array(np.zeros(0)), array(np.zeros((0, 6))), 0) == list(WHOLE)
    assert excited_stretches((), T, flown(), 0) == []


def test_spans_stay_spans() -> None:
    """Records apart in time: neither is joined to the other."""
    halves = (Stretch(0.0, 35.0), Stretch(45.0, 120.0))
    assert spans(flown((0, 20.0, 60.0, 30.0)), 0, halves) == [(20, 35), (45, 62)]


def test_an_axis_that_is_flown_for_a_hundredth_of_a_day_has_that_time_alone() -> None:
    """The 98th percentile of its thrust is what holds it."""
    t = array(np.arange(0.0, 1000.0, 0.1))
    wrenches = np.zeros((len(t), 6))
    wrenches[:, 0] = 30.0 * np.where((t // 2.5) % 2, -1.0, 1.0)
    wrenches[:, 3] = 0.03 * np.where((t // 0.7) % 2, -1.0, 1.0)
    flown_now = (t >= 300.0) & (t < 312.0)
    wrenches[flown_now, 0] = 0.0
    wrenches[flown_now, 3] = 3.0 * np.where((t[flown_now] // 2.0) % 2, -1.0, 1.0)
    (only,) = excited_stretches((Stretch(0.0, 1000.0),), t, array(wrenches), 3)
    assert (only.start_s, only.end_s) == pytest.approx((300.0, 312.0), abs=2.5)


def test_a_thrust_outside_of_the_spans_is_no_measure_of_those_within() -> None:
    wrenches = flown((0, 10.0, 30.0, 3.0), (0, 60.0, 90.0, 300.0), (1, 10.0, 120.0, 20.0))
    parts = (Stretch(0.0, 50.0), Stretch(100.0, 120.0))
    assert spans(wrenches, 0, parts) == [(10, 31)]


def test_a_record_of_maneuvers_is_divided() -> None:
    log = PhaseLog([])
    log.add(0.0, "surge", "excite")
    log.add(9.0, "", "")
    assert log.undivided
    log.add(10.0, "surge", "plateau")
    assert not log.undivided


def test_an_axis_that_is_pushed_for_a_hundredth_of_the_time_has_its_largest_thrust() -> None:
    """By the percentile of the whole it would have none, and every share of it would be endless."""
    rare = array(np.where(T < 1.2, 3.0, 0.0))
    assert largest(rare) == 3.0
    assert largest(array(np.where(T < 1.2, 3.0, 1e-6))) == 3.0, "an allocation leaves a little everywhere"
    spiked = array(np.where(T < 0.05, 500.0, np.linspace(-30.0, 30.0, len(T))))
    assert 29.0 < largest(spiked) < 30.0, "a spike is not the largest of anything"
    assert largest(array(np.zeros(5))) == largest(array(np.zeros(0))) == 0.0
