"""CDR messages to objects, by code that is generated once for each schema that a bag brings.

A message of fixed fields becomes one `struct` call instead of one per field. Layout: OMG CDR (XCDR1), every number
aligned to its size, counted from behind the four bytes of encapsulation. Nothing here needs ROS.
"""

from __future__ import annotations

import keyword
import re
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from hindrax_bag.definitions import SEPARATOR

LITTLE_ENDIAN = b"\x00\x01"
UNROLLED = 8
"""Longest array of messages whose elements are written out one by one."""
CODES = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z]\w*(?:/[A-Za-z]\w*)*)(?:<=\d+)?(?P<array>\[(?:<=)?(?P<count>\d*)\])?"
    r"\s+(?P<name>[A-Za-z]\w*)\s*(?P<constant>=)?",
    re.ASCII,
)
TIME = (("sec", "int32"), ("nanosec", "uint32"))
_FLOAT32 = struct.Struct("<f")
Decode = Callable[[bytes], Any]
Match = Callable[[bytes, Any], bool]
Place = tuple[str, str, int]
"""An expression of the generated code, the code of its numbers, and their count: 0 for one that is no array."""


class SchemaError(ValueError):
    """A schema that cannot be turned into code."""


@dataclass(frozen=True, slots=True)
class Field:
    """One field: name, type (a primitive, `string`, or `package/Name`), and length: 1, of an array, or unknown (-1)."""

    name: str
    type: str
    count: int = 1
    array: bool = False


Specs = Mapping[str, tuple[Field, ...]]
"""Fields of each type, as `package/Name`."""


@lru_cache(maxsize=256)
def decoder(type_name: str, text: str, added: tuple[str, ...] = ()) -> Decode:
    """Make the decoder of a type given as `package/msg/Type` with its full definition (`ros2msg`).

    Its objects have slots for the fields `added`, which it leaves unset. It takes little-endian messages only and
    raises ValueError or struct.error for what ends early. SchemaError for schemas that it cannot serve: wide strings,
    types that the definition leaves out.
    """
    top = short(type_name)
    made: Decode = _Decoder(parse(type_name, text), added).function(top)
    return made


@lru_cache(maxsize=256)
def matcher(type_name: str, text: str) -> Match:
    """Make the function that says whether a message object holds the same values as little-endian bytes do.

    NaN is not the same as NaN here: False means that one has to look closer. SchemaError as of `decoder`.
    """
    made: Match = _Matcher(parse(type_name, text)).function(short(type_name))
    return made


def short(type_name: str) -> str:
    """`package/msg/Name` as `package/Name`."""
    return type_name.replace("/msg/", "/")


def parse(type_name: str, text: str) -> dict[str, tuple[Field, ...]]:
    """Fields by type (`package/Name`) of a definition with everything it depends on."""
    time = tuple(Field(name, kind) for name, kind in TIME)
    specs: dict[str, tuple[Field, ...]] = {"builtin_interfaces/Time": time, "builtin_interfaces/Duration": time}
    for number, block in enumerate(re.split(rf"^{SEPARATOR[:40]}=*\s*$", text, flags=re.MULTILINE)):
        key, body = short(type_name), block
        if number:
            first, _, body = block.lstrip().partition("\n")
            key = short(first.removeprefix("MSG:").strip())
        found = (_field(line.partition("#")[0].strip(), key.partition("/")[0]) for line in body.splitlines())
        specs[key] = tuple(field for field in found if field is not None)
    return specs


def _field(line: str, package: str) -> Field | None:
    found = _FIELD.match(line)
    if found is None or found["constant"]:
        return None
    kind = short(found["type"])
    if kind not in CODES and kind != "string" and "/" not in kind:
        kind = "std_msgs/Header" if kind == "Header" else f"{package}/{kind}"
    name = f"{found['name']}_" if keyword.iskeyword(found["name"]) else found["name"]
    if not found["array"]:
        return Field(name, kind)
    bounded = not found["count"] or "<=" in found["array"]
    return Field(name, kind, -1 if bounded else int(found["count"]), array=True)


