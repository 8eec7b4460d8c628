"""Cerulean DVL-75 Doppler velocity log; a Tracker 650 is supported too.

$DVPDL gives the displacement of the vehicle in the interval before its time tag. Velocity is that over the interval:
a mean, so it is stamped with the middle of the interval, on the device's clock mapped to ROS time.

Each delta is rounded to 1 mm on its own when it is printed (captured lines show -0.000, which a carried remainder would
never give), so its error is uniform over 1 mm, with standard deviation 1 mm / sqrt(12), and independent from
one sentence to the next: 5.8 mm/s at 20 Hz. The instrument's own noise is a floor beside it.

$DVPDL is off in the factory settings. When the device talks and no delta comes, `SEND-DVPDL ON` is sent, a few
times at most: the setting is kept in flash. Every other setting is touched only by `hindrax dvl setup`.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from hindrax_core.driver_interface import Identity, Output, Send, Trouble
from hindrax_core.events import NS_PER_S, Rejected, Stamp, Stamped, seconds_between
from hindrax_core.hydrostatics import Water
from hindrax_core.readings import BottomVelocity, DeviceText, Echo, Vec3
from hindrax_core.rejects import RejectCode, reject
from hindrax_drivers.devices.dvl75_settings import DEFAULT_KNOBS, FRESH_WATER, Dvl75Knobs, commands, wanted_settings
from hindrax_drivers.driver import Driver, SilenceMonitor
from hindrax_drivers.protocols import dvl75_protocol as protocol
from hindrax_drivers.timebase import Break, Timebase, came_again

ASK_CONFIGURATION = b"\nCONFIGURATION\n"
ENABLE_DELTAS = b"SEND-DVPDL ON\n"
RETWEET = b"GPS:"
"""Prefix of the sentences of a GPS. Page "Re-Tweeted GPS Messages"."""
SHORTEST_us, LONGEST_us = 20_000, 1_000_000
"""Plausible intervals: the page says 5 to 20 Hz, which is 50 to 200 ms."""
ROUNDING_VARIANCE_m2 = protocol.POSITION_STEP_m**2 / 12.0


class Dvl75:
    """Serial device: sentences in; BottomVelocity, BottomTrack, Position, KalmanSupport, DeviceText out.

    A Tracker 650 gives its altitude as an Echo.
    """

    def __init__(self, knobs: Dvl75Knobs = DEFAULT_KNOBS, water: Water = FRESH_WATER) -> None:
        self._knobs, self._water, self.baud = knobs, water, knobs.baud
        self._silence = SilenceMonitor("DVL", f"$DV sentences at {knobs.baud} baud", knobs.stall_s)
        drift_ppm, latency_s = knobs.clock_drift_ppm, knobs.latency_s
        self._clock = Timebase(1e-6, drift_ppm=drift_ppm, latency_s=latency_s, on_break=self._on_clock_break)
        self._handlers: dict[bytes, Callable[[list[bytes], bytes, Stamp], Iterable[Output]]] = {
            b"DVPDX": self._on_delta,
            b"DVEXT": self._on_extended,
            b"DVNVM": self._on_configuration,
            b"DVTXT": self._on_text,
            b"DVKFA": self._on_kalman,
            b"DVKFC": self._on_known,
            b"GPRMC": self._on_minimum,
        }
        self.configuration: Mapping[str, str] = {}
        """Last reported settings of the device; empty before the first report."""
        self._reset(Stamp(0))

    def _reset(self, stamp: Stamp) -> None:
        """Reset to the state after opening the line."""
        self._lines = protocol.LineSplitter()
        self._clock.restart()
        self._retweet = False
        self._identity = ""
        self._last_us = -1
        self._last_tag = self._last_extended = b""
        self._last_stamp = self._last_track = Stamp(0)
        self._moved = self._asked = stamp
        self._requests = 0
        self._silence.restart(stamp)
        self._troubles: list[Trouble] = []

    @property
    def ready(self) -> bool:
        """Whether a Cerulean DVL has been recognized and its deltas keep coming."""
        return bool(self._identity) and self._last_us >= 0 and self._silence.condition == "well" and self._requests == 0

    def start(self, stamp: Stamp) -> list[Output]:
        """Request the identity. Settings are not changed."""
        self._reset(stamp)
        return [Send(ASK_CONFIGURATION)]

    def feed(self, data: bytes, stamp: Stamp) -> list[Output]:
        """Decode received bytes; invalid ones come back as Rejected, in the order of the bytes."""
        self._silence.last_byte = stamp
        outputs: list[Output] = []
        for line in self._lines.feed(data):
            try:
                outputs += self._on_line(line, stamp)
            except protocol.SentenceError as bad:
                outputs.append(Rejected(stamp, reject(bad.code, _name(line)), line))
        outputs += self._troubles
        self._troubles = []
        return outputs

    def _on_line(self, line: bytes, stamp: Stamp) -> Iterable[Output]:
        if line.startswith(b"$DVPDL,"):
            return self._on_delta(protocol.split_verified(line), line, stamp)
        if len(line) >= protocol.MAX_LINE:
            raise protocol.SentenceError(RejectCode.LENGTH)
        retweet, self._retweet = self._retweet, line == RETWEET
        if line[:1] != b"$":
            return self._on_plain(line, stamp)
        if line[:6] == b"$DVTXT" and line[-3:-2] != b"*":
            return self._on_text(line[1:].split(b",", 1), line, stamp)
        fields = protocol.split_verified(line)
        if retweet and not fields[0].startswith(b"DV"):
            return self._on_known(fields, line, stamp)
        handler = self._handlers.get(fields[0])
        if handler is None:
            raise protocol.SentenceError(RejectCode.UNKNOWN)
        self._silence.last_valid = stamp
        return handler(fields, line, stamp)

    def _on_delta(self, fields: list[bytes], line: bytes, stamp: Stamp) -> list[Output]:
        protocol.require_numbers(line[6:-3])
        tag = fields[0]
        now_us, span_us, moved, percent = protocol.position_delta(fields if tag == b"DVPDL" else fields[:10])
        if not (0 <= now_us < protocol.CLOCK_END_US and SHORTEST_us <= span_us <= LONGEST_us and 0 <= percent <= 100):
            raise protocol.SentenceError(RejectCode.RANGE)
        if now_us == self._last_us:
            if tag == self._last_tag:
                raise protocol.SentenceError(RejectCode.REPEATED)
            self._last_tag = tag
            return self._standoff(fields, percent, self._last_stamp)
        if came_again(self._last_us, now_us):
            raise protocol.SentenceError(RejectCode.REPEATED)
        if 0 < now_us - self._last_us < 0.9 * span_us and self._last_us >= 0:
            raise protocol.SentenceError(RejectCode.OVERLAP)
        reading = self._velocity(moved, span_us, percent, now_us)
        middle = self._clock.map(now_us, stamp) - span_us * 500
        at = self._last_stamp = Stamp(max(self._last_stamp, middle))  # never before the previous one
        self._last_us, self._last_tag = now_us, tag
        self._moved = self._silence.last_valid = stamp
        self._requests = 0
        standoff = self._standoff(fields, percent, at)
        return [Stamped(at, reading), *standoff, *self._identify("DVL-75" if tag == b"DVPDL" else "Tracker 650")]

    def _standoff(self, fields: list[bytes], percent: int, at: Stamp) -> list[Output]:
        """Altitude of a Tracker 650 from its $DVPDX, while it tracks the bottom."""
        confidence = percent * 0.01
        if fields[0] != b"DVPDX" or confidence < self._knobs.min_confidence:
            return []
        return [Stamped(at, Echo(protocol.standoff(fields), confidence))]

    def _velocity(self, moved: Vec3, span_us: int, percent: int, now_us: int) -> BottomVelocity:
        """Mean velocity over the interval, or none at low confidence, when the deltas are zero or invalid."""
        span_s = span_us * 1e-6
        confidence = percent * 0.01
        if confidence < self._knobs.min_confidence:
            return BottomVelocity(None, math.inf, confidence, span_s, now_us)
        x, y, z = moved
        reach = self._knobs.max_speed_mps * span_s
        if not (-reach <= x <= reach and -reach <= y <= reach and -reach <= z <= reach):
            raise protocol.SentenceError(RejectCode.RANGE)
        sx, sy, sz = self._knobs.axis_sign
        velocity = (sx * x / span_s, sy * y / span_s, sz * z / span_s)
        sigma = math.sqrt(self._knobs.sigma_floor_mps**2 + ROUNDING_VARIANCE_m2 / (span_s * span_s))
        return BottomVelocity(velocity, sigma, confidence, span_s, now_us)

    def _on_extended(self, fields: list[bytes], line: bytes, stamp: Stamp) -> list[Output]:
        """Decode $DVEXT. It has no time: its stamp is the start of transmission, never before the last one."""
        if line == self._last_extended:
            # Four beams measured to a tenth of a millimetre per second do not come out the same twice.
            raise protocol.SentenceError(RejectCode.REPEATED)
        track = protocol.extended(fields, self._knobs.attitude_sign)
        self._last_extended = line
        on_wire_ns = round((len(line) + 2) * 10 * NS_PER_S / self._knobs.baud)
        self._last_track = min(stamp, max(self._last_track, Stamp(stamp - on_wire_ns)))
        outputs: list[Output] = [*self._identify("DVL-75"), Stamped(self._last_track, track)]
        place = protocol.position(fields)
        return outputs if place is None else [*outputs, Stamped(self._last_track, place)]

    def _on_configuration(self, fields: list[bytes], _: bytes, stamp: Stamp) -> list[Output]:
        self.configuration = protocol.configuration(fields)
        self._identity = self.configuration.get("Model", "DVL-75")
        firmware = self.configuration.get("Firmware", "unknown")
        outputs: list[Output] = [Identity(f"Cerulean {self._identity}, firmware {firmware}")]
        wanted = wanted_settings(self._knobs, water=self._water)
        for key in ("Speed of sound", "Velocity adjustment"):
            found = self.configuration.get(key)
            if found is not None and commands({key: found}, {key: wanted[key]}):
                sentence = f"DVL {key.lower()}: found {found}, wanted {wanted[key]}; run ./hindrax dvl setup"
                outputs.append(Trouble(stamp, sentence))
        return outputs

    def _on_text(self, fields: list[bytes], _: bytes, stamp: Stamp) -> list[Output]:
        text = b",".join(fields[1:])
        if not _printable(text):
            raise protocol.SentenceError(RejectCode.TEXT)
        return [Stamped(stamp, DeviceText(text.decode("ascii").strip()))]

    def _on_kalman(self, fields: list[bytes], _: bytes, stamp: Stamp) -> list[Output]:
        support = protocol.kalman_support(fields)
        return [*self._identify("DVL-75"), Stamped(stamp, support)]

    def _on_minimum(self, fields: list[bytes], _: bytes, stamp: Stamp) -> list[Output]:
        """Decode the device's own $GPRMC; $DVEXT has the same place with more digits."""
        place = protocol.recommended_minimum(fields)
        return [] if place is None or self._last_extended else [Stamped(stamp, place)]

    def _on_known(self, _fields: list[bytes], _line: bytes, stamp: Stamp) -> list[Output]:
        """Take a sentence without use here for a sign of life: a GPS behind the DVL, raw beams of a Tracker 650."""
        self._silence.last_valid = stamp
        return []

    def _on_plain(self, line: bytes, stamp: Stamp) -> Sequence[Output]:
        """Handle a line that is no sentence: boot message, answer to a command, or a fragment of a sentence."""
        if line == RETWEET:
            return ()
        if line[:4] == b"IMU:":
            protocol.retweet(line)
            return []
        if line[-3:-2] == b"*":
            raise protocol.SentenceError(RejectCode.CUT)
        if not _printable(line) or line.upper() == line.lower():
            raise protocol.SentenceError(RejectCode.TEXT)
        return [Stamped(stamp, DeviceText(line.decode("ascii").strip()))]

    def _identify(self, model: str) -> list[Output]:
        if self._identity:
            return []
        self._identity = model
        return [Identity(f"Cerulean {model}")]

    def _on_clock_break(self, one: Break) -> None:
        self._last_stamp = Stamp(0) if one.kind == "host step" else self._last_stamp
        what = {"reset": "has restarted", "jump": "leapt", "host step": "goes on, but the host's was set back"}
        sentence = f"DVL clock {what[one.kind]} at {one.ticks} us (by {one.shift_s:.3f} s)"
        self._troubles.append(Trouble(one.arrival, f"{sentence}; stamps restart"))

    def tick(self, stamp: Stamp) -> list[Output]:
        """Detect silence, foreign data and missing deltas; request deltas of a DVL and on a silent line."""
        troubles = self._silence.tick(stamp)
        stranger = not self._identity and self._silence.condition != "silent"
        if stranger or self._silence.condition == "foreign":
            return [*troubles]
        return [*troubles, *self._ask_for_deltas(stamp)]

    def _ask_for_deltas(self, stamp: Stamp) -> list[Output]:
        if seconds_between(max(self._moved, self._asked), stamp) < self._knobs.enable_after_s:
            return []
        self._asked = stamp
        self._requests += 1
        if self._requests <= self._knobs.enable_tries:
            return [Send(ENABLE_DELTAS)]
        if self._requests > self._knobs.enable_tries + 1:
            return []
        return [Trouble(stamp, f"DVL: no $DVPDL after {self._requests - 1} requests; check its firmware and settings")]


_KNOWN = (b"DVPDL", b"DVPDX", b"DVEXT", b"DVNVM", b"DVTXT", b"DVKFA", b"DVKFC", b"GPRMC")


def _name(line: bytes) -> str:
    """Name of a refused line: its tag if known, so that the set of reasons stays small."""
    if line[:1] != b"$":
        return "line"
    return line[1:6].decode("ascii") if line[1:6] in _KNOWN else "sentence"


def _printable(text: bytes) -> bool:
    return text.isascii() and text.replace(b"\t", b" ").decode("ascii").isprintable()


DRIVER = Driver(Dvl75Knobs, lambda knobs, _mount, vehicle: Dvl75(knobs, vehicle.water), looking={"enable_tries": 0})
"""Its enable command would be written to the flash."""
