"""Wrench to command and applied pulses to achieved wrench, with the guard between."""

import math
from dataclasses import replace

import pytest

from hindrax_control.allocation.allocation_cycle import COMMANDS_KEPT, AllocationCycle
from hindrax_control.allocation.allocator import AllocationKnobs, Allocator
from hindrax_core.events import Stamp, after, stamp_from_s
from hindrax_core.readings import Vec6
from hindrax_core.rotation import FSD
from hindrax_core.signals import ZERO6, Allocation, Command
from hindrax_core.text.refusals import Reason
from hindrax_core.vehicle import Vehicle

NOW = Stamp(10**9)


def achieved(vehicle: Vehicle, surge_N: float) -> Allocation:
    cycle = AllocationCycle(vehicle)
    command = cycle.command((surge_N, 0.0, 0.0, 0.0, 0.0, 0.0), FSD, NOW, NOW)
    assert command is not None
    return cycle.achieved(command.sequence, command.pulses_us)


@pytest.mark.parametrize("surge_N", [30.0, -30.0])
def test_what_a_limit_of_the_vehicle_takes_is_missing(hindrax: Vehicle, surge_N: float) -> None:
    """Holds and the guard of thrust without motion go by what is missing of what was asked for."""
    limited = replace(hindrax, limits=replace(hindrax.limits, wrench=(10.0, *hindrax.limits.wrench[1:])))
    found = achieved(limited, surge_N)
    assert found.wanted[0] == surge_N
    assert found.achieved[0] == pytest.approx(math.copysign(10.0, surge_N), abs=0.1)
    assert found.shortfall[0] == pytest.approx(found.wanted[0] - found.achieved[0])
    assert found.refused == (f"X: found {surge_N:g}, limited to 10",)


def test_within_limits_nothing_is_missing(hindrax: Vehicle) -> None:
    assert achieved(hindrax, 10.0).shortfall[0] == pytest.approx(0.0, abs=0.1)


def test_a_force_that_is_no_number_was_not_asked_for(hindrax: Vehicle) -> None:
    assert achieved(hindrax, math.nan).wanted[0] == 0.0


START = stamp_from_s(100.0)
WRENCH = (5.0, -4.0, 3.0, 0.0, 0.0, -0.5)


@pytest.fixture
def cycle(hindrax: Vehicle) -> AllocationCycle:
    return AllocationCycle(hindrax)


def commanded(cycle: AllocationCycle, wrench: Vec6 = WRENCH, at_s: float = 0.0) -> Command:
    now = after(START, at_s)
    command = cycle.command(wrench, FSD, now, now)
    assert command is not None
    return command


def test_commands_are_numbered_and_are_the_pulses_of_the_allocator(cycle: AllocationCycle, hindrax: Vehicle) -> None:
    first, second = commanded(cycle), commanded(cycle, ZERO6, 0.02)
    assert (first.sequence, second.sequence) == (1, 2)
    assert first.pulses_us == Allocator(hindrax).allocate(WRENCH).pulses_us
    assert second.pulses_us == (1500,) * 8
    assert (cycle.now, cycle.refused, cycle.inexact) == (after(START, 0.02), (), 0)


def test_applied_pulses_are_held_against_the_plan_of_their_command(cycle: AllocationCycle) -> None:
    first, _ = commanded(cycle), commanded(cycle, ZERO6, 0.02)
    served = cycle.achieved(first.sequence, first.pulses_us)
    assert served.wanted == WRENCH
    assert served.achieved == pytest.approx(WRENCH, abs=0.3)
    assert served.shortfall == pytest.approx([a - b for a, b in zip(WRENCH, served.achieved, strict=True)])
    stopped = cycle.achieved(first.sequence, (1500.0,) * 8)
    assert (stopped.wanted, stopped.achieved, stopped.shortfall) == (WRENCH, ZERO6, WRENCH)
    assert stopped.forces_N == (0.0,) * 8


@pytest.mark.parametrize("sequence", [0, 99])
def test_pulses_of_no_command_were_wanted_by_nobody(cycle: AllocationCycle, sequence: int) -> None:
    pulses_us = commanded(cycle).pulses_us
    allocation = cycle.achieved(sequence, pulses_us)
    assert allocation.wanted == ZERO6
    assert allocation.achieved == pytest.approx(WRENCH, abs=0.3)
    assert allocation.saturated == (False,) * 8


