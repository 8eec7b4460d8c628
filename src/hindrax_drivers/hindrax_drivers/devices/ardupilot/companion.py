"""What the drivers of an ArduSub's measurements have in common: a companion on the link that asks for its streams."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping

from hindrax_core.driver_interface import Identity, Output, Trouble
from hindrax_core.events import Rejected, Stamp
from hindrax_drivers.devices.ardupilot.link import BAUD, Handlers, Link, no_submarine
from hindrax_drivers.driver import SilenceMonitor
from hindrax_drivers.timebase import Break, came_again


class Companion(ABC):
    """One serial device: `streams` by message number [Hz], and what is made of their messages."""

    baud = BAUD

    def __init__(self, name: str, component: int, streams: Mapping[int, float], stall_s: float) -> None:
        self._name = name
        self._link = Link((), streams, companion=component)
        self._silence = SilenceMonitor(name, "MAVLink of an ArduSub", stall_s)
        self._on = self._handlers()
        self._reset(Stamp(0))

    @abstractmethod
    def _handlers(self) -> Handlers:
        """What is made of each kind of message."""

    @abstractmethod
    def _clear(self) -> None:
        """Forget what was received before."""

    def _reset(self, stamp: Stamp) -> None:
        self._link.restart(stamp)
        self._silence.restart(stamp)
        self._identity = self._told = ""
        self._broken: list[Trouble] = []
        self._newest_us: dict[str, int] = {}
        self._clear()

    def _is_old(self, what: str, boot_us: int) -> bool:
        """Whether a message is no newer than the last of its kind, by the time since power-up."""
        if came_again(self._newest_us.get(what, -1), boot_us):
            return True
        self._newest_us[what] = boot_us
        return False

    @property
    def ready(self) -> bool:
        """Whether an ArduSub has been recognized, and speaks."""
        return bool(self._identity) and self._silence.condition == "well"

    def start(self, stamp: Stamp) -> Iterable[Output]:
        """Begin anew after the line was opened."""
        self._reset(stamp)
        return list(self._link.tick(stamp))

    def feed(self, data: bytes, stamp: Stamp) -> Iterable[Output]:
        """Decode received bytes."""
        self._silence.last_byte = stamp
        outputs: list[Output] = []
        for message in self._link.feed(data, stamp):
            if isinstance(message, Rejected):
                outputs.append(message)
            elif self._on.know(message) and not no_submarine(self._link.beat):
                self._silence.last_valid = stamp
                outputs += self._on.outputs(message, stamp)
        broken, self._broken = self._broken, []
        return [*outputs, *broken]

    def tick(self, stamp: Stamp) -> Iterable[Output]:
        """Heartbeat, requests, silence."""
        return [*self._silence.tick(stamp), *self._identify(stamp), *self._link.tick(stamp)]

    def _identify(self, stamp: Stamp) -> list[Output]:
        beat = self._link.beat or self._link.foreign
        if found := beat and no_submarine(beat):
            told, self._told = self._told, found
            return [] if told == found else [Trouble(stamp, f"{self._name}: {found}")]
        if self._link.beat is None or self._link.asking or self._identity:
            return []
        version = f" {self._link.version}" if self._link.version else ""
        self._identity = f"ArduSub{version}, system {self._link.system}"
        missing = ", ".join(map(str, self._link.refused))
        lack = [Trouble(stamp, f"{self._name}: does not stream messages {missing} on request")] if missing else []
        return [Identity(self._identity), *lack]

    def _on_break(self, found: Break) -> None:
        what = "has restarted" if found.kind == "reset" else f"its clock jumped by {found.shift_s:.3g} s"
        if found.kind == "jump" and found.shift_s < 0.0:
            lost = f"its clock lost {-found.shift_s:.2g} s"
            what = f"{lost}, as that of a simulator on a busy computer, or the link got slower"
        self._broken.append(Trouble(found.arrival, f"{self._name}: {what}"))
