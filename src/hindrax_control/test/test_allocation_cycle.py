"""Wrench to command and applied pulses to achieved wrench, with the guard between."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from hindrax_control.allocation.allocation_cycle import AllocationCycle
from hindrax_core.events import Stamp
from hindrax_core.rotation import FSD
from hindrax_core.signals import Allocation
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
