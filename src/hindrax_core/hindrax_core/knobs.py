"""A number is declared once: default, range, unit and meaning; validation, ROS parameters and docs follow from it.

`knob(...)` makes a dataclass field. `build(cls, mapping, path)` makes a checked instance from plain data (YAML, ROS
parameters), and every error names the key path, what was found and what was wanted.
"""

import math
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from typing import Any, TypeVar

from hindrax_core.errors import UsageError

T = TypeVar("T")

META = "hindrax"
LONGEST_SHOWN = 60
"""Of what was found in the place of a value: a file of another kind is one long text [characters]."""
_WORDS: Mapping[object, str] = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}


@dataclass(frozen=True, slots=True)
class Knob:
    """Range, meaning (with its unit in brackets) and choices of one declared number, vector or text."""

    low: float = -math.inf
    high: float = math.inf
    meaning: str = ""
    choices: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """The text between the last brackets of the meaning, or an empty string."""
        return self.meaning.rpartition("[")[2].rstrip("]") if self.meaning.endswith("]") else ""


def knob(default: T, low: float = -math.inf, high: float = math.inf, meaning: str = "") -> T:
    """Declare a number (or a tuple of numbers) of a dataclass; a file may leave it out.

    Parameters
    ----------
    default
        Its value where the file says nothing.
    low, high
        Closed range, also of each number of a tuple.
    meaning
        What it is, with its unit in brackets at the end; parameters of nodes and reference pages show it.

    Returns
    -------
    T
        A `dataclasses.field`, which the class takes for the default that it declares.
    """
    made: T = field(default=default, metadata={META: Knob(low, high, meaning)})
    return made


def fact(low: float = -math.inf, high: float = math.inf, meaning: str = "") -> Any:
    """Declare a number without a default: the file must give it.

    Parameters
    ----------
    low, high, meaning
        As of `knob`.

    Returns
    -------
    Any
        A `dataclasses.field`.
    """
    return field(metadata={META: Knob(low, high, meaning)})


def block(factory: Callable[[], T], meaning: str) -> T:
    """Declare an optional block of keys, or an optional list; `factory` makes its default."""
    made: T = field(default_factory=factory, metadata={META: Knob(meaning=meaning)})
    return made


def choice(default: T, choices: Sequence[str], meaning: str) -> T:
    """Declare a choice from a closed set, or a list of them.

    Parameters
    ----------
    default
        One of the choices, or several.
    choices
        All there are.
    meaning
        As of `knob`.

    Returns
    -------
    T
        A `dataclasses.field`, as of `knob`.
    """
    made: T = field(default=default, metadata={META: Knob(meaning=meaning, choices=tuple(choices))})
    return made


def knob_of(declared: Field[object]) -> Knob:
    """Return the declaration of a field; without one it has no limits and no meaning."""
    found: Knob = declared.metadata.get(META, Knob())
    return found


def leaves(cls: type[object], prefix: str = "") -> dict[str, Knob]:
    """Every knob of a dataclass and of those inside, by its name with dots, as of a ROS parameter."""
    found: dict[str, Knob] = {}
    hints = typing.get_type_hints(cls)
    for declared in fields(cls):  # type: ignore[arg-type]  # a dataclass by contract
        inner, name = hints[declared.name], prefix + declared.name
        found |= (
            leaves(inner, f"{name}.") if isinstance(inner, type) and is_dataclass(inner) else {name: knob_of(declared)}
        )
    return found


