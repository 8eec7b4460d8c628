"""Messages as CDR bytes."""

from __future__ import annotations

from typing import Any

from rclpy.serialization import deserialize_message, serialize_message


def serialized(message: Any) -> bytes:
    """CDR bytes of a message; bytes are returned unchanged."""
    return message if isinstance(message, bytes) else bytes(serialize_message(message))


def deserialized(data: bytes, kind: type) -> Any:
    """Message of a class, from its bytes."""
    return deserialize_message(data, kind)


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


def current_bytes(message: Any, message_type: Any) -> bytes:
    """CDR bytes of a message of a bag (`BagMessage`) in today's form of its type."""
    return serialized(as_message(message.decoded(), message_type)) if message.form.old else bytes(message.data)
