"""Definition of a message: the fields of its type and of the types within, from the text that a bag embeds (`ros2msg`).

The text of a type, then that of each type which it contains, below a line of `=` and `MSG: package/Name`.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

SEPARATOR = "=" * 80
BUILTIN = frozenset(
    ["bool", "byte", "char", "float32", "float64", "string", "wstring"]
    + [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
)
_FIELD = re.compile(r"^\s*([A-Za-z][\w/]*)(?:<=\d+)?(\[[^\]]*\])?\s+([A-Za-z]\w*)\s*(=?)")
_HEAD = re.compile(r"^=+\nMSG: (\S+)\n", re.MULTILINE)
ONE, SEQUENCE = -1, -2
"""Lengths of a field that is no array, and of one whose messages tell it."""


class Field(NamedTuple):
    """One field: name; builtin type or `package/Name`; number of elements, `ONE` or `SEQUENCE`."""

    name: str
    kind: str
    length: int = ONE


Definition: TypeAlias = Mapping[str, tuple[Field, ...]]
"""Fields in their order, by type as `package/Name`; that of the message is the first."""


def plain_name(type_name: str) -> str:
    """`package/Name` of a type, also if written as `package/msg/Name`."""
    return type_name.replace("/msg/", "/")


def parsed(type_name: str, text: str) -> Definition:
    """Definition from its text; constants are no fields."""
    own, *others = _HEAD.split(text)
    texts = {plain_name(type_name): own} | dict(zip(others[::2], others[1::2], strict=True))
    return {plain_name(name): fields_of(plain_name(name), part) for name, part in texts.items()}


def fields_of(type_name: str, text: str) -> tuple[Field, ...]:
    """Fields of one type, from its text alone."""
    package = type_name.partition("/")[0]
    found = (_FIELD.match(line.partition("#")[0]) for line in text.splitlines())
    return tuple(Field(one[3], _kind(one[1], package), _count(one[2])) for one in found if one and not one[4])


def _kind(written: str, package: str) -> str:
    if written in BUILTIN:
        return written
    return plain_name(written) if "/" in written else f"{package}/{written}"


def _count(brackets: str | None) -> int:
    """`[]` and `[<=9]` are sequences, `[9]` an array."""
    if not brackets:
        return ONE
    inside = brackets[1:-1]
    return int(inside) if inside.isdigit() else SEQUENCE
