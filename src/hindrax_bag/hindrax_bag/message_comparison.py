"""Comparison of two messages of a topic, field by field: the recorded one and the replayed one."""

import fnmatch
import math
import struct
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Self
from weakref import WeakKeyDictionary

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import NS_PER_S
from hindrax_core.knobs import build
from hindrax_core.text.yaml_text import read_yaml

TOLERANCES = Path(__file__).parent / "tolerances.yaml"
MOST_PADDING = 64
"""More bytes than these that differ are not padding."""
WORD = 4
"""A message travels in words of so many bytes; one that was just written ends with its last field."""
_KNOWN_NAMES: WeakKeyDictionary[type, tuple[str, ...]] = WeakKeyDictionary()
MISSING = "(message)"
"""Stands for the field where a whole message has no counterpart."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Allowed distance of a number from the recorded one: absolute or relative, whichever is larger."""

    absolute: float = 0.0
    relative: float = 0.0

    def allows(self, recorded: float, replayed: float) -> bool:
        """Whether the two count as equal; NaN equals NaN."""
        if recorded == replayed or (math.isnan(recorded) and math.isnan(replayed)):
            return True
        return abs(recorded - replayed) <= max(self.absolute, self.relative * abs(recorded))


@dataclass(frozen=True, slots=True)
class Rule:
    """Rule of one topic: fields that are not compared, tolerances of fields, and allowed missing messages."""

    ignore: tuple[str, ...] = ()
    fields: Mapping[str, Tolerance] = field(default_factory=dict)
    default: Tolerance | None = None
    sampled: bool = False
    """Only some of what the replay makes was published."""
    unmatched: float = 0.0
    """Part of the messages that may lack a counterpart: lost on the way to the recorder [-]."""

    def tolerance(self, name: str) -> Tolerance | None:
        """Tolerance of a field, None when it is not compared. Names may hold wildcards; the first that fits counts."""
        if any(fnmatch.fnmatchcase(name, pattern) for pattern in self.ignore):
            return None
        for pattern, tolerance in self.fields.items():
            if fnmatch.fnmatchcase(name, pattern):
                return tolerance
        return self.default

    def is_sharp(self, name: str) -> bool:
        """Whether a field has no rule of its own and is compared exactly."""
        return self.tolerance(_unnumbered(name)) is self.default


@dataclass(frozen=True, slots=True)
class Rules:
    """The rules of all topics, as a section of a file has them."""

    default: Tolerance = field(default_factory=Tolerance)
    topics: Mapping[str, Rule] = field(default_factory=dict)

    def of(self, topic: str) -> Rule:
        """Rule of a topic: by its name, else by the first pattern that it matches."""
        patterns = (rule for pattern, rule in self.topics.items() if "*" in pattern and fnmatchcase(topic, pattern))
        rule = self.topics.get(topic) or next(patterns, Rule())
        return rule if rule.default else replace(rule, default=self.default)


def load_rules(path: Path = TOLERANCES, section: str = "pure") -> Rules:
    """Read a section of a file of tolerances: `pure`, `reference` or `ros`; UsageError when it is invalid."""
    try:
        return build(Rules, read_yaml(path.read_text(encoding="utf-8"), str(path))[section], f"{section}:")
    except (OSError, UsageError, KeyError, TypeError) as error:
        raise UsageError(f"{path}: cannot be read as tolerances ({error})") from error


@dataclass(slots=True)
class Difference:
    """One field of a topic that differs: how often, when first, and the worst case."""

    topic: str
    field: str
    count: int
    first: int
    recorded: object
    replayed: object
    worst: float

    def document(self, begin: int) -> dict[str, object]:
        """JSON document; times in seconds since the begin of the bag."""
        return {
            "topic": self.topic,
            "field": self.field,
            "count": self.count,
            "first_s": round((self.first - begin) / NS_PER_S, 6),
            "recorded": _plain(self.recorded),
            "replayed": _plain(self.replayed),
        }

    def sentence(self, begin: int) -> str:
        """One line of text."""
        when = f"{(self.first - begin) / NS_PER_S:.3f} s"
        values = f"recorded {self.recorded!s:.40}, replayed {self.replayed!s:.40}"
        return f"{self.topic} {self.field}: {self.count} times, first at {when}; worst: {values}"


