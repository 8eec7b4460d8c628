"""The operator's hand: signs of every axis, the dead man, and what comes late."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_control.teleop import Teleop, TeleopKnobs
from hindrax_core.readings import Vec6
from hindrax_core.signals import ZERO6

LIMITS: Vec6 = (60.0, 50.0, 80.0, 20.0, 25.0, 30.0)
PRESSED, LET_GO = [0, 0, 0, 0, 1], [0, 0, 0, 0, 0]
EVERY = TeleopKnobs(roll_axis=2, pitch_axis=5, dead_zone=0.0, share=1.0)


def pushed(**way: float) -> list[float]:
    axes = [0.0] * 6
    for name, value in way.items():
        axes[getattr(EVERY, f"{name}_axis")] = value
    return axes


@pytest.mark.parametrize(
    ("stick", "wanted"),
    [
        ("surge", (60.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
        ("sway", (0.0, -50.0, 0.0, 0.0, 0.0, 0.0)),
        ("heave", (0.0, 0.0, -80.0, 0.0, 0.0, 0.0)),
        ("roll", (0.0, 0.0, 0.0, 20.0, 0.0, 0.0)),
        ("pitch", (0.0, 0.0, 0.0, 0.0, -25.0, 0.0)),
        ("yaw", (0.0, 0.0, 0.0, 0.0, 0.0, -30.0)),
    ],
)
def test_a_full_stick_is_the_limit_in_the_right_direction(stick: str, wanted: Vec6) -> None:
    assert Teleop(LIMITS, EVERY).joystick(pushed(**{stick: 1.0}), PRESSED, 0.0, 0.0) == wanted


@pytest.mark.parametrize(
    ("linear", "angular", "wanted"),
    [
        ((0.5, 0.0, 0.0), (0.0, 0.0, 0.0), (30.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
        ((0.0, 0.5, 0.0), (0.0, 0.0, 0.0), (0.0, -25.0, 0.0, 0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.25), (0.0, 0.0, 0.0), (0.0, 0.0, -20.0, 0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 10.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 0.0, -12.5, 0.0)),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 9.0), (0.0, 0.0, 0.0, 0.0, 0.0, -15.0)),
    ],
)
def test_a_velocity_becomes_a_wrench_in_the_axes_of_the_model(
    linear: tuple[float, float, float], angular: tuple[float, float, float], wanted: Vec6
) -> None:
    assert Teleop(LIMITS).twist(linear, angular) == pytest.approx(wanted)


def test_a_share_of_the_full_speed_or_rate_is_that_share_of_the_wrench() -> None:
    knobs = TeleopKnobs(full_speed_mps=0.8, full_rate_radps=0.5)
    for share in (0.25, 0.5):
        wrench = Teleop(LIMITS, knobs).twist((0.8 * share, 0.0, 0.0), (0.0, 0.0, 0.5 * share))
        assert wrench == pytest.approx((knobs.share * LIMITS[0] * share, 0, 0, 0, 0, -knobs.share * LIMITS[5] * share))


def test_without_the_button_nothing_is_reported_and_letting_go_is_reported_once() -> None:
    hand = Teleop(LIMITS)
    assert hand.joystick(pushed(surge=1.0), LET_GO, 0.0, 0.0) is None
    assert hand.joystick(pushed(surge=1.0), PRESSED, 0.1, 0.1) == (30.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert hand.joystick(pushed(surge=1.0), LET_GO, 0.2, 0.2) == ZERO6
    assert hand.joystick(pushed(surge=1.0), LET_GO, 0.3, 0.3) is None


def test_a_joystick_without_such_a_button_or_axis_moves_nothing() -> None:
    assert Teleop(LIMITS).joystick([1.0], [1], 0.0, 0.0) is None
    assert Teleop(LIMITS).joystick([], PRESSED, 0.0, 0.0) == ZERO6


def test_around_its_middle_a_stick_is_at_rest_and_beyond_it_begins_softly() -> None:
    hand = Teleop(LIMITS, TeleopKnobs(dead_zone=0.1, share=1.0))
    assert hand.joystick(pushed(surge=0.1), PRESSED, 0.0, 0.0) == ZERO6
    wrench = hand.joystick(pushed(surge=-0.11), PRESSED, 0.0, 0.0)
    assert wrench is not None
    assert -1.0 < wrench[0] < 0.0
    assert hand.joystick(pushed(surge=math.nan), PRESSED, 0.0, 0.0) == ZERO6
    assert hand.joystick(pushed(surge=math.inf), PRESSED, 0.0, 0.0) == ZERO6
    assert hand.joystick(pushed(surge=1.7e308), PRESSED, 0.0, 0.0) == (60.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("ahead_s", [0.0, 1e6, -1e6])
def test_what_was_held_up_on_its_way_is_not_obeyed_whatever_clock_it_was_made_on(ahead_s: float) -> None:
    hand = Teleop(LIMITS)
    for turn in range(20):
        assert hand.joystick(pushed(surge=1.0), PRESSED, ahead_s + turn * 0.05, 100.0 + turn * 0.05)
    assert hand.joystick(pushed(surge=1.0), PRESSED, ahead_s + 1.0, 103.0) == ZERO6
    assert hand.joystick(pushed(surge=1.0), PRESSED, ahead_s + 1.05, 103.0) is None
    assert hand.joystick(pushed(surge=1.0), PRESSED, ahead_s + 3.05, 103.05) == (30.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_a_joystick_that_is_started_anew_with_an_earlier_clock_is_obeyed() -> None:
    hand = Teleop(LIMITS)
    assert hand.joystick(pushed(surge=1.0), PRESSED, 5000.0, 100.0)
    assert hand.joystick(pushed(surge=1.0), PRESSED, 3.0, 110.0)


def test_after_an_earlier_clock_delays_are_those_of_that_clock() -> None:
    hand = Teleop(LIMITS)
    assert hand.joystick(pushed(surge=1.0), PRESSED, 5000.0, 100.0)
    assert hand.joystick(pushed(surge=1.0), PRESSED, 3.0, 110.0)
    assert hand.joystick(pushed(surge=1.0), PRESSED, 3.2, 110.2)
    assert hand.joystick(pushed(surge=1.0), PRESSED, 3.4, 110.8) == ZERO6


def test_a_delay_that_stays_is_not_forgotten_in_a_minute() -> None:
    hand = Teleop(LIMITS)
    assert hand.joystick(pushed(surge=1.0), PRESSED, 0.0, 0.0)
    for turn in range(10, 1200):
        now_s = 0.05 * turn
        late = hand.joystick(pushed(surge=1.0), PRESSED, now_s - 0.4, now_s)
        assert late in (None, ZERO6), now_s


def test_two_clocks_that_drift_apart_are_never_taken_for_a_delay() -> None:
    hand = Teleop(LIMITS)
    for turn in range(4000):
        now_s = turn * 1.0
        assert hand.joystick(pushed(surge=1.0), PRESSED, now_s * (1.0 - 5e-4), now_s)


numbers = st.floats(-1e300, 1e300)


@given(axes=st.lists(st.floats(), max_size=8), buttons=st.lists(st.integers(0, 1), max_size=8))
def test_no_stick_asks_for_more_than_its_share(axes: list[float], buttons: list[int]) -> None:
    wrench = Teleop(LIMITS).joystick(axes, buttons, 0.0, 0.0)
    if wrench is not None:
        assert all(abs(part) <= 0.5 * limit for part, limit in zip(wrench, LIMITS, strict=True))


@given(linear=st.tuples(numbers, numbers, numbers), angular=st.tuples(numbers, numbers, numbers))
def test_no_velocity_asks_for_more_than_its_share(
    linear: tuple[float, float, float], angular: tuple[float, float, float]
) -> None:
    wrench = Teleop(LIMITS).twist(linear, angular)
    assert all(abs(part) <= 0.5 * limit for part, limit in zip(wrench, LIMITS, strict=True))


def test_what_is_no_number_is_left_for_the_vehicle_to_refuse() -> None:
    wrench = Teleop(LIMITS).twist((math.nan, 0.0, math.inf), (0.0, 0.0, 0.0))
    assert not math.isfinite(wrench[0])
    assert not math.isfinite(wrench[2])
    assert wrench[1] == 0.0
