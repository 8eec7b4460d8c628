"""A dataclass of knobs as a table: name, default, range, unit, meaning."""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

from hindrax_core.knobs import Knob, knob_of
from hindrax_tools.reference.markdown import code, number, table

COLUMNS = ("name", "default", "range", "unit", "meaning")


def knob_table(*kinds: type[Any]) -> str:
    """One table of all knobs of some dataclasses."""
    return table(COLUMNS, [row for kind in kinds for row in rows(kind)])


def rows(kind: type[Any], prefix: str = "") -> Iterator[tuple[str, ...]]:
    """A row per knob; those of a nested dataclass as `field.knob`."""
    hints = typing.get_type_hints(kind)
    for declared in fields(kind):
        inner = hints[declared.name]
        if is_dataclass(inner):
            yield from rows(typing.cast("type[Any]", inner), f"{prefix}{declared.name}.")
        else:
            yield _row(prefix + declared.name, declared, inner)


def _row(name: str, declared: Field[Any], hint: Any) -> tuple[str, ...]:
    knob = knob_of(declared)
    meaning = knob.meaning.removesuffix(f"[{knob.unit}]").strip() if knob.unit else knob.meaning
    return code(name), _default(declared), _range(knob, hint), "" if knob.unit == "-" else knob.unit, meaning


def _default(declared: Field[Any]) -> str:
    if declared.default is not MISSING:
        return _plain(declared.default)
    if declared.default_factory is not MISSING:
        return _plain(declared.default_factory())
    return "must be said"


def _plain(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_plain, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return double(value) if isinstance(value, float) else number(value)
    return "none" if value is None or value in ("", {}) else str(value)


def double(value: float) -> str:
    """A number as ROS reads a double: never like an integer."""
    text = number(value)
    return text if set(text) & set(".en") else f"{text}.0"


def _range(knob: Knob, hint: Any) -> str:
    if knob.choices:
        return ", ".join(map(code, knob.choices))
    if bool in (hint, *typing.get_args(hint)):
        return "true, false"
    if typing.get_origin(hint) in (types.UnionType, typing.Union) and math.isinf(knob.low):
        return ""
    low, high = ("" if math.isinf(bound) else number(bound) for bound in (knob.low, knob.high))
    return f"{low} to {high}".strip() if low or high else ""
