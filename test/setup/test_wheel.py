"""The wheel `hindrax`, installed with the dependencies that it declares and nothing else: no ROS, none of the clone."""

import ast
import json
import math
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from hindrax_cli.command_line import main

ROOT = Path(__file__).parents[2]
VERSION = (ROOT / "VERSION").read_text(encoding="utf-8").strip()
COPIED = ("setup.py", "pyproject.toml", "VERSION", "LICENSE", "docs/how-to/without-ros.md", "src")
ONLY_POSIX = {"curses", "fcntl", "grp", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty"}
RUN = """
import sys
sys.path.insert(0, sys.argv.pop(1))
from hindrax_cli.__main__ import without_ros
sys.exit(without_ros())
"""
TESTS = """
import runpy, sys
sys.path[:0] = sys.argv[1:3]
sys.argv[:] = sys.argv[3:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""
QUICK = ("hindrax_core",)
"""A package of the wheel whose tests are quick."""
EVERYTHING = """
import importlib, pkgutil, sys
sys.path.insert(0, sys.argv[1])
for name in sys.argv[2:]:
    package = importlib.import_module(name)
    for module in pkgutil.walk_packages(package.__path__, name + "."):
        importlib.import_module(module.name)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy, so that nothing is left behind in the clone."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in COPIED:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        if (ROOT / name).is_dir():
            unwanted = shutil.ignore_patterns("test", "__pycache__", "hindrax_sim", "hindrax_msgs")
            shutil.copytree(ROOT / name, folder / name, ignore=unwanted)
        else:
            shutil.copyfile(ROOT / name, folder / name)
    words = [sys.executable, "setup.py", "-q", "bdist_wheel", "--dist-dir", "dist"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return next((folder / "dist").glob("*.whl"))


def distributions(names: set[str]) -> Iterator[metadata.Distribution]:
    """These and all that they require, without extras."""
    known: set[str] = set()
    while names - known:
        name = (names - known).pop()
        known.add(name)
        found = metadata.distribution(name)
        yield found
        for line in found.requires or ():
            wanted = Requirement(line)
            if wanted.marker is None or wanted.marker.evaluate({"extra": ""}):
                names.add(wanted.name)


def link(names: set[str], folder: Path) -> None:
    """Make links to the contents of distributions and of all that they require."""
    for one in distributions(names):
        tops = {file.parts[0] for file in one.files or () if file.parts[0] not in ("..", "__pycache__")}
        for top in tops:
            if not (folder / top).exists():
                (folder / top).symlink_to(Path(str(one.locate_file(top))))


@pytest.fixture(scope="module")
def site(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the contents of the wheel, and links to those of what it declares."""
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    (found,) = metadata.distributions(path=[str(folder)])
    assert found.requires
    link({re.split(r"[^\w.-]", line)[0] for line in found.requires if "extra" not in line}, folder)
    return folder


def run(site: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the tool without the packages of this environment (`-S`) and without its variables."""
    command = [sys.executable, "-I", "-S", "-c", RUN, str(site), *words]
    return subprocess.run(command, cwd=folder, env={"HOME": str(folder)}, capture_output=True, text=True, check=False)


def ours(site: Path) -> list[Path]:
    return [path for folder in sorted(site.glob("hindrax_*")) for path in sorted(folder.rglob("*.py"))]


def test_it_is_small_pure_and_of_one_version(wheel: Path) -> None:
    assert wheel.name == f"hindrax-{VERSION}-py3-none-any.whl"
    assert wheel.stat().st_size < 2e6


def test_every_module_of_it_imports_without_ros(site: Path) -> None:
    names = [folder.name for folder in sorted(site.glob("hindrax_*"))]
    words = [sys.executable, "-I", "-S", "-c", EVERYTHING, str(site), *names]
    done = subprocess.run(words, capture_output=True, text=True, check=False, env={})
    assert done.returncode == 0, done.stderr


def test_the_tests_of_its_packages_pass_where_nothing_else_is(site: Path, tmp_path: Path) -> None:
    """Without ROS, and without the clone: `test/wheel_tests.py` copies them; the forge's CI runs those of all."""
    link({"pytest", "hypothesis"}, tmp_path)
    words = [
        sys.executable,
        "-I",
        "-S",
        "-c",
        TESTS,
        str(site),
        str(tmp_path),
        str(ROOT / "test/wheel_tests.py"),
        *QUICK,
    ]
    done = subprocess.run(words, cwd=tmp_path, env={"HOME": str(tmp_path)}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert int(re.findall(r"(\d+) passed", done.stdout)[0]) > 150


def test_no_module_of_it_needs_posix_at_import(site: Path) -> None:
    for path in ours(site):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            found = {alias.name for alias in node.names} if isinstance(node, ast.Import) else set()
            found |= {node.module or ""} if isinstance(node, ast.ImportFrom) else set()
            assert not found & ONLY_POSIX, f"{path}: imports {found}"


def test_the_overview_lists_what_is_here_and_names_the_rest(site: Path, tmp_path: Path) -> None:
    done = run(site, tmp_path, "--help")
    assert done.returncode == 0, done.stderr
    listed, _, rest = done.stdout.partition("With ROS 2")
    for name in ("report", "export", "identify", "bag", "vehicle", "towing", "papers", "allocate"):
        assert re.search(rf"^  {name}\s", listed, re.MULTILINE)
    assert "pool-test" in rest
    assert "./hindrax" not in done.stdout


def test_the_example_of_a_subcommand_has_the_name_of_this_installation(site: Path, tmp_path: Path) -> None:
    done = run(site, tmp_path, "vehicle", "new", "--help")
    assert "\n  hindrax vehicle new myrov\n" in done.stdout
    assert "./hindrax" not in done.stdout


def test_what_needs_ros_says_so_in_one_sentence(site: Path, tmp_path: Path) -> None:
    done = run(site, tmp_path, "pool-test", "--mock")
    assert done.returncode == 2
    assert done.stderr.startswith("hindrax pool-test: needs ROS 2 and a clone of hindrax")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("record", ["surge.csv", "bag"])
def test_a_record_is_identified(site: Path, tmp_path: Path, record: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The numbers of the bag are those of the clone, and the tool has the name of this installation."""
    words = ["--json", "--dof", "surge", "--report", str(tmp_path / "report.html")]
    if record == "bag":
        words.insert(0, str(ROOT / "test/replay/bags/surge"))
    else:
        (tmp_path / record).write_text(surge_csv(), encoding="utf-8")
        words[:0] = [record, "--vehicle", "bluerov2"]
    done = run(site, tmp_path, "identify", *words)
    assert done.returncode == 0, done.stderr
    report = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "./hindrax" not in done.stdout + done.stderr + report
    assert "hindrax weigh" in report
    found = json.loads(done.stdout)
    if record == "bag":
        assert main(["identify", *words]) == 0
        assert found["motions"] == json.loads(capsys.readouterr().out.replace("./hindrax", "hindrax"))["motions"]
    else:
        assert found["motions"]["surge"]["k_q"]["value"] == pytest.approx(45.0, rel=0.05)


def surge_csv() -> str:
    """Surge of 13.5 kg with k_q 45 N s^2/m^2, stepped by Euler at 1 kHz, written at 10 Hz."""
    rows, u = ["t,u,X"], 0.0
    for step in range(60_000):
        t = 1e-3 * step
        X = 25.0 * math.sin(0.4 * t) + 12.0 * math.sin(1.3 * t)
        if step % 100 == 0:
            rows.append(f"{t:.1f},{u:.6f},{X:.4f}")
        u += 1e-3 * (X - 45.0 * abs(u) * u) / 13.5
    return "\n".join(rows)


def test_the_version_stands_in_one_place() -> None:
    """`setup/version.sh` writes it into the others, which bloom and colcon want it in."""
    own = ROOT / "src/hindrax_bag/hindrax_bag/__init__.py"
    for path in (*ROOT.glob("src/*/package.xml"), *ROOT.glob("src/*/setup.cfg"), own):
        found = re.search(
            r"^(?:version = |  <version>|__version__ = \")(\d+\.\d+\.\d+)", path.read_text(), re.MULTILINE
        )
        assert found is not None, path
        assert found[1] == VERSION, path
