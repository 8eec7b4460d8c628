"""Faults of the building: the vehicle is wired or mounted otherwise than its file says, from the start and for good."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

from hindrax_core.errors import UsageError
from hindrax_core.readings import Vec3
from hindrax_core.vehicle import Thruster, Vehicle
from hindrax_sim.conditions.thrust import with_later_start

WIDER_us, MORE_OHM = 20.0, 0.15
BuildFault: TypeAlias = Callable[[Vehicle, str], Vehicle]
"""The true vehicle of one as its file describes it; the name is that of a thruster, a pair of them, or a sensor."""


def thruster_reversed(vehicle: Vehicle, target: str) -> Vehicle:
    """Two phases of its motor are exchanged: it pushes the other way."""
    at = _index(vehicle, target)
    return _with(vehicle, {at: replace(vehicle.thrusters[at], reversed=not vehicle.thrusters[at].reversed)})


def thrusters_swapped(vehicle: Vehicle, target: str) -> Vehicle:
    """The cables of two thrusters (T1-T2) are exchanged: each gets the pulses of the other."""
    one, other = (_index(vehicle, name) for name in target.split("-"))
    first, second = vehicle.thrusters[one], vehicle.thrusters[other]
    # Each name keeps its channel, which is what the mock drives by; what hangs there is the other motor.
    return _with(vehicle, {one: _motor_of(second, first), other: _motor_of(first, second)})


def turned(angles_deg: Vec3) -> BuildFault:
    """Return the fault that a sensor is mounted with these angles more; it raises UsageError where there is none."""

    def turn(vehicle: Vehicle, target: str) -> Vehicle:
        mount = vehicle.sensors.get(target)
        if mount is None:
            raise UsageError(
                f"--fault: found no {target} on {vehicle.name}, wanted one of {', '.join(vehicle.sensors)}"
            )
        roll, pitch, yaw = (a + b for a, b in zip(mount.rotation_deg, angles_deg, strict=True))
        return replace(vehicle, sensors={**vehicle.sensors, target: replace(mount, rotation_deg=(roll, pitch, yaw))})

    return turn


def dead_bands_wider(vehicle: Vehicle, _target: str) -> Vehicle:
    """Every speed controller begins 20 us later than the curves of the file say."""
    curves = {name: with_later_start(curve, WIDER_us) for name, curve in vehicle.curves.items()}
    return replace(vehicle, curves=curves)


def supply_sags(vehicle: Vehicle, _target: str) -> Vehicle:
    """Battery, cables and plugs have 150 milliohm more than the file says."""
    declared_ohm = 0.0 if vehicle.supply_ohm is None else vehicle.supply_ohm
    return replace(vehicle, supply_ohm=declared_ohm + MORE_OHM)


def _with(vehicle: Vehicle, changed: dict[int, Thruster]) -> Vehicle:
    return replace(vehicle, thrusters=tuple(changed.get(at, one) for at, one in enumerate(vehicle.thrusters)))


def _motor_of(motor: Thruster, place: Thruster) -> Thruster:
    return replace(motor, name=place.name, channel=place.channel)


def _index(vehicle: Vehicle, target: str) -> int:
    """Index of a thruster by its name, or of T3 as the third of a vehicle whose thrusters have other names."""
    names = [one.name for one in vehicle.thrusters]
    if target in names:
        return names.index(target)
    number = target.removeprefix("T")
    if number.isdecimal() and 1 <= int(number) <= len(names):
        return int(number) - 1
    raise UsageError(f"--fault: found no thruster {target} on {vehicle.name}, wanted one of {', '.join(names)}")
