"""Which sensors of a vehicle measure what: the devices of each kind."""

from __future__ import annotations

from hindrax_core.vehicle import Vehicle

INERTIAL = ("icm20948",)
VELOCITY = ("dvl75",)
DEPTH = ("ms5837",)
ALTITUDE = ("ping1d", "ping2")


def sensors_of(vehicle: Vehicle, devices: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the vehicle's sensors that are such devices."""
    return tuple(name for name, mount in vehicle.sensors.items() if mount.device in devices)
