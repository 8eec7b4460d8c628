"""ROS parameters from knob dataclasses: declared once, described with unit and range, read back and checked."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from hindrax_core.knobs import Knob, build, knob_of

T = TypeVar("T")

OF_EVERY_NODE = "vehicle"
"""Given to every node of a stack, and declared by those that read it."""

RENAMED = {"box.": "pool_bounds.", "hand.": "operator_wrench.", "safety.": "guards.", "watch.": "fault_detector."}
"""Groups of parameters that had another name: old prefix, new prefix."""


def text(node: Node, name: str, default: str, meaning: str) -> str:
    """Declare one text parameter, fixed at start, and return its value."""
    descriptor = ParameterDescriptor(description=meaning, read_only=True)
    return str(node.declare_parameter(name, default, descriptor).value)


def whole(node: Node, name: str, default: int, meaning: str) -> int:
    """Declare one whole number, fixed at start, and return its value."""
    descriptor = ParameterDescriptor(description=meaning, read_only=True)
    return int(node.declare_parameter(name, default, descriptor).value)


def knobs(node: Node, cls: type[T]) -> T:
    """Declare every knob of a dataclass as a parameter of the node and make a checked instance of their values.

    Knobs of a nested dataclass are declared as `field.knob`.
    """
    return build(cls, _declared(node, cls(), ""), node.get_name())


def unknown_parameters(
    node: str, given: Iterable[str], declared: Collection[str], elsewhere: Collection[str] = ()
) -> list[str]:
    """Return one sentence for each parameter given to a node that neither it nor its process declares.

    `elsewhere`: the names that the other nodes of the process declare; arguments of a process reach all its nodes.
    """
    found = []
    for name in sorted({*given} - {*declared}):
        new = _new_name(name)
        if name in elsewhere or (new in elsewhere and new not in declared):
            continue
        near = difflib.get_close_matches(name, declared, n=1)
        hint = f"; it is called {new} now" if new in declared else f"; the nearest is {near[0]}" if near else ""
        found.append(f"parameter {name!r} of {node}: unknown, ignored{hint}")
    return found


def _new_name(name: str) -> str:
    return next((new + name.removeprefix(old) for old, new in RENAMED.items() if name.startswith(old)), "")


def warn_of_unknown_parameters(nodes: Sequence[Node]) -> None:
    """Log a warning for each parameter that was given to the nodes of this process and that none of them declares."""
    declared = {node: node.get_parameters_by_prefix("").keys() for node in nodes}
    for node in nodes:
        given = node._parameter_overrides.keys() - {OF_EVERY_NODE}  # noqa: SLF001  # rclpy offers no other way to them
        elsewhere = {name for other in nodes if other is not node for name in declared[other]}
        for sentence in unknown_parameters(node.get_name(), given, declared[node], elsewhere):
            node.get_logger().warning(sentence)


def _declared(node: Node, defaults: Any, prefix: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for declared in fields(defaults):
        default = getattr(defaults, declared.name)
        name = prefix + declared.name
        if is_dataclass(default):
            found[declared.name] = _declared(node, default, name + ".")
            continue
        value = node.declare_parameter(name, _plain(default), _descriptor(knob_of(declared), default))
        found[declared.name] = _restored(value.value)
    return found


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _restored(value: Any) -> Any:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [float(one) if isinstance(one, float) else one for one in value]
    return value


def _descriptor(knob: Knob, default: Any) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=knob.meaning, read_only=True)
    if knob.choices:
        descriptor.additional_constraints = "one of " + ", ".join(knob.choices)
    bounded = math.isfinite(knob.low) and math.isfinite(knob.high)
    if bounded and isinstance(default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=knob.low, to_value=knob.high)]
    if bounded and isinstance(default, int) and not isinstance(default, bool):
        descriptor.integer_range = [IntegerRange(from_value=int(knob.low), to_value=int(knob.high), step=1)]
    return descriptor
