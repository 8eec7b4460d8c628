"""Faults of vehicle and water: a failed thruster, a DVL without bottom lock, a current, a leak."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from hindrax_core.readings import Vec3
from hindrax_sim.faults.fault_schedule import FaultSchedule, Scheduled
from hindrax_sim.world import World

CURRENT_mps = (0.0, 0.15, 0.0)
"""Across the pool: what a vehicle that flies along it feels most."""


class WorldFault(Protocol):
    """A temporary fault of the world."""

    def begin(self, world: World, target: str) -> None:
        """Start the fault."""

    def end(self, world: World, target: str) -> None:
        """End the fault."""


class ThrusterFails:
    """The thruster `target` produces no thrust."""

    def begin(self, world: World, target: str) -> None:
        """Stop it."""
        world.fail_thruster(target)

    def end(self, world: World, target: str) -> None:
        """Restore the thruster."""
        world.fail_thruster(target, 1.0)


class LockLost:
    """The DVL has no bottom lock."""

    def begin(self, world: World, target: str) -> None:
        """Remove the lock."""
        del target
        world.dvl_silenced = True

    def end(self, world: World, target: str) -> None:
        """Restore the lock."""
        del target
        world.dvl_silenced = False


class Leak:
    """Water comes into the dry hull; at the end it dries."""

    def begin(self, world: World, target: str) -> None:
        """Let it in."""
        del target
        world.water_in_hull = True

    def end(self, world: World, target: str) -> None:
        """Dry the hull."""
        del target
        world.water_in_hull = False


class Current:
    """The water moves across the pool at 0.15 m/s."""

    def begin(self, world: World, target: str) -> None:
        """Switch it on."""
        del target
        world.plant.current_mps = _plus(world.plant.current_mps, CURRENT_mps)

    def end(self, world: World, target: str) -> None:
        """Leave the water as it moves without it."""
        del target
        x, y, z = CURRENT_mps
        world.plant.current_mps = _plus(world.plant.current_mps, (-x, -y, -z))


def _plus(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


class FaultInjector:
    """Starts and ends the faults of the world by time, each with its target."""

    def __init__(self, world: World, schedule: Sequence[Scheduled[tuple[WorldFault, str]]]) -> None:
        self._world = world
        self._schedule = FaultSchedule(schedule)

    def step(self, now_s: float) -> None:
        """Advance the faults to now."""
        begun, ended = self._schedule.advance(now_s)
        for fault, target in begun:
            fault.begin(self._world, target)
        for fault, target in ended:
            fault.end(self._world, target)
