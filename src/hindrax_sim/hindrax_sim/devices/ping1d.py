"""A Blue Robotics Ping1D as ping-protocol describes it (docs/index.md, definitions common.json and ping1d.json).

Assumptions where the definitions have gaps: the sonar sends when the whole scan has been received and 2 ms have gone
into it; settings are lost with the power; in automatic mode the scan reaches to about twice the distance found,
the gain grows with it; an answer is about the last ping that is complete.
"""

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_core.readings import DeviceText, Echo, SonarHealth
from hindrax_sim.devices.emulator import BaudRateLine, Emulator, Part

PROCESSING_S = 0.002
BAUD = 115200
SAMPLES = 200
DEFAULT_INTERVAL_ms = 100
SHORTEST_m, FARTHEST_m = 0.3, 100.0
SATURATED_mm = 0xFFFFFFFF
PING1D, PING360 = 1, 2
ACK, NACK, GENERAL_REQUEST = 1, 2, 6
ANY = range(1, 65)
SETTINGS: Mapping[int, tuple[str, Sequence[int], range]] = {
    100: ("device_id", (1,), range(256)),
    1000: ("device_id", (1,), range(256)),
    1002: ("speed_mmps", (4,), range(1, 1 << 32)),
    1003: ("auto", ANY, range(2)),
    1004: ("interval_ms", (2,), range(1, 1 << 16)),
    1005: ("gain", ANY, range(7)),
    1006: ("enabled", ANY, range(2)),
}
"""Setting, sizes of the payload and values of the messages that change one."""


@dataclass(frozen=True, slots=True)
class PingTruth:
    """Truth of a sonar: distance to the first echo along the beam (None: no echo), and the water."""

    distance_m: float | None = 2.0
    confidence: float = 1.0
    speed_of_sound_mps: float = 1484.0


@dataclass(slots=True)
class _Settings:
    """Settings in the units of the protocol, with the defaults of power-up."""

    start_mm: int = 0
    length_mm: int = 5000
    speed_mmps: int = 1_500_000
    auto: int = 1
    interval_ms: int = DEFAULT_INTERVAL_ms
    gain: int = 1
    enabled: int = 1
    stream: int = 0
    device_id: int = 1


@dataclass(frozen=True, slots=True)
class _Ping:
    """A complete ping: content of messages 1211, 1212 and 1300."""

    number: int = 0
    distance_mm: int = 0
    confidence: int = 0
    start_mm: int = 0
    length_mm: int = 5000
    gain: int = 1
    strength: bytes = bytes(SAMPLES)

    @property
    def head(self) -> bytes:
        """Payload of 1212, beginning of that of 1300."""
        fields = (self.number, self.start_mm, self.length_mm, self.gain)
        return struct.pack("<IHHIIII", self.distance_mm, self.confidence, 52, *fields)


