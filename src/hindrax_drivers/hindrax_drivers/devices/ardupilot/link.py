"""The ground station's end of a MAVLink link to an autopilot, sans-IO: who is there, its parameters, its streams.

    waiting --heartbeat of an autopilot--> asking (parameters by name, version, streams) --all answered--> ready

What is not answered after some requests is absent: `parameters` has no such name, `refused` the streams that the
firmware does not send. Frames of others on the same network, ground stations and cameras, are left out, but noted.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from hindrax_core.driver_interface import Output, Send
from hindrax_core.events import Rejected, Stamp, seconds_between
from hindrax_core.signals import NEVER
from hindrax_drivers.protocols import ardupilot, mavlink
from hindrax_drivers.protocols.ardupilot import FROM_AUTOPILOT, GROUND_STATION, ParameterValue, Version
from hindrax_drivers.protocols.mavlink import AUTOPILOT, ONBOARD_COMPUTER, SYSTEM, CommandAck, Decoder, Heartbeat, Sent

MessageT = TypeVar("MessageT")
GCS_SYSTEM = 255
"""System of the ground station whose sticks ArduPilot obeys, unless its parameter says otherwise."""
GCS_PARAMETERS = ("MAV_GCS_SYSID", "SYSID_MYGCS")
"""That parameter: from 4.7 on, and before."""
BAUD = 115200
LATENCY_S = 0.005
"""From what a message tells to its arrival, at the least."""
HEARTBEAT_S = 1.0
ANSWER_S, ATTEMPTS = 0.3, 4
"""Wait for an answer, and how often a request is sent before it counts as unanswered."""
ATTEMPTS_OF_LOSSY = 16
"""The same on a link that has lost some: there silence is no sign of what the autopilot does not have."""
LOOK_S, TOO_FEW = 1.0, 0.5
"""Time over which a stream is counted, and the part of what was asked for below which it is asked for anew.

