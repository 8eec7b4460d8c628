"""A Water Linked DVL A50 as its pages describe it: docs.waterlinked.com, "DVL A50/A125 TCP JSON API", "Range mode".

Assumptions where the pages have gaps: a velocity is the mean over a ping of 50 ms around its time of validity; a report
is sent as long after that as in the example of the page; without lock all numbers are zero and distances -1; settings
outlive a restart, the clock begins anew with it, as without a time server; lines end with CR LF, which the vendor's
own client (dvl-python) counts on. Beams lie 22.5 degrees off the axis, ahead, astern and to both sides, half way.
"""

import json
import math
from collections import deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import numpy as np

from hindrax_core.readings import BottomTrack, BottomVelocity, Vec3
from hindrax_core.rotation import minus
from hindrax_sim.devices.dvl75 import dvl_truth
from hindrax_sim.devices.dvl75_sentences import DvlTruth
from hindrax_sim.devices.emulator import Emulator, Part
from hindrax_sim.physics.geometry import plus

RANGE_MODES = ((0.05, 0.6, 15.0), (0.3, 3.0, 10.0), (1.5, 14.0, 5.5), (7.7, 36.0, 7.5), (15.0, 50.0, 3.0))
"""Lower and upper altitude [m], reports a second. Page "Range mode"; the A50 reaches 50 m."""
SEARCH_Hz = 4.0
PING_S, LATENCY_S = 0.05, 0.189
POSITION_EVERY_S = 0.2
LOCK_AFTER_S = 0.5
BOOT_S = 1.0
"""Until it reports again; the real one needs 20 s and more, which would only make the tests longer."""
NEW_CLOCK_us = 1_600_000_000_000_000
SET_CLOCK_us = 1_638_191_471_563_017
BEAM_rad = math.radians(22.5)
AZIMUTHS_rad = tuple(math.radians(45.0 + 90.0 * number) for number in range(4))
SATURATED_mps = 3.75
"""End of its scale."""
OTHER = b'{"type": "status", "device": "sonar-3d-15", "temperature": 21.5}\r\n'
"""Of another instrument at the same address."""
LONGEST_COMMAND = 4096
NOWHERE: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class A50Settings:
    """Settings of the device by their names in the protocol; the defaults are those of the factory."""

    speed_of_sound: float = 1500.0
    acoustic_enabled: bool = True
    dark_mode_enabled: bool = False
    mounting_rotation_offset: float = 0.0
    range_mode: str = "auto"
    periodic_cycling_enabled: bool = True


