"""Vehicles of the sources beside this package: what holds them, hindrax_bringup, needs the simulator."""

from pathlib import Path

import yaml

from hindrax_core.knobs import build
from hindrax_core.vehicle import Vehicle, load_vehicle

BRINGUP = Path(__file__).parents[2] / "hindrax_bringup"


def vehicle_beside(name: str = "hindrax") -> Vehicle:
    """Vehicle that comes with the stack."""
    return load_vehicle(BRINGUP / f"vehicles/{name}.yaml")


def hindrax_with(*names: str) -> Vehicle:
    """The Hindrax with some of the optional sensors on board."""
    data, more = (
        yaml.safe_load((BRINGUP / name).read_text())
        for name in ("vehicles/hindrax.yaml", "config/optional_sensors.yaml")
    )
    data["sensors"] |= {name: more[name] for name in names}
    return build(Vehicle, data, "the Hindrax:")
