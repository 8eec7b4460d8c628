"""Faults of vehicle and water rather than of a wire: a thruster fails, the DVL finds no bottom, a current runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from hindrax_sim.world import World

CURRENT_mps = (0.0, 0.15, 0.0)
"""Across the pool: what a vehicle that flies along it feels most."""


class WorldFault(Protocol):
    """Something that happens to the world, and is over after a while."""

    def begin(self, world: World, target: str) -> None:
        """Let it happen."""

    def end(self, world: World, target: str) -> None:
        """Let it be over."""


class ThrusterFails:
    """The thruster `target` gives no thrust."""

    def begin(self, world: World, target: str) -> None:
        """Stop it."""
        world.fail_thruster(target)

    def end(self, world: World, target: str) -> None:
        """Let it turn again."""
        world.fail_thruster(target, world.conditions.thrust_gain)


class LockLost:
    """The DVL finds no bottom."""

    def begin(self, world: World, target: str) -> None:
        """Silence it."""
        del target
        world.dvl_silenced = True

    def end(self, world: World, target: str) -> None:
        """Let it hear again."""
        del target
        world.dvl_silenced = False


class Current:
    """The water moves across the pool at 0.15 m/s."""

    def begin(self, world: World, target: str) -> None:
        """Switch it on."""
        del target
        world.plant.current_mps = CURRENT_mps

    def end(self, world: World, target: str) -> None:
        """Bring the water back to what the conditions of the day say."""
        del target
        world.plant.current_mps = world.conditions.current_mps


@dataclass(frozen=True, slots=True)
class ScheduledWorldFault:
    """A fault, what it falls on, and the time in which it lasts."""

    fault: WorldFault
    target: str
    start_s: float
    end_s: float


class Fate:
    """Lets the world's faults begin and end in time."""

    def __init__(self, world: World, schedule: Sequence[ScheduledWorldFault]) -> None:
        self._world = world
        self._waiting = sorted(schedule, key=lambda one: one.start_s)
        self._active: list[ScheduledWorldFault] = []

    def step(self, now_s: float) -> None:
        """Bring the faults up to now."""
        while self._waiting and self._waiting[0].start_s <= now_s:
            one = self._waiting.pop(0)
            one.fault.begin(self._world, one.target)
            self._active.append(one)
        for one in [one for one in self._active if one.end_s <= now_s]:
            self._active.remove(one)
            one.fault.end(self._world, one.target)
