"""The reference says what the code does, and every command explains itself with an example that it takes."""

import argparse
import ast
import json
import math
import re
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, get_type_hints
from xml.etree import ElementTree as ET

import pytest

from hindrax_bringup.clone import clone_root
from hindrax_bringup.share_files import default_vehicle
from hindrax_cli import command_line
from hindrax_cli.command import MODULES
from hindrax_cli.command_line import main
from hindrax_core.knobs import Knob, knob_of
from hindrax_core.vehicle import Mount, Output, Vehicle, load_vehicle
from hindrax_operator.node_parameters import NODES
from hindrax_tools import reference
from hindrax_tools.reference import message_stubs, readmes
from hindrax_tools.reference.commands import words_of
from hindrax_tools.reference.devices import identities
from hindrax_tools.reference.parameters import rows

PAGES = clone_root() / "docs" / "reference"


def test_the_pages_are_up_to_date() -> None:
    stale = reference.stale(PAGES)
    assert not stale, f"stale: {', '.join(stale)}; run `{reference.COMMAND}` and commit what it writes"


def test_the_stubs_of_the_messages_are_up_to_date() -> None:
    stale = message_stubs.stale(clone_root())
    assert not stale, f"stale: {', '.join(map(str, stale))}; run `{reference.COMMAND}` and commit what it writes"


def test_the_nodes_in_the_readmes_of_the_packages_are_up_to_date() -> None:
    stale = readmes.stale(clone_root())
    assert not stale, f"stale: {', '.join(map(str, stale))}; run `{reference.COMMAND}` and commit what it writes"
    named = {file.parent.name for file in clone_root().glob("src/*/README.md") if readmes.BEGIN in file.read_text()}
    assert named == {f"hindrax_{name}" for name in ("bag", "bringup", "control", "drivers", "ident")}


def test_a_stub_says_what_a_field_gives_and_takes() -> None:
    """In the files, which the test above holds equal to what is generated."""
    names = ("sensor_msgs/msg", "diagnostic_msgs/msg", "hindrax_msgs/srv")
    folder = clone_root() / message_stubs.FOLDER
    imu, status, services = ((folder / name / "__init__.pyi").read_text(encoding="utf-8") for name in names)
    assert "    def orientation_covariance(self) -> NDArray[np.float64]: ..." in imu
    assert "    def orientation_covariance(self, value: Iterable[float]) -> None: ..." in imu
    assert "    header: std_msgs.msg.Header" in imu
    assert "    OK: ClassVar[bytes]" in status
    assert "    def values(self) -> list[KeyValue]: ..." in status
    assert "    Request: TypeAlias = Arm_Request" in services


def test_a_stale_page_is_named_with_the_command_that_writes_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    two = {name: reference.PAGES[name] for name in ("topics.md", "worlds.md")}
    monkeypatch.setattr(reference, "PAGES", two)  # the test above makes them all
    assert main(["reference", "--write", "--out", str(tmp_path)]) == 0
    assert main(["reference", "--check", "--out", str(tmp_path)]) == 0
    (tmp_path / "topics.md").write_text("something else", encoding="utf-8")
    capsys.readouterr()
    assert main(["reference", "--out", str(tmp_path)]) == 1
    assert "stale are topics.md; `./hindrax reference --write` writes them" in capsys.readouterr().err


@pytest.mark.parametrize("kind", [Vehicle, *(kind for kinds in NODES.values() for kind in kinds)])
def test_every_setting_states_what_it_means(kind: type[Any]) -> None:
    for name, *_, meaning in rows(kind):
        assert meaning, f"{kind.__name__}.{name} has no meaning: declare it with knob(..., meaning=...)"


@pytest.mark.parametrize("kind", [Vehicle, Mount, Output, *(kind for kinds in NODES.values() for kind in kinds)])
def test_no_number_stands_for_not_set(kind: type[Any]) -> None:
    for name, default, *_, meaning in rows(kind):
        assert not (default in ("0", "0.0") and re.search(r"\b0: |\b0 for ", meaning)), (
            f"{kind.__name__}.{name}: use None"
        )


def defaults(kind: type[Any]) -> Iterator[tuple[str, float, Knob]]:
    """Every number that a setting has by itself, also of blocks inside, and its declaration."""
    hints = get_type_hints(kind)
    for declared in fields(kind):
        if is_dataclass(hints[declared.name]):
            yield from defaults(hints[declared.name])
        elif isinstance(declared.default, int | float):
            yield f"{kind.__name__}.{declared.name}", declared.default, knob_of(declared)


