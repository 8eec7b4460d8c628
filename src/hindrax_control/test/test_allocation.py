"""Allocation against its laws; `test_bounded_allocation.py` judges its order."""

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hindrax_control.allocation.allocator import (
    KEPT_LAYOUTS,
    LARGEST_WRENCH,
    AllocationKnobs,
    Allocator,
    _unchecked,
    bounded_axes,
)
from hindrax_control.allocation.effectiveness import NullPattern, effectiveness
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.readings import Vec6
from hindrax_core.signals import Allocation
from hindrax_core.vehicle import AXES, load_vehicle

HINDRAX = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup" / "vehicles" / "hindrax.yaml")
NAMES = tuple(thruster.name for thruster in HINDRAX.thrusters)
ALLOCATOR = Allocator(HINDRAX)
B = effectiveness(HINDRAX)
TOP = 15.5283
ROUNDING_N = 0.5 * 0.0546  # half a microsecond at the steepest slope of the curve, 1297 us

finite = st.floats(allow_nan=False, allow_infinity=False)
wrenches = st.tuples(finite, finite, finite, finite, finite, finite)
usual = st.tuples(*[st.floats(-40.0, 40.0)] * 3, *[st.floats(-10.0, 10.0)] * 3)
masks = st.frozensets(st.sampled_from(NAMES))


def applied_wrench(allocation: Allocation) -> NDArray[np.float64]:
    wrench: NDArray[np.float64] = B @ np.array(allocation.forces_N)
    return wrench


def six(values: Iterable[float]) -> Vec6:
    X, Y, Z, K, M, N = values
    return (X, Y, Z, K, M, N)


@given(wrenches, masks)
def test_any_finite_wrench_and_mask_gives_forces_within_limits(wrench: Vec6, mask: frozenset[str]) -> None:
    allocation = ALLOCATOR.allocate(wrench, mask)
    assert all(-TOP - 1e-4 <= force <= TOP + 1e-4 for force in allocation.forces_N)
    assert all(1100 <= pulse <= 1900 for pulse in allocation.pulses_us)
    running_us = 25.0 + ALLOCATOR.knobs.dead_band_margin_us
    assert all(pulse == 1500 or abs(pulse - 1500) >= running_us for pulse in allocation.pulses_us)
    assert all(allocation.pulses_us[NAMES.index(name)] == 1500 for name in mask)
    assert np.allclose(allocation.achieved, applied_wrench(allocation), atol=1e-9)
    assert np.allclose(np.subtract(allocation.wanted, allocation.achieved), allocation.shortfall, rtol=1e-12, atol=1e-9)
    assert allocation.refused == ()


@given(st.lists(st.floats(-TOP, TOP), min_size=8, max_size=8), st.sampled_from([(), *((name,) for name in NAMES)]))
def test_wrench_that_can_be_had_is_had(forces: list[float], mask: tuple[str, ...]) -> None:
    wanted = B @ np.array([0.0 if name in mask else force for name, force in zip(NAMES, forces, strict=True)])
    given_forces = ALLOCATOR.forces(tuple(wanted), frozenset(mask))
    assert np.allclose(B @ np.array(given_forces), wanted, atol=1e-7)


@given(usual)
def test_pulses_miss_a_reachable_wrench_by_rounding_only(wrench: Vec6) -> None:
    """The pattern without wrench keeps every thruster out of its dead band, wherever there is room for it."""
    wrench = six(0.4 * value for value in wrench)
    shortfall = np.abs(ALLOCATOR.allocate(wrench).shortfall)
    assert np.all(shortfall <= np.abs(B) @ np.full(8, ROUNDING_N) + 1e-9)


def test_zero_wrench_stops_every_thruster() -> None:
    assert ALLOCATOR.allocate((0.0,) * 6, previous_us=(1600,) * 8).pulses_us == (1500,) * 8