An autopilot has one rate for each message and line, and a router puts several stations on one: QGroundControl asks for
groups of messages at 2 to 10 Hz when it starts. After a restart of the autopilot nothing comes.
"""
AT_ONCE = 8
"""Parameters that are asked for at the same time."""
LOST_S = 3.0
"""Silence of the heartbeat, 1 Hz, after which the autopilot counts as lost."""
ACCEPTED, IN_PROGRESS = 0, 5
SECOND_COMPUTER, THIRD_COMPUTER, FOURTH_COMPUTER, COMPANION = 192, 193, 194, 18
"""MAV_COMP_ID_ONBOARD_COMPUTER2 to 4, MAV_TYPE_ONBOARD_CONTROLLER."""
ARDUPILOT = 3
"""MAV_AUTOPILOT_ARDUPILOTMEGA."""
SUBMARINE = 12
"""MAV_TYPE_SUBMARINE."""


def no_submarine(beat: Heartbeat | None) -> str:
    """Why the autopilot of a heartbeat is no ArduSub; empty where it is one."""
    found = beat and beat.type
    return "" if found == SUBMARINE else f"found a vehicle of MAV_TYPE {found}, wanted {SUBMARINE}, an ArduSub"


def _is_submarine(beat: Heartbeat) -> bool:
    return beat.autopilot == ARDUPILOT and not no_submarine(beat)


@dataclass(frozen=True, slots=True)
class Command:
    """A COMMAND_LONG that waits for its answer."""

    number: int
    parameters: tuple[float, ...]
    at: Stamp = NEVER
    attempt: int = 0


class Handlers:
    """What is made of the messages of each kind; a handler sees only those of its own."""

    def __init__(self) -> None:
        self._by_kind: dict[type, Callable[[Any, Stamp], list[Output]]] = {}

    def on(self, kind: type[MessageT], handle: Callable[[MessageT, Stamp], list[Output]]) -> None:
        """Hand messages of a kind to `handle`, with the time of their arrival."""
        self._by_kind[kind] = handle

    def know(self, message: object) -> bool:
        """Whether something is made of messages of this kind."""
        return type(message) in self._by_kind

    def outputs(self, message: object, stamp: Stamp) -> list[Output]:
        """Outputs of one message; none of a kind that nothing is made of."""
        handle = self._by_kind.get(type(message))
        return handle(message, stamp) if handle else []


class Link:
    """One link. `wanted`: names of parameters; `streams`: rates by message number [Hz].

    A `companion` has that component of the autopilot's own system: its heartbeat must not pass for a ground station's.
    """

    def __init__(self, wanted: Sequence[str], streams: Mapping[int, float], *, companion: int = 0) -> None:
        self._companion, self._component = companion, companion or ONBOARD_COMPUTER
        self._wanted = () if companion else tuple(dict.fromkeys((*GCS_PARAMETERS, *wanted)))
        self._streams = dict(streams)
        self._sequence = 0
        self.restart(Stamp(0))

    def restart(self, stamp: Stamp) -> None:
        """Forget everything: the line was opened, or the autopilot has restarted."""
        self._decoder = Decoder(FROM_AUTOPILOT)
        self.system = 0
        """System of the autopilot; 0 before its first heartbeat."""
        self.beat: Heartbeat | None = None
        self.beat_at = self.opened_at = stamp
        self.parameters: dict[str, float] = {}
        self.version: Version | None = None
        self.refused: list[int] = []
        self.stations: set[tuple[int, int]] = set()
        """Other ground stations on the link, by system and component."""
        self.foreign: Heartbeat | None = None
        self.changed = ""
        """Parameter of which another value came than before, for who goes by it; he clears this."""
        self._unread = False
        self._left: deque[str] = deque(self._wanted)
        self._asked: dict[str, tuple[Stamp, int]] = {}
        self._unanswered: list[str] = []
        self._lossy = False
        """Whether an answer came to a repeated request only."""
        self._commands: deque[Command] = deque([Command(ardupilot.REQUEST, (ardupilot.VERSION,))])
        self._ask_streams(self._streams)
        self._sent_at = Stamp(0)
        self._came: Counter[int] = Counter()
        self._looked = stamp

    def _ask_streams(self, numbers: Iterable[int]) -> None:
        self._commands += (Command(ardupilot.SET_INTERVAL, (one, 1e6 / self._streams[one])) for one in numbers)

    @property
    def own_system(self) -> int:
        """Our system: that of the ground station which the autopilot obeys, or that of the autopilot."""
        if self._companion:
            return self.system or SYSTEM
        named = (self.parameters[name] for name in GCS_PARAMETERS if name in self.parameters)
        return round(next(named, GCS_SYSTEM))

    @property
    def stranger(self) -> str:
        """Who is there in the place of an ArduPilot."""
        if self.foreign is not None:
            kind = f" of kind {self.foreign.autopilot}" if self.foreign.autopilot != ARDUPILOT else ""
            return f"an autopilot{kind} of a vehicle of MAV_TYPE {self.foreign.type}"
        settings = "check its SERIALn_PROTOCOL, wanted 2, and SERIALn_BAUD, wanted 115"
        return f"no unsigned MAVLink 2 ({settings})" if self._unread else "no heartbeat of an ArduPilot"

    @property
    def asking(self) -> bool:
        """Whether something was asked that is not answered yet."""
        return bool(self._left or self._asked or self._commands)

    def alive(self, stamp: Stamp) -> bool:
        """Whether the autopilot's heartbeat is current."""
        return self.beat is not None and seconds_between(self.beat_at, stamp) <= LOST_S

    def send(self, message: Sent) -> Send:
        """Encode a message of ours."""
        data = mavlink.encode(message, self._sequence, self.own_system, self._component)
        self._sequence = (self._sequence + 1) & 0xFF
        return Send(data)

    def command(self, number: int, *parameters: float, confirmation: int = 0) -> Send:
        """COMMAND_LONG to the autopilot, whose answer is the caller's to wait for.

        Parameters
        ----------
        number
            MAV_CMD.
        *parameters
            The first of seven; the others are zero.
        confirmation
            Counts repeats.

        Returns
        -------
        Send
            One frame.
        """
        return self.send(mavlink.command_long(number, parameters, confirmation, self.system))

    def feed(self, data: bytes, stamp: Stamp) -> Iterator[object]:
        """Yield the messages of the autopilot, and rejected bytes; answers to our own requests are taken."""
        for event in self._decoder.feed(data, stamp):
            if isinstance(event, Rejected):
                self._unread = True
                yield event
            elif self._is_autopilot(event, stamp) and not self._receive(event.message, stamp) and event.message:
                yield event.message

    def _is_autopilot(self, frame: mavlink.MavlinkFrame, stamp: Stamp) -> bool:
        message = frame.message
        if isinstance(message, Heartbeat):
            if message.type == GROUND_STATION:
                self.stations.add((frame.system, frame.component))
            elif frame.component == AUTOPILOT and (frame.system == self.system or _is_submarine(message)):
                self.system = self.system or frame.system
                if frame.system == self.system:
                    self.beat, self.beat_at = message, stamp
            elif frame.component == AUTOPILOT:  # such as the boat above it, on the same line
                self.foreign = message
        ours = frame.system == self.system and frame.component == AUTOPILOT
        self._came[frame.number] += ours
        return ours

    def _receive(self, message: object, stamp: Stamp) -> bool:
        """Whether a message is an answer to a request of the set-up."""
        if isinstance(message, ParameterValue):
            return self._on_parameter(message)
        if isinstance(message, Version):
            self.version = message
            return True
        if isinstance(message, CommandAck) and self._commands and self._commands[0].number == message.command:
            if not self.is_ours(message) or not self._commands[0].attempt:
                return False
            if message.result == IN_PROGRESS:
                self._commands[0] = replace(self._commands[0], at=stamp)
                return True
            done = self._commands.popleft()
            if done.attempt > 1:
                self._on_loss()
            if message.result != ACCEPTED:
                self._note(done)
            return True
        return False

    def _on_parameter(self, found: ParameterValue) -> bool:
        """Whether a value was wanted."""
        asked = self._asked.pop(found.name, None)
        if asked is not None and asked[1] > 1:
            self._on_loss()
        if found.name in GCS_PARAMETERS:  # the other one is its name in other releases
            for name in GCS_PARAMETERS:
                self._asked.pop(name, None)
            self._left = deque(name for name in self._left if name not in GCS_PARAMETERS)
        if asked is None and found.name not in self._wanted:
            return False
        if self.parameters.get(found.name, found.value) != found.value:
            self.changed = found.name
        self.parameters[found.name] = found.value
        return True

    def is_ours(self, answer: CommandAck) -> bool:
        """Whether an answer is for a command of this end, not of another ground station."""
        systems, components = (0, GCS_SYSTEM, self.own_system), (0, self._component)
        return answer.target_system in systems and answer.target_component in components

    @property
    def _attempts(self) -> int:
        return ATTEMPTS_OF_LOSSY if self._lossy else ATTEMPTS

    def _on_loss(self) -> None:
        """Ask once more for what was given up before the link was known to lose messages."""
        if not self._lossy:
            self._lossy = True
            self._left += self._unanswered
            self._unanswered.clear()

    def _note(self, command: Command) -> None:
        if command.number == ardupilot.SET_INTERVAL:
            self.refused.append(round(command.parameters[0]))

    def tick(self, stamp: Stamp) -> Iterator[Send]:
        """Heartbeat, requests and their repetitions."""
        if not self._sent_at or seconds_between(self._sent_at, stamp) >= HEARTBEAT_S:
            self._sent_at = stamp
            yield self.send(ardupilot.beat(COMPANION if self._companion else GROUND_STATION))
        if self.system:
            self._watch_streams(stamp)
            yield from self._ask_parameters(stamp)
            yield from self._ask_command(stamp)

    def _watch_streams(self, stamp: Stamp) -> None:
        """Ask anew for the streams of which too little comes."""
        if self.asking or not self.alive(stamp):
            self._came.clear()
            self._looked = stamp
        elif (counted_s := seconds_between(self._looked, stamp)) >= LOOK_S:
            rates = ((one, rate) for one, rate in self._streams.items() if one not in self.refused)
            self._ask_streams([one for one, rate in rates if self._came[one] < TOO_FEW * rate * counted_s])
            self._came.clear()
            self._looked = stamp

    def _ask_parameters(self, stamp: Stamp) -> Iterator[Send]:
        for name, (at, attempt) in list(self._asked.items()):
            if seconds_between(at, stamp) < ANSWER_S:
                continue
            if attempt >= self._attempts:
                del self._asked[name]
                self._unanswered.append(name)
                continue
            self._asked[name] = (stamp, attempt + 1)
            yield self.send(ardupilot.read_parameter(name, self.system))
        while self._left and len(self._asked) < AT_ONCE:
            name = self._left.popleft()
            self._asked[name] = (stamp, 1)
            yield self.send(ardupilot.read_parameter(name, self.system))

    def _ask_command(self, stamp: Stamp) -> Iterator[Send]:
        if not self._commands:
            return
        first = self._commands[0]
        if first.attempt and seconds_between(first.at, stamp) < ANSWER_S:
            return
        if first.attempt >= self._attempts:
            self._note(self._commands.popleft())
            return
        self._commands[0] = replace(first, at=stamp, attempt=first.attempt + 1)
        yield self.command(first.number, *first.parameters, confirmation=first.attempt)
