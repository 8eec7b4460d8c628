"""The thruster controller without its pins: bytes and time in, bytes and pulses out."""

import struct

from . import mavlink
from .failsafe import Failsafe

SYSTEM, COMPONENT = 1, 1
ARM_DISARM = 400
ACCEPTED, TEMPORARILY_REJECTED, UNSUPPORTED = 0, 1, 3
STANDBY, ACTIVE, CRITICAL = 3, 4, 5
WARNING, INFO = 4, 6
PERIODS_MS = {mavlink.HEARTBEAT: 1000, mavlink.SERVO_OUTPUT_RAW: 50, mavlink.BATTERY_STATUS: 1000}


class Controller:
    """Answers its host by MAVLink and keeps the failsafe."""

    def __init__(self, thrusters: int, lights: int, now_ms: int) -> None:
        self.failsafe = Failsafe(thrusters, lights, now_ms)
        self.pulses = self.failsafe.step(now_ms)
        self.millivolts = 0
        self._parser = mavlink.Parser()
        self._sequence = 0
        self._due_ms = dict.fromkeys(PERIODS_MS, now_ms)
        self._reported = ""
        self._was_silent = False

    def receive(self, data: bytes, now_ms: int) -> bytes:
        """Handle bytes of the host; returns the answers. Senders of other systems are not obeyed."""
        answer = b""
        for system, message, payload in self._parser.feed(data):
            if system != SYSTEM:
                continue
            if message == mavlink.RC_CHANNELS_OVERRIDE:
                self._override(payload, now_ms)
            elif message == mavlink.COMMAND_LONG:
                answer += self._command(payload, now_ms)
        return answer

    def step(self, now_ms: int) -> bytes:
        """Advance time: sets `pulses`, the output from now on; returns messages for the host."""
        self.pulses = self.failsafe.step(now_ms)
        replies = self._report_changes(now_ms)
        if self._due(mavlink.HEARTBEAT, now_ms):
            replies += self._send(mavlink.HEARTBEAT, mavlink.heartbeat(self.failsafe.armed, self._status(now_ms)))
        if self._due(mavlink.SERVO_OUTPUT_RAW, now_ms):
            replies += self._send(mavlink.SERVO_OUTPUT_RAW, mavlink.servo_output(now_ms * 1000, self.pulses))
        if self.millivolts and self._due(mavlink.BATTERY_STATUS, now_ms):
            replies += self._send(mavlink.BATTERY_STATUS, mavlink.battery_status(self.millivolts))
        return replies

    def _override(self, payload: bytes, now_ms: int) -> None:
        channels = list(struct.unpack("<8H", payload[:16]))
        if payload[16] not in (0, SYSTEM) or payload[17] not in (0, COMPONENT):
            return
        self.failsafe.override(channels + list(struct.unpack("<10H", payload[18:38])), now_ms)

    def _command(self, payload: bytes, now_ms: int) -> bytes:
        wish, _, _, _, _, _, _, command, system, component, _ = struct.unpack("<7fHBBB", payload)
        if system not in (0, SYSTEM) or component not in (0, COMPONENT):
            return b""
        if command != ARM_DISARM:
            return self._send(mavlink.COMMAND_ACK, mavlink.command_ack(command, UNSUPPORTED))
        if wish != 1.0:
            self.failsafe.disarm("disarmed by the host", now_ms)
            return self._send(mavlink.COMMAND_ACK, mavlink.command_ack(command, ACCEPTED))
        why = self.failsafe.arm(now_ms)
        result = TEMPORARILY_REJECTED if why else ACCEPTED
        refusal = self._text(WARNING, "not armed: " + why) if why else b""
        return refusal + self._send(mavlink.COMMAND_ACK, mavlink.command_ack(command, result))

    def _report_changes(self, now_ms: int) -> bytes:
        replies = b""
        silent = self.failsafe.silent(now_ms)
        if silent and not self._was_silent:
            replies += self._text(WARNING, "no override: neutral")
        self._was_silent = silent
        if self.failsafe.reason != self._reported:
            self._reported = self.failsafe.reason
            replies += self._text(INFO, self._reported or "armed")
        return replies

    def _status(self, now_ms: int) -> int:
        if self.failsafe.silent(now_ms):
            return CRITICAL
        return ACTIVE if self.failsafe.armed else STANDBY

    def _due(self, message: int, now_ms: int) -> bool:
        if now_ms < self._due_ms[message]:
            return False
        self._due_ms[message] = now_ms + PERIODS_MS[message]
        return True

    def _text(self, severity: int, text: str) -> bytes:
        return self._send(mavlink.STATUSTEXT, mavlink.status_text(severity, text))

    def _send(self, message: int, payload: bytes) -> bytes:
        self._sequence = (self._sequence + 1) & 0xFF
        return mavlink.frame(message, payload, self._sequence, SYSTEM, COMPONENT)