class Ping1d(Part[PingTruth]):
    """One sonar; distances are noisy by half a percent (1 sigma). It may know no `continuous` mode.

    Disguised, it is a Ping360, which uses the same protocol.
    """

    def __init__(self, *, seed: int = 0, noise: float = 0.005, continuous: bool = True, supply_V: float = 5.0) -> None:
        super().__init__(PingTruth())
        self._continuous, self._supply_V = continuous, supply_V
        self._random = np.random.default_rng(seed)
        self._noise = noise
        self._wire = BaudRateLine(BAUD)
        self._stepped = False
        self._boot(0.0)

    def _boot(self, now_s: float) -> None:
        self._settings = _Settings()
        self._last = _Ping()
        self._bytes = b""
        self._begin(now_s)

    def _begin(self, now_s: float) -> None:
        """Send a ping: the scan ends when the echo of its end would arrive."""
        settings = self._settings
        self._started_s = now_s
        scan_s = 2.0 * (settings.start_mm + settings.length_mm) / settings.speed_mmps
        self._done_s = now_s + scan_s + PROCESSING_S if settings.enabled else math.inf

    def step(self, now_s: float) -> bytes:
        """Frames of the stream, if there is one, that are complete on the wire by now."""
        if not self._stepped:
            # Time starts with the first step: earlier pings are lost.
            self._stepped = True
            self._begin(now_s)
        while self._done_s <= now_s:
            done_s = self._done_s
            self._last = self._finish_ping()
            if self._settings.stream:
                self._wire.send(self._message(self._settings.stream), done_s)
            self._adapt_range()
            self._begin(max(self._started_s + self._settings.interval_ms * 0.001, done_s))
        return self._wire.receive_complete(now_s)

    def _finish_ping(self) -> _Ping:
        """Result of the ping: distance from the time of flight with the configured speed of sound."""
        settings, truth = self._settings, self._truth
        span = (settings.start_mm, settings.length_mm, settings.gain)
        number = (self._last.number + 1) & 0xFFFFFFFF
        if self._saturated:
            return _Ping(number, SATURATED_mm, 100, *span)
        reach_mm = settings.start_mm + settings.length_mm
        if truth.distance_m is not None and SHORTEST_m <= truth.distance_m <= FARTHEST_m:
            measured_m = truth.distance_m * (1.0 + self._noise * float(self._random.standard_normal()))
            measured_mm = round(measured_m * settings.speed_mmps / truth.speed_of_sound_mps)
            if settings.start_mm <= measured_mm <= reach_mm:
                confidence = round(100.0 * truth.confidence)
                return _Ping(number, measured_mm, confidence, *span, self._echo(measured_mm, confidence))
        nonsense_mm = int(self._random.integers(settings.start_mm, reach_mm))
        return _Ping(number, nonsense_mm, 0, *span, self._echo(nonsense_mm, 0))

    def _echo(self, distance_mm: int, confidence: int) -> bytes:
        """Noise floor, and a peak at the distance as high as the confidence."""
        strength = bytearray(self._random.integers(0, 24, SAMPLES, dtype=np.uint8).tobytes())
        at = (distance_mm - self._settings.start_mm) * SAMPLES // self._settings.length_mm
        for place, share in ((at - 1, 0.5), (at, 1.0), (at + 1, 0.5)):
            if 0 <= place < SAMPLES:
                strength[place] = max(strength[place], round(2.55 * confidence * share))
        return bytes(strength)

    def _adapt_range(self) -> None:
        """Automatic mode: scan twice the echo distance, at least 2 m; increase while there is no echo."""
        if not self._settings.auto:
            return
        found = self._last.confidence > 0
        wanted_mm = 2 * self._last.distance_mm if found else self._settings.length_mm * 3 // 2
        self._settings.start_mm = 0
        self._settings.length_mm = max(2000, min(wanted_mm, round(FARTHEST_m * 1000.0)))
        self._settings.gain = min(6, self._settings.length_mm // 5000)

    # ---- messages

    def _message(self, message: int) -> bytes:
        """Frame of a message the device can send; a NACK for any other."""
        maker = self._makers().get(message)
        if maker is None:
            return _frame(NACK, struct.pack("<H", message) + b"unknown message")
        return _frame(message, maker())

    def _makers(self) -> dict[int, Callable[[], bytes]]:
        settings, last, supply_mV = self._settings, self._last, round(1000.0 * self._supply_V)
        return {
            4: lambda: bytes([PING360 if self._disguised else PING1D, 2, 3, 28, 0, 0]),
            5: lambda: bytes([1, 0, 0, 0]),
            1200: lambda: struct.pack("<BBHH", PING1D, 2, 3, 28),
            1201: lambda: bytes([settings.device_id]),
            1202: lambda: struct.pack("<H", supply_mV),
            1203: lambda: struct.pack("<I", settings.speed_mmps),
            1204: lambda: struct.pack("<II", settings.start_mm, settings.length_mm),
            1205: lambda: bytes([settings.auto]),
            1206: lambda: struct.pack("<H", settings.interval_ms),
            1207: lambda: struct.pack("<I", settings.gain),
            1208: lambda: struct.pack("<H", 52),
            1210: lambda: struct.pack("<HHHHBB", 3, 28, supply_mV, settings.interval_ms, settings.gain, settings.auto),
            1211: lambda: struct.pack("<IB", last.distance_mm, last.confidence),
            1212: lambda: last.head,
            1213: lambda: struct.pack("<H", 3000),
            1214: lambda: struct.pack("<H", 2500),
            1215: lambda: bytes([settings.enabled]),
            1300: lambda: last.head + struct.pack("<H", SAMPLES) + last.strength,
        }

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Handle frames of the host. A message is requested by a general_request or by its own id, empty."""
        self._bytes += data
        answers = b""
        while (found := self._next_frame()) is not None:
            message, payload = found
            if message == GENERAL_REQUEST and len(payload) == 2:
                answers += self._message(int.from_bytes(payload, "little"))
            elif not payload:
                answers += self._message(message)
            else:
                answers += self._handle_message(message, payload, now_s)
        return answers

    def _next_frame(self) -> tuple[int, bytes] | None:
        """Cut the next good frame off the bytes received; None when more is needed."""
        while (start := self._bytes.find(b"BR")) >= 0 and len(self._bytes) >= start + 8:
            self._bytes = self._bytes[start:]
            length, message = struct.unpack_from("<HH", self._bytes, 2)
            if length <= 64 and len(self._bytes) < length + 10:
                return None
            total = sum(self._bytes[: length + 8]) & 0xFFFF
            if length <= 64 and total == int.from_bytes(self._bytes[length + 8 : length + 10], "little"):
                payload = self._bytes[8 : length + 8]
                self._bytes = self._bytes[length + 10 :]
                return message, payload
            self._bytes = self._bytes[2:]
        self._bytes = self._bytes[-9:] if start < 0 else self._bytes
        return None

    def _handle_message(self, message: int, payload: bytes, now_s: float) -> bytes:
        reason = "not a Ping1D" if self._disguised else self._set(message, payload)
        if reason:
            return _frame(NACK, struct.pack("<H", message) + reason.encode("ascii"))
        if message == 1006:
            self._begin(now_s)
        return _frame(ACK, struct.pack("<H", message))

    def _set(self, message: int, payload: bytes) -> str:
        """Change one setting; returns why not, or an empty text."""
        value = int.from_bytes(payload, "little")
        name, sizes, valid = SETTINGS.get(message, ("", (), range(0)))
        if len(payload) in sizes and value in valid:
            setattr(self._settings, name, value)
        elif message == 1001 and len(payload) == 8 and value >> 32 >= 1000:
            self._settings.start_mm, self._settings.length_mm = value & 0xFFFFFFFF, value >> 32
        elif message == 1400 and self._continuous and value in (1211, 1212, 1300):
            self._settings.stream = value
        elif message == 1401:
            self._settings.stream = 0
        else:
            return "bad value" if message in range(1001, 1007) or message == 1400 else "unknown message"
        return ""

    # ---- faults

    def power_cycle(self, now_s: float) -> None:
        """Restart: settings and ping number of power-up, no stream."""
        self._wire.clear()
        self._boot(now_s)

    def disguise(self, on: bool) -> None:
        """Fault: a Ping360 comes or goes, silent as after its power-up."""
        super().disguise(on)
        self._settings.stream = 0


def _frame(message: int, payload: bytes) -> bytes:
    body = struct.pack("<2sHHBB", b"BR", len(payload), message, 0, 0) + payload
    return body + struct.pack("<H", sum(body) & 0xFFFF)


HALF_BEAM_rad = math.radians(12.5)


def _agrees(truth: PingTruth, reading: object) -> bool:
    """Five sigma of half a percent, and the way of the bottom within a ping interval."""
    if not isinstance(reading, Echo):
        return isinstance(reading, DeviceText | SonarHealth)
    return truth.distance_m is not None and abs(reading.range_m - truth.distance_m) < 0.025 * truth.distance_m + 0.03


EMULATOR = Emulator(
    lambda seed: Ping1d(seed=seed),
    lambda world, at: PingTruth(world.echo_m(at, HALF_BEAM_rad)),
    lambda seconds: PingTruth(2.5 + 0.3 * math.sin(0.5 * seconds)),
    _agrees,
)
