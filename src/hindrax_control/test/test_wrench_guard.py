"""The command guard: what is refused whole, what axis by axis, and what it says about it."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_control.allocation.wrench_guard import Accepted, WrenchGuard, WrenchGuardKnobs
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.readings import Vec6
from hindrax_core.rotation import FLU, FSD, half_turn
from hindrax_core.text.refusals import Reason
from hindrax_core.vehicle import load_vehicle

HINDRAX = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup" / "vehicles" / "hindrax.yaml")
NOW = stamp_from_s(100.0)
WRENCH = (5.0, -4.0, 3.0, -2.0, 1.0, -0.5)


def judge(wrench: Vec6 = WRENCH, frame: str = FSD, age_s: float = 0.0) -> Accepted:
    return WrenchGuard(HINDRAX).step(wrench, frame, Stamp(NOW - stamp_from_s(age_s)), NOW)


def test_fresh_wrench_passes_as_it_is() -> None:
    assert judge().wrench == WRENCH
    assert judge().refused == ()


def test_wrench_of_the_other_body_frame_is_rotated_by_half_a_turn_about_x() -> None:
    assert judge(frame=FLU).wrench == judge(frame="rov1/base_link").wrench == (5.0, 4.0, -3.0, -2.0, -1.0, 0.5)
    assert judge(frame="rov1/base_link_fsd").wrench == judge().wrench
    assert half_turn(half_turn(WRENCH)) == WRENCH


@pytest.mark.parametrize(
    ("frame", "age_s", "reason", "sentence"),
    [
        (FSD, 0.73, Reason.LATE, "wrench: 0.73 s old, wanted at most 0.50 s"),
        (FSD, -0.3, Reason.CLOCK, "wrench: stamped 0.30 s in the future"),
        ("map", 0.0, Reason.FRAME, "wrench: found frame 'map', wanted base_link_fsd or base_link"),
        ("", 0.0, Reason.FRAME, ""),
    ],
)
def test_what_is_refused_whole_states_why(frame: str, age_s: float, reason: Reason, sentence: str) -> None:
    judged = judge(frame=frame, age_s=age_s)
    assert judged.wrench is None
    (refusal,) = judged.refused
    assert refusal.reason is reason
    assert refusal.startswith(sentence)


@pytest.mark.parametrize(
    ("age_s", "refused"),
    [(1.9, False), (2.1, True), (-0.9, False), (-1.1, True)],
)
def test_its_knobs_decide_how_old_and_how_early_a_wrench_may_be(age_s: float, refused: bool) -> None:
    guard = WrenchGuard(HINDRAX, WrenchGuardKnobs(max_age_s=2.0, max_lead_s=1.0))
    judged = guard.step(WRENCH, FSD, Stamp(NOW - stamp_from_s(age_s)), NOW)
    assert (judged.wrench is None) is refused
    strict = WrenchGuard(HINDRAX, WrenchGuardKnobs(max_age_s=0.05, max_lead_s=0.0))
    assert strict.step(WRENCH, FSD, Stamp(NOW - stamp_from_s(0.06)), NOW).wrench is None
    assert strict.step(WRENCH, FSD, Stamp(NOW - stamp_from_s(0.04)), NOW).wrench == WRENCH


def test_wrench_out_of_order_is_refused() -> None:
    guard = WrenchGuard(HINDRAX)
    guard.step(WRENCH, FSD, NOW, NOW)
    judged = guard.step(WRENCH, FSD, Stamp(NOW - stamp_from_s(0.1)), NOW)
    assert judged.wrench is None
    assert [one.reason for one in judged.refused] == [Reason.OUT_OF_ORDER]


def test_refused_wrench_does_not_block_the_next() -> None:
    guard = WrenchGuard(HINDRAX)
    guard.step(WRENCH, "map", NOW, NOW)
    assert guard.step(WRENCH, FSD, Stamp(NOW - stamp_from_s(0.1)), NOW).wrench == WRENCH


def test_axes_that_are_not_finite_are_refused_alone() -> None:
    judged = judge((math.nan, -4.0, math.inf, 0.0, 1.0, 0.0))
    assert judged.wrench == (0.0, -4.0, 0.0, 0.0, 1.0, 0.0)
    assert judged.refused == ("X: found nan, wanted a finite number", "Z: found inf, wanted a finite number")
    assert {one.reason for one in judged.refused} == {Reason.NOT_FINITE}


def test_limits_of_the_vehicle_file_keep_the_direction_of_travel() -> None:
    judged = judge((120.0, 30.0, 200.0, 0.0, 0.0, 31.0))
    assert judged.wrench == (60.0, 15.0, 80.0, 0.0, 0.0, 30.0)
    assert judged.refused == (
        "X: found 120, limited to 60",
        "Z: found 200, limited to 80",
        "N: found 31, limited to 30",
    )
    assert {one.reason for one in judged.refused} == {Reason.LIMITED}
    back = judge((-120.0, 0.0, 0.0, 0.0, 0.0, -31.0))
    assert back.wrench == (-60.0, 0.0, 0.0, 0.0, 0.0, -30.0)
    assert back.refused == ("X: found -120, limited to 60", "N: found -31, limited to 30")


@given(st.tuples(*[st.floats()] * 6))
def test_what_passes_is_finite_and_within_limits(wrench: Vec6) -> None:
    passed = judge(wrench).wrench
    assert passed is not None
    assert all(abs(value) <= limit * (1 + 1e-12) for value, limit in zip(passed, HINDRAX.limits.wrench, strict=True))