def _class_of(key: str, fields: tuple[Field, ...], added: tuple[str, ...]) -> type:
    names = (*(field.name for field in fields), *added)

    def values(self: Any) -> tuple[Any, ...]:
        return tuple(getattr(self, name, None) for name in names)

    def same(self: Any, other: object) -> bool:
        return type(self) is type(other) and values(self) == values(other)

    def said(self: Any) -> str:
        return f"{key}({', '.join(f'{name}={value!r}' for name, value in zip(names, values(self), strict=True))})"

    inside = {"__slots__": names, "__eq__": same, "__repr__": said, "__hash__": None}
    return type(key.rpartition("/")[2], (), inside)


class _Decoder:
    """Writes the code of one decoder. Neighboring numbers are gathered into runs; alignment is known modulo `_of`."""

    opening = "def made(data):\n    at = 4"
    ending = "    if at > len(data): raise ValueError(f'found {len(data)} bytes, wanted {at}')\n    return m"

    def __init__(self, specs: Specs, added: tuple[str, ...]) -> None:
        self._specs, self._added = specs, added
        self._names: dict[str, Any] = {"unpack_from": struct.unpack_from, "text": str}
        self._classes: dict[str, str] = {}
        self._lines: list[str] = []
        self._depth, self._count = 1, 0
        self._of, self._at = 8, 0
        self._format, self._places = "<", list[Place]()

    def function(self, top: str) -> Any:
        """Make the function for a type."""
        self._message(top, "m", self._added)
        self._flush()
        source = "\n".join([self.opening, *self._lines, self.ending])
        exec(compile(source, f"<decoder of {top}>", "exec"), self._names)  # noqa: S102  # of checked names only
        return self._names["made"]

    def _say(self, line: str) -> None:
        self._lines.append("    " * self._depth + line)

    def _new(self, stem: str) -> str:
        self._count += 1
        return f"{stem}{self._count}"

    def _number(self, code: str, place: str, count: int = 0) -> None:
        """Add a number to the run, or with `count` an array of them; arrays of bytes stay bytes."""
        size = struct.calcsize(f"<{code}")
        if size > self._of:
            self._align(size)
        pad = -self._at % size
        self._at = (self._at + pad + size * max(1, count)) % self._of
        self._format += "x" * pad + (f"{count}s" if code == "B" and count else f"{count or ''}{code}")
        self._places.append((place, code, count))

    def _align(self, size: int) -> None:
        self._flush()
        self._say(self._align_line(size))
        self._of, self._at = size, 0

    def _anywhere(self, of: int = 1) -> None:
        """Forget the alignment: what follows lies behind something of unknown length."""
        self._of, self._at = of, 0

    def _flush(self) -> None:
        if self._format != "<":
            name = self._new("run")
            self._names[name] = struct.Struct(self._format)
            self._run(name, self._places)
        self._format, self._places = "<", []

    def _message(self, key: str, name: str, added: tuple[str, ...] = ()) -> None:
        if key not in self._specs:
            raise SchemaError(f"{key}: its definition is missing")
        self._begin(key, name, added)
        if not self._specs[key]:
            self._format += "x"
            self._at = (self._at + 1) % self._of
        for field in self._specs[key]:
            place = f"{name}.{field.name}"
            if not field.array:
                self._one(field.type, place)
            elif field.type in CODES:
                self._numbers(CODES[field.type], field.count, place)
            else:
                self._elements(field, place)

    def _begin(self, key: str, name: str, added: tuple[str, ...]) -> None:
        if key not in self._classes:
            self._classes[key] = self._new("Class")
            self._names[self._classes[key]] = _class_of(key, self._specs[key], added)
        self._say(f"{name} = {self._classes[key]}()")

    def _one(self, kind: str, place: str) -> None:
        if kind in CODES:
            self._number(CODES[kind], place)
        elif kind == "string":
            self._text(place)
        else:
            self._nested(kind, place)

    def _align_line(self, size: int) -> str:
        return f"at = at + {size - 1} & {-size}" if size <= 4 else f"at = (at + {size - 5} & {-size}) + 4"

    def _run(self, name: str, places: list[Place]) -> None:
        self._say(f"t = {name}.unpack_from(data, at); at += {self._names[name].size}")
        at = 0
        for place, code, count in places:
            several = count and code != "B"
            value = f"list(t[{at}:{at + count}])" if several else f"t[{at}]"
            if place == "n":
                self._say(f"n = {value}")
            else:
                self._got(place, value, code, count)
            at += count if several else 1

    def _nested(self, kind: str, place: str) -> None:
        name = self._new("m")
        self._message(kind, name)
        self._say(f"{place} = {name}")

    def _text(self, place: str) -> None:
        self._number("I", "n")
        self._flush()
        self._say("at += n")
        self._got(place, "text(data[at - n:at - 1], 'utf-8') if n else ''", "text", 0)
        self._anywhere()

    def _numbers(self, code: str, count: int, place: str) -> None:
        if count > 0:
            self._number(code, place, count)
            return
        size = struct.calcsize(f"<{code}")
        self._number("I", "n")
        self._flush()
        if size > 4:
            self._say(f"if n: {self._align_line(size)}")
        self._say(f"at += n * {size}")
        if code == "B":
            self._got(place, "data[at - n:at]", "B", 1)
        else:
            self._got(place, f"list(unpack_from(f'<{{n}}{code}', data, at - n * {size}))", code, 1)
        self._anywhere(min(size, 4))

    def _got(self, place: str, value: str, code: str, count: int) -> None:
        """Say what is done with a value of the message: `code` tells its kind, `count` is not 0 for an array."""
        del code, count
        self._say(f"{place} = {value}")

    def _elements(self, field: Field, place: str) -> None:
        if 0 <= field.count <= UNROLLED and field.type != "string":
            self._unrolled(field, place)
            return
        if field.count < 0:
            self._number("I", "n")
        self._flush()
        self._loop(field, place, "n" if field.count < 0 else str(field.count))
        self._anywhere()

    def _unrolled(self, field: Field, place: str) -> None:
        names = [self._new("m") for _ in range(field.count)]
        for name in names:
            self._message(field.type, name)
        self._say(f"{place} = [{', '.join(names)}]")

    def _loop(self, field: Field, place: str, count: str) -> None:
        several, index = self._new("several"), self._new("i")
        self._say(f"{place} = {several} = []")
        self._say(f"for {index} in range({count}):")
        self._body(field, "one", f"{several}.append(one)")

    def _body(self, field: Field, one: str, last: str) -> None:
        self._depth += 1
        self._anywhere()
        self._one(field.type, one)
        self._flush()
        self._say(last)
        self._depth -= 1


