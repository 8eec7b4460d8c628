"""The clone: folder of tests, workspace, sources and developers' tools."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType

from hindrax_core.errors import HindraxError


def clone_root() -> Path:
    """Top folder of the clone; HindraxError when the tool was installed without one."""
    for folder in Path(__file__).resolve().parents:
        if (folder / "pyproject.toml").is_file() and (folder / "src").is_dir():
            return folder
    raise HindraxError("this command needs the clone, found only an installed copy; run ./hindrax in the clone")


def developer_module(name: str) -> ModuleType:
    """Import a module of the developers' tools (`tools/`); HindraxError without them, as on a vehicle."""
    try:
        return import_module(f"hindrax_tools.{name}")
    except ModuleNotFoundError as error:
        if error.name != "hindrax_tools":
            raise
    raise HindraxError("this command needs the folder tools/ of the clone, found none here; run it in the clone")
