"""A Cerulean DVL-75 as its pages describe it: docs.ceruleansonar.com, DVL-75, Communicating with the DVL.

Assumptions where the pages have gaps: deltas are rounded one by one when printed, without a carried
remainder (captured lines print -0.000, which a remainder would never give); $DVPDL goes out before $DVEXT; x, y, z
are forward, starboard, down; the interval is one of the three that the $DVKFA page calls standard, chosen by
altitude; a lock takes half a second to find and no time to lose.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from hindrax_core.readings import BottomTrack, BottomVelocity, DeviceText, Position, Vec3
from hindrax_core.rotation import matrix, minus, rotate
from hindrax_sim.devices import dvl75_sentences as sentences
from hindrax_sim.devices.dvl75_sentences import DvlSettings, DvlTruth
from hindrax_sim.devices.emulator import BaudRateLine, Emulator, Part
from hindrax_sim.physics.geometry import plus
from hindrax_sim.world import Mounting, World

__all__ = ["Dvl75", "DvlSettings", "DvlTruth"]

INTERVALS_us = ((15.0, 50_000), (35.0, 100_000), (math.inf, 200_000))
"""Altitude up to which an interval is used [m], interval [us of the device]."""
SEARCH_INTERVAL_us = 100_000
ALTITUDES_m = (0.1, 75.0)
LOCK_AFTER_S = 0.5
BOOT_S = 0.5
UP_S = 60.0
"""Time since its start when it is first looked at."""
BOOT_TEXT = b"DVL-75 starting\r\n"
FOREIGN = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"
"""The well-known example of NMEA 0183: output of a GPS receiver on the wrong port."""
SATURATED_m = (9.999, -9.999, 9.999)
BEAM_NOISE_mps = 0.003
NOWHERE: Vec3 = (0.0, 0.0, 0.0)
LONGEST_COMMAND = 256

M_PER_DEGREE = 1.1131884502145034e5
"""Metres per degree of latitude, as Cerulean's extension of BlueOS reckons."""
GPS_EVERY_S = 1.0

Change: TypeAlias = dict[str, Any]


def _switch(name: str) -> Callable[[str], Change | None]:
    return lambda text: {name: text == "ON"} if text in ("ON", "OFF") else None


def _scalar(name: str, low: float, high: float, kind: type = float) -> Callable[[str], Change | None]:
    def change(text: str) -> Change | None:
        (value,) = _numbers(text, 1) or (math.nan,)
        return {name: kind(value)} if low <= value <= high else None

    return change


SETTERS: Mapping[str, Callable[[str], Change | None]] = {
    "SEND-DVPDL": _switch("deltas"),
    "SEND-DVEXT": _switch("extended"),
    "SEND-FREEFORM": _switch("freeform"),
    "SEND-DVKFA": _switch("kalman"),
    "SEND-DVFKA": _switch("kalman"),  # so spelled in the page's table
    "SEND-GPRMC": _switch("minimum"),
    "RETWEET-GPS": _switch("retweet_gps"),
    "SET-SPEED-OF-SOUND": _scalar("speed_of_sound_mps", 1100.0, 1950.0),
    "SET-VELOCITY-ADJUSTMENT": _scalar("velocity_adjustment", 0.8, 1.25),
    "DECLINATION": _scalar("declination_deg", -180.0, 180.0),
    "HEADING-OFFSET": _scalar("heading_offset_deg", -360.0, 360.0),
    "SET-SENSOR-ORIENTATION": lambda text: {"orientation_deg": _numbers(text, 3)} if _numbers(text, 3) else None,
    "GRAB-IMU-CAL": lambda _: {"imu_calibrated": True},
    "VOID-IMU-CAL": lambda _: {"imu_calibrated": False},
    # OFF, or ten numbers: those that Cerulean's extension of BlueOS sends for a pool.
    "MANUAL-MODE": lambda text: {"pool_mode": text != "OFF"} if text == "OFF" or _numbers(text, 10) else None,
    "BAUD-RATE": _scalar("baud", 9600, 921600, int),
}
"""Change of the settings by a command's argument; None where it is refused."""
WITHOUT_EFFECT = frozenset(
    (
        *("SUPPRESS-GPS", "SEND-DVFKB", "SEND-DVKFB", "RETWEET-IMU", "SET-SIDE-TRACKING", "SEND-SIDE-TRACKING-FRAME"),
        *("IP-ADDRESS", "HOST-ADDRESS"),
    )
)
"""Commands of the page that the device accepts silently and that have no effect here."""


