"""A ROS installation brings its own numpy, and everything that is installed beside it has to run with that one."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
LOCK = (ROOT / "setup/native.lock").read_text(encoding="utf-8")
NEEDS_NUMPY_2_FROM = {"scipy": (1, 18), "contourpy": (1, 4)}
"""Requires-Dist of the packages themselves; Ubuntu 24.04 has numpy 1.26.4."""


def version(name: str) -> tuple[int, ...]:
    (found,) = re.findall(rf"^{name}==([\d.]+)", LOCK, re.MULTILINE)
    return tuple(int(part) for part in found.split("."))


def test_what_is_pinned_runs_with_the_numpy_of_ubuntu() -> None:
    for name, first in NEEDS_NUMPY_2_FROM.items():
        assert version(name)[:2] < first, name


def test_the_numpy_of_ubuntu_is_not_hidden_and_not_overridden() -> None:
    assert not re.search(r"^numpy==", LOCK, re.MULTILINE)
    script = (ROOT / "setup/lock.sh").read_text(encoding="utf-8")
    assert "--constraint - " in script
    assert "--override" not in script
