"""Messages as CDR bytes: by rclpy, and for topics too fast for message objects in place (see `hindrax_core.messages`).

A `CdrWriter` writes the numbers of a message into the bytes of an example. The definition by which bytes are read or
written here is that of the installed class.
"""

import importlib
import re
import struct
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any, Protocol, TypeVar

from rclpy.serialization import deserialize_message, serialize_message

from hindrax_core.messages.cdr import CdrLayout, CdrReader, stretches
from hindrax_core.messages.contents import Contents, ContentT_co, Read, bytes_reader
from hindrax_core.messages.definition import ONE, SEQUENCE, Definition, Field

MessageT = TypeVar("MessageT")


class Message(Protocol):
    """A message of an installed type, as rosidl makes its class."""

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """Names of the fields, and their types in the words of rosidl."""
        ...


class RecordedMessage(Protocol):
    """A message of a bag, by the names that `hindrax_bag` gives its parts."""

    @property
    def type(self) -> str:
        """Type, written as `package/msg/Type`."""
        ...

    @property
    def data(self) -> bytes:
        """CDR bytes, in the form of the record."""
        ...

    @property
    def is_old(self) -> bool:
        """Whether the type has changed since."""
        ...

    def decoded(self) -> object:
        """The message in the form of today."""
        ...


_KINDS = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
"""Names of builtin types in a definition, where rosidl has others."""
_ARRAY = re.compile(r"(?P<of>.+)\[(?P<count>\d+)\]")
_SEQUENCE = re.compile(r"sequence<(?P<of>.+?)(, \d+)?>")
_BOUND = re.compile(r"<\d+>")


@cache
def message_class(type_name: str) -> type[Message]:
    """Class of a message type written as `package/msg/Type`."""
    package, kind, name = type_name.split("/")
    found: type[Message] = getattr(importlib.import_module(f"{package}.{kind}"), name)
    return found


@cache
def definition_of(kind: type[Message]) -> Definition:
    """Definition of a class of messages."""
    return dict(_definitions(kind))


def _definitions(kind: type[Message]) -> Iterator[tuple[str, tuple[Field, ...]]]:
    """Fields by type: of a class of messages, then of those within."""
    package = kind.__module__.partition(".")[0]
    fields = tuple(_field(name, text) for name, text in kind.get_fields_and_field_types().items())
    yield f"{package}/{kind.__name__}", fields
    for field in fields:
        owner, slash, name = field.kind.partition("/")
        if slash:
            yield from _definitions(message_class(f"{owner}/msg/{name}"))


def _field(name: str, text: str) -> Field:
    """A field, from what `get_fields_and_field_types` says of it."""
    if found := _SEQUENCE.fullmatch(text):
        count = SEQUENCE
    elif found := _ARRAY.fullmatch(text):
        count = int(found["count"])
    else:
        count = ONE
    kind = _BOUND.sub("", found["of"] if found else text)
    return Field(name, _KINDS.get(kind, kind), count)


def fields_reader(type_name: str, *paths: str) -> Callable[[bytes], tuple[Any, ...]]:
    """Make the reader of the fields at `paths` of an installed type."""
    return CdrReader(definition_of(message_class(type_name)), *paths).read


def contents_reader(type_name: str, contents: Contents[ContentT_co]) -> Read[ContentT_co]:
    """Make the reader of messages of an installed type."""
    return bytes_reader(definition_of(message_class(type_name)), contents)


def serialized(message: object) -> bytes:
    """CDR bytes of a message; bytes are returned unchanged."""
    return message if isinstance(message, bytes) else bytes(serialize_message(message))


def deserialized(data: bytes, kind: type[MessageT]) -> MessageT:
    """Message of a class, from its bytes; ValueError for bytes that are none."""
    try:
        found: MessageT = deserialize_message(data, kind)
    except Exception as error:
        raise ValueError(f"found {len(data)} bytes that are no {kind.__name__}: {error}") from error
    return found


def as_message(decoded: object, message_type: type[Message]) -> Message:
    """Message of a type whose fields have the values of the same names in any decoded object, nested ones too.

    Parameters
    ----------
    decoded
        An object with attributes. Sequences of messages are not converted; no message of ours that old bags hold has
        one.
    message_type
        Class of the message.

    Returns
    -------
    Message
        A new one.
    """
    message = message_type()
    for name in message_type.get_fields_and_field_types():
        value, default = getattr(decoded, name), getattr(message, name)
        nested = hasattr(default, "get_fields_and_field_types")
        setattr(message, name, as_message(value, type(default)) if nested else value)
    return message


def current_bytes(message: RecordedMessage) -> bytes:
    """CDR bytes of a message of a bag (`BagMessage`) in today's form of its type."""
    if not message.is_old:
        return bytes(message.data)
    return serialized(as_message(message.decoded(), message_class(message.type)))


class CdrWriter:
    """Writes the fields at `paths` into the bytes of an example; the rest stays as it is there.

    The paths are named in the order of the definition. `key` names what the example stands for.
    """

    def __init__(self, *paths: str) -> None:
        self._paths = paths
        self.key: object = None
        self._bytes = bytearray()
        self._parts: list[tuple[Callable[..., None], int, slice]] = []

    def learn(self, key: object, example: Message) -> None:
        """Set the example: a message of the new shape or with the new text."""
        self.key = key
        data = serialize_message(example)
        self._bytes = bytearray(data)
        self._parts = []
        begin = 0
        for at, codes, count in stretches(CdrLayout(definition_of(example.__class__), data), self._paths):
            self._parts.append((struct.Struct("<" + codes).pack_into, at, slice(begin, begin + count)))
            begin += count

    def write(self, values: Sequence[object]) -> bytes:
        """Bytes of a message; `values` are those at `paths`, arrays flattened."""
        for pack, at, part in self._parts:
            pack(self._bytes, at, *values[part])
        return bytes(self._bytes)
