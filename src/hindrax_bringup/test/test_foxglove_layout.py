"""The Foxglove layout shows what there is: every path in it is a field of a topic of the table."""

from __future__ import annotations

import importlib
import json
import re
from typing import Any

import pytest

from hindrax_bringup.share_files import share_folder
from hindrax_core.topics import TOPICS, resolved

LAYOUT = json.loads((share_folder("foxglove") / "hindrax.json").read_text(encoding="utf-8"))
TYPES = {resolved(topic): topic.type for topic in TOPICS}
PANELS = LAYOUT["configById"]


def paths() -> list[str]:
    found = [path["value"] for panel in PANELS.values() for path in panel.get("paths", ())]
    keys = ("path", "topicPath", "topicToRender")
    return found + [panel[key] for panel in PANELS.values() for key in keys if key in panel]


def message(kind: str) -> type:
    """Class of a type: `package/msg/Type` in the table, `package/Type` in a message."""
    words = kind.split("/")
    return getattr(importlib.import_module(f"{words[0]}.msg"), words[-1])


def resolve(path: str) -> str:
    """Type of the field that a path names; raises where it names nothing."""
    topic, *words = path.split(".")
    kind = TYPES[topic]
    for word in words:
        name, index = re.fullmatch(r"(\w+)(\[\d+\])?", word).groups()
        kind = message(kind).get_fields_and_field_types()[name]
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
