"""The tutorial, word for word: what stands under "At the desk" is run in order, in a folder of its own."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from documentation.pages import TUTORIAL, commands_of

pytest.importorskip("rclpy", reason="needs the ROS environment")

pytestmark = pytest.mark.ros
DESK = [command for command in commands_of(TUTORIAL) if command.heading == "At the desk"]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory, tutorial_flight: tuple[Path, Any]) -> Path:
    """A folder in which the pool test of the tutorial has been flown already: it is the same as elsewhere here."""
    place = tmp_path_factory.mktemp("desk")
    shutil.copytree(tutorial_flight[0], place / "runs" / "first")
    return place


def test_the_tutorial_flies_once_at_the_desk() -> None:
    assert [one.words[:2] for one in DESK].count(["pool-test", "--mock"]) == 1
    assert all("--mock" in one.words or one.words[0] != "doctor" for one in DESK)


@pytest.mark.parametrize("command", [one for one in DESK if one.words[0] != "pool-test"], ids=lambda one: one.line)
def test_a_command_of_the_tutorial_works(place: Path, command: Any) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "hindrax_cli", *command.words],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        cwd=place,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.strip() or "written: " in done.stderr
    assert "not identifiable" not in done.stdout, "the first day shows what works"
    if "--out" in command.words:
        assert (place / command.words[command.words.index("--out") + 1]).stat().st_size > 0


def test_the_tutorial_ends_with_a_report(place: Path) -> None:
    for name in ("report.html", "coefficients.yaml", "vehicle.yaml", "later.html", "model.sdf"):
        assert (place / "runs" / "first" / name).is_file(), name
    for name in ("bag", "logs"):
        assert (place / "runs" / "first" / name).is_dir(), name
