"""From what the maneuver says to stretches of time."""

from dataclasses import replace
from typing import Any

import numpy as np

from hindrax_ident.arrays import Array
from hindrax_ident.records.axis_record import PhaseLog, Series, Stretch, usable
from hindrax_ident.tuning import Tuning

LIMITS = Tuning(gap_s=1.0, thrust_age_s=2.0, stretch_s=60.0)


def log(*changes: tuple[float, str, str]) -> PhaseLog:
    reported = PhaseLog([])
    for change in changes:
        reported.add(*change)
    return reported


def spans(stretches: list[Stretch] | tuple[Stretch, ...]) -> list[Any]:
    return [(round(one.start_s, 3), round(one.end_s, 3)) for one in stretches]


def test_neighboring_phases_are_one_stretch_and_others_are_left_out() -> None:
    reported = log(
        (0.0, "surge", "settle"),
        (5.0, "surge", "transient"),
        (8.0, "surge", "plateau"),
        (20.0, "surge", "transit"),
        (21.0, "surge", "transient"),
        (30.0, "", ""),
    )
    assert spans(reported.stretches(["surge"], ["transient", "plateau"], 40.0)) == [(5.0, 20.0), (21.0, 30.0)]
    assert spans(reported.stretches(["surge"], ["transient", "plateau"], 40.0, join_s=1.0)) == [(5.0, 30.0)]
    assert spans(reported.stretches(["surge"], ["plateau"], 40.0)) == [(8.0, 20.0)]
    assert reported.stretches(["yaw"], ["plateau"], 40.0) == []


def test_what_was_blocked_is_left_out_from_before_it_was_noticed() -> None:
    reported = log(
        (5.0, "surge", "transient"),
        (8.0, "surge", "plateau"),
        (19.0, "surge", "transient"),
        (20.0, "surge", "blocked"),
        (23.0, "surge", "transient"),
        (30.0, "", ""),
    )
    assert spans(reported.stretches(["surge"], ["transient", "plateau"], 40.0, join_s=1.0)) == [
        (5.0, 18.0),
        (23.0, 30.0),
    ]


def test_a_phase_that_never_ends_lasts_to_the_end() -> None:
    assert spans(log((3.0, "yaw", "excite")).stretches(["yaw"], ["excite"], 12.0)) == [(3.0, 12.0)]


def test_the_order_of_the_changes_does_not_matter() -> None:
    reported = log((8.0, "", ""), (2.0, "yaw", "excite"))
    assert spans(reported.stretches(["yaw"], ["excite"], 12.0)) == [(2.0, 8.0)]


def regular(start: float, end: float, step: float = 0.1) -> Array:
    return np.arange(start, end, step, dtype=np.float64)


def test_gaps_part_a_stretch() -> None:
    measured = np.concatenate([regular(0.0, 5.0), regular(7.0, 10.0)])
    thrust = Series(regular(0.0, 10.0), np.ones(100))
    assert spans(usable([Stretch(0.0, 10.0)], measured, thrust, LIMITS)) == [(0.0, 4.9), (7.0, 9.9)]


def test_old_thrust_parts_a_stretch() -> None:
    thrust_times = np.concatenate([regular(0.0, 4.0), regular(8.0, 10.0)])
    thrust = Series(thrust_times, np.ones(len(thrust_times)))
    found = spans(usable([Stretch(0.0, 10.0)], regular(0.0, 10.0), thrust, LIMITS))
    assert found == [(0.0, 5.9), (8.6, 9.9)], "and the lag of what was commanded meanwhile is to be over"


def test_a_short_time_of_unknown_thrust_parts_a_stretch_too() -> None:
    thrust_times = np.concatenate([regular(0.0, 4.0), regular(4.7, 10.0)])
    short = replace(LIMITS, thrust_age_s=0.5)
    pushing = Series(thrust_times, np.ones(len(thrust_times)))
    assert spans(usable([Stretch(0.0, 10.0)], regular(0.0, 10.0), pushing, short)) == [(0.0, 4.4), (5.3, 9.9)]
    neutral = Series(thrust_times, np.where(np.abs(thrust_times - 3.9) < 0.01, 0.0, 1.0))
    assert spans(usable([Stretch(0.0, 10.0)], regular(0.0, 10.0), neutral, short)) == [(0.0, 9.9)]


def test_nothing_is_used_before_the_first_thrust() -> None:
    thrust = Series(regular(3.0, 10.0), np.ones(70))
    assert spans(usable([Stretch(0.0, 10.0)], regular(0.0, 10.0), thrust, LIMITS))[0][0] == 3.0


def test_long_stretches_are_cut_without_using_a_sample_twice() -> None:
    measured = regular(0.0, 150.0)
    found = usable([Stretch(0.0, 150.0)], measured, Series(measured, np.ones(len(measured))), LIMITS)
    assert len(found) == 3
    assert all(one.end_s - one.start_s <= 60.0 for one in found)
    inside = sum(int(((measured >= one.start_s) & (measured <= one.end_s)).sum()) for one in found)
    assert inside == len(measured)


def test_without_thrust_or_measurements_nothing_is_usable() -> None:
    empty = Series(np.zeros(0), np.zeros(0))
    assert usable([Stretch(0.0, 1.0)], regular(0.0, 1.0), empty, LIMITS) == ()
    assert usable([Stretch(0.0, 1.0)], np.zeros(0), Series(np.zeros(1), np.zeros(1)), LIMITS) == ()
