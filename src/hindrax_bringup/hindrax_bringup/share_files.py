"""Where the files that come with the stack lie: vehicles, middleware profiles."""

from __future__ import annotations

from pathlib import Path


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