def test_idle_thrusters_hold_against_each_other() -> None:
    allocation = ALLOCATOR.allocate((0.0, 0.0, 1e-3, 0.0, 0.0, 0.0))
    assert np.abs(allocation.forces_N) == pytest.approx([2.0] * 8, abs=ROUNDING_N + 1e-3)


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_without_idle_forces_thrusters_stand_until_half_of_the_smallest_force_is_wanted(axis: int, sign: float) -> None:
    # 1.202 N at the edge of the dead band, 1.3 N beyond its margin.
    quiet = Allocator(HINDRAX, AllocationKnobs(idle_bias_N=0.0))
    for most_N, still in ((1e-3, True), (0.56, True), (0.75, False)):
        forces = np.linalg.pinv(B)[:, axis]
        wrench = np.zeros(6)
        wrench[axis] = sign * most_N / np.max(np.abs(forces))
        assert (quiet.allocate(six(wrench.tolist())).pulses_us == (1500,) * 8) is still


def test_without_a_margin_the_smallest_running_force_is_that_at_the_edge_of_the_dead_band() -> None:
    edge = Allocator(HINDRAX, AllocationKnobs(idle_bias_N=0.0, dead_band_margin_us=0.0))
    allocation = edge.allocate((-4.0 * 1.0 * math.cos(math.radians(55.0)), 0.0, 0.0, 0.0, 0.0, 0.0))
    assert {abs(pulse - 1500) for pulse in allocation.pulses_us[:4]} == {25}
    assert np.abs(allocation.forces_N[:4]) == pytest.approx([1.2017] * 4, abs=0.0005)


@given(usual.filter(lambda wrench: any(0.4 * value for value in wrench)))
def test_pattern_moves_no_more_than_it_must(first: Vec6) -> None:
    """With the pulses sent before, a wrench that hardly changes hardly changes the forces."""
    before = ALLOCATOR.allocate(six(0.4 * value for value in first))
    nudged = six(0.4 * value + 1e-3 for value in first)
    again = ALLOCATOR.allocate(nudged, previous_us=before.pulses_us)
    assert np.max(np.abs(np.subtract(again.forces_N, before.forces_N))) < 0.1


@given(usual, st.floats(3.0, 100.0))
def test_out_of_reach_the_first_priority_keeps_its_direction(wrench: Vec6, excess: float) -> None:
    wanted = np.array(wrench) * excess
    given_wrench = B @ np.array(ALLOCATOR.forces(tuple(wanted)))
    for axes in ([2, 3, 4, 5], [0, 1]):
        length = float(np.linalg.norm(wanted[axes]))
        if length > 1e-3:
            part = float(wanted[axes] @ given_wrench[axes]) / length
            assert -5e-3 <= part <= length + 5e-3
            assert given_wrench[axes] == pytest.approx(part * wanted[axes] / length, abs=5e-3)


def test_heave_and_attitude_go_before_surge_and_sway() -> None:
    # Of the 23.3 N m in yaw nearly all: served first, they leave little thrust for surge and sway.
    wanted = (100.0, 50.0, 20.0, 2.0, 1.0, 20.0)
    given_wrench = B @ np.array(ALLOCATOR.forces(wanted))
    assert given_wrench[2:] == pytest.approx(wanted[2:], abs=0.02)
    assert given_wrench[0] / given_wrench[1] == pytest.approx(2.0, rel=1e-3)
    assert 4.0 < given_wrench[0] < 6.0


def test_reach_of_each_axis() -> None:
    # All four vectored thrusters at the ends of the curve, and all four vertical ones.
    c, s = math.cos(math.radians(55.0)), math.sin(math.radians(55.0))
    for sign in (-1.0, 1.0):
        assert ALLOCATOR.reach("surge", sign) == pytest.approx(4 * c * TOP, rel=1e-3)
        assert ALLOCATOR.reach("sway", sign) == pytest.approx(4 * s * TOP, rel=1e-3)
        assert ALLOCATOR.reach("heave", sign) == pytest.approx(4 * TOP, rel=1e-3)
    # Without T3 nothing may turn the vehicle: T1 and T2 alone.
    assert ALLOCATOR.reach("surge", 1.0, frozenset({"T3"})) == pytest.approx(2 * c * TOP, rel=1e-3)


