"""A stand-in for launch and launch_ros, which are not among the wheels of ROS: it takes down what launch files say."""

import importlib.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

MODULES = (
    *("launch", "launch.actions", "launch.event_handlers", "launch.launch_description_sources", "launch.substitutions"),
)
MODULES_OF_ROS = ("launch_ros", "launch_ros.actions", "launch_ros.parameter_descriptions", "launch_ros.substitutions")


@dataclass
class Said:
    """Whatever a launch file makes: its words and keywords."""

    kind: str
    words: tuple[Any, ...]
    keywords: dict[str, Any]


def said(kind: str, *words: Any, **keywords: Any) -> Said:
    return Said(kind, words, keywords)


def put_in_place(monkeypatch: pytest.MonkeyPatch, take: Callable[..., Said] = said) -> None:
    """Let every name of launch be a function that hands its kind, words and keywords to `take`."""
    for name in (*MODULES, *MODULES_OF_ROS):
        module = ModuleType(name)
        module.__getattr__ = lambda kind: partial(take, kind)  # type: ignore[method-assign]
        monkeypatch.setitem(sys.modules, name, module)


def actions_of(file: Path) -> list[Said]:
    """Actions of the description that a launch file makes."""
    spec = importlib.util.spec_from_file_location("launch_file", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return list(module.generate_launch_description().words[0])
