"""Messages that nobody should send: in every field of any message what a stranger, a fault or a slip may put there."""

import math
from collections.abc import Iterator, Sequence
from copy import deepcopy
from itertools import islice, product
from typing import Any

from builtin_interfaces.msg import Time

from hindrax_ros.messages.serialization import message_class

NUMBERS = (math.nan, math.inf, -math.inf)
HUGE = (1e308, -1e308, 1e-320, 0.0)
FLOAT32_MOST = 3e38
LENGTHS = (0, 1, 9, 300)
TEXTS = ("", "x" * 2000, "\u0436\u6c34", "depth", "surge", "base_link_fsd")
TIMES = ((-(2**31), 0), (-1, 0), (0, 0), (1, 2**32 - 1), (2_000_000_000, 0), (2**31 - 1, 2**32 - 1))
"""From both ends of what a stamp can carry, 1970 and the year 2033."""
UNSIGNED = {"uint8": 8, "uint16": 16, "uint32": 32, "uint64": 64}
SIGNED = {"int8": 8, "int16": 16, "int32": 32, "int64": 64}


def filled(kind: type, number: float, length: int, text: str, time: Time) -> Any:
    """Make a message of nothing but these."""
    message = kind()
    for name, field in message.get_fields_and_field_types().items():
        setattr(message, name, _value(field, number, length, text, time))
    return message


def _value(field: str, number: float, length: int, text: str, time: Time) -> Any:
    if field == "builtin_interfaces/Time":
        return time
    if field.startswith("sequence<"):
        of = field.removeprefix("sequence<").removesuffix(">").partition(",")[0]
        inside = min(length, 9)  # lists of long lists would only take time
        return [_value(of, number, inside, text, time) for _ in range(length)]
    if field.endswith("]"):
        of, _, count = field.removesuffix("]").partition("[")
        return [_value(of, number, length, text, time) for _ in range(int(count))]
    return _plain(field, number, length, text, time)


def _plain(field: str, number: float, length: int, text: str, time: Time) -> Any:
    plain = {"float": number, "double": number, "boolean": False, "string": text, "octet": b"\xff"}
    plain |= {name: 2**bits - 1 for name, bits in UNSIGNED.items()}
    plain |= {name: -(2 ** (bits - 1)) for name, bits in SIGNED.items()}
    if field in plain:
        return plain[field]
    package, _, name = field.partition("/")
    return filled(message_class(f"{package}/msg/{name}"), number, length, text, time)


def floods(kind: type, now: Time, every: int = 1) -> Iterator[Any]:
    """Messages in which everything is wrong, or every so manieth of them; some are stamped now."""
    times = [now, *(Time(sec=sec, nanosec=nanosec) for sec, nanosec in TIMES)]
    for number, length, text, time in islice(product(NUMBERS, LENGTHS, TEXTS, times), 0, None, every):
        yield filled(kind, number, length, text, time)


def mutants(good: Any) -> Iterator[Any]:
    """Messages that are good but for one field."""
    for path, field in _leaves(good, ()):
        for value in _hostile(field):
            yield _with(good, path, value)


def wrong_stamps(good: Any) -> Iterator[Any]:
    """Messages that are good but for the time at which they say that they were made."""
    for sec, nanosec in TIMES:
        made = deepcopy(good)
        made.header.stamp = Time(sec=sec, nanosec=nanosec)
        yield made


def _leaves(message: Any, prefix: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], str]]:
    for name, field in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            yield from _leaves(value, (*prefix, name))
        else:
            yield (*prefix, name), field


def _hostile(field: str) -> Sequence[Any]:
    if field.startswith("sequence<"):
        of = field.removeprefix("sequence<").removesuffix(">").partition(",")[0]
        every = product(NUMBERS, LENGTHS, TEXTS)
        return [[_plain(of, number, 0, text, Time())] * length for number, length, text in every]
    if field.endswith("]"):
        of, _, count = field.removesuffix("]").partition("[")
        return [[_plain(of, number, 0, "", Time())] * int(count) for number in NUMBERS]
    numbers = {
        "double": [*NUMBERS, *HUGE],
        "float": [*NUMBERS, *(min(FLOAT32_MOST, max(-FLOAT32_MOST, one)) for one in HUGE)],
        "string": TEXTS,
    }
    numbers |= {name: [0, 2**bits - 1] for name, bits in UNSIGNED.items()}
    numbers |= {name: [-(2 ** (bits - 1)), 2 ** (bits - 1) - 1] for name, bits in SIGNED.items()}
    return numbers.get(field, [])


def _with(good: Any, path: tuple[str, ...], value: Any) -> Any:
    made = deepcopy(good)
    owner = made
    for name in path[:-1]:
        owner = getattr(owner, name)
    setattr(owner, path[-1], value)
    return made