def nested(values: Mapping[str, object]) -> dict[str, object]:
    """Nested blocks instead of names with dots, as `build` takes them."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        *blocks, last = name.split(".")
        place = found
        for one in blocks:
            place = place.setdefault(one, {})
        place[last] = value
    return found


def build(cls: type[T], data: object, path: str) -> T:
    """Make a checked instance of a dataclass from nested mappings.

    Parameters
    ----------
    cls
        Its fields are declared by `knob`, `fact` and `choice`.
    data
        What was read, such as a block of YAML.
    path
        Where it stood, for errors. The path of a file ends with a colon, so that the keys inside stand apart from it.

    Returns
    -------
    T
        The instance, with defaults where the data say nothing.

    Raises
    ------
    UsageError
        Names the path of the key that is unknown, missing, of another type or out of its range.
    """
    if not isinstance(data, Mapping):
        raise UsageError(f"{path.removesuffix(':')}: found {_shown(data)}, wanted a block of keys for {cls.__name__}")
    declared = {f.name: f for f in fields(cls)}  # type: ignore[arg-type]  # T is a dataclass by contract
    unknown = [str(key) for key in data if key not in declared]
    if unknown:
        raise UsageError(f"{_inside(path, unknown[0])}: unknown key, wanted one of {', '.join(declared)}")
    values, hints = {}, typing.get_type_hints(cls)
    for name, one in declared.items():
        if name in data:
            values[name] = _value(hints[name], one, data[name], _inside(path, name))
        elif one.default is MISSING and one.default_factory is MISSING:
            raise UsageError(f"{_inside(path, name)}: missing, wanted {knob_of(one).meaning or 'a value'}")
    try:
        return cls(**values)
    except ValueError as error:
        raise UsageError(f"{path.removesuffix(':')}: {error}") from error


def _inside(path: str, name: str) -> str:
    return f"{path} {name}" if path.endswith(":") else f"{path}.{name}"


def _value(hint: object, declared: Field[object], data: object, path: str) -> object:
    origin = typing.get_origin(hint)
    if origin in (types.UnionType, typing.Union):
        inner = [one for one in typing.get_args(hint) if one is not type(None)]
        unset = data is None or (data == "" and inner[0] is not str)  # a launch file cannot leave a parameter out
        return None if unset else _value(inner[0], declared, data, path)
    if is_dataclass(hint):
        return build(typing.cast("type[object]", hint), data, path)
    if origin is tuple:
        return _tuple(hint, declared, data, path)
    if origin in (dict, Mapping):
        return _mapping(hint, declared, data, path)
    return _scalar(hint, knob_of(declared), data, path)


def _tuple(hint: object, declared: Field[object], data: object, path: str) -> tuple[object, ...]:
    arguments = typing.get_args(hint)
    many = len(arguments) == 2 and arguments[1] is Ellipsis
    if isinstance(data, str) or not isinstance(data, Sequence):
        raise UsageError(f"{path}: found {_shown(data)}, wanted a list ({knob_of(declared).meaning})")
    if not many and len(data) != len(arguments):
        raise UsageError(f"{path}: found {len(data)} values, wanted {len(arguments)} ({knob_of(declared).meaning})")
    kinds = [arguments[0]] * len(data) if many else arguments
    pairs = enumerate(zip(kinds, data, strict=True))
    return tuple(_value(kind, declared, one, f"{path}[{index}]") for index, (kind, one) in pairs)


def _mapping(hint: object, declared: Field[object], data: object, path: str) -> dict[str, object]:
    if not isinstance(data, Mapping):
        raise UsageError(f"{path}: found {_shown(data)}, wanted a block of names")
    kind = typing.get_args(hint)[1]
    return {str(name): _value(kind, declared, one, f"{path}.{name}") for name, one in data.items()}


def _scalar(kind: object, knob: Knob, data: object, path: str) -> object:
    if kind is float and isinstance(data, int | float) and not isinstance(data, bool):
        return _in_range(float(data), knob, path)
    if kind is int and isinstance(data, int) and not isinstance(data, bool):
        return int(_in_range(data, knob, path))
    if (kind is str and isinstance(data, str)) or (kind is bool and isinstance(data, bool)):
        if knob.choices and data not in knob.choices:
            raise UsageError(f"{path}: found {_shown(data)}, wanted one of {', '.join(knob.choices)}")
        return data
    raise UsageError(f"{path}: found {_shown(data)}, wanted {_WORDS[kind]} ({knob.meaning})")


def _shown(data: object) -> str:
    """What was found, short enough for a sentence; an empty file or key is nothing."""
    found = "nothing" if data is None else repr(data)
    return found if len(found) <= LONGEST_SHOWN else f"{found[:LONGEST_SHOWN]}..."


def _in_range(number: float, knob: Knob, path: str) -> float:
    if not math.isfinite(number) or not knob.low <= number <= knob.high:
        raise UsageError(f"{path}: found {number:g}, wanted {knob.low:g} to {knob.high:g} ({knob.meaning})")
    return number
