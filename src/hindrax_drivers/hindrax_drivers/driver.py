"""What a driver file offers under the name DRIVER: its knobs and its constructor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from hindrax_core.vehicle import Mount, Vehicle


@dataclass(frozen=True, slots=True)
class Driver:
    """`make(knobs, mount, vehicle)` gives a SerialDevice or a RegisterDevice, as the table of sensors says."""

    knobs: type[Any]
    make: Callable[[Any, Mount, Vehicle], Any]


def in_water(knobs: Any, vehicle: Vehicle) -> Any:
    """Knobs with the speed of sound of the vehicle's water, unless they set another."""
    if knobs.speed_of_sound_mps != type(knobs)().speed_of_sound_mps:
        return knobs
    return replace(knobs, speed_of_sound_mps=vehicle.water.speed_of_sound_mps)