class _Matcher(_Decoder):
    """Writes the code that holds a message object of ROS against the bytes of a recorded one."""

    opening = "def made(data, m):\n    at = 4"
    ending = "    return at <= len(data)"

    def __init__(self, specs: Specs) -> None:
        super().__init__(specs, ())
        self._names |= {"rounded": _rounded, "plain": _plain}

    def _begin(self, key: str, name: str, added: tuple[str, ...]) -> None:
        """Nothing is made: the message is there."""

    def _got(self, place: str, value: str, code: str, count: int) -> None:
        if count:
            found = f"bytes({place})" if code == "B" else f"plain({place})"
        else:
            found = f"rounded({place})" if code == "f" else place
        self._say(f"if {found} != {value}: return False")

    def _nested(self, kind: str, place: str) -> None:
        name = self._new("m")
        self._say(f"{name} = {place}")
        self._message(kind, name)

    def _unrolled(self, field: Field, place: str) -> None:
        for index in range(field.count):
            self._nested(field.type, f"{place}[{index}]")

    def _loop(self, field: Field, place: str, count: str) -> None:
        one = self._new("one")
        self._say(f"if len({place}) != {count}: return False")
        self._say(f"for {one} in {place}:")
        self._body(field, one, "pass")


def _rounded(value: float) -> float:
    """Float as it is after it has been a float32."""
    return float(_FLOAT32.unpack(_FLOAT32.pack(value))[0])


def _plain(values: Any) -> list[Any]:
    return values.tolist() if hasattr(values, "tolist") else [*values]
