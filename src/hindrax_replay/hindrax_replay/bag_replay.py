"""Replays a recorded run without ROS: wire frames pass the real devices, navigator and identification.

Recorded wrenches pass the real guard and allocation. All recorded outputs are compared with the replayed ones. A bag
without wire frames is replayed from its messages; then the devices are not compared.
"""

import gc
import json
import multiprocessing
import signal
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Self

from hindrax_analysis.records.third_party_bag import listed, topics_of
from hindrax_bag.message_comparison import ComparisonReport, Rules, load_rules
from hindrax_bag.read.bag_reader import BagMessage, attached_vehicle, attachments, messages
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.sensor_table import Capability
from hindrax_core.topics import IMU, ODOMETRY, PRESSURE, Topic, carriers, resolved
from hindrax_core.topics import topics_of as topics_of_vehicle
from hindrax_core.vehicle import Vehicle
from hindrax_replay import allocation_stage, state_stage
from hindrax_replay.allocation_stage import AllocationStage
from hindrax_replay.recorded_devices import parameters_of
from hindrax_replay.state_stage import StateStage
from hindrax_replay.wire_stage import ReferenceSamples, WireStage

READ: tuple[Capability, ...] = ("rates", "field", "depth", "altitude", "velocity")
PREFIX = "reference "
"""Topics of a reference appear in reports and in the file of tolerances with this before their name."""
TOGETHER = 200
"""Messages per report to the second stage."""
COLLECT_AFTER = 100_000
"""Allocations between garbage collections; readings hold no reference cycles."""
SettledMessage = tuple[BagMessage, bytes | None]
"""A message, and its replacement if the replayed device publishes something else."""
_fork = multiprocessing.get_context("fork")


@dataclass(slots=True)
class Replayed:
    """Outcome of one replay."""

    bag: Path
    ledger: ComparisonReport
    begin: int = 0
    vehicle_s: float = 0.0
    wall_s: float = 0.0
    samples: ReferenceSamples = field(default_factory=ReferenceSamples)

    def document(self) -> dict[str, object]:
        """As it appears in JSON."""
        differences = [one.document(self.begin) for one in self.ledger.differences()]
        found = {"bag": str(self.bag), "fields_compared": self.ledger.fields_compared, "differences": differences}
        return {**found, "explained": self.ledger.explanations()}


def replay(
    bag: Path,
    rules: Rules | None = None,
    vehicle: Vehicle | None = None,
    *,
    results: bool = False,
    names: Mapping[str, str] | None = None,
) -> Replayed:
    """Replay a bag and compare. UsageError when it is no bag, or has no vehicle file inside and none is given.

    Parameters
    ----------
    bag
        Folder.
    rules
        Tolerances; None: those of the package.
    vehicle
        None: the one in the bag.
    results
        Whether the identification is finished too, for a reference.
    names
        Our topic by the bag's topic, for third-party bags; None: all are ours.

    Returns
    -------
    Replayed
        Counts, differences and times.
    """
    start = time.perf_counter()
    inside = attachments(bag)
    parameters = parameters_of(inside)
    vehicle = vehicle or attached_vehicle(bag, inside)
    done = Replayed(bag, ComparisonReport(rules or load_rules()))
    ours = names or {}
    followed = state_stage.inputs(vehicle)

    def record() -> Iterator[BagMessage]:
        return (one._replace(topic=ours[one.topic]) if one.topic in ours else one for one in messages(bag))

    def follow(settled: Iterator[SettledMessage]) -> tuple[ComparisonReport, ReferenceSamples]:
        samples = ReferenceSamples()
        state = StateStage(vehicle, parameters, done.ledger, samples)
        for message, replaced in settled:
            state.feed(message, replaced)
        state.finish()
        if results:
            state.keep_results()
        return done.ledger, samples

    with hardly_collecting(), SecondStage((one for one in record() if one.topic in followed), follow) as second:
        first = WireStage(vehicle, parameters, done.ledger, done.samples, second.forward, followed=followed)
        # It is fed with what was recorded alone, so either process could have it: this one has less to do.
        allocation = AllocationStage(vehicle, parameters, done.ledger, done.samples)
        for message in record():
            first.feed(message)
            if message.topic in allocation_stage.INPUTS:
                allocation.feed(message)
        first.finish()
        allocation.finish()
        ledger, samples = second.result()
    done.ledger.add(ledger)
    done.samples |= samples
    done.begin, done.vehicle_s = first.begin, first.seconds
    done.wall_s = time.perf_counter() - start
    return done


def _by_type(vehicle: Vehicle) -> dict[str, str]:
    """Our inputs and outputs of the navigator by type, for third-party topics: of several sensors the first."""
    topics: list[Topic] = [next(iter(carriers(vehicle, capability).values())) for capability in READ]
    return {topic.type: resolved(topic) for topic in (*topics, ODOMETRY)}


def names_of(bag: Path, remaps: Sequence[str], vehicle: Vehicle) -> dict[str, str]:
    """Find which topics of a third-party bag are ours.

    Parameters
    ----------
    bag
        Folder.
    remaps
        `THEIRS:=OURS`.
    vehicle
        Whose topics are looked for.

    Returns
    -------
    dict[str, str]
        Our topic by the bag's, by the remaps, else by type where the bag holds none of our topics.

    Raises
    ------
    UsageError
        For a remap that does not fit, for a type that several topics have, and when nothing is left to replay.
    """
    types = {resolved(topic): topic.type for topic in topics_of_vehicle(vehicle)}
    if not remaps and any(message.topic in types for message in messages(bag)):
        return {}
    topics = topics_of(bag)
    if remaps:
        return dict(_remap(word, topics, bag, types) for word in remaps)
    found: dict[str, str] = {}
    by_type = _by_type(vehicle)
    for theirs, kind in topics.items():
        if ours := by_type.get(kind):
            if ours in found.values():
                raise UsageError(f"{bag}: several topics are of type {kind}; name the one with --remap THEIRS:={ours}")
            found[theirs] = ours
    if by_type[IMU.type] not in found.values():
        raise UsageError(
            f"{bag}: found no topic of type {IMU.type}, which the navigator requires; it holds {listed(topics)}"
        )
    return found