@pytest.mark.parametrize("kind", [Vehicle, *(kind for kinds in NODES.values() for kind in kinds)])
def test_every_default_lies_within_its_own_range(kind: type[Any]) -> None:
    for name, value, knob in defaults(kind):
        assert math.isnan(value) or knob.low <= value <= knob.high, name


def test_every_dataclass_that_a_node_declares_as_parameters_is_on_the_page() -> None:
    wanted = {kind for kinds in NODES.values() for kind in kinds}
    for file in (clone_root() / "src").glob("hindrax_*/hindrax_*/nodes/*.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        homes = {
            alias.name: node.module for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names
        }
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "knobs":
                kind = call.args[1]
                if isinstance(kind, ast.Name):
                    found = getattr(import_module(homes[kind.id]), kind.id)
                    assert is_dataclass(found)
                    assert found in wanted, f"{file}: declares {kind.id}, which node_parameters.py does not list"


def test_every_sensor_of_the_vehicle_states_who_it_is() -> None:
    vehicle = load_vehicle(default_vehicle())
    assert set(identities(vehicle)) >= set(vehicle.sensors)


def parsers() -> list[argparse.ArgumentParser]:
    made = [command_line.parser_of(command_line.load(name)) for name in MODULES]
    return made + [word for one in made for word in words_of(one)]


@pytest.mark.parametrize("parser", parsers(), ids=lambda one: one.prog)
def test_help_shows_an_example_that_the_command_takes(parser: argparse.ArgumentParser) -> None:
    text = parser.format_help()
    assert "example:\n" in text
    examples = re.findall(r"^ +\S*hindrax .*", text.partition("example:\n")[2], re.MULTILINE)
    assert examples
    for example in examples:
        first = re.split(r"\|\||&&|  +\(", example.replace("sudo ", ""))[0]
        words = shlex.split(first, comments=True)
        assert words[0] == "./hindrax"
        command = command_line.load(words[1])
        assert command_line.parser_of(command).parse_args(words[2:]) is not None


@pytest.mark.parametrize("parser", parsers(), ids=lambda one: one.prog)
def test_every_option_states_what_it_does(parser: argparse.ArgumentParser) -> None:
    for action in parser._actions:
        if not isinstance(action, argparse._SubParsersAction):
            assert action.help, f"{parser.prog} {action.dest}: has no help"


def test_the_overview_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    for name in MODULES:
        assert re.search(rf"^  {name} +\w", printed, re.MULTILINE)


def test_every_page_is_linked_from_the_overview_of_the_documentation() -> None:
    overview = (PAGES.parent / "README.md").read_text(encoding="utf-8")
    for name in reference.PAGES:
        assert Path("reference", name).as_posix() in overview


def test_the_figures_are_drawn_from_what_lies_beside_them(tmp_path: Path) -> None:
    figures = PAGES.parent / "explanation" / "figures"
    shutil.copy(figures / "flights.json", tmp_path)
    page = (PAGES.parent / "explanation" / "identification.md").read_text(encoding="utf-8")
    assert main(["reference", "--figures", "--out", str(tmp_path)]) == 0
    drawn = sorted(tmp_path.glob("*.svg"))
    assert [file.name for file in drawn] == sorted(file.name for file in figures.glob("*.svg"))
    for file in drawn:
        ET.fromstring(file.read_text(encoding="utf-8"))
        assert (figures / file.name).stat().st_size < 60_000
        assert f"figures/{file.name}" in page


def test_the_flights_behind_the_figures_say_what_the_page_states() -> None:
    """With a curve that promises too little all runs are off by more than noise, none by more than calibration."""
    flights = json.loads((PAGES.parent / "explanation" / "figures" / "flights.json").read_text(encoding="utf-8"))
    drag = load_vehicle(default_vehicle()).hydrodynamics
    assert drag is not None
    good = [one["found"]["k_q"] for one in flights if one["thrust_gain"] == 1.0]
    poor = [one["found"]["k_q"] for one in flights if one["thrust_gain"] != 1.0]
    assert len(good) == len(poor) == 8
    assert sum(abs(value - drag.surge.k_q) < 1.96 * std for value, std, _ in good) >= 7
    assert not any(abs(value - drag.surge.k_q) < 1.96 * std for value, std, _ in poor)
    assert all(abs(value - drag.surge.k_q) < 1.96 * calibrated for value, _, calibrated in poor)
