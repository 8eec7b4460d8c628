"""Faults of vehicle and water: a failed thruster, a DVL without bottom lock, a current, a leak."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from hindrax_sim.faults.fault_schedule import FaultSchedule, Scheduled
from hindrax_sim.world import World

CURRENT_mps = 0.15
"""Across the pool: what a vehicle that flies along it feels most."""


WorldFault: TypeAlias = Callable[[World, str, bool], None]
"""Starts a fault of the world, or ends it; the name is that of its target."""


def thruster_fails(world: World, target: str, on: bool) -> None:
    """Stop the thruster `target`, or restore it."""
    world.fail_thruster(target, 0.0 if on else 1.0)


def lock_lost(world: World, _target: str, on: bool) -> None:
    """Take the DVL its bottom lock."""
    world.dvl_silenced = on


def leak(world: World, _target: str, on: bool) -> None:
    """Let water into the dry hull; at the end it dries."""
    world.water_in_hull = on


def current(world: World, _target: str, on: bool) -> None:
    """Move the water across the pool; at the end it moves as it does without the fault."""
    x, y, z = world.plant.current_mps
    world.plant.current_mps = (x, y + (CURRENT_mps if on else -CURRENT_mps), z)


class FaultInjector:
    """Starts and ends the faults of the world by time, each with its target."""

    def __init__(self, world: World, schedule: Sequence[Scheduled[tuple[WorldFault, str]]]) -> None:
        self._world = world
        self._schedule = FaultSchedule(schedule)

    def step(self, now_s: float) -> None:
        """Advance the faults to now."""
        for (fault, target), on in self._schedule.advance(now_s):
            fault(self._world, target, on)
