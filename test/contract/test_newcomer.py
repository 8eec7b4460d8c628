"""The way of a newcomer: what `docs/how-to/new-sensor.md` says is done in a copy of the clone, and nothing else."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from contract.how_to import TABLE, VEHICLE, commands, contents, copy_of_the_clone, follow

NEW = {
    "src/hindrax_drivers/hindrax_drivers/devices/lps22hb.py",
    "src/hindrax_sim/hindrax_sim/devices/lps22hb.py",
    "test/golden/lps22hb/cases.yaml",
    "test/golden/lps22hb/test_golden_lps22hb.py",
}
READ = """
import sys
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.flights.lockstep_rigs import BytesRig
from hindrax_core.topics import TOPICS

assert {"lps22hb/pressure", "raw/lps22hb"} <= {topic.name for topic in TOPICS}
rig = BytesRig(load_vehicle(default_vehicle()), seed=1)
heard = [one.reading for _ in range(400) for name, one in rig.advance() if name == "lps22hb"]
assert len(heard) > 50, len(heard)
assert all(abs(one.pressure_Pa - 101_325.0) < 10.0 for one in heard)
"""


@pytest.fixture(scope="module")
def before_and_after(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str], dict[str, str]]:
    place = copy_of_the_clone(tmp_path_factory.mktemp("clone"))
    before = contents(place)
    follow(place)
    return place, before, contents(place)


def run(place: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python in the copy: its own sources, everything else as here."""
    paths = [str(folder) for folder in (place / "src").iterdir() if (folder / "setup.py").exists()]
    path = os.pathsep.join([*paths, os.environ.get("PYTHONPATH", "")])
    environment = dict(os.environ, PYTHONPATH=path, HINDRAX_RUNTIME_DIR=str(place / "run"))
    command = [sys.executable, *words]
    return subprocess.run(command, check=False, cwd=place, env=environment, capture_output=True, text=True)


def hindrax(place: Path, command: str) -> subprocess.CompletedProcess[str]:
    return run(place, "-m", "hindrax_cli", *command.removeprefix("./hindrax ").split())


def test_four_files_one_row_and_one_line_and_nothing_else(
    before_and_after: tuple[Path, dict[str, str], dict[str, str]],
) -> None:
    _, before, after = before_and_after
    assert {path for path in after if path not in before} == NEW
    changed = {path for path in before if after[path] != before[path]}
    assert changed == {TABLE, VEHICLE}
    for path in changed:
        more = len(after[path].splitlines()) - len(before[path].splitlines())
        assert more == 1, f"{path}: {more} lines more, wanted one"


def test_the_new_files_keep_the_rules_of_the_house(
    before_and_after: tuple[Path, dict[str, str], dict[str, str]],
) -> None:
    place, _, _ = before_and_after
    for check in (("check",), ("format", "--check")):
        done = run(place, "-m", "ruff", *check, "--no-cache", *NEW - {"test/golden/lps22hb/cases.yaml"}, TABLE)
        assert done.returncode == 0, done.stdout


def test_the_sweep_finds_it_and_it_keeps_the_contract(
    before_and_after: tuple[Path, dict[str, str], dict[str, str]],
) -> None:
    place, _, _ = before_and_after
    done = hindrax(place, commands()[0])
    assert done.returncode == 0, done.stdout
    passed = re.search(r"(\d+) passed", done.stdout)
    assert passed
    assert int(passed[1]) > 15, done.stdout


def test_the_real_driver_reads_it_in_the_mock_vehicle(
    before_and_after: tuple[Path, dict[str, str], dict[str, str]],
) -> None:
    done = run(before_and_after[0], "-c", READ)
    assert done.returncode == 0, done.stderr


@pytest.mark.ros
def test_the_doctor_knows_it(before_and_after: tuple[Path, dict[str, str], dict[str, str]]) -> None:
    done = hindrax(before_and_after[0], f"{commands()[1]} --json")
    checks = {one["name"]: one for one in json.loads(done.stdout)["checks"]}
    assert checks["lps22hb"]["ok"], done.stdout
    assert "LPS22HB at 0x5c" in checks["lps22hb"]["found"]


def test_the_reference_knows_it(before_and_after: tuple[Path, dict[str, str], dict[str, str]]) -> None:
    place, _, _ = before_and_after
    done = hindrax(place, commands()[2])
    assert done.returncode == 0, done.stderr
    pages = {file.name: file.read_text(encoding="utf-8") for file in (place / "docs" / "reference").iterdir()}
    assert "## lps22hb: ST LPS22HB, pressure in the hull" in pages["devices.md"]
    assert "`LPS22HB at 0x5c`" in pages["devices.md"]
    assert "`/hindrax/lps22hb/pressure`" in pages["topics.md"]
    assert "larger steps between two readings are damage" in pages["parameters.md"]
