"""Results as plain data, for JSON or YAML, and printed as JSON."""

import json
import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass

import numpy as np

from hindrax_core.text.screen_text import print_whole


def plain(value: object) -> object:
    """Dataclasses become mappings, arrays and tuples lists, numpy numbers Python's; non-finite numbers None."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def print_json(document: Mapping[str, object] | object) -> None:
    """Print one JSON document; non-finite numbers are null."""
    print_whole(json.dumps(plain(document), indent=2, allow_nan=False))
