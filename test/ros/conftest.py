"""One pool test in mock for everybody who wants to look at one: that of the tutorial."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from documentation.pages import TUTORIAL, commands_of


@pytest.fixture(scope="session")
def tutorial_flight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    """Folder and document of the run that the tutorial tells to fly: its water does not obey the law that is fitted."""
    folder = tmp_path_factory.mktemp("pool") / "run"
    words = next(one.words for one in commands_of(TUTORIAL) if one.words[0] == "pool-test")
    words = [*words[: words.index("--out")], "--json", "--out", str(folder)]
    done = subprocess.run(
        [sys.executable, "-m", "hindrax_cli", *words],
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return folder, json.loads(done.stdout)
