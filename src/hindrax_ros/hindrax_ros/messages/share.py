"""Text of the definitions in the installed packages."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory


def share_lookup(package: str, name: str) -> str:
    """Text of `msg/NAME.msg` of an installed package."""
    return (Path(get_package_share_directory(package)) / "msg" / f"{name}.msg").read_text(encoding="utf-8")