class Dvl75(Part[DvlTruth]):
    """One instrument: its clock is `drift_ppm` fast, each axis of its velocity noisy by `noise_mps` (1 sigma).

    Disguised, it is a GPS receiver; saturated, its deltas are at the end of their scale, with full confidence.
    """

    def __init__(
        self,
        *,
        seed: int = 0,
        settings: DvlSettings | None = None,
        noise_mps: float = 0.01,
        drift_ppm: float = 40.0,
    ) -> None:
        super().__init__(DvlTruth())
        self.settings = settings or DvlSettings()
        self._random = np.random.default_rng(seed)
        self._noise_mps = noise_mps
        self._us_per_s = 1e6 * (1.0 + drift_ppm * 1e-6)
        self._wire = BaudRateLine(self.settings.baud)
        self._measured_m: Vec3 = (0.0, 0.0, 0.0)
        self._stepped = False
        self._boot(-UP_S, UP_S)

    def _boot(self, now_s: float, silent_s: float) -> None:
        self._booted_s = now_s
        self._jumped_us = 0
        self._end_us = round(silent_s * self._us_per_s)
        self._span_us = SEARCH_INTERVAL_us
        self._next_s = now_s + self._end_us / self._us_per_s
        self._skips = 0
        self._in_range_since_s: float | None = None
        self._seen_s = now_s
        self._velocity_mps = self._truth.velocity_mps
        self._travel_m = self._reported_m = self._truth.travel_m or NOWHERE
        self._reported_rad = self._truth.turned_rad
        self._line = b""
        self._paused = False
        self._place_deg, self._fix = (0.0, 0.0), False
        self._sequence = 0
        self._gps_s = now_s

    # ---- time

    def step(self, now_s: float) -> bytes:
        """Sentences that are complete on the wire by now."""
        if not self._stepped:
            self._start_at(now_s)
        if self._truth.travel_m is None or now_s >= self._next_s:
            before_s, before_m = self._seen_s, self._travel_m
            self._integrate_travel(now_s)
            while self._next_s <= now_s:
                past = (self._next_s - before_s) / (now_s - before_s) if now_s > before_s else 1.0
                self._measure(plus(before_m, minus(self._travel_m, before_m), past))
        return self._wire.receive_complete(now_s)

    def _start_at(self, now_s: float) -> None:
        """Set the start time with the first step: earlier output is lost."""
        self._stepped = True
        self._booted_s += now_s
        self._next_s += now_s
        self._seen_s = now_s
        self._travel_m = self._reported_m = self._truth.travel_m or NOWHERE

    def _integrate_travel(self, now_s: float) -> None:
        """Integrate the travel up to now: as given, or by the trapezoid between the last velocity and this one."""
        truth, half_s = self._truth, 0.5 * (now_s - self._seen_s)
        if truth.travel_m is not None:
            self._travel_m = truth.travel_m
        else:
            self._travel_m = plus(self._travel_m, plus(self._velocity_mps, truth.velocity_mps), half_s)
        self._velocity_mps = truth.velocity_mps
        self._seen_s = now_s

    def _measure(self, travel_m: Vec3) -> None:
        locked = self._update_lock()
        if locked:  # dead reckoning
            north, east, _ = sentences.over_ground(self._truth)
            latitude, longitude = self._place_deg
            step = self._span_us * 1e-6 / M_PER_DEGREE
            self._place_deg = (latitude + north * step, longitude + east * step / math.cos(math.radians(latitude)))
        turned_rad = self._truth.turned_rad
        moved_m, confidence = self._measured_delta(minus(travel_m, self._reported_m), locked)
        end_us, turn = self._end_us + self._jumped_us, minus(turned_rad, self._reported_rad)
        self._emit(sentences.delta(end_us, self._span_us, moved_m, turn, confidence), locked)
        self._reported_m, self._reported_rad = travel_m, turned_rad
        altitude = self._truth.altitude_m
        self._span_us = SEARCH_INTERVAL_us
        if locked and altitude is not None:
            self._span_us = next(span for reach, span in INTERVALS_us if altitude <= reach)
        self._end_us += self._span_us
        self._next_s = self._booted_s + self._end_us / self._us_per_s

    def _update_lock(self) -> bool:
        """Update the lock: whether the bottom has been in range for half a second."""
        altitude = self._truth.altitude_m
        if altitude is None or not ALTITUDES_m[0] <= altitude <= ALTITUDES_m[1]:
            self._in_range_since_s = None
        elif self._in_range_since_s is None:
            self._in_range_since_s = self._next_s
        locked = self._in_range_since_s is not None and self._next_s - self._in_range_since_s >= LOCK_AFTER_S
        self._skips = 0 if locked else self._skips - 1
        return locked

    def _measured_delta(self, way_m: Vec3, locked: bool) -> tuple[Vec3, int]:
        """Delta and confidence. Velocity from Doppler uses the configured speed of sound, not the true one."""
        if self._saturated:
            return SATURATED_m, 100
        if not locked:
            return (0.0, -0.0, -0.0), 0
        if self._truth.frozen:
            return self._measured_m, 100
        scale = self.settings.speed_of_sound_mps / self._truth.speed_of_sound_mps * self.settings.velocity_adjustment
        noise = self._random.normal(0.0, self._noise_mps * self._span_us * 1e-6, 3).tolist()
        roll, pitch, yaw = self.settings.orientation_deg
        turned_m = rotate(matrix((math.radians(roll), math.radians(pitch), math.radians(yaw))), way_m)
        x, y, z = (scale * way + error for way, error in zip(turned_m, noise, strict=True))
        self._measured_m = x, y, z
        return self._measured_m, 100

    def _emit(self, delta: bytes, locked: bool) -> None:
        if self._disguised:
            self._wire.send(FOREIGN, self._next_s)
        elif not self._paused:
            for line in self._sentences(delta, locked):
                self._wire.send(line, self._next_s)

    def _sentences(self, delta: bytes, locked: bool) -> Iterator[bytes]:
        settings = self.settings
        if settings.deltas:
            yield delta
        if settings.extended:
            noise = self._random.normal(0.0, BEAM_NOISE_mps, 4).tolist()
            track = sentences.Track(locked, self._skips, self._place_deg, noise)
            yield sentences.extended(self._truth, settings, self._span_us, track)
        if settings.kalman:
            yield sentences.kalman(self._sequence, self._span_us)
            self._sequence += 1
        if settings.minimum:
            yield sentences.minimum((self._end_us + self._jumped_us) * 1e-6, self._place_deg, self._fix)
        if settings.retweet_gps and self._next_s >= self._gps_s:
            self._gps_s = self._next_s + GPS_EVERY_S
            yield b"GPS:" + FOREIGN

    # ---- commands

    def receive(self, data: bytes, now_s: float) -> bytes:
        """Commands end with LF, CR before it is ignored. Page "Commands Accepted by the DVL"."""
        *lines, rest = (self._line + data).split(b"\n")
        self._line = rest[-LONGEST_COMMAND:]
        return b"".join(self._handle_command(line.rstrip(b"\r").decode("ascii", "replace"), now_s) for line in lines)

    def _handle_command(self, line: str, now_s: float) -> bytes:
        word, _, argument = line.strip().partition(" ")
        if self._disguised or not word:
            return b""
        if word == "CONFIGURATION" or word.startswith("?"):
            return sentences.configuration(self.settings)
        if word == "REBOOT":
            self.power_cycle(now_s)
            return b""
        if word in ("PAUSE", "RESUME"):
            self._paused = word == "PAUSE"
            return b""
        taken = word in WITHOUT_EFFECT or line.startswith("$GPRMC,") or self._change(word, argument.strip())
        return b"" if taken or not self.settings.freeform else b"Unrecognized command\r\n"

    def _change(self, word: str, argument: str) -> bool:
        """Change a setting or the place, if the command does so and its argument is valid."""
        if word == "SET-POSITION":
            place = _numbers(argument, 2)
            self._place_deg, self._fix = (place[0], place[1]) if place else self._place_deg, bool(place) or self._fix
            return bool(place)
        changed = SETTERS[word](argument) if word in SETTERS else None
        if changed is None:
            return False
        self.settings = replace(self.settings, **changed)
        if "baud" in changed:  # assumed: at once, as it is flash that is written, and not at the next start
            self._wire = BaudRateLine(self.settings.baud)
        return True

    # ---- faults

    def power_cycle(self, now_s: float) -> None:
        """Restart: clock at zero, settings from flash, only the boot text on the wire."""
        self._wire.clear()
        self._boot(now_s, BOOT_S)
        if not self._disguised and self.settings.freeform:
            self._wire.send(BOOT_TEXT, now_s)

    def jump_clock(self, seconds: float) -> None:
        """Fault: the device's clock jumps."""
        self._jumped_us += round(seconds * 1e6)


