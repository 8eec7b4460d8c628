"""The thrust curve against the paper's table and its own law: pulse and force are inverse to each other."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_control.allocation.thrust_curve import ThrustCurve, thrust_curves
from hindrax_core.errors import UsageError
from hindrax_core.thrust.curves import (
    Branch,
    Curve,
    inverse,
    problems_of,
    running,
    slope,
    stationary_points,
)
from hindrax_core.vehicle import Vehicle

# COB-2023-1394 Table 2.
NEGATIVE = Branch(c=(927.1827, -2.2726, 0.001794, -4.61e-7), from_us=1100.0, to_us=1475.0)
PRINTED_POSITIVE = Branch(c=(174.3542, -0.3106, 1.82e-4, -3.52e-7), from_us=1500.0, to_us=1900.0)
CURVE = Curve(negative=NEGATIVE)
MAIN = ThrustCurve(CURVE)


def test_forces_of_the_printed_negative_row() -> None:
    assert MAIN.force(1100.0) == pytest.approx(-15.53, abs=0.005)
    assert MAIN.force(1300.0) == pytest.approx(-8.154, abs=0.0005)
    assert MAIN.force(1475.0) == pytest.approx(-1.2017, abs=0.0005)


def test_printed_positive_row_is_refused_with_the_reason() -> None:
    with pytest.raises(UsageError, match=r"thrust curve main: positive branch does not rise.*-1124 N at 1525 us"):
        ThrustCurve(replace(CURVE, positive=PRINTED_POSITIVE), name="main")


def test_negative_row_up_to_the_stop_is_not_monotone() -> None:
    reasons = problems_of(replace(CURVE, negative=replace(NEGATIVE, to_us=1500.0), dead_band_us=0.0))
    assert any("turns at 1495.8 us" in reason for reason in reasons)
    reasons = problems_of(replace(CURVE, negative=replace(NEGATIVE, from_us=1000.0)))
    assert any("turns at 1098.6 us" in reason for reason in reasons)


@pytest.mark.parametrize(
    ("curve", "reason"),
    [
        (replace(CURVE, negative=replace(NEGATIVE, c=(math.nan, 0.0, 0.0, 0.0))), "finite"),
        (replace(CURVE, negative=replace(NEGATIVE, c=(0.0, 0.0, 0.0, 0.0))), "does not rise"),
        (replace(CURVE, negative=replace(NEGATIVE, c=(-5.0, 0.01, 0.0, 0.0))), "wanted a negative force"),
        (replace(CURVE, dead_band_us=400.0), "wanted a rising range"),
    ],
)
def test_what_cannot_be_a_thrust_curve_is_refused(curve: Curve, reason: str) -> None:
    with pytest.raises(UsageError, match=reason):
        ThrustCurve(curve)


def test_each_branch_is_judged_by_its_own_sign() -> None:
    forward = Branch(c=(-5.0, 0.001, 0.0, 0.0), from_us=1525.0, to_us=1900.0)
    backward = Branch(c=(-5.0, 0.01, 0.0, 0.0), from_us=1100.0, to_us=1475.0)
    assert problems_of(Curve(backward, forward)) == [
        "negative branch gives 6 N at 1100 us, wanted a negative force",
        "negative branch gives 9.75 N at 1475 us, wanted a negative force",
        "positive branch gives -3.475 N at 1525 us, wanted a positive force",
        "positive branch gives -3.1 N at 1900 us, wanted a positive force",
    ]
    silent = Branch(c=(-1.6, 0.001, 0.0, 0.0), from_us=1600.0, to_us=1900.0)
    assert problems_of(replace(CURVE, positive=silent)) == [], "no force at its end is of either sign"


@pytest.mark.parametrize(("dead_band_us", "below", "above"), [(10.0, 1480.0, 1530.0), (40.0, 1470.0, 1550.0)])
def test_branches_end_at_the_dead_band_or_before(dead_band_us: float, below: float, above: float) -> None:
    negative = Branch(c=(-15.0, 0.01, 0.0, 0.0), from_us=1100.0, to_us=1480.0)
    positive = Branch(c=(-15.0, 0.01, 0.0, 0.0), from_us=1530.0, to_us=1900.0)
    cut = running(Curve(negative, positive, stop_us=1510.0, dead_band_us=dead_band_us))
    assert (cut.negative, cut.positive) == (replace(negative, to_us=below), replace(positive, from_us=above))


@pytest.mark.parametrize("supply_V", [math.nan, math.inf, 0.0, -12.0])
def test_supply_that_is_not_a_voltage_is_refused(supply_V: float) -> None:
    with pytest.raises(UsageError, match=f"found a supply of {supply_V:g} V"):
        ThrustCurve(CURVE, supply_V)
    assert ThrustCurve(CURVE, 0.5).range_N[1] > 0.0


def test_missing_positive_branch_is_the_mirror_image() -> None:
    assert MAIN.range_N == pytest.approx((-15.5283, 15.5283))
    for pulse in (1525.0, 1600.0, 1777.0, 1900.0):
        assert MAIN.force(pulse) == pytest.approx(-MAIN.force(3000.0 - pulse), abs=1e-9)


@given(st.floats(1100.0, 1475.0) | st.floats(1525.0, 1900.0))
def test_pulse_undoes_force(pulse: float) -> None:
    # Near 1100 us the curve is almost flat: a femtonewton there is a nanosecond.
    assert MAIN.pulse(MAIN.force(pulse)) == pytest.approx(pulse, abs=1e-6)


@given(st.floats(-15.5, -1.21) | st.floats(1.21, 15.5), st.floats(9.0, 17.0))
def test_force_undoes_pulse_at_any_supply(force: float, supply: float) -> None:
    curve = ThrustCurve(CURVE, supply)
    reachable = max(curve.range_N[0], min(curve.range_N[1], force * (supply / 14.8) ** 1.2))
    assert curve.force(curve.pulse(reachable)) == pytest.approx(reachable, abs=1e-9)


@pytest.mark.parametrize("pulse", [1100.0, 1475.0, 1525.0, 1900.0])
def test_ends_are_exact(pulse: float) -> None:
    assert MAIN.pulse(MAIN.force(pulse)) == pytest.approx(pulse, abs=1e-9)


def test_beyond_the_ends_is_the_end() -> None:
    assert MAIN.pulse(-99.0) == 1100.0
    assert MAIN.pulse(math.inf) == 1900.0
    assert MAIN.force(900.0) == MAIN.force(1100.0)
    assert MAIN.force(2100.0) == MAIN.force(1900.0)


def test_not_a_number_stands_still() -> None:
    assert MAIN.pulse(math.nan) == 1500.0
    assert MAIN.pulse(math.nan, 1600.0) == 1500.0


def test_dead_band_gives_nothing() -> None:
    assert [MAIN.force(pulse) for pulse in (1476.0, 1500.0, 1524.0)] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_force_gap_takes_the_nearer_side_with_hysteresis(sign: float) -> None:
    edge = sign * 1.2017
    stop, run = 1500.0, 1500.0 + sign * 25.0
    assert MAIN.pulse(0.49 * edge) == stop
    assert MAIN.pulse(0.51 * edge) == run
    assert MAIN.pulse(0.45 * edge, previous_us=run + sign * 10.0) == run
    assert MAIN.pulse(0.39 * edge, previous_us=run) == stop
    assert MAIN.pulse(0.55 * edge, previous_us=stop) == stop
    assert MAIN.pulse(0.61 * edge, previous_us=stop) == run
    # Running the other way is not running this way.
    assert MAIN.pulse(0.55 * edge, previous_us=1500.0 - sign * 50.0) == stop


def test_mirrored_thruster_turns_the_other_way() -> None:
    turned = ThrustCurve(CURVE, mirrored=True)
    assert turned.force(1600.0) == pytest.approx(MAIN.force(1400.0))
    assert turned.pulse(5.0) == pytest.approx(3000.0 - MAIN.pulse(5.0))
    assert turned.pulse(-0.45 * 1.2017, previous_us=1540.0) == 1525.0


@given(st.floats(1110.0, 1470.0))
def test_slope_is_the_difference_quotient(pulse: float) -> None:
    quotient = (MAIN.force(pulse + 0.5) - MAIN.force(pulse - 0.5)) / 1.0
    assert slope(NEGATIVE.c, pulse) == pytest.approx(quotient, abs=1e-6)


def test_thrust_falls_with_the_supply() -> None:
    half = ThrustCurve(CURVE, 7.4)
    assert half.force(1200.0) == pytest.approx(MAIN.force(1200.0) * 0.5**1.2)
    assert half.range_N[1] == pytest.approx(15.5283 * 0.5**1.2)


PARABOLA = Branch(c=(-112.5, 0.15, -5e-5, 0.0), from_us=1100.0, to_us=1475.0)
LINE = Branch(c=(-60.0, 0.04, 0.0, 0.0), from_us=1525.0, to_us=1900.0)
UNEVEN = (Curve(negative=PARABOLA, positive=LINE), Curve(negative=NEGATIVE, positive=LINE), Curve(negative=PARABOLA))


@pytest.mark.parametrize("given_curve", UNEVEN)
@given(force=st.floats(-20.0, 20.0))
def test_curves_that_are_no_cubics_are_inverted_too(given_curve: Curve, force: float) -> None:
    curve = ThrustCurve(given_curve)
    low, high = curve.range_N
    pulse = curve.pulse(force)
    if curve.gap_N[0] < force < curve.gap_N[1]:
        weakest_N, running_us = (curve.gap_N[1], 1525.0) if force >= 0.0 else (curve.gap_N[0], 1475.0)
        assert pulse == (running_us if abs(force) > 0.5 * abs(weakest_N) else 1500.0)
    else:
        assert curve.force(pulse) == pytest.approx(max(low, min(high, force)), abs=1e-9)


@pytest.mark.parametrize("given_curve", UNEVEN)
def test_each_direction_has_its_own_smallest_force(given_curve: Curve) -> None:
    curve = ThrustCurve(given_curve)
    for weakest_N, running_us in zip(curve.gap_N, (1475.0, 1525.0), strict=True):
        assert [curve.pulse(share * weakest_N) for share in (0.45, 0.55)] == [1500.0, running_us]
        assert [curve.pulse(share * weakest_N, running_us) for share in (0.35, 0.45)] == [1500.0, running_us]
        assert [curve.pulse(share * weakest_N, 1500.0) for share in (0.55, 0.65)] == [1500.0, running_us]


@pytest.mark.parametrize("mirrored", [False, True])
def test_between_dead_band_and_the_first_point_of_the_curve_thrust_grows_in_proportion(mirrored: bool) -> None:
    curve = ThrustCurve(replace(UNEVEN[1], dead_band_us=5.0), mirrored=mirrored)
    assert [curve.force(pulse) for pulse in (1495.5, 1504.5)] == [0.0, 0.0]
    for edge_us, begin_us in ((1495.0, 1475.0), (1505.0, 1525.0)):
        for share in (0.1, 0.5, 0.9):
            wanted_N = share * curve.force(begin_us)
            assert curve.force(edge_us + share * (begin_us - edge_us)) == pytest.approx(wanted_N)


def test_reflected_twice_is_the_branch() -> None:
    twice = NEGATIVE.reflected(1500.0).reflected(1500.0)
    assert twice.c == pytest.approx(NEGATIVE.c, rel=1e-9)
    assert (twice.from_us, twice.to_us) == (1100.0, 1475.0)


def _cubic(c: tuple[float, float, float, float], x: float) -> float:
    return ((c[3] * x + c[2]) * x + c[1]) * x + c[0]


@given(
    st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3), st.floats(-2, 2)).filter(
        lambda c: all(v == 0.0 or abs(v) > 0.05 for v in c)
    ),
    st.floats(-4.0, 4.0),
    st.floats(0.3, 3.0),
    st.floats(0.02, 0.98),
)
def test_inverse_of_any_monotone_piece(
    c: tuple[float, float, float, float], low: float, width: float, part: float
) -> None:
    # Every kind of cubic, quadratic and line: between, left of and right of the stationary points, or without any.
    high = low + width
    turns = stationary_points(c)
    if any(low - 0.05 < turn < high + 0.05 for turn in turns) or (c[1] == c[2] == c[3] == 0.0):
        return
    x = low + part * width
    assert inverse(c, low, high)(_cubic(c, x)) == pytest.approx(x, abs=1e-6)


def test_stationary_points_are_those_of_the_derivative() -> None:
    assert stationary_points((0.0, -3.0, 0.0, 1.0)) == pytest.approx((-1.0, 1.0))
    assert stationary_points((0.0, 0.0, 0.0, 1.0)) == pytest.approx((0.0, 0.0))
    assert stationary_points((0.0, 2.0, 1.0, 0.0)) == pytest.approx((-1.0,))
    assert stationary_points((0.0, 3.0, 0.0, 1.0)) == ()


@pytest.mark.parametrize("rising", [1.0, -1.0])
def test_a_cubic_with_a_threefold_root_is_inverted_on_both_sides_of_it(rising: float) -> None:
    found = inverse((5.0 - 8.0 * rising, 12.0 * rising, -6.0 * rising, rising), 0.0, 4.0)  # 5 + rising (x - 2)^3
    for x in (0.0, 0.5, 1.0, 2.0, 3.0, 4.0):
        assert found(5.0 + rising * (x - 2.0) ** 3) == pytest.approx(x)


@pytest.mark.parametrize("rising", [1.0, -1.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_cubic_is_inverted_beyond_its_turns_near_and_far(rising: float, side: float) -> None:
    """x^3 - 3 x turns at 1, is 2 at 2, where three real roots become one, and 110 at 5."""
    c = (7.0, -3.0 * rising, 0.0, rising)
    low, high = sorted((side, side * 5.0))
    found = inverse(c, low, high)
    for index in range(1, 81):
        x = side * (1.0 + 0.05 * index)
        assert found(_cubic(c, x)) == pytest.approx(x)


def test_curves_of_a_vehicle_are_those_of_its_thrusters_at_the_supply_that_is_asked_for(hindrax: Vehicle) -> None:
    turned = replace(hindrax.thrusters[0], reversed=True)
    vehicle = replace(hindrax, thrusters=(turned, *hindrax.thrusters[1:]), supply_V=13.0)
    for asked_V, supply_V in ((None, 13.0), (12.0, 12.0)):
        found = thrust_curves(vehicle, asked_V)
        assert [one.supply_V for one in found] == [supply_V] * 8
        curves = [vehicle.curves[one.curve] for one in vehicle.thrusters]
        straight = [ThrustCurve(curve, supply_V).force(1600.0) for curve in curves]
        assert [one.force(1600.0) for one in found[1:]] == straight[1:]
        assert found[0].force(1400.0) == pytest.approx(straight[0])