def _plain(value: object) -> object:
    finite = isinstance(value, float) and math.isfinite(value)
    return value if finite or isinstance(value, bool | int | str) else str(value)


class ComparisonReport:
    """Counts of compared fields and of differences."""

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.fields_compared = 0
        self.messages: Counter[str] = Counter()
        self._differences: dict[tuple[str, str], Difference] = {}
        self._explained: dict[str, str] = {}
        self._sizes: dict[tuple[str, int], int] = {}
        """Compared fields of a message, by topic and number of bytes: some have lists."""
        self._padding = Padding()
        self._tolerances: dict[str, dict[str, Tolerance | None]] = {}

    def compare_bytes(
        self, topic: str, stamp: int, recorded: bytes, replayed: bytes, decode: Callable[[bytes], object]
    ) -> bool:
        """Compare two CDR messages, decoded only when their bytes differ.

        Parameters
        ----------
        topic
            Names the tolerances.
        stamp
            Time of receipt [ns], for the report.
        recorded, replayed
            The messages.
        decode
            Makes a message of one of the two.

        Returns
        -------
        bool
            Whether they are equal, or differ in padding only.
        """
        if len(recorded) - len(replayed) < WORD:
            recorded = recorded[: len(replayed)]
        if recorded == replayed or self._padding.same(topic, recorded, replayed, decode):
            shape = topic, len(recorded)
            if shape not in self._sizes:
                rule, fields = self.rules.of(topic), flat(decode(recorded))
                self._sizes[shape] = sum(rule.tolerance(_unnumbered(name)) is not None for name, _ in fields)
            self._count(topic, self._sizes[shape])
            return True
        self.compare_messages(topic, stamp, decode(recorded), decode(replayed))
        return False

    def compare_messages(self, topic: str, stamp: int, recorded: object, replayed: object) -> None:
        """Compare two decoded messages of one type.

        Parameters
        ----------
        topic
            Names the tolerances.
        stamp
            Time of receipt [ns], for the report.
        recorded, replayed
            The messages.
        """
        self.compare_values(topic, stamp, dict(flat(recorded)), dict(flat(replayed)))

    def compare_values(
        self, topic: str, stamp: int, recorded: Mapping[str, object], replayed: Mapping[str, object]
    ) -> None:
        """Compare two sets of named values; a name in only one of them is a difference.

        Parameters
        ----------
        topic
            Names the tolerances.
        stamp
            Time of receipt [ns], for the report.
        recorded, replayed
            Values by the path of their field.
        """
        tolerances = self._tolerances.setdefault(topic, {})
        rule = self.rules.of(topic)
        compared = 0
        for name in recorded.keys() | replayed.keys():
            if name not in tolerances:
                tolerances[name] = rule.tolerance(_unnumbered(name))
            tolerance = tolerances[name]
            if tolerance is None:
                continue
            compared += 1
            one, other = recorded.get(name), replayed.get(name)
            if one != other and not _equal(one, other, tolerance):
                self._differ(topic, name, stamp, one, other)
        self._count(topic, compared)

    def unmatched(self, topic: str, stamp: int, text: str, recorded: str, replayed: str) -> None:
        """Record a message without a counterpart.

        Parameters
        ----------
        topic
            Of the message.
        stamp
            Time of receipt [ns].
        text
            What is missing.
        recorded, replayed
            What stands on either side of the report.
        """
        self._differ(topic, f"{MISSING} {text}", stamp, recorded, replayed)

    def explain(self, topic: str, why: str) -> None:
        """Give the cause that the record itself names for the differences of a topic; they no longer count as such."""
        self._explained[topic] = why

    def explanations(self) -> list[str]:
        """One sentence for each topic whose differences are explained."""
        counts = Counter(topic for topic, _ in self._differences if topic in self._explained)
        return [f"{topic}: {count} fields differ, for {self._explained[topic]}" for topic, count in counts.items()]

    def add(self, other: Self) -> None:
        """Add the counts of another report, of other topics."""
        self.fields_compared += other.fields_compared
        self.messages |= other.messages
        self._differences |= other._differences
        self._explained |= other._explained

    def differences(self) -> list[Difference]:
        """Differences beyond the tolerances, the earliest first."""
        kept = [one for key, one in self._differences.items() if not self._forgiven(*key)]
        return sorted(kept, key=lambda one: (one.first, one.topic, one.field))

    def _forgiven(self, topic: str, name: str) -> bool:
        if topic in self._explained:
            return True
        allowed = self.rules.of(topic).unmatched * self.messages[topic]
        return name.startswith(MISSING) and self._differences[topic, name].count <= allowed

    def _count(self, topic: str, compared: int) -> None:
        self.fields_compared += compared
        self.messages[topic] += 1

    def _differ(self, topic: str, name: str, stamp: int, recorded: object, replayed: object) -> None:
        apart = _distance(recorded, replayed)
        known = self._differences.get((topic, name))
        if known is None:
            self._differences[topic, name] = Difference(topic, name, 1, stamp, recorded, replayed, apart)
            return
        known.count += 1
        if apart > known.worst:
            known.recorded, known.replayed, known.worst = recorded, replayed, apart


