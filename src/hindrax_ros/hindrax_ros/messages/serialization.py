"""Messages as CDR bytes; fields of these read and written in place, for topics too fast for message objects.

Messages of one shape (the same lengths of all strings and sequences) have every field at the same place. A
`CdrLayout` finds these places from an example; `CdrReader` and `CdrWriter` use them, and learn a new shape by the
ordinary way when one comes along. Little-endian CDR as of XCDR1: alignment counts from behind the four bytes of
encapsulation.
"""

import importlib
import re
import struct
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any

from rclpy.serialization import deserialize_message, serialize_message

STAMP = ("header.stamp.sec", "header.stamp.nanosec")
ENCAPSULATION = 4
LITTLE_ENDIAN = b"\x00\x01"
PRIMITIVES = {
    "boolean": "?",
    "octet": "B",
    "uint8": "B",
    "int8": "b",
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "int64": "q",
    "float": "f",
    "double": "d",
}
_ARRAY = re.compile(r"(?P<of>.+)\[(?P<count>\d+)\]")
_SEQUENCE = re.compile(r"sequence<(?P<of>[^,>]+)(, \d+)?>")


@cache
def message_class(type_name: str) -> Any:
    """Class of a message type written as `package/msg/Type`."""
    package, kind, name = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


def parts(path: str, names: str = "xyz") -> tuple[str, ...]:
    """Paths of the fields of a vector or quaternion."""
    return tuple(f"{path}.{name}" for name in names)


def serialized(message: Any) -> bytes:
    """CDR bytes of a message; bytes are returned unchanged."""
    return message if isinstance(message, bytes) else bytes(serialize_message(message))


def deserialized(data: bytes, kind: type) -> Any:
    """Message of a class, from its bytes; ValueError for bytes that are none."""
    try:
        return deserialize_message(data, kind)
    except Exception as error:
        raise ValueError(f"found {len(data)} bytes that are no {kind.__name__}: {error}") from error


def as_message(decoded: Any, message_type: Any) -> Any:
    """Message of a type whose fields have the values of the same names in any decoded object, nested ones too.

    Sequences of messages are not converted; no message of ours that old bags hold has one.
    """
    message = message_type()
    for name in message_type.get_fields_and_field_types():
        value, default = getattr(decoded, name), getattr(message, name)
        nested = hasattr(default, "get_fields_and_field_types")
        setattr(message, name, as_message(value, type(default)) if nested else value)
    return message


def current_bytes(message: Any) -> bytes:
    """CDR bytes of a message of a bag (`BagMessage`) in today's form of its type."""
    if not message.form.old:
        return bytes(message.data)
    return serialized(as_message(message.decoded(), message_class(message.type)))


class CdrLayout:
    """Offset of each field of an example message in its CDR bytes.

    `fields` gives offset, struct format and count by path, such as `header.stamp.sec`; `lengths` gives the lengths
    of strings and sequences by offset, which together are the shape.
    """

    def __init__(self, example: Any) -> None:
        self.fields: dict[str, tuple[int, str, int]] = {}
        self.lengths: list[tuple[int, int]] = []
        self._at = 0
        self._message(example, "")
        self.size = ENCAPSULATION + self._at

    def _message(self, message: Any, prefix: str) -> None:
        for name, kind in message.get_fields_and_field_types().items():
            self._value(getattr(message, name), kind, prefix + name)

    def _value(self, value: Any, kind: str, path: str) -> None:
        if kind in PRIMITIVES:
            self._numbers(PRIMITIVES[kind], 1, path)
        elif kind == "string":
            self._length(len(value.encode()) + 1)
            self._at += len(value.encode()) + 1
        elif found := _ARRAY.fullmatch(kind):
            self._many(value, found["of"], path)
        elif found := _SEQUENCE.fullmatch(kind):
            self._length(len(value))
            self._many(value, found["of"], path)
        else:
            self._message(value, path + ".")

    def _many(self, values: Sequence[Any], kind: str, path: str) -> None:
        if kind in PRIMITIVES:
            self._numbers(PRIMITIVES[kind], len(values), path)
            return
        for index, value in enumerate(values):
            self._value(value, kind, f"{path}.{index}")

    def _numbers(self, code: str, count: int, path: str) -> None:
        size = struct.calcsize(code)
        if count:
            self._at += -self._at % size
        self.fields[path] = (ENCAPSULATION + self._at, code, count)
        self._at += size * count

    def _length(self, length: int) -> None:
        self._at += -self._at % 4
        self.lengths.append((ENCAPSULATION + self._at, length))
        self._at += 4