def test_saturation_of_the_plan_is_kept(cycle: AllocationCycle) -> None:
    command = commanded(cycle, (0.0, 0.0, 0.0, 0.0, 0.0, 30.0))
    allocation = cycle.achieved(command.sequence, command.pulses_us)
    assert any(allocation.saturated)
    assert cycle.inexact == 0


def test_plans_that_are_not_exact_are_counted(cycle: AllocationCycle, monkeypatch: pytest.MonkeyPatch) -> None:
    real = Allocator.allocate
    monkeypatch.setattr(Allocator, "allocate", lambda *words: replace(real(*words), exact=False))
    commanded(cycle)
    commanded(cycle, at_s=0.02)
    assert cycle.inexact == 2


def test_it_knows_the_plans_of_its_last_commands(cycle: AllocationCycle) -> None:
    sent = [commanded(cycle, at_s=0.02 * index).sequence for index in range(COMMANDS_KEPT + 3)]
    assert [cycle.has_plan(sequence) for sequence in sent] == [False] * 3 + [True] * COMMANDS_KEPT
    assert cycle.has_plan(0)
    assert not cycle.has_plan(sent[-1] + 1)


def test_numbers_go_on_after_a_command_that_was_sent_before(cycle: AllocationCycle) -> None:
    cycle.resume(Command((1500,) * 8, (), Stamp(0), 41))
    assert commanded(cycle).sequence == 42


def test_what_was_refused_is_reported_until_something_is_served(cycle: AllocationCycle) -> None:
    before = commanded(cycle)
    assert cycle.command(WRENCH, "map", after(START, 0.02), after(START, 0.02)) is None
    assert cycle.refused[0].reason is Reason.FRAME
    assert cycle.achieved(before.sequence, before.pulses_us).refused == cycle.refused
    partly = commanded(cycle, (math.nan, *WRENCH[1:]), 0.04)
    refused = cycle.achieved(partly.sequence, partly.pulses_us).refused
    assert refused == cycle.refused
    assert [one.reason for one in cycle.refused] == [Reason.NOT_FINITE]
    assert cycle.achieved(before.sequence, before.pulses_us).refused == ()


def test_thrusters_out_of_use_stand_still_and_are_reported_with_what_is_lost(cycle: AllocationCycle) -> None:
    cycle.disable(frozenset({"T8", "T7", "nobody"}))
    command = commanded(cycle)
    assert command.pulses_us[6:] == (1500, 1500)
    allocation = cycle.achieved(command.sequence, command.pulses_us)
    assert (allocation.disabled, allocation.lost_axes) == (("T7", "T8"), ("pitch",))
    cycle.disable(frozenset())
    assert (cycle.disabled, cycle.lost_axes) == (frozenset(), ())


def test_an_axis_that_a_vehicle_never_served_is_not_lost(hindrax: Vehicle) -> None:
    flat = replace(hindrax, thrusters=hindrax.thrusters[:4])
    assert "heave" in Allocator(flat).lost_axes(frozenset())
    cycle = AllocationCycle(flat)
    assert not cycle.lost_axes
    cycle.disable(frozenset({"T3", "T4"}))
    assert cycle.lost_axes == ("sway",)
    cycle.disable(frozenset())
    assert not cycle.lost_axes


def test_a_supply_may_be_measured_before_the_first_command(cycle: AllocationCycle) -> None:
    assert cycle.supply.update(14.0, cycle.now) == ""


def test_other_knobs_count_from_then_on(cycle: AllocationCycle) -> None:
    before = commanded(cycle, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    cycle.tune(AllocationKnobs(idle_bias_N=0.0))
    assert commanded(cycle, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.02).pulses_us != before.pulses_us


def test_a_weaker_supply_wants_longer_pulses_and_shows_the_same_forces(hindrax: Vehicle) -> None:
    cycle = AllocationCycle(replace(hindrax, supply_V=14.8))
    full = commanded(cycle, (20.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    cycle.command(WRENCH, FSD, START, START)
    for index in range(200):
        cycle.command((20.0, 0.0, 0.0, 0.0, 0.0, 0.0), FSD, after(START, 0.1 * index), after(START, 0.1 * index))
        assert cycle.supply.update(12.0, cycle.now) == ""
    assert cycle.supply_V == pytest.approx(12.0, abs=0.5)
    low = commanded(cycle, (20.0, 0.0, 0.0, 0.0, 0.0, 0.0), 20.0)
    assert max(low.pulses_us) > max(full.pulses_us)
    assert cycle.achieved(low.sequence, low.pulses_us).achieved[0] == pytest.approx(20.0, abs=0.3)
    assert "wanted" in cycle.supply.update(math.nan, cycle.now)