def test_failed_thrusters_name_the_axes_that_are_lost() -> None:
    assert ALLOCATOR.allocate((5.0, 0.0, 0.0, 0.0, 0.0, 0.0), frozenset({"T3"})).lost_axes == ()
    lost = ALLOCATOR.allocate((5.0, 2.0, 0.0, 0.0, 0.0, 1.0), frozenset({"T3", "T4"}))
    assert lost.lost_axes == ("sway",)
    assert lost.disabled == ("T3", "T4")
    assert lost.achieved[0] == pytest.approx(5.0, abs=0.1)
    assert lost.achieved[5] == pytest.approx(1.0, abs=0.3)
    everything = ALLOCATOR.allocate((5.0, 2.0, 0.0, 0.0, 0.0, 1.0), frozenset(NAMES))
    assert everything.lost_axes == AXES
    assert everything.pulses_us == (1500,) * 8


def test_axis_that_is_not_finite_is_refused_and_the_others_are_served() -> None:
    allocation = ALLOCATOR.allocate((5.0, math.nan, 3.0, 0.0, math.inf, 0.5))
    assert allocation.refused == ("Y: found nan, wanted a finite number", "M: found inf, wanted a finite number")
    assert allocation.wanted == (5.0, 0.0, 3.0, 0.0, 0.0, 0.5)
    assert allocation.achieved == pytest.approx(allocation.wanted, abs=0.07)


@given(st.tuples(*[st.floats()] * 6))
def test_no_axis_whatever_it_holds_makes_another_one_wrong(wrench: Vec6) -> None:
    accepted, refused = bounded_axes(wrench)
    assert len(refused) == sum(not math.isfinite(value) for value in wrench)
    assert all(abs(value) <= LARGEST_WRENCH for value in accepted)
    assert all(map(math.isfinite, ALLOCATOR.allocate(wrench).achieved))


def test_unknown_thruster_is_named() -> None:
    assert ALLOCATOR.allocate((1.0, 0.0, 0.0, 0.0, 0.0, 0.0), frozenset({"T9"})).refused == ("T9: no such thruster",)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_saturation_is_shown(sign: float) -> None:
    allocation = ALLOCATOR.allocate((0.0, 0.0, 500.0 * sign, 0.0, 0.0, 0.0))
    assert allocation.saturated == (False,) * 4 + (True,) * 4
    assert allocation.shortfall[2] == pytest.approx(sign * (500.0 - 4 * TOP), abs=0.1)


def test_low_battery_costs_thrust_and_the_pulse_makes_up_for_it() -> None:
    full = ALLOCATOR.allocate((0.0, 0.0, -30.0, 0.0, 0.0, 0.0), supply_V=14.8)
    low = ALLOCATOR.allocate((0.0, 0.0, -30.0, 0.0, 0.0, 0.0), supply_V=12.0)
    assert low.pulses_us[4] > full.pulses_us[4]
    assert low.achieved[2] == pytest.approx(-30.0, abs=0.15)


@pytest.mark.parametrize("supply_V", [math.nan, math.inf, 0.0, -12.0])
def test_a_supply_that_is_no_voltage_is_refused(supply_V: float) -> None:
    with pytest.raises(UsageError, match=f"supply voltage: found {supply_V:g} V, wanted more than zero"):
        ALLOCATOR.allocate((1.0,) * 6, supply_V=supply_V)


def test_any_voltage_above_zero_is_one() -> None:
    assert max(map(abs, ALLOCATOR.allocate((0.0, 0.0, -30.0, 0.0, 0.0, 0.0), supply_V=0.9).achieved)) < 30.0


