"""Tests of packages in the wheel, run where the wheel is installed and nothing of the clone can be imported.

    python test/wheel_tests.py
    python test/wheel_tests.py hindrax_core hindrax_laboratory

Needs pytest and hypothesis, and for all packages the extras `autopilot` and `rosbags`. The files are copied: no test
imports its package from the clone.
"""

import ast
import importlib.util
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[1] / "src"
PACKAGES = (
    *("hindrax_core", "hindrax_laboratory", "hindrax_ident"),
    *("hindrax_bag", "hindrax_control", "hindrax_analysis"),
)
NEEDS_ROS = re.compile(r"(rclpy|\w+_msgs|\w+\.nodes|hindrax_(ros|sim|drivers|replay|operator))(\.|$)")
"""What the wheel leaves out: ROS, and the packages that fly or mock a vehicle."""
PEERS = {"brping", "filterpy", "pymavlink", "pyulog", "rosbags"}
"""Left out where they are not installed."""

NEED_SOURCES = {"test_sensor_table.py", "test_without_ros.py"}
"""Files that start a process which imports from src."""


def imported(source: Path) -> Iterator[str]:
    """Modules that a file imports, in its functions too."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{one.name}" for one in node.names)


def needs_more(source: Path) -> str:
    """What a file of tests needs that is not here; empty where it needs nothing more."""
    if source.name in NEED_SOURCES:
        return "src"
    for name in imported(source):
        top = name.partition(".")[0]
        if NEEDS_ROS.match(name) or (top in PEERS and importlib.util.find_spec(top) is None):
            return name
    return ""


def main(names: list[str]) -> int:
    """Copy, and run."""
    with tempfile.TemporaryDirectory() as folder:
        sources = Path(folder, "src")
        shutil.copytree(SOURCES / "hindrax_bringup" / "vehicles", sources / "hindrax_bringup" / "vehicles")
        for name in names or PACKAGES:
            shutil.copytree(SOURCES / name / "test", sources / name / "test")
            for file in sorted((sources / name / "test").glob("test_*.py")):
                if more := needs_more(file):
                    sys.stdout.write(f"left out: {name}/{file.name}, which needs {more}\n")
                    file.unlink()
        words = ["-q", "--import-mode=importlib", "-p", "no:cacheprovider", "-W", "error::ImportWarning"]
        return int(pytest.main([*words, "--rootdir", folder, str(sources)]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
