"""What the packages say of themselves agrees with what they contain, so that rosdep and colcon can be believed."""

import ast
import configparser
import re
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import pytest

from hindrax_bringup import processes
from hindrax_core import topics

ROOT = Path(__file__).parents[2]
PACKAGES = sorted(path.parent for path in ROOT.glob("src/*/package.xml"))
PYTHON_PACKAGES = [package for package in PACKAGES if (package / "setup.cfg").exists()]
INTERFACES = sorted(path for kind in ("msg", "srv", "action") for path in (ROOT / "src/hindrax_msgs" / kind).iterdir())

# Module -> rosdep key. Those of the second table have none that apt can serve (rosdep would call pip, which refuses on
# Ubuntu 24.04): they are named for pip in the exports of package.xml, and come from the locks or with the wheel.
KEY_OF_MODULE = {
    "matplotlib": "python3-matplotlib",
    "numpy": "python3-numpy",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "serial": "python3-serial",
    "smbus2": "python3-smbus2",
    "textual": "python3-textual",
    "tornado": "python3-tornado",
    "yaml": "python3-yaml",
}
PIP_OF_MODULE = {
    "lz4": "lz4",
    "mcap": "mcap",
    "mcap_ros2": "mcap-ros2-support",
    "segno": "segno",
    "zstandard": "zstandard",
}
RUNTIME = (ROOT / "setup/runtime.in").read_text(encoding="utf-8")
EXTRAS = {"hindrax_i2c_file"}
"""Packages that are looked for, and whose lack is one sentence."""
DEVELOPMENT_MODULES = {
    re.findall(r"^[\w.-]+", line)[0].lower().replace("-", "_")
    for line in (ROOT / "setup/development.in").read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
}


def modules_imported(package: Path) -> Iterator[tuple[str, Path]]:
    for source in (*(package / package.name).rglob("*.py"), *package.glob("launch/*.py")):
        tree = ast.parse(source.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                yield from ((alias.name.split(".")[0], source) for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                yield node.module.split(".")[0], source


def dependencies(package: Path) -> set[str]:
    manifest = ET.parse(package / "package.xml").getroot()
    kinds = ("depend", "exec_depend", "export/pip_depend")
    return {element.text or "" for kind in kinds for element in manifest.findall(kind)}


def keys_needed(package: Path) -> Iterator[tuple[str, Path]]:
    for module, source in modules_imported(package):
        if module in sys.stdlib_module_names or module in {package.name, *DEVELOPMENT_MODULES, *EXTRAS}:
            continue
        known = KEY_OF_MODULE | PIP_OF_MODULE
        yield known.get(module, module), source  # packages of ROS and our own have their own name for a key
    if package.name == "hindrax_ros":  # imports the messages of the table of topics by their names
        yield from ((topic.type.partition("/")[0], Path(topics.__file__)) for topic in topics.TOPICS)
    if package.name == "hindrax_bringup":  # starts the executables of these packages
        others = {process.package for process in processes.EVERY} - {package.name}
        yield from ((other, Path(processes.__file__)) for other in others)


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=lambda package: package.name)
def test_every_import_is_a_declared_dependency(package: Path) -> None:
    declared = dependencies(package)
    for key, source in keys_needed(package):
        assert key in declared, f"{source} needs {key}: {package.name}/package.xml lacks it"


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=lambda package: package.name)
def test_every_declared_dependency_is_imported(package: Path) -> None:
    assert dependencies(package) - {key for key, _ in keys_needed(package)} == set()


STAND_ALONE = (
    *("hindrax_core", "hindrax_ros", "hindrax_drivers", "hindrax_control", "hindrax_ident"),
    *("hindrax_laboratory", "hindrax_replay"),
)
"""Packages whose tests need what their manifest names, from a copy of src: `colcon test --packages-up-to NAME`."""


@pytest.mark.parametrize("name", STAND_ALONE)
def test_the_tests_of_a_package_need_nothing_above_it(name: str) -> None:
    every, below, waiting = {package.name: package for package in PACKAGES}, {name}, [name]
    while waiting:
        new = (dependencies(every[waiting.pop()]) & every.keys()) - below
        below |= new
        waiting += new
    ours = every.keys() | {file.stem for file in (ROOT / "test").glob("*.py")} | {"hindrax_tools"}
    for file in (every[name] / "test").rglob("*.py"):
        beside = {path.stem for path in file.parent.glob("*.py")}
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            found = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [one.name for one in node.names] if isinstance(node, ast.Import) else []
            roots = {module.partition(".")[0] for module in found}
            assert not (roots & ours) - below - beside, file


