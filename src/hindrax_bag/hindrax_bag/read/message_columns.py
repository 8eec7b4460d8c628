"""Messages of a bag as columns: for a spreadsheet or a plot."""

import contextlib
import csv
import itertools
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

from hindrax_bag.message_comparison import flat
from hindrax_bag.read.bag_reader import BagMessage, DamagedMessageError, messages, stamp_of
from hindrax_bag.read.mcap_records import Damage
from hindrax_core.errors import UsageError
from hindrax_core.events import NS_PER_S
from hindrax_core.text.received_names import file_name
from hindrax_core.text.text_file import nothing_left, writing

MOST_NAMED = 12
TIME = ("time_s", "stamp_ns")


def extract(
    bag: Path, folder: Path, topics: Collection[str] | None, *, damage: Damage | None = None
) -> dict[str, tuple[Path, int]]:
    """Write one CSV file per topic.

    Columns: seconds since the first message of the bag, the message's own stamp (that of receipt where it has none),
    then every field. The fields of a topic are those of its first message; longer lists of later ones are cut.

    Parameters
    ----------
    bag
        As `bag_files` takes it.
    folder
        Is made; where the work fails, nothing is left in it.
    topics
        Names of those wanted; None: all.
    damage
        Receives a report of what was left out.

    Returns
    -------
    dict[str, tuple[Path, int]]
        File and number of rows by topic.

    Raises
    ------
    UsageError
        For a topic without messages, and for a folder that cannot be written.
    """
    tables: dict[str, _Table] = {}
    with writing(folder, "name another"), nothing_left(folder), contextlib.ExitStack() as files:
        for message, time_s, stamp, row in message_rows(bag, topics, damage=damage):
            if message.topic not in tables:
                folder.mkdir(parents=True, exist_ok=True)
                path = _unused(folder, file_name(message.topic), [one.path for one in tables.values()])
                files.enter_context(nothing_left(path))
                writer = csv.writer(files.enter_context(path.open("w", newline="", encoding="utf-8")))
                writer.writerow([*TIME, *row])
                tables[message.topic] = _Table(path, list(row), writer.writerow)
            table = tables[message.topic]
            table.write([time_s, stamp, *(row.get(name, "") for name in table.names)])
            table.rows += 1
        missing = sorted(set(topics or ()) - tables.keys())
        if missing or not tables:
            lacking = f"no message on {missing[0]}" if missing else "holds no message"
            raise UsageError(f"{bag}: {lacking}; `./hindrax bag info {bag}` lists the topics")
    return {topic: (table.path, table.rows) for topic, table in tables.items()}


def _unused(folder: Path, name: str, used: Collection[Path]) -> Path:
    """Path of a table: two topics may differ in a slash only, and another bag's table is replaced."""
    numbered = (folder / f"{name}{f'_{number}' if number else ''}.csv" for number in itertools.count())
    return next(path for path in numbered if path not in used)


def message_rows(
    bag: Path, topics: Collection[str] | None, *, damage: Damage | None = None
) -> Iterator[tuple[BagMessage, float, int, dict[str, object]]]:
    """Messages of these topics or of all: seconds since the first of the bag, own stamp or receipt [ns], fields.

    Parameters
    ----------
    bag, topics
        As `bag_files` takes it, and names of those wanted; None: all.
    damage
        Receives a report of what was left out.

    Yields
    ------
    tuple[BagMessage, float, int, dict[str, object]]
        Of each message that can be decoded.
    """
    begin: int | None = None
    noted = Damage() if damage is None else damage
    for message in messages(bag, damage=noted):
        begin = message.received if begin is None else begin
        if topics is None or message.topic in topics:
            try:
                row = dict(flat(message.decoded()))
            except DamagedMessageError as error:
                noted.skip(str(error), message.received, message.received)
                continue
            stamp = stamp_of(message.data) if "header.stamp.sec" in row else message.received
            yield message, (message.received - begin) / NS_PER_S, stamp, row


@dataclass(slots=True)
class _Table:
    """One CSV file under way."""

    path: Path
    names: Sequence[str]
    write: Callable[[Sequence[object]], object]
    rows: int = 0


@dataclass(slots=True)
class FieldSeries:
    """One field over time [s since the first message of the bag]."""

    name: str
    time_s: list[float] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)
    """Time of measurement by the header of the message, or of receipt without one [ns]."""
    values: list[float] = field(default_factory=list)
    unit: str = ""
    """As the definition of the message names it; empty where it does not."""


def series(bag: Path, wanted: Sequence[str], *, damage: Damage | None = None) -> list[FieldSeries]:
    """Fields of messages over time.

    Parameters
    ----------
    bag
        As `bag_files` takes it.
    wanted
        `TOPIC:FIELD` each, the field with dots and numbers, such as `twist.twist.linear.x`.
    damage
        Receives a report of what was left out.

    Returns
    -------
    list[FieldSeries]
        In the order of `wanted`, each with its unit where the definition of the message says it.

    Raises
    ------
    UsageError
        Names the topic or field that is not there, or is no number.
    """
    places = [_place(word) for word in wanted]
    made = [FieldSeries(word) for word in wanted]
    for message, time_s, stamp, row in message_rows(bag, {topic for topic, _ in places}, damage=damage):
        for one, (topic, name) in zip(made, places, strict=True):
            if topic == message.topic:
                one.unit = one.unit or _unit(message.form.definition, name)
                one.time_s.append(time_s)
                one.stamps.append(stamp)
                one.values.append(_number(row, name, topic))
    for one, (topic, _) in zip(made, places, strict=True):
        if not one.values:
            raise UsageError(f"{bag}: no message on {topic}; `./hindrax bag info {bag}` lists the topics")
    return made


def _unit(definition: str, name: str) -> str:
    """Unit in brackets at the end of the comment on a field, as in `float64 depth  # below the surface [m]`."""
    own = definition.partition("\n===")[0]
    found = re.search(rf"^\S+ +{re.escape(name.partition('[')[0])} .*#.*\[([^\]]+)\] *$", own, re.MULTILINE)
    return found[1] if found else ""


def _place(word: str) -> tuple[str, str]:
    topic, colon, name = word.partition(":")
    if not colon or not name:
        raise UsageError(f"found {word!r}, wanted TOPIC:FIELD, as in /hindrax/navigation/status:depth")
    return topic, name


def _number(row: Mapping[str, object], name: str, topic: str) -> float:
    value = row.get(name)
    if not isinstance(value, int | float):
        numbers = [key for key, one in row.items() if isinstance(one, int | float)]
        alike = [key for key in numbers if key.startswith(f"{name}[")] or get_close_matches(name, numbers, 3)
        there = ", ".join((alike or numbers)[:MOST_NAMED]) or "none in its messages"
        raise UsageError(f"{topic}: no number called {name!r}; there is {there}")
    return float(value)