class A50(Part[DvlTruth]):
    """One instrument: its clock is `drift_ppm` fast, each axis of its velocity noisy by `noise_mps` (1 sigma)."""

    def __init__(self, *, seed: int = 0, noise_mps: float = 0.005, drift_ppm: float = 30.0) -> None:
        super().__init__(DvlTruth())
        self.settings = A50Settings()
        self._random = np.random.default_rng(seed)
        self._noise_mps, self._us_per_s = noise_mps, 1e6 * (1.0 + 1e-6 * drift_ppm)
        self._clock_us = float(SET_CLOCK_us)
        self._line = b""
        self._outbox: deque[tuple[float, bytes]] = deque()
        self._stepped = False
        self._boot(0.0, 0.0)

    def _boot(self, now_s: float, silent_s: float) -> None:
        self._outbox.clear()
        self._booted_s, self._jumped_us = now_s, 0.0
        self._next_s = self._reported_s = self._position_s = now_s + silent_s
        self._begun: tuple[float, Vec3] | None = None
        self._in_range_since_s: float | None = None
        self._seen_s, self._travel_m = now_s, self._truth.travel_m or NOWHERE
        self._reckoned_from_m = self._travel_m
        self._measured_mps: Vec3 = NOWHERE

    def _us(self, now_s: float) -> int:
        return round(self._clock_us + self._jumped_us + (now_s - self._booted_s) * self._us_per_s)

    # ---- time

    def step(self, now_s: float) -> bytes:
        """Reports whose time has come."""
        if not self._stepped:
            self._stepped = True
            self._boot(now_s, 0.0)
        before_s, self._seen_s = self._seen_s, now_s
        truth = self._truth
        self._travel_m = truth.travel_m or plus(self._travel_m, truth.velocity_mps, now_s - before_s)
        if self._begun is None and now_s >= self._next_s - 0.5 * PING_S:
            self._begun = (now_s, self._travel_m)
        elif self._begun is not None and now_s >= self._next_s + 0.5 * PING_S:
            self._ping(*self._begun, now_s)
        if now_s >= self._position_s:
            self._position_s += POSITION_EVERY_S
            self._send(now_s, self._position)
        return self._due(now_s)

    def _due(self, now_s: float) -> bytes:
        sent = []
        while self._outbox and self._outbox[0][0] <= now_s:
            sent.append(self._outbox.popleft()[1])
        return b"".join(sent)

    def _send(self, at_s: float, report: Callable[[int], object]) -> None:
        """Queue a report, which gets the time at which it leaves."""
        data = OTHER if self._disguised else json.dumps(report(self._us(at_s))).encode("ascii") + b"\r\n"
        self._outbox.append((at_s, data))
        self._outbox = deque(sorted(self._outbox, key=lambda one: one[0]))

    def _ping(self, from_s: float, from_m: Vec3, now_s: float) -> None:
        middle_s, self._begun = 0.5 * (from_s + now_s), None
        way_m = minus(self._travel_m, from_m)
        x, y, z = (one / (now_s - from_s) for one in way_m)
        locked = self._update_lock(now_s)
        velocity = self._measured((x, y, z), locked)
        interval_s, self._reported_s = middle_s - self._reported_s, middle_s
        validity_us = self._us(middle_s)
        if self.settings.acoustic_enabled:
            self._send(
                middle_s + LATENCY_S,
                lambda sent_us: self._velocity(velocity, locked, interval_s, validity_us=validity_us, sent_us=sent_us),
            )
        self._next_s = max(self._next_s + 1.0 / self._rate_Hz(locked), now_s)

    def _rate_Hz(self, locked: bool) -> float:
        altitude = self._truth.altitude_m
        fits = (rate for low, high, rate in RANGE_MODES if altitude is not None and low <= altitude <= high)
        return next(fits, SEARCH_Hz) if locked else SEARCH_Hz

    def _update_lock(self, now_s: float) -> bool:
        altitude = self._truth.altitude_m
        if altitude is None or not RANGE_MODES[0][0] <= altitude <= RANGE_MODES[-1][1]:
            self._in_range_since_s = None
        elif self._in_range_since_s is None:
            self._in_range_since_s = now_s
        return self._in_range_since_s is not None and now_s - self._in_range_since_s >= LOCK_AFTER_S

    def _measured(self, velocity_mps: Vec3, locked: bool) -> Vec3:
        """Velocity by Doppler with the configured speed of sound, in the frame that the device is set to."""
        if not locked:
            return NOWHERE
        if self._saturated:
            return (SATURATED_mps, -SATURATED_mps, SATURATED_mps)
        if self._truth.frozen:
            return self._measured_mps
        scale = self.settings.speed_of_sound / self._truth.speed_of_sound_mps
        turn = math.radians(self.settings.mounting_rotation_offset)
        u, v, w = velocity_mps
        turned = (math.cos(turn) * u - math.sin(turn) * v, math.sin(turn) * u + math.cos(turn) * v, w)
        noise = self._random.normal(0.0, self._noise_mps, 3).tolist()
        x, y, z = (scale * one + error for one, error in zip(turned, noise, strict=True))
        self._measured_mps = (x, y, z)
        return self._measured_mps

    # ---- reports

    def _velocity(
        self, velocity: Vec3, locked: bool, interval_s: float, *, validity_us: int, sent_us: int
    ) -> dict[str, object]:
        """Section "Velocity-and-transducer report"."""
        variance, altitude = self._noise_mps**2, self._truth.altitude_m if locked else None
        scale = self.settings.speed_of_sound / self._truth.speed_of_sound_mps
        vx, vy, vz = velocity
        return {
            "time": 1e3 * interval_s,
            "vx": vx,
            "vy": vy,
            "vz": vz,
            "fom": self._noise_mps if locked else 1.0,
            "covariance": [[variance if row == column else 0.0 for column in range(3)] for row in range(3)],
            "altitude": -1.0 if altitude is None else scale * altitude,
            "transducers": [self._beam(number, velocity, altitude) for number in range(4)],
            "velocity_valid": locked,
            "status": 0,
            "format": "json_v3.1",
            "type": "velocity",
            "time_of_validity": validity_us,
            "time_of_transmission": sent_us,
        }

    def _beam(self, number: int, velocity: Vec3, altitude_m: float | None) -> dict[str, object]:
        u, v, w = velocity
        azimuth = AZIMUTHS_rad[number]
        along = math.sin(BEAM_rad) * (math.cos(azimuth) * u + math.sin(azimuth) * v) + math.cos(BEAM_rad) * w
        return {
            "id": number,
            "velocity": along if altitude_m is not None else 0.0,
            "distance": -1.0 if altitude_m is None else altitude_m / math.cos(BEAM_rad),
            "rssi": -30.0,
            "nsd": -90.0,
            "beam_valid": altitude_m is not None,
        }

    def _position(self, sent_us: int) -> dict[str, object]:
        """Section "Dead reckoning report"; the way of the truth, in the axes of the start while it flies level."""
        x, y, z = minus(self._travel_m, self._reckoned_from_m)
        roll, pitch, yaw = (math.degrees(angle) for angle in self._truth.attitude_rad)
        return {
            "ts": 1e-6 * sent_us,
            "x": x,
            "y": y,
            "z": z,
            "std": 0.002,
            "roll": roll,
            "pitch": pitch,
            "yaw": yaw,
            "type": "position_local",
            "status": 0,
            "format": "json_v3.1",
        }

    # ---- commands

    def receive(self, data: bytes, _now_s: float) -> bytes:
        """Commands are JSON objects. Not all clients end them with a line, so that each counts when it is complete."""
        text, answers = (self._line + data).decode("utf-8", "replace"), []
        while text := text.lstrip():
            try:
                order, end = json.JSONDecoder().raw_decode(text)
            except ValueError:
                _, newline, after = text.partition("\n")
                if not newline:  # it may become one
                    break
                text = after
                continue
            answers.append(self._answer(order))
            text = text[end:]
        self._line = text.encode()[-LONGEST_COMMAND:]
        return b"".join(answers) if not self._disguised else b""

    def _answer(self, order: object) -> bytes:
        if not isinstance(order, dict) or "command" not in order:
            return b""
        name, given = order["command"], order.get("parameters", {})
        wrong, result = "", None
        if name == "get_config":
            result = asdict(self.settings)
        elif name == "set_config":
            wrong = self._set(given)
        elif name == "reset_dead_reckoning":
            self._reckoned_from_m = self._travel_m
        elif name not in ("calibrate_gyro", "trigger_ping"):
            wrong = "unknown command"
        answer = {"response_to": name, "success": not wrong, "error_message": wrong, "result": result}
        return json.dumps(answer | {"format": "json_v3.1", "type": "response"}).encode("ascii") + b"\r\n"

    def _set(self, given: object) -> str:
        """Change settings, all or none; returns why not."""
        known = asdict(self.settings)
        if not isinstance(given, dict) or not given.keys() <= known.keys():
            return "unknown parameter"
        for name, value in given.items():
            kind = (int, float) if isinstance(known[name], float) else type(known[name])
            if not isinstance(value, kind) or (isinstance(value, bool) is not isinstance(known[name], bool)):
                return f"{name}: wrong type"
        if not 1000.0 <= given.get("speed_of_sound", 1500.0) <= 2000.0:
            return "speed_of_sound: out of range"
        self.settings = replace(self.settings, **given)
        return ""

    # ---- faults

    def power_cycle(self, now_s: float) -> None:
        """Restart: a clock without a time server begins anew."""
        self._clock_us = float(NEW_CLOCK_us)
        self._boot(now_s, BOOT_S)

    def jump_clock(self, seconds: float) -> None:
        """Fault: the device's clock jumps, as when a time server is found."""
        self._jumped_us += 1e6 * seconds


def _agrees(truth: DvlTruth, reading: BottomVelocity) -> bool:
    """Five sigma and what a ping's mean differs by; altitude to centimeters."""
    if isinstance(reading, BottomVelocity):
        pairs = zip(reading.velocity_mps or truth.velocity_mps, truth.velocity_mps, strict=True)
        return all(abs(found - true) < 0.03 for found, true in pairs)
    if isinstance(reading, BottomTrack):
        return reading.altitude_m is None or abs(reading.altitude_m - (truth.altitude_m or 0.0)) < 0.05
    return False


EMULATOR = Emulator(
    lambda seed: A50(seed=seed),
    dvl_truth,
    lambda s: DvlTruth((0.4 * math.sin(0.5 * s), -0.3, 0.1), (0.05, -0.1, 2.0), 2.0 + 0.1 * math.sin(s)),
    _agrees,
)