def _remap(word: str, topics: Mapping[str, str], bag: Path, types: Mapping[str, str]) -> tuple[str, str]:
    theirs, arrow, ours = word.partition(":=")
    if not arrow or ours not in types:
        raise UsageError(f"--remap {word}: wanted THEIRS:=OURS, ours being a topic such as {resolved(PRESSURE)}")
    if topics.get(theirs) != types[ours]:
        found = topics.get(theirs, "no such topic")
        raise UsageError(f"--remap {word}: found {found}, wanted {types[ours]}; {bag} holds {listed(topics)}")
    return theirs, ours


# ---- references: what our own code made of a bag the last time they were reviewed; written only when asked for


def reference_file(bag: Path, folder: Path) -> Path:
    """File of the reference of a bag."""
    return folder / f"{bag.name}.json"


def check_reference(replayed: Replayed, file: Path) -> None:
    """Compare the samples of a replay with its reference; UsageError when that cannot be read."""
    try:
        expected = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{file}: cannot be read as a reference ({error}); --update-refs writes one") from error
    ledger, found = replayed.ledger, replayed.samples
    for topic in expected.keys() | found.keys():
        there, here = expected.get(topic, {}), found.get(topic, {})
        for key in there.keys() | here.keys():
            stamp = int(key) if key.isdigit() else replayed.begin
            if key in there and key in here:
                ledger.compare_values(PREFIX + topic, stamp, there[key], _as_read(here[key]))
            elif key in there:
                ledger.unmatched(PREFIX + topic, stamp, "in the reference, not replayed", key, "none")
            else:
                ledger.unmatched(PREFIX + topic, stamp, "replayed, not in the reference", "none", key)


def write_reference(replayed: Replayed, file: Path) -> None:
    """Write the samples of a replay as the reference from now on, a line for each."""
    topics = []
    for topic, samples in sorted(replayed.samples.items()):
        lines = [f"  {json.dumps(key)}: {json.dumps(_as_read(values))}" for key, values in samples.items()]
        topics.append(f"{json.dumps(topic)}: {{\n" + ",\n".join(lines) + "\n}")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("{\n" + ",\n".join(topics) + "\n}\n", encoding="utf-8")


def _as_read(values: Mapping[str, object]) -> dict[str, object]:
    """Bytes have no JSON; everything else comes back as it was."""
    return {name: value.hex() if isinstance(value, bytes) else value for name, value in values.items()}


# ---- the second stage: it follows the first in a process of its own, so that both work in parallel


class SecondStage:
    """Handle of the second stage in the first; use it as a context manager, which ends the process.

    The second reads the bag itself. The first sends it the number of settled messages, and the replacements of those
    that the replayed devices publish differently.
    """

    def __init__(self, bag: Iterable[BagMessage], follow: Callable[[Iterator[SettledMessage]], object]) -> None:
        """`bag`: the messages that the first stage will forward; `follow` processes them and returns its result."""
        self._pipe, theirs = _fork.Pipe()
        self._settled, self._replacements = 0, dict[int, bytes]()
        self._process = _fork.Process(target=_run, args=(theirs, self._pipe, bag, follow), daemon=True)
        self._process.start()
        theirs.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()

    def forward(self, replaced: bytes | None) -> None:
        """Send that the next message is settled, with its replacement if there is one."""
        if replaced is not None:
            self._replacements[self._settled] = replaced
        self._settled += 1
        if self._settled % TOGETHER == 0:
            self._send()

    def result(self) -> Any:
        """Result of the second stage once it is through; raises its exception if it had one.

        Returns
        -------
        Any
            Of `follow`.

        Raises
        ------
        HindraxError
            When its process was killed.
        """
        self._send()
        try:
            found = self._pipe.recv()
        except (EOFError, OSError) as error:
            raise HindraxError("the second stage of the replay was killed; is there too little memory?") from error
        if isinstance(found, BaseException):
            raise found
        return found

    def _send(self) -> None:
        replacements, self._replacements = self._replacements, {}
        # If it has ended early, its result holds the reason.
        with suppress(OSError):
            self._pipe.send((self._settled, replacements))


def _run(
    pipe: Connection,
    other_end: Connection,
    bag: Iterable[BagMessage],
    follow: Callable[[Iterator[SettledMessage]], object],
) -> None:
    """The second process."""
    # Ctrl-C is for the first stage, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    other_end.close()
    with suppress(EOFError, OSError):
        try:
            pipe.send(follow(_settled(bag, pipe)))
        except Exception as error:  # noqa: BLE001  # raised again in the first process
            error.add_note(traceback.format_exc())
            pipe.send(error)


def _settled(bag: Iterable[BagMessage], pipe: Connection) -> Iterator[SettledMessage]:
    """Messages of the bag as far as the first stage has settled them, in their order."""
    settled, replacements = 0, dict[int, bytes]()
    for index, message in enumerate(bag):
        while index >= settled:
            settled, more = pipe.recv()
            replacements |= more
        yield message, replacements.pop(index, None)


@contextmanager
def hardly_collecting() -> Iterator[None]:
    """Collect garbage rarely, and never among the objects that exist now."""
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(COLLECT_AFTER)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
