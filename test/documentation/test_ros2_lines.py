"""Lines with `ros2`, which is not among the wheels of ROS: what they name exists, and what they send fits its type."""

import importlib
import re
import shlex
from collections.abc import Iterator, Mapping
from configparser import ConfigParser
from itertools import pairwise
from typing import Any

import pytest
import yaml
from documentation.pages import PAGES, ROOT

from hindrax_bringup.network.security import ROLES
from hindrax_core.messages.inputs import INPUTS
from hindrax_core.sensor_table import QUANTITIES
from hindrax_core.topics import TOPICS

LINE = re.compile(r"(?:^|`)(ros2 [a-z]+ [^`\n]*)", re.MULTILINE)
READMES = sorted(ROOT.glob("src/*/README.md"))
OTHERS = ("joy", "teleop_twist_keyboard", "mavros_msgs", "ros_gz_bridge", "stonefish_ros2")
"""Packages of others, which are not installed everywhere."""
NAMES = {topic.name.removeprefix("/") for topic in TOPICS} | {"odometry", "wrench", "pulses", "__ns"}
"""What can be remapped in a node of ours."""
OF_A_SENSOR = {*QUANTITIES, *(word for words in INPUTS.values() for word in words)}
"""What follows the name of a sensor, which is the user's."""
NODES = {role.node for role in ROLES}
PARAMETERS = (ROOT / "docs" / "reference" / "parameters.md").read_text(encoding="utf-8")


def lines() -> Iterator[Any]:
    for page in (*PAGES, *READMES):
        text = re.sub(r"\\\n *", "", page.read_text(encoding="utf-8"))
        for number, line in enumerate(LINE.findall(text)):
            yield pytest.param(line, id=f"{page.relative_to(ROOT)}-{number}")


@pytest.mark.parametrize("line", lines())
def test_a_line_names_what_is_there(line: str) -> None:
    words = shlex.split(re.split(r"  +[#(]|  # |   ", line)[0].strip())[1:]
    kind, *rest = [word for word in words if word not in ("-f", "--once")]
    if kind == "run":
        assert_executable(*rest)
    elif kind == "launch":
        assert_launch_file(*rest)
    elif kind in ("service", "action") and len(rest) > 2:
        assert_request(*rest)
    elif kind == "param" and len(rest) > 2:
        assert f"| `{rest[2]}` |" in PARAMETERS
    elif kind == "lifecycle" and len(rest) > 1:
        assert rest[1].rpartition("/")[2] in NODES
        assert rest[2] in ("configure", "activate", "deactivate", "cleanup")


def assert_executable(package: str, name: str, *words: str) -> None:
    if package in OTHERS:
        return
    setup = ConfigParser()
    setup.read(ROOT / "src" / package / "setup.cfg")
    scripts = setup["options.entry_points"]["console_scripts"]
    assert re.search(rf"^{name} = ", scripts, re.MULTILINE), f"{package}: no executable {name}"
    for flag, word in pairwise(words):
        if flag == "-r":
            name = word.partition(":=")[0].rpartition(":")[2]
            assert name in NAMES or name.partition("/")[2] in OF_A_SENSOR, word


def assert_launch_file(package: str, name: str, *words: str) -> None:
    if package in OTHERS:
        return
    file = ROOT / "src" / package / "launch" / name
    assert file.is_file()
    text = file.read_text(encoding="utf-8")
    declared = set(re.findall(r"[\"'](\w+)[\"']", text + text_of(package)))
    given = {word.partition(":=")[0] for word in words if ":=" in word}
    assert given <= declared | knobs_of(name), f"{name}: declares no {given - declared}"


def text_of(package: str) -> str:
    return "".join(file.read_text(encoding="utf-8") for file in ROOT.glob(f"src/{package}/{package}/**/*launch*.py"))


def knobs_of(name: str) -> set[str]:
    """Parameters of the node of a device, by the name of its launch file."""
    section = re.search(rf"^## .*`{name.partition('.')[0]}`.*?(?=^## |\Z)", PARAMETERS, re.MULTILINE | re.DOTALL)
    return set(re.findall(r"^\| `(\w+)` \|", section[0] if section else "", re.MULTILINE))


def assert_request(_word: str, _name: str, kind: str, text: str = "{}") -> None:
    package, of, name = kind.split("/")
    if package in OTHERS:
        return
    made = getattr(importlib.import_module(f"{package}.{of}"), name)
    assert_fits(yaml.safe_load(text), getattr(made, "Request" if of == "srv" else "Goal"))


def assert_fits(given: Mapping[str, Any], kind: Any) -> None:
    """Every field exists, and takes what is given."""
    fields = kind.get_fields_and_field_types()
    for key, value in given.items():
        assert key in fields, f"{kind.__name__}: no field {key}"
        if isinstance(value, Mapping):
            assert_fits(value, type(getattr(kind(), key)))
        else:
            kind(**{key: value}, check_fields=True)


def test_the_lines_are_found() -> None:
    found = [one.values[0] for one in lines()]
    assert len(found) > 30
    assert {str(one).split()[1] for one in found} >= {"run", "launch", "service", "action", "param", "lifecycle"}


def test_a_wrong_line_is_noticed() -> None:
    for wrong in (
        "ros2 run hindrax_control nobody",
        "ros2 run hindrax_control allocator --ros-args -r control/push:=/mine",
        "ros2 launch hindrax_bringup mock.launch.py seeds:=7",
        'ros2 service call /x hindrax_msgs/srv/Arm "{armed: true}"',
        'ros2 action send_goal /x hindrax_msgs/action/FlyManeuver "{motions: surge}"',
        "ros2 param set /hindrax/pilot holds.turns 0.2",
    ):
        with pytest.raises(AssertionError):
            test_a_line_names_what_is_there(wrong)


ROSDEP = {"--from-paths", "--ignore-src", "-y"}
"""Options of `rosdep install` that there are, of 0.22 to 0.27; `--yes` is none."""


def test_rosdep_is_asked_with_options_that_it_has() -> None:
    texts = [page.read_text(encoding="utf-8") for page in (*PAGES, ROOT / "ros_ws" / "README.md")]
    found = [line for text in texts for line in re.findall(r"rosdep install ([^#&\n]*)", text)]
    assert len(found) == 3
    assert {word for line in found for word in line.split() if word.startswith("-")} <= ROSDEP
