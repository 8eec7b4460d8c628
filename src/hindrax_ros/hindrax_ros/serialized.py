"""Messages as CDR bytes."""

from __future__ import annotations

from typing import Any

from rclpy.serialization import deserialize_message, serialize_message


def serialized(message: Any) -> bytes:
    """Bytes of a message as they go over the wire; what is bytes already stays as it is."""
    return message if isinstance(message, bytes) else bytes(serialize_message(message))


def deserialized(data: bytes, kind: type) -> Any:
    """Message of a class, from its bytes."""
    return deserialize_message(data, kind)
