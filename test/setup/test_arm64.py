"""The script that tests on aarch64 under emulation: it names tests that exist, and CI runs it."""

import re
import subprocess
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "setup" / "arm64.sh"


def test_the_tests_that_it_names_exist_and_need_no_ros() -> None:
    named = re.findall(r"src/hindrax_\w+/test[\w./]*", SCRIPT.read_text(encoding="utf-8"))
    assert {one.split("/")[1] for one in named} >= {f"hindrax_{name}" for name in ("core", "drivers", "bag", "ident")}
    for one in named:
        assert (ROOT / one).exists(), f"{SCRIPT.name} names {one}"


def test_ci_runs_it_with_what_it_needs() -> None:
    job = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))["jobs"]["arm64"]
    lines = [step.get("run", "") for step in job["steps"]]
    assert "setup/arm64.sh" in lines
    needed = re.search(r"# Needs (\S+) and (\S+) \(with (\S+) on Ubuntu\)", SCRIPT.read_text(encoding="utf-8"))
    assert needed
    assert any(set(needed.groups()) <= set(line.split()) for line in lines)


def test_without_a_set_up_it_says_so(tmp_path: Path) -> None:
    folder = tmp_path / "setup"
    folder.mkdir()
    script = folder / "arm64.sh"
    script.write_bytes(SCRIPT.read_bytes())
    done = subprocess.run(["sh", str(script)], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "wanted hindrax set up; run ./hindrax setup" in done.stderr