class Padding:
    """Bytes of CDR messages that belong to no field: writers leave them uninitialized.

    A byte is padding when the message decodes to the same with that byte turned over. What was found holds for
    messages of the same topic and length.
    """

    def __init__(self) -> None:
        self._masks: dict[tuple[str, int], int] = {}

    def same(self, topic: str, one: bytes, other: bytes, decode: Callable[[bytes], object]) -> bool:
        """Whether two messages differ in padding only; what was found to be padding is kept.

        Parameters
        ----------
        topic
            Topic of both.
        one, other
            CDR.
        decode
            Makes a message of one of the two.

        Returns
        -------
        bool
            True also for equal ones.
        """
        if len(one) != len(other):
            return False
        key = (topic, len(one))
        apart = int.from_bytes(one, "little") ^ int.from_bytes(other, "little")
        known = self._masks.get(key, 0)
        if not apart & ~known:
            return True
        offsets = [index for index in range(len(one)) if one[index] != other[index]]
        if len(offsets) > MOST_PADDING or not _without_effect(one, offsets, decode):
            return False
        self._masks[key] = known | sum(0xFF << (8 * index) for index in offsets)
        return True


def _without_effect(data: bytes, offsets: Iterable[int], decode: Callable[[bytes], object]) -> bool:
    turned = bytearray(data)
    for index in offsets:
        turned[index] ^= 0xFF
    try:
        return repr(list(flat(decode(bytes(turned))))) == repr(list(flat(decode(data))))
    except (HindraxError, ValueError, IndexError, OverflowError, struct.error):  # such as a text that is none any more
        return False


def _equal(recorded: object, replayed: object, tolerance: Tolerance) -> bool:
    if isinstance(recorded, float | int) and isinstance(replayed, float | int):
        return tolerance.allows(float(recorded), float(replayed))
    return bool(recorded == replayed)


def _distance(recorded: object, replayed: object) -> float:
    if isinstance(recorded, float | int) and isinstance(replayed, float | int):
        apart = abs(float(recorded) - float(replayed))
        return math.inf if math.isnan(apart) else apart
    return math.inf


def _unnumbered(name: str) -> str:
    """Name of a field without the numbers of its elements: `beams[2].range` is covered by `beams.range`."""
    return "".join(part.partition("]")[2] if index else part for index, part in enumerate(name.split("[")))


def flat(message: object, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield names and values of all fields of a decoded message, nested ones with dots, elements with numbers."""
    for name in _names(message):
        yield from _flat_value(f"{prefix}{name}", getattr(message, name))


def _names(message: object) -> Iterable[str]:
    kind = type(message)
    known = _KNOWN_NAMES.get(kind)
    if known is not None:
        return known
    if hasattr(message, "get_fields_and_field_types"):
        found = tuple(message.get_fields_and_field_types())
    else:  # of `mcap_ros2`; fields that a migration added are beside the slots
        found = tuple(name for name in (*getattr(message, "__slots__", ()), *vars(message)) if not name.startswith("_"))
    _KNOWN_NAMES[kind] = found
    return found


def _flat_value(name: str, value: object) -> Iterator[tuple[str, object]]:
    if isinstance(value, bool | int | float | str | bytes):
        yield name, value
    elif isinstance(value, list | tuple):
        for index, one in enumerate(value):
            yield from _flat_value(f"{name}[{index}]", one)
    elif hasattr(value, "tolist"):
        yield from _flat_value(name, value.tolist())
    else:
        yield from flat(value, f"{name}.")
