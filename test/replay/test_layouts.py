"""The layouts of Foxglove and PlotJuggler show what there is: fields of the table's topics, numbers in real bags."""

import importlib
import json
import re
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from hindrax_bag.message_comparison import flat
from hindrax_bag.read.bag_reader import messages
from hindrax_bringup.share_files import share_folder
from hindrax_core.topics import TOPICS, resolved

LAYOUT = json.loads((share_folder("foxglove") / "hindrax.json").read_text(encoding="utf-8"))
TYPES = {resolved(topic): topic.type for topic in TOPICS}
PANELS = LAYOUT["configById"]
JUGGLED = ET.parse(share_folder("plotjuggler") / "hindrax.xml").getroot()
BAGS = Path(__file__).parent / "bags"


def paths() -> list[str]:
    found = [path["value"] for panel in PANELS.values() for path in panel.get("paths", ())]
    keys = ("path", "topicPath", "topicToRender")
    return found + [panel[key] for panel in PANELS.values() for key in keys if key in panel]


def fields(kind: str) -> dict[str, str]:
    """Types of the fields of a type: `package/msg/Type` in the table, `package/Type` in a message."""
    words = kind.split("/")
    found: dict[str, str] = getattr(importlib.import_module(f"{words[0]}.msg"), words[-1]).get_fields_and_field_types()
    return found


def resolve(path: str) -> str:
    """Type of the field that a path names; raises where it names nothing."""
    topic, *words = path.split(".")
    kind = TYPES[topic]
    for word in words:
        parts = re.fullmatch(r"(\w+)(\[\d+\])?", word)
        assert parts is not None, f"{path}: {word}"
        name, index = parts.groups()
        kind = fields(kind)[name]
        listed = re.fullmatch(r"sequence<(.*)>|(.*)\[\d+\]", kind)
        assert bool(listed) == bool(index), f"{path}: {name} is {kind}"
        kind = (listed[1] or listed[2]) if listed else kind
    return kind


@pytest.mark.parametrize("path", paths())
def test_every_path_is_a_field_of_a_topic(path: str) -> None:
    kind = resolve(path)
    if path.count(".") and not path.endswith((".state", ".motion", ".phase")):
        assert kind in ("double", "float", "uint32", "int32"), f"{path} is {kind}: nothing to plot"


@pytest.mark.parametrize("path", ["/hindrax/nothing.x", "/hindrax/battery.volts", "/hindrax/control/allocation.forces"])
def test_a_path_that_names_nothing_is_found(path: str) -> None:
    with pytest.raises((KeyError, AssertionError)):
        resolve(path)


def panels(layout: Any) -> list[str]:
    if isinstance(layout, str):
        return [layout]
    return panels(layout["first"]) + panels(layout["second"])


def test_every_panel_has_its_place_and_every_place_its_panel() -> None:
    tabs = [name for tab in PANELS["Tab!main"]["tabs"] for name in panels(tab["layout"])]
    assert LAYOUT["layout"] == "Tab!main"
    assert sorted([*tabs, "Tab!main"]) == sorted(PANELS)


def test_it_has_what_foxglove_asks_of_a_layout() -> None:
    """Its import wants these five, and places that are panels or two halves; types are those of its own panels."""
    assert LAYOUT.keys() >= {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert LAYOUT["playbackConfig"]["speed"] > 0
    kinds = {name.partition("!")[0] for name in PANELS}
    assert kinds <= {"Plot", "Tab", "StateTransitions", "Gauge", "DiagnosticSummary", "RawMessages"}
    assert all(name.partition("!")[2] for name in PANELS)
    for path in (path for panel in PANELS.values() for path in panel.get("paths", ())):
        assert path["timestampMethod"] in {"receiveTime", "headerStamp"}
    tabs = PANELS["Tab!main"]
    assert 0 <= tabs["activeTabIdx"] < len(tabs["tabs"])
    for tab in tabs["tabs"]:
        check_place(tab["layout"])


def check_place(layout: Any) -> None:
    if isinstance(layout, dict):
        assert layout["direction"] in {"row", "column"}
        assert 0 < layout.get("splitPercentage", 50) < 100
        check_place(layout["first"])
        check_place(layout["second"])


# ---- against recorded bags


@cache
def numbers() -> dict[str, set[str]]:
    """Names of the numbers in the first messages of every topic of two bags, one with estimates."""
    found: dict[str, set[str]] = {}
    for bag in ("surge", "surge_estimates"):
        for message in messages(BAGS / bag):
            if message.topic not in found:
                fields = dict(flat(message.decoded())).items()
                found[message.topic] = {name for name, value in fields if isinstance(value, int | float)}
    return found


def curves() -> list[str]:
    """Curves of the PlotJuggler layout: topic and field, all with slashes."""
    return [curve.attrib["name"] for curve in JUGGLED.iter("curve")]


def plotted() -> list[tuple[str, str]]:
    """Topic and field of all that is drawn as a line in either layout; those that the bags have."""
    lines = [path["value"] for name, panel in PANELS.items() if name.startswith("Plot") for path in panel["paths"]]
    both = {tuple(line.split(".", 1)) for line in lines}
    for curve in curves():
        topic = max((name for name in TYPES if curve.startswith(f"{name}/")), key=len)
        both.add((topic, curve.removeprefix(f"{topic}/").replace("/", ".")))
    return sorted(both)


def test_both_layouts_plot_the_same_topics() -> None:
    ours = {topic for topic, _ in plotted()}
    assert ours == {path.split(".")[0] for name, one in PANELS.items() if "Plot!" in name for path in _values(one)}


def _values(panel: Any) -> list[str]:
    return [path["value"] for path in panel["paths"]]


@pytest.mark.parametrize(("topic", "field"), plotted())
def test_what_is_plotted_is_a_number_in_a_recorded_bag(topic: str, field: str) -> None:
    assert field in numbers()[topic]


def test_it_has_what_plotjuggler_asks_of_a_layout() -> None:
    """Tabs with one container each, splitters that count their parts, plots of curves with a color and a name."""
    (window,) = JUGGLED.findall("tabbed_widget")
    assert window.attrib["parent"] == "main_window"
    tabs = window.findall("Tab")
    assert [tab.attrib["tab_name"] for tab in tabs] == [tab["title"] for tab in PANELS["Tab!main"]["tabs"]]
    assert [tab.attrib["containers"] for tab in tabs] == [str(len(tab.findall("Container"))) for tab in tabs]
    for splitter in window.iter("DockSplitter"):
        sizes = [float(size) for size in splitter.attrib["sizes"].split(";")]
        assert int(splitter.attrib["count"]) == len(splitter) == len(sizes)
        assert sum(sizes) == pytest.approx(1.0, abs=0.001)
        assert splitter.attrib["orientation"] in {"-", "|"}
    assert {plot.attrib["mode"] for plot in window.iter("plot")} == {"TimeSeries"}
    assert all(re.fullmatch(r"#[0-9a-f]{6}", curve.attrib["color"]) for curve in window.iter("curve"))
    assert window.find("currentTabIndex") is not None