def _numbers(text: str, count: int) -> tuple[float, ...]:
    """As many finite numbers between commas; nothing when they are others."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        return ()
    return values if len(values) == count and all(map(math.isfinite, values)) else ()


def dvl_truth(world: World, at: Mounting) -> DvlTruth:
    """What a DVL at a place of the vehicle would see, whatever its make."""
    turned, travel = world.travel(at)
    return DvlTruth(
        velocity_mps=world.velocity_mps(at),
        attitude_rad=world.attitude_rad,
        altitude_m=None if world.dvl_silenced else world.range_m(at),
        travel_m=travel,
        turned_rad=turned,
        speed_of_sound_mps=world.vehicle.water.speed_of_sound_mps,
    )


def _agrees(truth: DvlTruth, reading: object) -> bool:
    """Five sigma of velocity and half a millimeter per interval; angles to 0.1 degrees, altitude to centimeters."""
    if isinstance(reading, BottomVelocity):
        pairs = zip(reading.velocity_mps or truth.velocity_mps, truth.velocity_mps, strict=True)
        return all(abs(found - true) < 0.06 for found, true in pairs)
    if isinstance(reading, BottomTrack):
        angles = (reading.roll_rad, reading.pitch_rad, reading.heading_rad)
        level = all(abs(found - true) < 0.002 for found, true in zip(angles, truth.attitude_rad, strict=True))
        altitude = truth.altitude_m if reading.altitude_m is None else reading.altitude_m
        return level and (altitude is None or abs(altitude - (truth.altitude_m or 0.0)) < 0.06)
    return isinstance(reading, DeviceText | Position)


EMULATOR = Emulator(
    lambda seed: Dvl75(seed=seed),
    dvl_truth,
    lambda s: DvlTruth((0.4 * math.sin(0.5 * s), -0.3, 0.1), (0.05, -0.1, 2.0), 2.0 + 0.1 * math.sin(s)),
    _agrees,
)
