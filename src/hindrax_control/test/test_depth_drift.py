"""A depth that drifts is told from a DVL with a bias, from a floor that slopes, and from a mount that is askew."""

import math

import pytest

from hindrax_control.navigation.depth_drift import REMEMBERED_S, DepthDrift

SPAN_S = 0.125


def swum(
    drift_mps: float = 0.0, bias_mps: float = 0.0, slope: float = 0.0, speed_mps: float = 0.0, seconds: float = 60.0
) -> DepthDrift:
    """Swim to and fro along 4 m of floor, with a pressure that drifts, and a DVL that reads too much downward."""
    found = DepthDrift()
    for number in range(int(seconds / SPAN_S)):
        now_s = number * SPAN_S
        north_m = abs((speed_mps * now_s + 4.0) % 8.0 - 4.0)
        found.step(bias_mps - drift_mps, speed_mps, SPAN_S)
        found.floor(2.0 + slope * north_m + drift_mps * now_s, (north_m, 0.0), now_s)
    return found


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("speed_mps", [0.0, 0.3])
def test_a_drift_is_found_at_rest_and_in_motion_before_it_is_half_a_meter(sign: float, speed_mps: float) -> None:
    assert 0.2 < sign * swum(sign * 0.01, speed_mps=speed_mps, seconds=50.0).off_m < 0.5


@pytest.mark.parametrize(
    "honest",
    [
        {"bias_mps": 0.01},
        {"bias_mps": -0.01},
        {"slope": 0.3, "speed_mps": 0.3},
        {"slope": -0.3, "speed_mps": 0.3, "bias_mps": 0.002},
        {"drift_mps": 0.002},
    ],
    ids=["bias", "bias upward", "slope", "slope and bias", "weather"],
)
def test_one_witness_alone_is_believed_no_drift(honest: dict[str, float]) -> None:
    assert swum(**honest).off_m == pytest.approx(0.0, abs=0.06)


def test_a_slope_with_a_dvl_askew_is_no_more_than_a_place_is_long() -> None:
    """The way that a mount turns into the vertical grows for ever; the floor comes back."""
    assert abs(swum(bias_mps=0.02, slope=0.1, speed_mps=0.5, seconds=300.0).off_m) <= 0.1


def test_a_place_is_forgotten_when_dead_reckoning_may_have_left_it() -> None:
    found = swum(0.01, seconds=REMEMBERED_S)
    assert found.off_m > 1.0
    for later_s in (0.5, 1.0):
        found.floor(2.0 + 0.01 * (REMEMBERED_S + later_s), (0.0, 0.0), REMEMBERED_S + later_s)
    assert found.off_m < 0.1


def test_what_is_unknown_changes_nothing() -> None:
    found = swum(0.01)
    known_m = found.off_m
    found.floor(math.nan, (0.0, 0.0), 61.0)
    found.floor(9.0, (math.nan, 0.0), 61.0)
    assert found.off_m == known_m > 0.2


@pytest.mark.parametrize("hung", [True, False])
def test_a_pressure_that_repeats_itself_is_found_by_the_floor_alone(hung: bool) -> None:
    found = DepthDrift()
    for number in range(200):
        now_s = 0.05 * number
        found.pressure(1.1e5 if hung else 1.1e5 + number % 2, now_s)
        found.floor(2.0 + 0.05 * now_s, (0.0, 0.0), now_s)
        assert now_s > 2.9 or found.off_m == 0.0
    assert found.off_m == pytest.approx(0.5 if hung else 0.0, abs=0.01)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_way_counts_less_what_the_dvl_may_be_wrong_by(sign: float) -> None:
    found = DepthDrift()
    found.step(-0.013 * sign, 0.4, 2.0)
    assert found.off_m == 0.0, "no floor was seen"
    found.floor(3.0, (0.0, 0.0), 0.0)
    found.floor(3.0 + sign, (0.0, 0.0), 1.0)
    assert found.off_m == pytest.approx(sign * 2.0 * (0.013 - 0.003 - 0.4 * 0.005))
    found.floor(3.0 + 0.005 * sign, (0.0, 0.0), 2.0)
    assert found.off_m == pytest.approx(sign * 0.005), "no more than the floor says"
    found.step(0.009 * sign, 0.4, 1.0)
    assert found.off_m == pytest.approx(sign * 0.002)


def test_a_place_is_a_square_meter_and_remembered_for_four_minutes() -> None:
    found = DepthDrift()
    found.step(-9.0, 0.0, 1.0)
    for floor_m, place_m in ((2.0, (0.1, 0.1)), (3.0, (1.1, 0.1)), (4.0, (0.1, 1.1)), (5.0, (-0.1, 0.1))):
        found.floor(floor_m, place_m, 100.0)
        assert found.off_m == 0.0, "another place"
        found.floor(floor_m + 0.3, (math.floor(place_m[0]) + 0.9, math.floor(place_m[1]) + 0.9), 110.0)
        assert found.off_m == pytest.approx(0.3)
    for now_s in (340.0, 340.1):
        found.floor(2.5, (0.1, 0.1), now_s)
        assert found.off_m == pytest.approx(0.5)
    found.floor(2.5, (0.1, 0.1), 340.2)
    assert found.off_m == 0.0


def test_a_pressure_counts_as_hung_after_three_seconds() -> None:
    found = DepthDrift()
    found.floor(2.0, (0.0, 0.0), 0.0)
    found.floor(2.4, (0.0, 0.0), 1.0)
    assert found.off_m == 0.0, "no pressure"
    for now_s, off_m in ((1.0, 0.0), (3.9, 0.0), (4.0, 0.4)):
        found.pressure(1e5, now_s)
        assert found.off_m == pytest.approx(off_m)
    found.pressure(1e5 + 1.0, 4.1)
    assert found.off_m == 0.0
