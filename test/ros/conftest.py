"""Two pool tests in mock for everybody who wants to look at one: that of the tutorial, and the same in *ideal*."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from documentation.pages import TUTORIAL, commands_of


def flown(folder: Path, *more: str) -> tuple[Path, Any]:
    """Folder and document of a run as the tutorial tells to fly it."""
    words = next(one.words for one in commands_of(TUTORIAL) if one.words[0] == "pool-test")
    words = [*words[: words.index("--out")], *more, "--json", "--out", str(folder)]
    done = subprocess.run(
        [sys.executable, "-m", "hindrax_cli", *words],
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return folder, json.loads(done.stdout)


@pytest.fixture(scope="session")
def tutorial_flight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """The run of the tutorial: its water does not obey the law that is fitted."""
    return flown(tmp_path_factory.mktemp("pool") / "run")


@pytest.fixture(scope="session")
def ideal_flight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """The same in the world whose law is the one that is fitted."""
    return flown(tmp_path_factory.mktemp("ideal") / "run", "--world", "ideal")
