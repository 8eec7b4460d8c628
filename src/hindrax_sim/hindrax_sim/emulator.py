"""What an emulator file offers under the name EMULATOR: constructor, truth from the world, check of readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hindrax_core.vehicle import Mount
from hindrax_sim.world import Mounting, World


@dataclass(frozen=True, slots=True)
class Emulator:
    """`make(seed)` gives the part, `truth(world, mounting)` what is true at its place in the mock world.

    The contract sweep uses the other two: `example(seconds)` is a truth that moves as a vehicle might, and
    `agrees(truth, reading)` says whether a reading may be said of a truth, by the accuracy of the data sheet.
    """

    make: Callable[[int], Any]
    truth: Callable[[World, Mounting], Any]
    example: Callable[[float], Any]
    agrees: Callable[[Any, Any], bool]
    address: int = 0
    """Its I2C address where the vehicle file gives none; 0 for a part on a serial line."""
    also_at: Callable[[Any, Mount], dict[int, Any]] = lambda _part, _mount: {}
    """Further addresses on the bus that the same part answers at, as it is mounted."""
