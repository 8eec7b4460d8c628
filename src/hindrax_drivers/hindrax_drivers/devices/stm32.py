"""STM32F407 thruster controller over MAVLink 2, as the output to the speed controllers (see `firmware/`).

The controller keeps its own failsafe: it boots disarmed at neutral, arms only after seconds of neutral, and goes
neutral when overrides are missing for 300 ms. This end repeats the wanted pulses often enough, and reads those that are
output. An autopilot with the same messages works too. Others on the same network, as ground stations, are ignored:
state comes from the controller alone, and answers to their commands are not ours.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from hindrax_core.driver_interface import Identity, Output, Send, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, seconds_between
from hindrax_core.readings import AppliedPulses, Battery, DeviceText
from hindrax_drivers.driver import SilenceMonitor
from hindrax_drivers.protocols import mavlink
from hindrax_drivers.protocols.mavlink import AUTOPILOT, ONBOARD_COMPUTER, SYSTEM

ONBOARD_CONTROLLER, INVALID_AUTOPILOT, STATE_ACTIVE = 18, 8, 4
ACCEPTED, IN_PROGRESS = 0, 5
SEVERITY_WARNING = 4
CHANNELS = 16
BOARD_NEUTRAL_us = 1500.0
"""Neutral of the firmware, and of an autopilot with its factory settings."""

BAUD = 115200
HEARTBEAT_S, OVERRIDE_S = 1.0, 0.02
"""Time between two of ours."""
HOLD_S = 0.2
"""Time for which a wish is repeated without being renewed."""
LOST_S = 2.5
"""Silence after which the controller counts as lost."""
ANSWER_S, ATTEMPTS = 0.2, 3
"""Wait for the answer to a command, and how often it is sent before it counts as unanswered."""


@dataclass(frozen=True, slots=True)
class _PendingCommand:
    """A command that waits for its answer."""

    arm: bool
    at: Stamp
    attempt: int


class Stm32:
    """The serial line to one controller. `channels` in the order of the pulses, thrusters then lights.

    `identity` of the controller is empty before an answer, `refusal` (why it refused the last command) when it accepted
    it or has not answered yet; `armed` is the state that the controller reports.
    """

    baud = BAUD
    lack = ""
    left_armed = owned = False
    """It disarms itself, soon after the last command."""

    def __init__(self, channels: Sequence[int]) -> None:
        """ValueError for channels that collide or that an override does not have."""
        if len(set(channels)) != len(channels) or not all(0 <= one < CHANNELS for one in channels) or not channels:
            raise ValueError(f"output channels: found {list(channels)}, wanted different ones from 0 to {CHANNELS - 1}")
        self._channels = tuple(channels)
        wanted = f"MAVLink 2 of system {SYSTEM}, component {AUTOPILOT}, at {BAUD} Bd"
        self._silence = SilenceMonitor("stm32", wanted, LOST_S)
        self._sequence = 0
        self._asked = self.settling = False
        self._reset()

    @property
    def ready(self) -> bool:
        """Whether the controller's heartbeat is current."""
        return self.identity != "" and self._silence.condition == "well"

    @property
    def trouble(self) -> str:
        """Why it is not ready."""
        if not self.identity:
            return "no MAVLink heartbeat; check the board"
        return "the board has fallen silent; check power and line"

    def fault(self) -> str:
        """Whether the board refused to arm, or has disarmed itself."""
        if not self._asked or self.armed or self.asking:
            return ""
        return self.refusal or "the board has disarmed itself"

    def drive(
        self, thrusters_us: tuple[float, ...], lights_us: tuple[float, ...], stamp: Stamp, *, armed: bool
    ) -> Iterable[Output]:
        """Send the wanted pulses; request arming once, and disarming until confirmed.

        Until the board is armed the thrusters stay neutral: it refuses to arm otherwise.

        Parameters
        ----------
        thrusters_us, lights_us : [us]
            In the order of the vehicle file.
        stamp
            Now.
        armed
            Whether thrusters may be other than neutral.

        Returns
        -------
        Iterable[Output]
            Frames to send, and troubles.
        """
        waiting = armed and not self.armed
        thrusters = (BOARD_NEUTRAL_us,) * len(thrusters_us) if waiting else thrusters_us
        outputs = [self.override(thrusters + lights_us, stamp)]
        if armed and not self._asked:
            outputs.append(self.arm(stamp))
        elif not armed and (self._asked or self.armed):
            outputs.append(self.disarm(stamp))
        self._asked = armed
        return outputs

    @property
    def asking(self) -> bool:
        """Whether a command waits for its answer."""
        return self._pending is not None

    def start(self, stamp: Stamp) -> Iterable[Output]:
        """Start with a heartbeat, with all state reset."""
        self._reset()
        self._silence.restart(stamp)
        self._heartbeat_at = stamp
        return [self._heartbeat()]

    def override(self, pulses_us: Sequence[float], stamp: Stamp) -> Send:
        """Send the wanted pulses [us] now; `tick` repeats them for a short while."""
        channels = [mavlink.UNKNOWN] * 8 + [0] * 8
        for channel, pulse in zip(self._channels, pulses_us, strict=True):
            channels[channel] = round(pulse)
        self._wanted = tuple(channels)
        self._wanted_at = self._sent_at = stamp
        return self._send(mavlink.channels_override(self._wanted))

    def arm(self, stamp: Stamp) -> Send:
        """Ask the controller to arm; the answer shows in `armed` and `refusal`."""
        return self._ask(_PendingCommand(arm=True, at=stamp, attempt=1))

    def disarm(self, stamp: Stamp) -> Send:
        """Ask the controller to disarm."""
        return self._ask(_PendingCommand(arm=False, at=stamp, attempt=1))

    def feed(self, data: bytes, stamp: Stamp) -> Iterable[Output]:
        """Decode received bytes."""
        self._silence.last_byte = stamp
        outputs: list[Output] = []
        for event in self._decoder.feed(data, stamp):
            if isinstance(event, Rejected):
                outputs.append(event)
            elif (event.system, event.component) == (SYSTEM, AUTOPILOT):
                self._silence.last_valid = stamp
                outputs += self._on_frame(event, stamp)
        return outputs

    def tick(self, stamp: Stamp) -> Iterable[Output]:
        """Send heartbeats, repeat overrides, retry unanswered commands."""
        outputs: list[Output] = list(self._silence.tick(stamp))
        if seconds_between(self._heartbeat_at, stamp) >= HEARTBEAT_S:
            self._heartbeat_at = stamp
            outputs.append(self._heartbeat())
        due = seconds_between(self._sent_at, stamp) >= OVERRIDE_S
        if self._wanted and due and seconds_between(self._wanted_at, stamp) < HOLD_S:
            self._sent_at = stamp
            outputs.append(self._send(mavlink.channels_override(self._wanted)))
        return outputs + self._retry(stamp)

    def _reset(self) -> None:
        self._decoder = mavlink.Decoder()
        self.identity, self.refusal, self._last_text, self.armed = "", "", "", False
        self._pending: _PendingCommand | None = None
        self._wanted = ()
        self._wanted_at = self._sent_at = self._heartbeat_at = Stamp(0)

    def _on_frame(self, frame: mavlink.MavlinkFrame, stamp: Stamp) -> list[Output]:
        message = frame.message
        if isinstance(message, mavlink.Heartbeat):
            return self._on_heartbeat(frame, message, stamp)
        if isinstance(message, AppliedPulses):
            return [Stamped(stamp, AppliedPulses(tuple(message.pulses_us[channel] for channel in self._channels)))]
        if isinstance(message, mavlink.CommandAck):
            return self._on_ack(message, stamp)
        if isinstance(message, Battery):
            return [Stamped(stamp, message)]
        if isinstance(message, mavlink.StatusText):
            return [self._on_text(message, stamp)]
        return []

    def _on_heartbeat(self, frame: mavlink.MavlinkFrame, beat: mavlink.Heartbeat, stamp: Stamp) -> list[Output]:
        outputs: list[Output] = []
        identity = f"MAVLink system {frame.system} component {frame.component}, type {beat.type}"
        if identity != self.identity:
            self.identity = identity
            outputs.append(Identity(identity))
        if self.armed and not beat.armed and self._pending is None:
            outputs.append(Trouble(stamp, "stm32: has disarmed itself; see its messages before, then arm again"))
        self.armed = beat.armed
        return outputs

    def _on_text(self, message: mavlink.StatusText, stamp: Stamp) -> Output:
        if message.severity <= SEVERITY_WARNING:
            self._last_text = message.text
            return Trouble(stamp, f"stm32: {message.text}")
        return Stamped(stamp, DeviceText(message.text))

    def _on_ack(self, answer: mavlink.CommandAck, stamp: Stamp) -> list[Output]:
        ours = answer.target_system in (0, SYSTEM) and answer.target_component in (0, ONBOARD_COMPUTER)
        if answer.command != mavlink.ARM_DISARM or self._pending is None or not ours:
            return []
        if answer.result == IN_PROGRESS:
            self._pending = replace(self._pending, at=stamp)
            return []
        pending, self._pending = self._pending, None
        if answer.result == ACCEPTED:
            self.armed, self.refusal = pending.arm, ""
            return []
        self.refusal = self._last_text or f"answered with result {answer.result}"
        request = "arm" if pending.arm else "disarm"
        return [Trouble(stamp, f"stm32: does not {request}: {self.refusal}")]

    def _retry(self, stamp: Stamp) -> list[Output]:
        pending = self._pending
        if pending is None or seconds_between(pending.at, stamp) < ANSWER_S:
            return []
        if pending.attempt < ATTEMPTS:
            return [self._ask(_PendingCommand(pending.arm, stamp, pending.attempt + 1))]
        self._pending = None
        self.refusal = f"no answer to {pending.attempt} requests"
        return [Trouble(stamp, f"stm32: {self.refusal}; check line and firmware")]

    def _ask(self, pending: _PendingCommand) -> Send:
        self._pending, self.refusal, self._last_text = pending, "", ""
        return self._send(mavlink.command_long(mavlink.ARM_DISARM, [float(pending.arm)], pending.attempt - 1))

    def _heartbeat(self) -> Send:
        return self._send(mavlink.heartbeat(ONBOARD_CONTROLLER, INVALID_AUTOPILOT, STATE_ACTIVE))

    def _send(self, message: mavlink.Sent) -> Send:
        data = mavlink.encode(message, self._sequence)
        self._sequence = (self._sequence + 1) & 0xFF
        return Send(data)
