"""Tests of each package in a copy of `src` alone: of ours, only what its package.xml declares is on the path.

    python -m hindrax_tools.bare_sources
    python -m hindrax_tools.bare_sources hindrax_ident hindrax_control --only "not ros"

As `colcon test --packages-up-to NAME` in a workspace of somebody who copied our sources: no root of the repository, no
tools, no package above. The messages are those of this clone's build. Prints a line per package; exit code 0 when all
pass, 1 when one does not, 2 for a package that there is not.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path

from hindrax_bringup.clone import clone_root
from hindrax_core.errors import UsageError

NO_TESTS_FOUND = 5
OURS = re.compile(r"/(hindrax_[a-z0-9_]+)(?=/|$)")


def declared(package: Path, *, tests: bool) -> set[str]:
    """Names that a package.xml declares: keys of rosdep, packages of ROS, and Python packages that only pip has."""
    manifest = ET.parse(package / "package.xml").getroot()  # noqa: S314  # our own file
    kinds = ["depend", "exec_depend", "export/pip_depend"]
    kinds += ["test_depend", "export/pip_test_depend"] if tests else []
    return {element.text or "" for kind in kinds for element in manifest.findall(kind)}


def packages_up_to(sources: Path, name: str) -> set[str]:
    """A package of these sources, those that its tests declare, and what those need in turn."""
    every = {path.parent.name for path in sources.glob("*/package.xml")}
    if name not in every:
        raise UsageError(f"package {name}: found none in {sources}, wanted one of {', '.join(sorted(every))}")
    found: set[str] = set()
    waiting = {name}
    while waiting:
        one = waiting.pop()
        found.add(one)
        # Of a package below, the tests are not run: what only they need may be missing.
        waiting |= (declared(sources / one, tests=one == name) & every) - found
    return found


def copy_of_sources(sources: Path, place: Path) -> Path:
    """Copy as a stranger would have it, without caches; a link that leads out of it stays one and leads nowhere."""
    unwanted = shutil.ignore_patterns("__pycache__", "*.egg-info", ".hypothesis")
    return Path(shutil.copytree(sources, place / "src", symlinks=True, ignore=unwanted))


def path_without_ours(value: str, kept: set[str]) -> Iterator[str]:
    """Entries of a search path that are not of the clone, nor of our packages but for those that are kept."""
    tools = str(clone_root() / "tools")
    for entry in filter(None, value.split(os.pathsep)):
        found = OURS.search(entry)
        if entry != tools and (found is None or found[1] in kept):
            yield entry


def environment_of(sources: Path, name: str) -> dict[str, str]:
    """Environment in which only a package, and what it declares, can be imported and found."""
    below = packages_up_to(sources, name)
    messages = below & {"hindrax_msgs"}  # built, not interpreted
    made = {key: value for key, value in os.environ.items() if key not in ("HINDRAX_ROOT", "PYTEST_ADDOPTS")}
    for key in ("PYTHONPATH", "AMENT_PREFIX_PATH", "PATH"):
        made[key] = os.pathsep.join(path_without_ours(made.get(key, ""), messages))
    python = [str(sources / one) for one in sorted(below - messages)]
    made["PYTHONPATH"] = os.pathsep.join([*python, *filter(None, [made["PYTHONPATH"]])])
    return made


def run_tests(sources: Path, name: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the tests of a package of a copy of the sources, in its folder, as colcon does."""
    command = [sys.executable, "-m", "pytest", "-q", "--no-header", "-p", "no:cacheprovider", "-W", "ignore", *words]
    return subprocess.run(  # noqa: S603  # our own interpreter
        command, cwd=sources / name, env=environment_of(sources, name), capture_output=True, text=True, check=False
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Copy, run, and print a line per package."""
    parser = argparse.ArgumentParser(description="tests of each package in a copy of src alone")
    parser.add_argument("packages", nargs="*", metavar="PACKAGE", help="all that have tests, where none is named")
    parser.add_argument("--only", default="", metavar="MARKERS", help="pytest's -m, such as 'not ros'")
    parser.add_argument("--collect", action="store_true", help="only collect: a tenth of the time")
    asked = parser.parse_args(arguments)
    words = (["-m", asked.only] if asked.only else []) + (["--collect-only"] if asked.collect else [])
    failed = False
    with tempfile.TemporaryDirectory() as folder:
        sources = copy_of_sources(clone_root() / "src", Path(folder))
        for name in asked.packages or sorted(path.parent.name for path in sources.glob("*/test")):
            begun = time.monotonic()
            try:
                done = run_tests(sources, name, *words)
            except UsageError as error:
                print(error, file=sys.stderr)
                return 2
            good = done.returncode in (0, NO_TESTS_FOUND)
            failed |= not good
            lines = done.stdout.splitlines()
            print(f"{name:20} {lines[-1] if lines else '?'} [{time.monotonic() - begun:.0f} s]", flush=True)
            if not good:
                print("\n".join(line for line in lines if line.startswith(("E  ", "FAILED", "ERROR"))) or done.stderr)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