def _runs(layout: CdrLayout, paths: Sequence[str]) -> Iterator[tuple[int, str, int]]:
    """Offset, format and number of values of each stretch of fields that lie side by side, in the order of `paths`."""
    begin, end, codes, count = 0, -1, "", 0
    for path in paths:
        at, code, number = layout.fields[path]
        if at != end:
            if codes:
                yield begin, codes, count
            begin, codes, count = at, "", 0
        codes += f"{number}{code}"
        count += number
        end = at + struct.calcsize(code) * number
    yield begin, codes, count


class CdrReader:
    """Reads the fields at `paths` out of the bytes of messages of one type, arrays flattened, in the order of `paths`.

    The paths are named in the order of the definition. ValueError names what is wrong with bytes of another kind.
    """

    def __init__(self, message_type: Any, *paths: str) -> None:
        self._type, self._paths = message_type, paths
        self._size = -1
        self._shape = struct.Struct("")
        self._lengths: tuple[int, ...] = ()
        self._fields = struct.Struct("")

    def read(self, data: bytes) -> tuple[Any, ...]:
        """Values of the fields."""
        if len(data) != self._size or self._shape.unpack_from(data) != self._lengths:
            self._learn(data)
        return self._fields.unpack_from(data)

    def _learn(self, data: bytes) -> None:
        if data[:2] != LITTLE_ENDIAN:
            raise ValueError(f"found encapsulation {data[:2].hex()}, wanted little-endian CDR (0001)")
        layout = CdrLayout(deserialized(data, self._type))
        if len(data) < layout.size:
            raise ValueError(f"found {len(data)} bytes, wanted {layout.size}")
        self._size = len(data)
        self._shape = struct.Struct("<" + _padded([(at, "I") for at, _ in layout.lengths]))
        self._lengths = tuple(length for _, length in layout.lengths)
        self._fields = struct.Struct("<" + _padded([(at, codes) for at, codes, _ in _runs(layout, self._paths)]))


def _padded(parts: Sequence[tuple[int, str]]) -> str:
    """Format of a struct from the first byte on, with the parts at their offsets."""
    made, end = "", 0
    for at, codes in parts:
        made += f"{at - end}x{codes}"
        end = at + struct.calcsize("<" + codes)
    return made


class CdrWriter:
    """Writes the fields at `paths` into the bytes of an example; the rest stays as it is there.

    The paths are named in the order of the definition. `key` names what the example stands for.
    """

    def __init__(self, *paths: str) -> None:
        self._paths = paths
        self.key: object = None
        self._bytes = bytearray()
        self._parts: list[tuple[Callable[..., None], int, slice]] = []

    def learn(self, key: object, example: Any) -> None:
        """Set the example: a message of the new shape or with the new text."""
        self.key = key
        self._bytes = bytearray(serialize_message(example))
        self._parts = []
        begin = 0
        for at, codes, count in _runs(CdrLayout(example), self._paths):
            self._parts.append((struct.Struct("<" + codes).pack_into, at, slice(begin, begin + count)))
            begin += count

    def write(self, values: Sequence[Any]) -> bytes:
        """Bytes of a message; `values` are those at `paths`, arrays flattened."""
        for pack, at, part in self._parts:
            pack(self._bytes, at, *values[part])
        return bytes(self._bytes)
