"""Blue Robotics Ping1D and Ping2 echo sounders.

After opening the port: wake the sonar and request its identity (repeatedly, its automatic baud rate fails now
and then), send the settings one by one, then measure. A setting holds when the device reports the wanted
value or has acknowledged it; a refused one is reported and skipped. A sonar that lost its power may have lost its
settings, so all of this is repeated whenever it falls silent or its ping numbers restart. A sonar that does not ping
by itself is polled. Supply and temperatures are asked for now and then.

A distance is stamped with the time of the echo. The sonar sends after the whole scan, so the
echo is older than the message by the rest of the scan and by the message's time on the wire. When it is polled, the
answer is moreover up to one ping interval old, which cannot be known from outside. Stamps never go back, also when
several messages arrive at once.
"""

import math
from collections import deque
from collections.abc import Callable

from hindrax_core.driver_interface import Identity, Output, Send, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, after, seconds_between
from hindrax_core.hydrostatics import Water
from hindrax_core.readings import DeviceText, Echo, EchoProfile, SonarHealth
from hindrax_core.rejects import Reject, RejectCode, reject
from hindrax_drivers.devices.ping1d_settings import (
    DEFAULT_KNOBS,
    FRESH_WATER,
    DeviceSetting,
    Ping1dKnobs,
    device_settings,
)
from hindrax_drivers.driver import Driver, SilenceMonitor, sound_mps
from hindrax_drivers.protocols import ping_protocol as protocol
from hindrax_drivers.protocols.ping_protocol import EchoMessage, FrameSplitter, PingFrame, Refused

HELLO = protocol.request(protocol.PROTOCOL_VERSION) + protocol.request(protocol.DEVICE_INFORMATION)
HALF_COUNT = 1 << 31
FARTHEST_mm = 140_000
HEALTH = (protocol.DEVICE_ID, protocol.SUPPLY_mV, protocol.PROCESSOR_cC, protocol.BOARD_cC)
HEALTH_EVERY_S = 10.0
SUPPLY_V = (4.5, 5.5)
"""A 5 V rail (ping1d.json of ping-protocol, message 1202 voltage_5) within a tenth; the tenth is our own limit."""