PROJECT_OF_MODULE = PIP_OF_MODULE | {"serial": "pyserial", "yaml": "pyyaml"}


@pytest.mark.parametrize("module", KEY_OF_MODULE | PIP_OF_MODULE)
def test_a_module_from_elsewhere_is_locked_too(module: str) -> None:
    assert re.search(rf"^{PROJECT_OF_MODULE.get(module, module)}\b", RUNTIME, re.MULTILINE)


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_rosdep_asks_pip_for_nothing(package: Path) -> None:
    """Ubuntu 24.04 refuses pip outside of an environment, and the documented installation would stop there."""
    elements = ET.parse(package / "package.xml").getroot()
    keys = {one.text for one in elements if one.tag.endswith("depend")}
    assert not keys & set(PIP_OF_MODULE.values())


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=lambda package: package.name)
def test_manifest_and_setup_agree(package: Path) -> None:
    manifest = ET.parse(package / "package.xml").getroot()
    setup = configparser.ConfigParser()
    setup.read(package / "setup.cfg")
    assert setup["metadata"]["name"] == manifest.findtext("name") == package.name
    assert setup["metadata"]["version"] == manifest.findtext("version")
    assert manifest.findtext("author") == setup["metadata"]["author"] == setup["metadata"]["maintainer"]
    assert manifest.findtext("url") == setup["metadata"]["url"]
    assert (package / "LICENSE").read_text(encoding="utf-8") == (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert f"{manifest.findtext('version')} (" in (package / "CHANGELOG.rst").read_text(encoding="utf-8")
    assert "package_format3.xsd" in (package / "package.xml").read_text(encoding="utf-8").splitlines()[1]
    assert setup["metadata"]["license"] == manifest.findtext("license") == "Apache-2.0"
    assert setup["metadata"]["description"] == manifest.findtext("description")
    assert (package / "resource" / package.name).exists()


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=lambda package: package.name)
def test_every_file_beside_the_modules_is_installed_with_them(package: Path) -> None:
    setup = configparser.ConfigParser()
    setup.read(package / "setup.cfg")
    patterns = {key: re.split(r"[\s,]+", value.strip()) for key, value in setup["options.package_data"].items()}
    for path in (package / package.name).rglob("*.*"):
        if path.suffix in {".py", ".pyc"}:
            continue
        inside = ".".join(path.parent.relative_to(package).parts)
        wanted = [*patterns["*"], *patterns.get(inside, [])]
        assert any(path.match(pattern) for pattern in wanted), f"{package.name}/setup.cfg lacks {path.name}"


@pytest.mark.parametrize("path", INTERFACES, ids=lambda path: path.name)
def test_every_field_ends_with_its_unit(path: Path) -> None:
    for line in path.read_text(encoding="utf-8").splitlines():
        is_field = line and not line.startswith(("#", "---")) and "=" not in line.split("#")[0]
        assert not is_field or re.search(r"#.*\[[^\]]+\]$", line), line


@pytest.mark.parametrize("path", INTERFACES, ids=lambda path: path.name)
def test_every_interface_is_built_and_states_what_for(path: Path) -> None:
    assert f"{path.parent.name}/{path.name}" in (ROOT / "src/hindrax_msgs/CMakeLists.txt").read_text(encoding="utf-8")
    assert path.read_text(encoding="utf-8").startswith("# ")


WITHOUT_HELPERS = ("bag", "bringup", "control", "core", "drivers", "ident", "laboratory", "ros")
HELPERS = {path.stem for path in (ROOT / "test").glob("*.py")}


@pytest.mark.parametrize("name", WITHOUT_HELPERS)
def test_tests_of_a_package_collect_from_a_copy_of_src_alone(name: str) -> None:
    """Their helpers are in the package or beside them, not in the folder of the whole system."""
    for source in (ROOT / f"src/hindrax_{name}/test").glob("*.py"):
        tree = ast.parse(source.read_text(encoding="utf-8"))
        found = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        found |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        assert not found & HELPERS, source
