"""Where the files that come with the stack lie: vehicles, middleware profiles."""

from __future__ import annotations

from pathlib import Path

import yaml

from hindrax_core.vehicle import Vehicle, parse_vehicle


def share_folder(name: str) -> Path:
    """Folder of the package: in the source tree, or in the package's share folder after an install."""
    beside = Path(__file__).resolve().parent.parent / name
    if beside.is_dir():
        return beside
    from ament_index_python.packages import get_package_share_directory  # noqa: PLC0415  # exists only under ROS

    return Path(get_package_share_directory("hindrax_bringup")) / name


def default_vehicle() -> Path:
    """Return the file of the Hindrax itself."""
    return share_folder("vehicles") / "hindrax.yaml"


def optional_sensors() -> dict[str, dict[str, object]]:
    """Lines for `sensors` of a vehicle file: sensors that a vehicle may have and the Hindrax has not."""
    file = share_folder("config") / "optional_sensors.yaml"
    found: dict[str, dict[str, object]] = yaml.safe_load(file.read_text(encoding="utf-8"))
    return found


def hindrax_with(*names: str) -> Vehicle:
    """The Hindrax with some of the optional sensors on board."""
    data, optional = yaml.safe_load(default_vehicle().read_text(encoding="utf-8")), optional_sensors()
    data["sensors"] |= {name: optional[name] for name in names}
    return parse_vehicle(data, f"{default_vehicle()} with {', '.join(names)}")