def test_reversed_thruster_gets_the_mirrored_pulse_for_the_same_force() -> None:
    turned = replace(HINDRAX, thrusters=(replace(HINDRAX.thrusters[0], reversed=True), *HINDRAX.thrusters[1:]))
    straight, mirrored = (Allocator(one).allocate((12.0, 0.0, 0.0, 0.0, 0.0, 0.0)) for one in (HINDRAX, turned))
    assert mirrored.pulses_us[0] == 3000 - straight.pulses_us[0]
    assert mirrored.forces_N[0] == pytest.approx(straight.forces_N[0])


def test_limits_that_leave_nothing_are_reported() -> None:
    """A fault of ours or of the curves: no force is above the lower and below this upper limit."""
    broken = Allocator(HINDRAX)
    enabled = broken._enabled(frozenset(), HINDRAX.supply_V)
    enabled.spreads, enabled.unchecked = [], ((0, TOP, -TOP),)
    enabled.attainable._limits[1] = -2 * TOP
    enabled.attainable._stages.clear()
    allocation = broken.allocate((100.0, 0.0, 10.0, 0.0, 0.0, 0.0))
    assert not allocation.exact
    assert "found no forces within limits" in allocation.refused[0]
    with pytest.raises(HindraxError, match="no forces within limits"):
        broken.forces((100.0, 0.0, 10.0, 0.0, 0.0, 0.0))
    assert ALLOCATOR.allocate((100.0, 0.0, 10.0, 0.0, 0.0, 0.0)).exact


def test_symmetric_demand_out_of_reach_leaves_heave_alone() -> None:
    given_wrench = B @ np.array(ALLOCATOR.forces((500.0, 0.0, 10.0, 0.0, 0.0, 0.0)))
    assert given_wrench == pytest.approx([4 * math.cos(math.radians(55.0)) * TOP, 0.0, 10.0, 0.0, 0.0, 0.0], abs=1e-4)


@settings(max_examples=15)
@given(st.permutations(range(8)), usual)
def test_order_of_thrusters_does_not_matter(order: list[int], wrench: Vec6) -> None:
    shuffled = Allocator(replace(HINDRAX, thrusters=tuple(HINDRAX.thrusters[index] for index in order)))
    given_wrench = shuffled.B @ np.array(shuffled.forces(wrench))
    assert given_wrench == pytest.approx(B @ np.array(ALLOCATOR.forces(wrench)), abs=0.02)


def test_voltages_are_distinguished_by_a_tenth_of_a_volt_and_a_few_of_them_are_kept() -> None:
    allocator, nobody = Allocator(HINDRAX), frozenset[str]()
    wrench = (10.0, 0.0, 5.0, 0.0, 0.0, 0.0)
    at_14 = allocator.allocate(wrench, nobody, (), 14.0).pulses_us
    assert allocator.allocate(wrench, nobody, (), 14.04).pulses_us == at_14
    assert allocator.allocate(wrench, nobody, (), 14.06).pulses_us != at_14
    kept = allocator._kept(nobody, 14.0)
    assert allocator._kept(nobody, 14.8) is not kept
    assert allocator._kept(nobody, 14.0) is kept
    for tenths in range(100):
        allocator._kept(nobody, 5.0 + tenths / 10.0)
        assert allocator._kept.cache_info().currsize <= KEPT_LAYOUTS


def test_limits_of_a_thruster_are_checked_at_the_end_unless_exactly_one_pattern_has_checked_them() -> None:
    once, twice, never = (NullPattern(((0, 1.0), (1, -1.0))), NullPattern(((1, 1.0),)), 2)
    layout = SimpleNamespace(patterns=(once, twice))
    limits = [(-1.0, 2.0), (-3.0, 4.0), (-5.0, 6.0)]
    checked = _unchecked(layout, limits)  # type: ignore[arg-type]
    assert [index for index, _, _ in checked] == [1, never]
    for (_, least, most), (low, high) in zip(checked, limits[1:], strict=True):
        assert least < low < least + 1e-6, "a force on its limit is not beyond it"
        assert most - 1e-6 < high < most
