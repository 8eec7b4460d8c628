"""Message types that are used where their package is installed."""

from __future__ import annotations

from typing import Any

from hindrax_ros.graph import message_class


def optional_class(type_name: str) -> Any:
    """Class of a message type written as `package/msg/Type`; None where its package is not installed."""
    try:
        return message_class(type_name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != type_name.partition("/")[0]:
            raise
        return None
