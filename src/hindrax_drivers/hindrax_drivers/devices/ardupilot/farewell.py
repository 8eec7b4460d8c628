"""What a dead man says to an autopilot in the place of an output that has died: a neutral stick, and disarm."""

from collections.abc import Iterable

from hindrax_core.driver_interface import Send
from hindrax_core.events import Stamp
from hindrax_drivers.devices.ardupilot.link import BAUD, GCS_SYSTEM
from hindrax_drivers.protocols import ardupilot, mavlink
from hindrax_drivers.protocols.ardupilot import ARM, FROM_AUTOPILOT, GROUND_STATION
from hindrax_drivers.protocols.mavlink import AUTOPILOT, SYSTEM, Decoder, Heartbeat, MavlinkFrame

NEUTRAL_STICKS = (0, 0, 500, 0, 0, 0)


class Farewell:
    """Repeated until the autopilot's heartbeat says that it is disarmed. Whoever armed it is to be sure that it did."""

    baud = BAUD

    def __init__(self) -> None:
        self._decoder = Decoder(FROM_AUTOPILOT)
        self._system, self._sequence, self._said = SYSTEM, 0, False
        self.done = False

    def feed(self, data: bytes, stamp: Stamp) -> None:
        """Learn who is there, and whether it is armed."""
        for event in self._decoder.feed(data, stamp):
            if isinstance(event, MavlinkFrame) and event.component == AUTOPILOT:
                self._system = event.system
                message = event.message
                self.done = self._said and not message.armed if isinstance(message, Heartbeat) else self.done

    def say(self) -> Iterable[Send]:
        """Return the frames."""
        self._said = True
        for message in (
            ardupilot.beat(GROUND_STATION),
            ardupilot.manual_control(NEUTRAL_STICKS, self._system),
            mavlink.command_long(ARM, [0.0], 0, self._system),
        ):
            yield Send(mavlink.encode(message, self._sequence, GCS_SYSTEM))
            self._sequence = (self._sequence + 1) & 0xFF
