"""Fields of messages read in place out of their CDR bytes, by the definition of their type.

Messages of one shape (the same lengths of all strings and sequences) have every field at the same place. A `CdrLayout`
finds these places in the bytes of one message; `CdrReader` uses them for all of its shape, and learns a new one when
such a message comes along. Little-endian CDR as of XCDR1: alignment counts from behind the four bytes of encapsulation.

ADR 25 has what this saves against message objects, and ADR 7 why it needs no ROS.
"""

import struct
from collections.abc import Iterator, Sequence
from typing import Any

from hindrax_core.messages.definition import ONE, SEQUENCE, Definition

ENCAPSULATION = 4
LITTLE_ENDIAN = b"\x00\x01"
TEXT = "s"
PRIMITIVES = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "uint8": "B",
    "int8": "b",
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "int64": "q",
    "float32": "f",
    "float64": "d",
}
_LENGTH = struct.Struct("<I")


class CdrLayout:
    """Offset of each field in the CDR bytes of one message.

    `fields` gives offset, struct format and count by path, such as `header.stamp.sec` or `beams.0.range`; a string
    counts its bytes. `lengths` gives the lengths of strings and sequences by offset, which together are the shape.
    ValueError for bytes that are no such message; no length in them is trusted.
    """

    def __init__(self, definition: Definition, data: bytes) -> None:
        if data[:2] != LITTLE_ENDIAN:
            raise ValueError(f"found encapsulation {data[:2].hex()}, wanted little-endian CDR (0001)")
        self.fields: dict[str, tuple[int, str, int]] = {}
        self.lengths: list[tuple[int, int]] = []
        self._definition, self._data = definition, data
        self._at = 0
        self._message(next(iter(definition)), "")
        self.size = ENCAPSULATION + self._at
        self._check(0)

    def _message(self, kind: str, prefix: str) -> None:
        if not self._definition[kind]:
            self._at += 1  # a message without fields travels as one byte
        for field in self._definition[kind]:
            count = self._length() if field.length == SEQUENCE else field.length
            self._values(field.kind, count, prefix + field.name)

    def _values(self, kind: str, count: int, path: str) -> None:
        if kind in PRIMITIVES:
            self._numbers(PRIMITIVES[kind], 1 if count == ONE else count, path)
        elif count == ONE:
            self._value(kind, path)
        else:
            self._check(count)  # each takes a byte at least: without this, four bytes would be work for hours
            for index in range(count):
                self._value(kind, f"{path}.{index}")

    def _value(self, kind: str, path: str) -> None:
        if kind == "wstring":
            raise ValueError(f"{path}: wide strings are not read")
        if kind != "string":
            self._message(kind, path + ".")
            return
        length = self._length()
        # The terminating zero counts; some writers send none with an empty string.
        self.fields[path] = (ENCAPSULATION + self._at, TEXT, max(0, length - 1))
        self._at += length

    def _numbers(self, code: str, count: int, path: str) -> None:
        size = struct.calcsize("<" + code)
        if count:
            self._at += -self._at % size
        self.fields[path] = (ENCAPSULATION + self._at, code, count)
        self._at += size * count

    def _length(self) -> int:
        self._at += -self._at % _LENGTH.size
        self._check(_LENGTH.size)
        at = ENCAPSULATION + self._at
        length: int = _LENGTH.unpack_from(self._data, at)[0]
        self.lengths.append((at, length))
        self._at += _LENGTH.size
        return length

    def _check(self, more: int) -> None:
        """ValueError when the data end within so many bytes more."""
        wanted = ENCAPSULATION + self._at + more
        if len(self._data) < wanted:
            raise ValueError(f"found {len(self._data)} bytes, wanted {wanted}")


def stretches(layout: CdrLayout, paths: Sequence[str]) -> Iterator[tuple[int, str, int]]:
    """Offset, format and number of values of each stretch of fields that lie in a row.

    Parameters
    ----------
    layout
        Places of the fields of a type.
    paths
        Fields, in the order in which their values are wanted.

    Yields
    ------
    tuple[int, str, int]
        Offset in the message [bytes], codes for `struct` without byte order, and how many values they give.

    Raises
    ------
    ValueError
        For a path that the type does not have.
    """
    begin, end, codes, count = 0, -1, "", 0
    for path in paths:
        if path not in layout.fields:
            raise ValueError(f"found no field {path!r}, wanted one in every message")
        at, code, number = layout.fields[path]
        if at != end:
            if codes:
                yield begin, codes, count
            begin, codes, count = at, "", 0
        codes += f"{number}{code}"
        count += 1 if code == TEXT else number
        end = at + struct.calcsize("<" + code) * number
    yield begin, codes, count


class CdrReader:
    """Reads the fields at `paths` out of the bytes of messages of one type, arrays flattened, in the order of `paths`.

    The paths are named in the order of the definition. ValueError names what is wrong with bytes of another kind.
    """

    def __init__(self, definition: Definition, *paths: str) -> None:
        self._definition, self._paths = definition, paths
        self._size = -1
        self._shape = struct.Struct("")
        self._lengths: tuple[int, ...] = ()
        self._fields = struct.Struct("")
        self._has_text = False

    def read(self, data: bytes) -> tuple[Any, ...]:
        """Values of the fields."""
        if len(data) != self._size or self._shape.unpack_from(data) != self._lengths:
            self._learn(data)
        found = self._fields.unpack_from(data)
        if self._has_text:
            return tuple(one.decode("utf-8", "replace") if isinstance(one, bytes) else one for one in found)
        return found

    def _learn(self, data: bytes) -> None:
        layout = CdrLayout(self._definition, data)
        found = list(stretches(layout, self._paths))
        self._fields = struct.Struct("<" + _padded([(at, codes) for at, codes, _ in found]))
        self._has_text = any(TEXT in codes for _, codes, _ in found)
        self._shape = struct.Struct("<" + _padded([(at, "I") for at, _ in layout.lengths]))
        self._lengths = tuple(length for _, length in layout.lengths)
        self._size = len(data)


def _padded(parts: Sequence[tuple[int, str]]) -> str:
    """Format of a struct from the first byte on, with the parts at their offsets."""
    made, end = "", 0
    for at, codes in parts:
        made += f"{at - end}x{codes}"
        end = at + struct.calcsize("<" + codes)
    return made
