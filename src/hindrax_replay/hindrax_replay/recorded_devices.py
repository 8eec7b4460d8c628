"""The sensors process over a bag: recorded wire frames into the real drivers, their readings to messages.

A serial device receives its chunks at their recorded times; an empty sent frame means that its port was opened and the
device restarted. A register device runs its programs again, and each transaction is answered with the recorded bytes. A
transaction that is not the next of the record failed on the wire, for only successful ones were recorded.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import Any, TypeVar

from hindrax_core.bus_operations import (
    DeviceError,
    FrameBatch,
    Operation,
    Pause,
    Program,
    Transaction,
    frames_in,
    unpack_transaction,
)
from hindrax_core.driver_interface import Output, RegisterDevice, SerialDevice
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.knobs import build
from hindrax_core.text.yaml_text import read_yaml
from hindrax_core.topics import resolved
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.driver_registry import driver_of
from hindrax_drivers.nodes.reading_messages import ReadingMessages, frame_of
from hindrax_ros.parameter_file import FRAME_PREFIX

KnobsT = TypeVar("KnobsT")
Parameters = Mapping[str, Mapping[str, Any]]
TICK_S = 0.05
TRIES = 4
"""A program, the cycle after it (an inertial sensor fails with the second) and its restart: more find nothing new."""
SENT = 1
"""hindrax_msgs/RawFrames: from the host to the device."""
NO_FRAME = Stamp(0)
_transaction = lru_cache(4096)(unpack_transaction)
"""A device repeats the same few transactions."""


@dataclass(slots=True)
class SerialWire:
    """Frames into a serial device. What it sends is not compared: time-outs depend on ticks that no bag has."""

    device: SerialDevice
    stamp: Stamp = NO_FRAME
    mismatches: list[str] = field(default_factory=list)
    opened: list[Stamp] = field(default_factory=list)
    """Times at which its port was opened."""

    def frame(self, stamp: Stamp, direction: int, data: bytes) -> Iterator[Output]:
        """Advance time to the frame, then feed it.

        Parameters
        ----------
        stamp, direction, data
            As it was recorded.

        Yields
        ------
        Output
            What the driver makes of it.
        """
        if not self.stamp or (direction == SENT and not data):
            self.stamp = stamp
            self.opened.append(stamp)
            yield from self.device.start(stamp)
        while after(self.stamp, TICK_S) < stamp:
            self.stamp = after(self.stamp, TICK_S)
            yield from self.device.tick(self.stamp)
        self.stamp = stamp
        if direction != SENT:
            yield from self.device.feed(data, stamp)
            yield from self.device.tick(stamp)


@dataclass(slots=True)
class RegisterWire:
    """Transactions into the programs of a register device."""

    name: str
    device: RegisterDevice
    stamp: Stamp = NO_FRAME
    mismatches: list[str] = field(default_factory=list)
    """Transactions of the record that the device did not ask for."""
    opened: list[Stamp] = field(default_factory=list)
    _asked: Transaction | None = None
    _program: Program[object] | None = None
    _operation: Operation | None = None
    _configured: bool = False

    def frame(self, stamp: Stamp, direction: int, data: bytes) -> Sequence[Output]:
        """Feed a transaction, and with the next frame its answer.

        Parameters
        ----------
        stamp, direction, data
            As it was recorded.

        Returns
        -------
        Sequence[Output]
            What the driver makes of it.
        """
        self.stamp = stamp
        if direction == SENT:
            self._asked = _transaction(data)
            return ()
        recorded, self._asked = self._asked, None
        if recorded is None:
            return ()
        wanted: Operation | None = None
        for _ in range(TRIES):
            if self._program is None:
                self._program = self.device.cycle(self.stamp) if self._configured else self.device.configure()
                self._operation = None
                self._resume(None)
            if self._operation == recorded:
                return self._resume(data)
            wanted = wanted or self._operation
            self._resume(DeviceError(f"{self.name}: this transaction is not in the record"))
        self.mismatches.append(f"{self.name}: asks for {wanted}, the record has {recorded}")
        return ()

    def _resume(self, answer: bytes | DeviceError | None) -> Sequence[Output]:
        """Run the program to its next transaction, from an answer or a failure; returns its outputs when it ends."""
        program = self._program
        if program is None:
            return ()
        try:
            if isinstance(answer, DeviceError):
                self._operation = program.throw(answer)
            else:
                self._operation = next(program) if answer is None else program.send(answer)
            while isinstance(self._operation, Pause):
                self._operation = program.send(b"")
        except StopIteration as stop:
            self._program = None
            found, self._configured = (tuple(stop.value) if self._configured else (stop.value,)), True
            return found
        except DeviceError:
            self._program, self._configured = None, False
        return ()


class ReplayedDevice:
    """One device of the vehicle on its recorded wire; its readings become messages."""

    def __init__(
        self, name: str, vehicle: Vehicle, parameters: Parameters, add_made: Callable[[str, int, object], None]
    ) -> None:
        """`add_made` is called with all that the device publishes: full topic, stamp, message or its CDR bytes."""
        mount = vehicle.sensors[name]
        self.name, self._add_made = name, add_made
        row = driver_of(mount.device)
        device = row.make(knobs_of(row.knobs, parameters, name), mount, vehicle)
        self.wire = SerialWire(device) if row.serial else RegisterWire(name, device)
        frame = parameters.get(name, {}).get("frame_id") or prefix_of(parameters, name) + frame_of(name)
        self._messages = ReadingMessages(name, mount.device, vehicle, frame)
        # Topics outside the table were not recorded and are not compared.
        self.topics = {topic.name: resolved(topic) for topic in self._messages.topics if topic.recorded}

    def frames(self, batch: FrameBatch) -> None:
        """Feed one RawFrames message to the device."""
        for stamp, direction, data in frames_in(batch):
            for output in self.wire.frame(stamp, direction, data):
                if isinstance(output, Stamped):
                    for name, message in self._messages.of(output):
                        if name in self.topics:
                            self._add_made(self.topics[name], output.stamp, message)


def prefix_of(parameters: Parameters, name: str) -> str:
    """Prefix of the frames of a node in the recorded run."""
    return str({**parameters.get("**", {}), **parameters.get(name, {})}.get(FRAME_PREFIX, ""))


def knobs_of(kind: type[KnobsT], parameters: Parameters, name: str) -> KnobsT:
    """Knobs of a node from the parameters of the recorded run; defaults for the others.

    Parameters
    ----------
    kind
        Dataclass of knobs.
    parameters
        Of the run.
    name
        Of the node.

    Returns
    -------
    KnobsT
        Checked.
    """
    given = parameters.get(name, {})
    names = [one.name for one in fields(kind)]  # type: ignore[arg-type]  # a dataclass by contract
    return build(kind, {one: given[one] for one in names if one in given}, name)


def parameters_of(inside: Mapping[str, bytes]) -> dict[str, dict[str, object]]:
    """Parameters by node, from the ROS parameter file among the attachments of a bag."""
    text = inside.get("parameters.yaml", b"").decode("utf-8", "replace")
    found: dict[str, dict[str, object]] = {}
    for node, block in (read_yaml(text, "parameters of the bag") or {}).items():
        name = node.rpartition("/")[2]
        found.setdefault(name, {}).update(block.get("ros__parameters", {}))
    return found
