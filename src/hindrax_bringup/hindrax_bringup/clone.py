"""The clone: folder of tests, workspace, sources and developers' tools."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType

from hindrax_core.errors import HindraxError

VEHICLE_SETUP, WHOLE_SETUP = "this is the set-up of a vehicle", "`./hindrax setup --all` installs it"


def clone_root() -> Path:
    """Top folder of the clone; HindraxError when the tool was installed without one."""
    for folder in Path(__file__).resolve().parents:
        if (folder / "pyproject.toml").is_file() and (folder / "src").is_dir():
            return folder
    raise HindraxError("this command needs the clone, found only an installed copy; run ./hindrax in the clone")


def developer_module(name: str) -> ModuleType:
    """Import a module of the developers' tools (`tools/`); HindraxError without them, or without what they need."""
    try:
        return import_module(f"hindrax_tools.{name}")
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if missing == "hindrax_tools":
            why = "this command needs the folder tools/ of the clone, found none here; run it in the clone"
            raise HindraxError(why) from error
        if missing.startswith("hindrax_") or not is_vehicle_setup():
            raise
        raise HindraxError(f"{VEHICLE_SETUP}, without {missing}; {WHOLE_SETUP}") from error


def is_vehicle_setup() -> bool:
    """Whether the set-up is that of a vehicle, without what only tests, peers and benchmarks need."""
    return (clone_root() / ".hindrax" / "vehicle").exists()