class Ping1d:
    """Serial device: frames in; Echo, SonarHealth (and EchoProfile where asked) out."""

    def __init__(self, knobs: Ping1dKnobs = DEFAULT_KNOBS, water: Water = FRESH_WATER) -> None:
        self._knobs, self._water, self.baud = knobs, water, knobs.baud
        self._stall_s = max(knobs.stall_s, 4.0 * knobs.interval_s)
        self._silence = SilenceMonitor("Ping", f"Ping frames at {knobs.baud} baud", self._stall_s)
        self._handlers: dict[int, Callable[[PingFrame, Stamp], list[Output]]] = {
            protocol.DEVICE_INFORMATION: self._on_identity,
            protocol.ACK: self._on_ack,
            protocol.NACK: self._on_nack,
            protocol.TEXT: self._on_text,
            protocol.DISTANCE_SIMPLE: self._on_simple,
            protocol.DISTANCE: self._on_echo,
            protocol.PROFILE: self._on_echo,
            **dict.fromkeys(HEALTH, self._on_health),
        }
        self._profile_wanted = knobs.profile
        self.round_trip_s: float | None = None
        """Time from the last question to its answer; None before the first."""
        self._wrong_type_reported = self._supply_reported = False
        self._last_stamp = Stamp(0)
        self._reset(Stamp(0))

    def _reset(self, stamp: Stamp) -> None:
        self._running = self._known = self._acked = False
        self._streaming = self._knobs.continuous
        self._health: dict[int, int] = {}
        self._health_wanted: tuple[int, ...] = HEALTH
        self._health_asked = stamp
        self._orders: deque[DeviceSetting] = deque()
        self._tries = 0
        self._asked = stamp
        self._waiting = False
        self._last_ping = -1
        self._fresh = stamp
        self._gap_reported = Stamp(-1 << 62)

    @property
    def ready(self) -> bool:
        """Whether a Ping sonar has answered and has received all settings."""
        return self._running and self._silence.condition == "well"

    def request_profile(self) -> list[Output]:
        """Return the request for a profile with the next echo, for the port to send."""
        self._profile_wanted = True
        return [] if self._running and self._streaming else [Send(protocol.request(protocol.PROFILE))]

    def start(self, stamp: Stamp) -> list[Output]:
        """Wake the sonar and request its identity."""
        self._frames = FrameSplitter()
        self._silence.restart(stamp)
        return self._wake(stamp)

    def _wake(self, stamp: Stamp) -> list[Output]:
        self._reset(stamp)
        return self._ask(Send(HELLO, wake=True), stamp)

    def _ask(self, question: Send, stamp: Stamp) -> list[Output]:
        self._asked, self._waiting = stamp, True
        return [question]

    def _answered(self, stamp: Stamp) -> None:
        if self._waiting:
            self.round_trip_s = seconds_between(self._asked, stamp)
            self._waiting = False

    def feed(self, data: bytes, stamp: Stamp) -> list[Output]:
        """Decode received bytes; invalid ones come back as Rejected, in the order of the bytes."""
        self._silence.last_byte = stamp
        outputs: list[Output] = []
        for piece in self._frames.feed(data):
            if isinstance(piece, Refused):
                outputs.append(Rejected(stamp, reject(piece.reason, "frame"), piece.data))
            else:
                outputs += self._on_frame(piece, stamp)
        return outputs

    def _on_frame(self, frame: PingFrame, stamp: Stamp) -> list[Output]:
        self._silence.last_valid = stamp
        handler = self._handlers.get(frame.id)
        outputs = handler(frame, stamp) if handler is not None else []
        if self._orders and frame.id == self._orders[0].proof:
            outputs += self._check_setting(frame, stamp)
        return outputs

    def _on_identity(self, frame: PingFrame, stamp: Stamp) -> list[Output]:
        kind, revision, major, minor, patch, _ = frame.payload
        self._answered(stamp)
        if self._known:
            return []
        if kind != protocol.PING1D_TYPE:
            reported, self._wrong_type_reported = self._wrong_type_reported, True
            wanted = f"wanted {protocol.PING1D_TYPE} (Ping1D, Ping2); check which device is on this port"
            return [] if reported else [Trouble(stamp, f"Ping: found device type {kind}, {wanted}")]
        self._known, self._wrong_type_reported = True, False
        self._orders = deque(device_settings(self._knobs, self._water))
        identity = Identity(f"Blue Robotics Ping sonar, revision {revision}, firmware {major}.{minor}.{patch}")
        return [identity, *self._send_order(stamp)]

    def _send_order(self, stamp: Stamp) -> list[Output]:
        """Send the first setting in the queue; when it is empty, start measuring."""
        self._tries, self._acked = 1, False
        self._found: int | None = None
        if not self._orders:
            self._running, self._waiting, self._fresh = True, False, stamp
            return self._ask_health(stamp)
        return self._ask(Send(self._orders[0].frames), stamp)

    def _next_order(self, stamp: Stamp, *, given_up: bool = False) -> list[Output]:
        order = self._orders.popleft()
        if given_up and order.message == protocol.CONTINUOUS_START:
            self._streaming = False
        return self._send_order(stamp)

    def _on_ack(self, frame: PingFrame, stamp: Stamp) -> list[Output]:
        if not self._orders or protocol.about(frame) != self._orders[0].message:
            return []
        self._acked = True
        return [] if self._orders[0].proof else self._next_order(stamp)

    def _on_nack(self, frame: PingFrame, stamp: Stamp) -> list[Output]:
        reason = frame.payload[2:].decode("ascii", "replace").strip("\0 ") or "no reason given"
        refused = protocol.about(frame)
        if self._orders and refused == self._orders[0].message:
            trouble = Trouble(stamp, f"Ping: {self._orders[0].name} refused ({reason})")
            return [trouble, *self._next_order(stamp, given_up=True)]
        if refused in self._health_wanted:
            self._health_wanted = tuple(one for one in self._health_wanted if one != refused)
        return [Trouble(stamp, f"Ping: message {refused} refused ({reason})")]

    def _ask_health(self, stamp: Stamp) -> list[Output]:
        self._health_asked, self._health = stamp, {}
        data = b"".join(map(protocol.request, self._health_wanted))
        return [Send(data)] if data else []

    def _on_health(self, frame: PingFrame, stamp: Stamp) -> list[Output]:
        """Collect what was asked for; the last answer completes the reading."""
        self._health[frame.id] = int.from_bytes(frame.payload, "little")
        if not self._running or self._health_wanted[-1:] != (frame.id,):
            return []
        millivolts, *hundredths = (self._health.get(one, math.nan) for one in HEALTH[1:])
        health = SonarHealth(
            self._health.get(protocol.DEVICE_ID), 0.001 * millivolts, *(0.01 * one for one in hundredths)
        )
        return [Stamped(stamp, health), *self._check_supply(health.supply_V, stamp)]

    def _check_supply(self, supply_V: float, stamp: Stamp) -> list[Output]:
        """Report a supply that the sonar is not made for, once until it is well again."""
        low, high = SUPPLY_V
        reported, self._supply_reported = self._supply_reported, supply_V < low or supply_V > high
        if reported or not self._supply_reported:
            return []
        return [Trouble(stamp, f"Ping: supply {supply_V:.2f} V, wanted {low} to {high} V; check cable and regulator")]

    def _check_setting(self, frame: PingFrame, stamp: Stamp) -> list[Output]:
        """Compare a reported setting with the wanted one; a mismatch is sent again after the timeout."""
        if not self._orders[0].holds(frame):
            self._acked = False
            self._found = int.from_bytes(frame.payload, "little")
            return []
        self._answered(stamp)
        return self._next_order(stamp)

    def _on_text(self, frame: PingFrame, stamp: Stamp) -> list[Output]:
        text = frame.payload.decode("ascii", "replace").strip("\0\r\n ")
        return [Stamped(stamp, DeviceText(text))] if text else []

    def _on_simple(self, frame: PingFrame, stamp: Stamp) -> list[Output]:
        if not self._running:
            return []
        distance_mm, percent = protocol.simple(frame)
        refused = self._refusal(distance_mm, percent)
        if refused:
            return [Rejected(stamp, refused, frame.payload)]
        self._fresh = stamp
        at = self._echo_stamp(stamp, self._age_s(frame, distance_mm))
        return [Stamped(at, Echo(distance_mm * 0.001, percent * 0.01))]

    def _on_echo(self, frame: PingFrame, stamp: Stamp) -> list[Output]:
        if not self._running:
            return []
        if not self._streaming:
            self._answered(stamp)
        message = protocol.echo(frame)
        if message is None:
            return [Rejected(stamp, reject(RejectCode.COUNT, "profile"), frame.payload)]
        outputs = self._check_number(message, stamp)
        if outputs is None:
            return []
        if not self._running:
            # A restarted sonar uses its own settings until it is set up again.
            return outputs
        reach_mm = message.start_mm + message.length_mm
        refused = self._refusal(message.distance_mm, message.confidence, reach_mm)
        if refused:
            return [*outputs, Rejected(stamp, refused, frame.payload)]
        at = self._echo_stamp(stamp, self._age_s(frame, 2 * reach_mm - message.distance_mm))
        return [*outputs, *(Stamped(at, reading) for reading in self._readings(message))]

    def _readings(self, message: EchoMessage) -> list[Echo | EchoProfile]:
        range_m, confidence = message.distance_mm * 0.001, message.confidence * 0.01
        echo = Echo(range_m, confidence, message.ping_number)
        if not self._profile_wanted or not message.strength:
            return [echo]
        self._profile_wanted = self._knobs.profile
        scan = (message.start_mm * 0.001, message.length_mm * 0.001)
        return [echo, EchoProfile(range_m, confidence, message.ping_number, *scan, message.gain, message.strength)]

    def _refusal(self, distance_mm: int, percent: int, reach_mm: int = FARTHEST_mm) -> Reject | None:
        """Why a distance is refused; None when it is not."""
        if percent > 100 or not 0 < distance_mm <= reach_mm <= FARTHEST_mm:
            return reject(RejectCode.RANGE, "distance")
        least = self._knobs.min_confidence
        if percent * 0.01 >= least:
            return None
        found = f"confidence {percent} %, wanted {100.0 * least:.0f} %; nothing there, or nearer than it can see?"
        return reject(RejectCode.CONFIDENCE, "distance", found=found)

    def _age_s(self, frame: PingFrame, path_mm: int) -> float:
        """Age of an echo when the last byte of its message arrives; `path_mm`: path of the sound after the echo."""
        on_wire_s = frame.size * 10.0 / self._knobs.baud
        return on_wire_s + path_mm * 0.001 / sound_mps(self._knobs, self._water) + self._knobs.latency_s

    def _echo_stamp(self, arrival: Stamp, age_s: float) -> Stamp:
        """Time of an echo, never before the previous one, unless the host's clock was set back."""
        at = after(arrival, -age_s)
        self._last_stamp = at if self._last_stamp > arrival else max(at, self._last_stamp)
        return self._last_stamp

    def _check_number(self, message: EchoMessage, stamp: Stamp) -> list[Output] | None:
        """Check the ping number: None for a repeated one; a restart and a gap are reported."""
        ahead = (message.ping_number - self._last_ping) & 0xFFFFFFFF if self._last_ping >= 0 else 1
        if ahead == 0:
            return None
        before, self._last_ping = self._last_ping, message.ping_number
        self._fresh = stamp
        if ahead >= HALF_COUNT:
            sentence = f"Ping: the sonar has restarted (ping {before}, then {message.ping_number}); setting it up again"
            return [Trouble(stamp, sentence), *self._wake(stamp)]
        if ahead == 1 or not self._streaming or seconds_between(self._gap_reported, stamp) < 10.0:
            return []
        self._gap_reported = stamp
        return [Trouble(stamp, f"Ping: {ahead - 1} pings lost before number {message.ping_number}")]

    def tick(self, stamp: Stamp) -> list[Output]:
        """Detect silence and foreign data (both restart the set-up); repeat settings; poll."""
        outputs: list[Output] = [*self._silence.tick(stamp)]
        waited_s = seconds_between(self._asked, stamp)
        if (self._running or self._orders) and self._silence.condition != "well":
            return [*outputs, *self._wake(stamp)]
        if self._running and seconds_between(self._fresh, stamp) > self._stall_s:
            sentence = f"Ping: no new ping for {self._stall_s:g} s although it answers; setting it up again"
            return [*outputs, Trouble(stamp, sentence), *self._wake(stamp)]
        if self._orders or not self._known:
            again = self._repeat_order if self._orders else self._wake
            return [*outputs, *(again(stamp) if waited_s >= self._knobs.answer_s else [])]
        if seconds_between(self._health_asked, stamp) >= HEALTH_EVERY_S:
            outputs += self._ask_health(stamp)
        return [*outputs, *self._poll(stamp, waited_s)]

    def _repeat_order(self, stamp: Stamp) -> list[Output]:
        order = self._orders[0]
        if self._acked and order.proof != protocol.PROFILE:
            return self._next_order(stamp)
        if self._tries >= self._knobs.tries:
            found = "no answer" if self._found is None else self._found
            wanted = int.from_bytes(order.payload, "little")
            sentence = f"{order.name} after {self._tries} tries: found {found}, wanted {wanted}; check the firmware"
            return [Trouble(stamp, f"Ping: {sentence}"), *self._next_order(stamp, given_up=True)]
        self._tries += 1
        return self._ask(Send(order.frames), stamp)

    def _poll(self, stamp: Stamp, waited_s: float) -> list[Output]:
        if self._streaming or waited_s < (self._knobs.answer_s if self._waiting else self._knobs.interval_s):
            return []
        message = protocol.PROFILE if self._profile_wanted else protocol.DISTANCE
        return self._ask(Send(protocol.request(message)), stamp)


DRIVER = Driver(Ping1dKnobs, lambda knobs, _mount, vehicle: Ping1d(knobs, vehicle.water))
