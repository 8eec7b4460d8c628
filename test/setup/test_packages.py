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
from hindrax_tools.bare_sources import copy_of_sources, declared, packages_up_to, run_tests

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
EXTRAS = {"hindrax_i2c_file", "mujoco"}
"""Packages that are looked for, and whose lack is one sentence."""
DEVELOPMENT_MODULES = {
    re.findall(r"^[\w.-]+", line)[0].lower().replace("-", "_")
    for line in (ROOT / "setup/development.in").read_text(encoding="utf-8").splitlines()
    if line and not line.startswith("#")
}


def imported_modules(source: Path) -> Iterator[str]:
    """Top names that a file imports, its relative imports aside."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.split(".")[0]


def modules_imported(package: Path) -> Iterator[tuple[str, Path]]:
    for source in (*(package / package.name).rglob("*.py"), *package.glob("launch/*.py")):
        yield from ((module, source) for module in imported_modules(source))


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
    known = declared(package, tests=False)
    for key, source in keys_needed(package):
        assert key in known, f"{source} needs {key}: {package.name}/package.xml lacks it"


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=lambda package: package.name)
def test_every_declared_dependency_is_imported(package: Path) -> None:
    assert declared(package, tests=False) - {key for key, _ in keys_needed(package)} == set()


KEY_OF_TESTS = KEY_OF_MODULE | {"hypothesis": "python3-hypothesis", "pytest": "python3-pytest"}
PIP_OF_TESTS = PIP_OF_MODULE | {
    "brping": "bluerobotics-ping",
    "filterpy": "filterpy",
    "pymavlink": "pymavlink",
    "pynmea2": "pynmea2",
    "rosbags": "rosbags",
}
"""Peers of the tests, which the lock of development has; `pip_test_depend` in the exports of package.xml."""
TESTED = [package for package in PYTHON_PACKAGES if (package / "test").is_dir()]


def keys_of_tests(package: Path) -> Iterator[tuple[str, Path]]:
    """Keys of what the tests of a package import, but for their own helpers."""
    for source in (package / "test").rglob("*.py"):
        beside = {path.stem for path in source.parent.glob("*.py")}
        for module in imported_modules(source):
            if module not in sys.stdlib_module_names and module not in beside | {package.name}:
                yield (KEY_OF_TESTS | PIP_OF_TESTS).get(module, module), source


@pytest.mark.parametrize("package", TESTED, ids=lambda package: package.name)
def test_the_tests_of_a_package_import_what_it_declares(package: Path) -> None:
    """So they run from a copy of src alone, under `colcon test` and `python -m hindrax_tools.bare_sources`."""
    known = declared(package, tests=True)
    for key, source in keys_of_tests(package):
        assert key in known, f"{source} needs {key}: {package.name}/package.xml lacks it, or the test belongs above it"


@pytest.mark.parametrize("package", TESTED, ids=lambda package: package.name)
def test_what_is_declared_for_tests_is_imported_by_them(package: Path) -> None:
    only_tests = declared(package, tests=True) - declared(package, tests=False)
    common = {"python3-hypothesis", "python3-pytest"}  # every conftest needs them
    assert common <= only_tests
    assert only_tests - common - {key for key, _ in keys_of_tests(package)} == set()


@pytest.mark.parametrize("package", TESTED, ids=lambda package: package.name)
def test_the_tests_of_a_package_need_nothing_above_it(package: Path) -> None:
    """A circle would stop colcon: nothing that a package or its tests declare needs the package."""
    for name in declared(package, tests=True) & {one.name for one in PACKAGES}:
        assert package.name not in packages_up_to(ROOT / "src", name), name


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_nothing_of_a_package_is_outside_of_src(package: Path) -> None:
    for path in package.rglob("*"):
        assert not path.is_symlink() or path.resolve().is_relative_to(package.resolve()), f"{path} leads out of it"
    for source in (package / "test").rglob("*.py"):
        found = re.search(r"\.parents\[[3-9]\]|clone_root|hindrax_tools", source.read_text(encoding="utf-8"))
        assert found is None, f"{source}: {found} is not there in a copy of src; such tests are in test/"


def test_tests_of_a_package_pass_in_a_copy_of_src_alone(tmp_path: Path) -> None:
    """One that needs most of the others: they are imported from the copy, and nothing of the clone is."""
    done = run_tests(copy_of_sources(ROOT / "src", tmp_path), "hindrax_replay")
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]


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


@pytest.mark.parametrize("package", PACKAGES, ids=lambda package: package.name)
def test_a_package_has_what_bloom_and_the_build_farm_want(package: Path) -> None:
    first, second = (package / "package.xml").read_text(encoding="utf-8").splitlines()[:2]
    assert first == '<?xml version="1.0"?>'
    assert second.startswith("<?xml-model href=")
    assert "package_format3.xsd" in second
    manifest = ET.parse(package / "package.xml").getroot()
    assert manifest.get("format") == "3"
    one_place = configparser.ConfigParser()
    one_place.read(ROOT / "src/hindrax_core/setup.cfg")
    metadata = one_place["metadata"]
    assert manifest.findtext("name") == package.name
    assert manifest.findtext("version") == (ROOT / "VERSION").read_text(encoding="utf-8").strip()
    assert manifest.findtext("description")
    assert manifest.findtext("author") == manifest.findtext("maintainer") == metadata["maintainer"]
    (maintainer,) = manifest.findall("maintainer")
    assert maintainer.get("email") == metadata["maintainer_email"]
    (url,) = manifest.findall("url")
    assert (url.get("type"), url.text) == ("website", metadata["url"])
    (license_,) = manifest.findall("license")
    assert (license_.get("file"), license_.text) == ("LICENSE", "Apache-2.0")
    assert (package / "LICENSE").read_text(encoding="utf-8") == (ROOT / "LICENSE").read_text(encoding="utf-8")
    changelog = (package / "CHANGELOG.rst").read_text(encoding="utf-8")
    assert package.name in changelog
    assert f"{manifest.findtext('version')} (" in changelog


@pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=lambda package: package.name)
def test_manifest_and_setup_agree(package: Path) -> None:
    manifest = ET.parse(package / "package.xml").getroot()
    setup = configparser.ConfigParser()
    setup.read(package / "setup.cfg")
    assert setup["metadata"]["name"] == manifest.findtext("name") == package.name
    assert setup["metadata"]["version"] == manifest.findtext("version")
    assert manifest.findtext("author") == setup["metadata"]["author"] == setup["metadata"]["maintainer"]
    assert manifest.findtext("url") == setup["metadata"]["url"]
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
