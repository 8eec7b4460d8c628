"""Tests of packages in the wheel, run where the wheel is installed and nothing of the clone can be imported.

    python test/wheel_tests.py

Needs pytest and hypothesis. The files are copied: no test imports its package from the clone.
"""

import shutil
import sys
import tempfile
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[1] / "src"
PACKAGES = ("hindrax_core", "hindrax_laboratory")
"""Those whose tests are quick, and start no process of the clone."""
NEED_MORE = ("hindrax_core/test/test_sensor_table.py",)
"""Files that test with a package that is not in the wheel."""


def main() -> int:
    """Copy, and run."""
    with tempfile.TemporaryDirectory() as folder:
        sources = Path(folder, "src")
        for name in PACKAGES:
            shutil.copytree(SOURCES / name / "test", sources / name / "test")
        shutil.copytree(SOURCES / "hindrax_bringup" / "vehicles", sources / "hindrax_bringup" / "vehicles")
        for name in NEED_MORE:
            (sources / name).unlink()
        words = ["-q", "--import-mode=importlib", "-p", "no:cacheprovider", "-W", "error::ImportWarning"]
        return int(pytest.main([*words, "--rootdir", folder, str(sources)]))


if __name__ == "__main__":
    sys.exit(main())
