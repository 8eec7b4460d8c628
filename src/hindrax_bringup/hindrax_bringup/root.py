"""Where the clone is: the tests, the workspace and the sources lie there."""

from __future__ import annotations

from pathlib import Path

from hindrax_core.errors import HindraxError


def clone_root() -> Path:
    """Top folder of the clone; HindraxError when the tool was installed without one."""
    for folder in Path(__file__).resolve().parents:
        if (folder / "pyproject.toml").is_file() and (folder / "src").is_dir():
            return folder
    raise HindraxError("this command needs the clone, found only an installed copy; run ./hindrax in the clone")
