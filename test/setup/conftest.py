"""Clones and machines for the tests of the set-up."""

from collections.abc import Callable
from pathlib import Path

import pytest
from stand_in_clone import STAND_IN, Clone, copy_clone


@pytest.fixture
def clone(tmp_path: Path) -> Clone:
    root, tools = tmp_path / "clone", tmp_path / "tools"
    tools.mkdir()
    copy_clone(root)
    made = Clone(root, tools, tmp_path / "calls")
    made.environment = {
        "PATH": f"{tools}:/usr/bin:/bin",
        "HOME": str(tmp_path),
        "CALLS": str(made.calls),
        "HINDRAX_ROS": "wheels",
    }
    made.tool("python3", STAND_IN)
    # The compiler is the slowest real thing left; one test of its own asks for the real one.
    made.tool("c++", "#!/bin/sh\n")
    made.tool("cc", "#!/bin/sh\n")
    return made


@pytest.fixture
def path_without() -> Callable[[Path, str], str]:
    def make(folder: Path, *names: str) -> str:
        folder.mkdir()
        for program in Path("/usr/bin").iterdir():
            if program.name not in names:
                (folder / program.name).symlink_to(program)
        return str(folder)

    return make
