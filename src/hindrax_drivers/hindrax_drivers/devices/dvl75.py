"""Cerulean DVL-75 Doppler velocity log; a Tracker 650 is understood too.

$DVPDL says by how much the vehicle has moved in the interval before its time tag. Velocity is that over the interval:
a mean, so it is stamped with the middle of the interval, on the device's clock mapped to ROS time.

Each delta is rounded to 1 mm on its own when it is printed (captured lines show -0.000, which a carried remainder would
never give), so its error is uniform over 1 mm, with standard deviation 1 mm / sqrt(12), and independent from
one sentence to the next: 5.8 mm/s at 20 Hz. The instrument's own noise is a floor beside it.

$DVPDL is off in the factory settings. When the device talks and no delta comes, `SEND-DVPDL ON` is sent, a few
times at most: the setting is kept in flash. Every other setting is touched only by `setup_commands`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping

from hindrax_core.device import Identity, Output, Send, Trouble
from hindrax_core.events import NS_PER_S, Rejected, Stamp, Stamped, seconds_between
from hindrax_core.readings import BottomVelocity, DeviceText, Echo, Vec3
from hindrax_drivers.devices import dvl75_protocol as protocol
from hindrax_drivers.devices.dvl75_settings import DEFAULT_KNOBS, Dvl75Knobs, commands, setup_commands, wanted_settings
from hindrax_drivers.devices.nmea import MAX_LINE, LineSplitter, SentenceError, require_numbers, split_verified
from hindrax_drivers.devices.vigil import Vigil
from hindrax_drivers.driver import Driver, in_water
from hindrax_drivers.timebase import Break, Timebase, TimebaseKnobs

__all__ = ["Dvl75", "Dvl75Knobs", "setup_commands"]

ASK_CONFIGURATION = b"\nCONFIGURATION\n"
ENABLE_DELTAS = b"SEND-DVPDL ON\n"
SHORTEST_us, LONGEST_us = 20_000, 1_000_000
"""Believable intervals: the page says 5 to 20 Hz, which is 50 to 200 ms."""
ROUNDING_VARIANCE_m2 = protocol.POSITION_STEP_m**2 / 12.0


class Dvl75:
    """Serial device: sentences in, BottomVelocity, BottomTrack, DeviceText (and Echo of a Tracker 650) out."""

    def __init__(self, knobs: Dvl75Knobs = DEFAULT_KNOBS) -> None:
        self._knobs = knobs
        self._min_confidence = knobs.min_confidence
        self._max_speed_mps = knobs.max_speed_mps
        self._axis_sign = knobs.axis_sign
        self._floor_variance = knobs.sigma_floor_mps**2
        self._vigil = Vigil("DVL", f"$DV sentences at {knobs.baud} baud", knobs.stall_s)
        self._lines = LineSplitter()
        self._clock = Timebase(
            1e-6,
            TimebaseKnobs(drift_ppm=knobs.clock_drift_ppm, latency_s=knobs.latency_s),
            told=self._clock_broke,
        )
        self._takers: dict[bytes, Callable[[list[bytes], bytes, Stamp], Iterable[Output]]] = {
            b"DVPDX": self._take_delta,
            b"DVEXT": self._take_extended,
            b"DVNVM": self._take_configuration,
            b"DVTXT": self._take_text,
            b"DVKFA": self._take_kalman,
            b"DVKFC": self._take_counted,
            b"GPRMC": self._take_counted,
        }
        self._counts: Counter[bytes] = Counter()
        self._configuration: dict[str, str] = {}
        self._forget(Stamp(0))

    def _forget(self, stamp: Stamp) -> None:
        """State of a line that has just been opened."""
        self._lines.clear()
        self._clock.restart()
        self._identity = ""
        self._last_us = -1
        self._last_tag = self._last_extended = b""
        self._last_stamp = self._last_track = Stamp(0)
        self._moved = self._asked = stamp
        self._tries = 0
        self._vigil.restart(stamp)
        self._troubles: list[Trouble] = []

    @property
    def baud(self) -> int:
        """Line speed."""
        return self._knobs.baud

    @property
    def ready(self) -> bool:
        """Whether a Cerulean DVL has been recognized and its deltas keep coming."""
        return bool(self._identity) and self._last_us >= 0 and self._vigil.condition == "well" and self._tries == 0

    @property
    def counts(self) -> Mapping[str, int]:
        """Verified sentences by tag, whether or not a reading came of them."""
        return {tag.decode("ascii"): count for tag, count in self._counts.items()}

    @property
    def configuration(self) -> Mapping[str, str]:
        """What the device last said about its settings; empty until it did."""
        return self._configuration

    def start(self, stamp: Stamp) -> list[Output]:
        """Ask who is there. Settings are not touched."""
        self._forget(stamp)
        return [Send(ASK_CONFIGURATION)]

    def feed(self, data: bytes, stamp: Stamp) -> list[Output]:
        """Decode what has arrived; what is refused comes back as Rejected, in the order of the bytes."""
        self._vigil.heard = stamp
        outputs: list[Output] = []
        for line in self._lines.feed(data):
            try:
                outputs += self._take(line, stamp)
            except SentenceError as bad:
                outputs.append(Rejected(stamp, f"{_name(line)}: {bad}", line))
        if self._troubles:
            outputs += self._troubles
            self._troubles = []
        return outputs

    def _take(self, line: bytes, stamp: Stamp) -> Iterable[Output]:
        if line.startswith(b"$DVPDL,"):
            return self._take_delta(split_verified(line), line, stamp)
        if len(line) >= MAX_LINE:
            raise SentenceError("length")
        if line[:1] != b"$":
            return self._take_plain(line, stamp)
        if line[:6] == b"$DVTXT" and line[-3:-2] != b"*":
            return self._take_text(line[1:].split(b",", 1), line, stamp)
        fields = split_verified(line)
        taker = self._takers.get(fields[0])
        if taker is None:
            raise SentenceError("unknown")
        self._vigil.understood = stamp
        return taker(fields, line, stamp)

    def _take_delta(self, fields: list[bytes], line: bytes, stamp: Stamp) -> list[Output]:
        require_numbers(line[6:-3])
        tag = fields[0]
        now_us, span_us, moved, percent = protocol.position_delta(fields if tag == b"DVPDL" else fields[:10])
        if not (0 <= now_us < protocol.CLOCK_END_US and SHORTEST_us <= span_us <= LONGEST_us and 0 <= percent <= 100):
            raise SentenceError("range")
        if now_us == self._last_us:
            if tag == self._last_tag:
                raise SentenceError("repeated")
            self._counts[tag] += 1
            self._last_tag = tag
            return self._standoff(fields, percent, self._last_stamp) if tag == b"DVPDX" else []
        if 0 < now_us - self._last_us < 0.9 * span_us and self._last_us >= 0:
            raise SentenceError("overlap")
        reading = self._velocity(moved, span_us, percent, now_us)
        at = self._middle(now_us, span_us, stamp)
        self._counts[tag] += 1
        self._last_us, self._last_tag = now_us, tag
        self._moved = self._vigil.understood = stamp
        self._tries = 0
        outputs: list[Output] = [Stamped(at, reading)]
        if tag == b"DVPDX":
            outputs += self._standoff(fields, percent, at)
        if not self._identity:
            outputs += self._identify("DVL-75" if tag == b"DVPDL" else "Tracker 650")
        return outputs

    def _standoff(self, fields: list[bytes], percent: int, at: Stamp) -> list[Output]:
        """Altitude of a Tracker 650: a $DVPDX tells it, for as long as the bottom is followed."""
        confidence = percent * 0.01
        return [Stamped(at, Echo(protocol.standoff(fields), confidence))] if confidence >= self._min_confidence else []

    def _middle(self, end_us: int, span_us: int, arrival: Stamp) -> Stamp:
        """Middle of an interval of which the device says when it ended; never before the one before."""
        middle = self._clock.map(end_us, arrival) - span_us * 500
        self._last_stamp = Stamp(max(self._last_stamp, middle))
        return self._last_stamp

    def _velocity(self, moved: Vec3, span_us: int, percent: int, now_us: int) -> BottomVelocity:
        """Mean velocity over the interval, or none while the confidence is low: the deltas are then zeros or bogus."""
        span_s = span_us * 1e-6
        confidence = percent * 0.01
        if confidence < self._min_confidence:
            return BottomVelocity(None, math.inf, confidence, span_s, now_us)
        x, y, z = moved
        reach = self._max_speed_mps * span_s
        if not (-reach <= x <= reach and -reach <= y <= reach and -reach <= z <= reach):
            raise SentenceError("range")
        sx, sy, sz = self._axis_sign
        velocity = (sx * x / span_s, sy * y / span_s, sz * z / span_s)
        sigma = math.sqrt(self._floor_variance + ROUNDING_VARIANCE_m2 / (span_s * span_s))
        return BottomVelocity(velocity, sigma, confidence, span_s, now_us)

    def _take_extended(self, fields: list[bytes], line: bytes, stamp: Stamp) -> list[Output]:
        """$DVEXT carries no time: it is stamped with the start of its transmission, and never before the last one."""
        if line == self._last_extended:
            # Four beams measured to a tenth of a millimetre per second do not come out the same twice.
            raise SentenceError("repeated")
        track = protocol.extended(fields, self._knobs.attitude_sign)
        self._last_extended = line
        self._counts[b"DVEXT"] += 1
        on_wire_ns = round((len(line) + 2) * 10 * NS_PER_S / self._knobs.baud)
        self._last_track = min(stamp, max(self._last_track, Stamp(stamp - on_wire_ns)))
        return [*self._identify("DVL-75"), Stamped(self._last_track, track)]

    def _take_configuration(self, fields: list[bytes], _: bytes, stamp: Stamp) -> list[Output]:
        self._counts[b"DVNVM"] += 1
        self._configuration = protocol.configuration(fields)
        self._identity = self._configuration.get("Model", "DVL-75")
        firmware = self._configuration.get("Firmware", "unknown")
        outputs: list[Output] = [Identity(f"Cerulean {self._identity}, firmware {firmware}")]
        wanted = wanted_settings(self._knobs)
        for key in ("Speed of sound", "Velocity adjustment"):
            found = self._configuration.get(key)
            if found is not None and commands({key: found}, {key: wanted[key]}):
                sentence = f"DVL {key.lower()}: found {found}, wanted {wanted[key]}; run hindrax dvl setup"
                outputs.append(Trouble(stamp, sentence))
        return outputs

    def _take_text(self, fields: list[bytes], _: bytes, stamp: Stamp) -> list[Output]:
        self._counts[b"DVTXT"] += 1
        text = b",".join(fields[1:])
        if not _printable(text):
            raise SentenceError("text")
        return [Stamped(stamp, DeviceText(text.decode("ascii").strip()))]

    def _take_kalman(self, fields: list[bytes], _: bytes, __: Stamp) -> list[Output]:
        protocol.kalman_header(fields)
        self._counts[b"DVKFA"] += 1
        return self._identify("DVL-75")

    def _take_counted(self, fields: list[bytes], _: bytes, __: Stamp) -> list[Output]:
        """Recognized, of no use here: the vehicle's own position, raw beams of a Tracker 650."""
        self._counts[fields[0]] += 1
        return []

    def _take_plain(self, line: bytes, stamp: Stamp) -> list[Output]:
        """A line that is no sentence: boot messages and answers to commands, or the rest of a sentence cut in two."""
        if line[:4] == b"IMU:":
            protocol.retweet(line)
            self._counts[b"IMU"] += 1
            return []
        if line[-3:-2] == b"*":
            raise SentenceError("cut")
        if not _printable(line) or line.upper() == line.lower():
            raise SentenceError("text")
        return [Stamped(stamp, DeviceText(line.decode("ascii").strip()))]

    def _identify(self, model: str) -> list[Output]:
        if self._identity:
            return []
        self._identity = model
        return [Identity(f"Cerulean {model}")]

    def _clock_broke(self, one: Break) -> None:
        self._last_stamp = Stamp(0) if one.kind == "host step" else self._last_stamp
        what = {"reset": "has restarted", "jump": "leapt", "host step": "goes on, but the host's was set back"}
        sentence = f"DVL clock {what.get(one.kind, 'wrapped')} at {one.ticks} us (by {one.shift_s:.3f} s)"
        self._troubles.append(Trouble(one.arrival, f"{sentence}; stamps start anew"))

    def tick(self, stamp: Stamp) -> list[Output]:
        """Notice silence, foreign talk and missing deltas; ask for deltas of a DVL, and of a line that is silent."""
        troubles = self._vigil.tick(stamp)
        stranger = not self._identity and self._vigil.condition != "silent"
        if stranger or self._vigil.condition == "foreign":
            return [*troubles]
        return [*troubles, *self._ask_for_deltas(stamp)]

    def _ask_for_deltas(self, stamp: Stamp) -> list[Output]:
        if seconds_between(max(self._moved, self._asked), stamp) < self._knobs.enable_after_s:
            return []
        self._asked = stamp
        self._tries += 1
        if self._tries <= self._knobs.enable_tries:
            return [Send(ENABLE_DELTAS)]
        if self._tries > self._knobs.enable_tries + 1:
            return []
        return [Trouble(stamp, f"DVL: no $DVPDL after {self._tries - 1} requests; check its firmware and settings")]


_KNOWN = (b"DVPDL", b"DVPDX", b"DVEXT", b"DVNVM", b"DVTXT", b"DVKFA", b"DVKFC", b"GPRMC")


def _name(line: bytes) -> str:
    """Name for a refused line: its tag where that is a known one, so that reasons stay countable."""
    if line[:1] != b"$":
        return "line"
    return line[1:6].decode("ascii") if line[1:6] in _KNOWN else "sentence"


def _printable(text: bytes) -> bool:
    return text.isascii() and text.replace(b"\t", b" ").decode("ascii").isprintable()


DRIVER = Driver(Dvl75Knobs, lambda knobs, _mount, vehicle: Dvl75(in_water(knobs, vehicle)))
