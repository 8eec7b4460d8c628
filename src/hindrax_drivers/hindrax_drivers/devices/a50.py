"""Water Linked DVL A50 and A125 over Ethernet: `tcp://192.168.2.95:16171`.

A report comes with every ping, 2 to 15 times a second by altitude. It says when the sound came back from the bottom
(time of validity) and when it was sent, both on the clock of the device. Arrivals map the time of transmission to ROS
time, since that is what reaches us after a short and least delay; the time of validity lies as far before it as the
device says. Velocity counts for the time since the report before.

An error of its standard deviation, which the device computes from its beams and which a pool with echoes exceeds, is
covered by a floor. Without lock there is no velocity.

At its start the settings are read; those that spoil a measurement (speed of sound, acoustics off, a turned frame beside
that of the vehicle file, water tracking) are set, unless the knob `configure` is off; then they are only reported.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from hindrax_core.driver_interface import Identity, Output, Send, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, seconds_between
from hindrax_core.hydrostatics import Water
from hindrax_core.knobs import knob
from hindrax_core.readings import BottomTrack, BottomVelocity
from hindrax_core.rejects import RejectCode
from hindrax_drivers.driver import Driver, SilenceMonitor, sound_mps
from hindrax_drivers.protocols import waterlinked_protocol as protocol
from hindrax_drivers.protocols.waterlinked_protocol import VelocityReport
from hindrax_drivers.timebase import Break, Timebase, came_again

NS_PER_US = 1000
LONGEST_INTERVAL_S = 0.5
"""Of the slowest range mode; after a gap a velocity does not count for the time before."""
ASK_EVERY_S, TRIES = 3.0, 3
NAME = "Water Linked DVL"


@dataclass(frozen=True, slots=True)
class A50Knobs:
    """Settings of the driver, and of the DVL itself as far as `configure` lets it."""

    configure: bool = knob(True, meaning="correct the settings of the device at the start; off: only report them")
    speed_of_sound_mps: float | None = knob(
        None, 1000.0, 2000.0, "speed of sound that the device uses; none: by the vehicle's water [m/s]"
    )
    range_mode: str = knob("auto", meaning="altitudes to search: auto, =1 (0.3 to 3 m), 0<=1 (0.05 to 3 m) ...")
    max_fom_mps: float = knob(0.1, 0.001, 10.0, "figure of merit above which there is no velocity [m/s]")
    sigma_floor_mps: float = knob(0.005, 0.0, 1.0, "standard deviation added to the covariance [m/s]")
    max_speed_mps: float = knob(3.7, 0.1, 20.0, "largest velocity along an axis; its scale ends at 3.75 [m/s]")
    clock_drift_ppm: float = knob(200.0, 0.0, 1000.0, "largest accepted error of the device's clock rate [ppm]")
    latency_s: float = knob(0.004, 0.0, 0.5, "transmission to arrival; the page measured 4 ms [s]")
    stall_s: float = knob(1.0, 0.6, 60.0, "silence that is reported [s]")


DEFAULT_KNOBS, FRESH_WATER = A50Knobs(), Water()


class A50:
    """Serial device (its line is a TCP connection): reports in; BottomVelocity and BottomTrack out."""

    baud = 115200
    """Of no meaning over Ethernet."""

    def __init__(self, knobs: A50Knobs = DEFAULT_KNOBS, water: Water = FRESH_WATER) -> None:
        self._knobs, self._sound_mps = knobs, sound_mps(knobs, water)
        self._silence = SilenceMonitor("DVL", "reports of a Water Linked DVL", knobs.stall_s)
        drift_ppm, latency_s = knobs.clock_drift_ppm, knobs.latency_s
        self._clock = Timebase(1e-6, drift_ppm=drift_ppm, latency_s=latency_s, on_break=self._on_clock_break)
        self._handlers: Mapping[str, Callable[[Mapping[str, object], Stamp], Iterable[Output]]] = {
            "velocity": self._on_velocity,
            "velocity_water": self._on_velocity,
            "position_local": self._on_position,
            "response": self._on_response,
        }
        self.configuration: Mapping[str, object] = {}
        """Last reported settings of the device; empty before the first report."""
        self._reset(Stamp(0))

    def _reset(self, stamp: Stamp) -> None:
        """Reset to the state after the connection was made."""
        self._lines = protocol.LineSplitter()
        self._clock.restart()
        self._identity = ""
        self._last_us, self._last_position_s, self._last_stamp = -1, -math.inf, Stamp(0)
        self._silence.restart(stamp)
        self._troubles: list[Trouble] = []
        self._told: set[str] = set()
        self._asked, self._asks, self._sets = stamp, 1, 0
        self._configured = False

    @property
    def ready(self) -> bool:
        """Whether a Water Linked DVL has been recognized and its reports keep coming."""
        return bool(self._identity) and self._last_us >= 0 and self._silence.condition == "well"

    def start(self, stamp: Stamp) -> list[Output]:
        """Request the settings."""
        self._reset(stamp)
        return [Send(protocol.command("get_config"))]

    def reset_dead_reckoning(self) -> list[Output]:
        """Let the device count its own position from here. Section "Reset dead reckoning"."""
        return [Send(protocol.command("reset_dead_reckoning"))]

    def calibrate_gyro(self) -> list[Output]:
        """Let the device find the offset of its gyroscope; it must rest, and needs up to 15 s."""
        return [Send(protocol.command("calibrate_gyro"))]

    def feed(self, data: bytes, stamp: Stamp) -> list[Output]:
        """Decode received bytes; invalid ones come back as Rejected, in the order of the bytes."""
        self._silence.last_byte = stamp
        outputs: list[Output] = []
        for line in self._lines.feed(data):
            try:
                report = protocol.parse(line)
                outputs += self._handlers.get(protocol.text(report, "type"), _refuse)(report, stamp)
                self._silence.last_valid = stamp
            except protocol.ReportError as bad:
                outputs.append(Rejected(stamp, bad.reason, line))
        outputs += self._troubles
        self._troubles = []
        return outputs

    def _on_velocity(self, report: Mapping[str, object], stamp: Stamp) -> Sequence[Output]:
        found = protocol.velocity_report(report)
        if came_again(self._last_us, found.validity_us):
            raise protocol.ReportError(RejectCode.REPEATED, "velocity")
        if max(map(abs, found.velocity_mps)) > self._knobs.max_speed_mps and found.valid:
            raise protocol.ReportError(RejectCode.RANGE, "velocity")
        self._last_us = found.validity_us
        sent = self._clock.map(found.transmission_us, stamp)
        valid = Stamp(sent - (found.transmission_us - found.validity_us) * NS_PER_US)
        # Reports are in the order of their pings; the map may move by a little from one to the next.
        at = self._last_stamp = max(self._last_stamp, valid)
        self._report("hot", found.hot, stamp, "is hot and will shut down; put it into water, or switch it off")
        self._report("water", found.tracks_water, stamp, "tracks the water, wanted the bottom; set range_mode to auto")
        return [*self._identify(found.format), *(Stamped(at, one) for one in self._readings(found))]

    def _readings(self, found: VelocityReport) -> tuple[BottomTrack, BottomVelocity]:
        """Beams and altitude, then the velocity: a message of both holds those of one ping."""
        nowhere = math.nan
        valid = found.valid and found.fom_mps <= self._knobs.max_fom_mps
        altitude_m = found.altitude_m if found.valid and found.altitude_m > 0.0 else None
        track = BottomTrack(
            locked=found.valid,
            roll_rad=nowhere,
            pitch_rad=nowhere,
            heading_rad=nowhere,
            altitude_m=altitude_m,
            velocity_north_east_mps=(nowhere, nowhere),
            beams=found.beams,
            imu_calibration="",
            skipped_pings=0,
        )
        interval_s = min(found.interval_s, LONGEST_INTERVAL_S)
        if not valid:
            return track, BottomVelocity(None, math.inf, 0.0, interval_s, found.validity_us)
        sigma = math.hypot(self._knobs.sigma_floor_mps, found.sigma_mps)
        share = sum(beam.locked for beam in found.beams) / len(found.beams)
        return track, BottomVelocity(found.velocity_mps, sigma, share, interval_s, found.validity_us)

    def _on_position(self, report: Mapping[str, object], _: Stamp) -> Sequence[Output]:
        """Check a dead reckoning report. Its yaw is no heading and its place has no north: nothing is made of it."""
        at_s, self._last_position_s = self._last_position_s, protocol.dead_reckoning(report).time_s
        if at_s == self._last_position_s:
            raise protocol.ReportError(RejectCode.REPEATED, "position")
        return ()

    def _on_response(self, report: Mapping[str, object], stamp: Stamp) -> list[Output]:
        order, done = report.get("response_to"), report.get("success")
        if not isinstance(order, str) or not isinstance(done, bool):
            raise protocol.ReportError(RejectCode.FIELDS, "response")
        if not done:
            reason = str(report.get("error_message", ""))[:100]
            return [Trouble(stamp, f"DVL: refused {order[:40]} ({reason or 'no reason given'})")]
        if order == "get_config":
            return self._on_settings(protocol.settings(report), protocol.text(report, "format"), stamp)
        if order == "set_config":
            return [Send(protocol.command("get_config"))]
        return []

    def _on_settings(self, found: Mapping[str, object], form: str, stamp: Stamp) -> list[Output]:
        self.configuration, self._configured = dict(found), True
        outputs = self._identify(form)
        wrong = {name: one for name, one in self.wanted_settings().items() if not _same(found.get(name), one)}
        if not wrong:
            return outputs
        if self._knobs.configure and self._sets < TRIES:
            self._sets += 1
            return [*outputs, Send(protocol.command("set_config", **wrong))]
        sentences = (f"{name.replace('_', ' ')}: found {found.get(name)}, wanted {one}" for name, one in wrong.items())
        return [
            *outputs,
            *(Trouble(stamp, f"DVL {sentence}; set it, or let the driver (configure)") for sentence in sentences),
        ]

    def wanted_settings(self) -> dict[str, object]:
        """Settings that this driver wants. The frame is turned by the vehicle file, not also by the device."""
        return {
            "speed_of_sound": round(self._sound_mps),
            "acoustic_enabled": True,
            "mounting_rotation_offset": 0,
            "range_mode": self._knobs.range_mode,
        }

    def _identify(self, form: str) -> list[Output]:
        if self._identity:
            return []
        self._identity = f"{NAME}, {form[:20]}"
        return [Identity(self._identity)]

    def _report(self, what: str, now: bool, stamp: Stamp, sentence: str) -> None:
        """Report something once, until it has gone."""
        if now and what not in self._told:
            self._troubles.append(Trouble(stamp, f"DVL {sentence}"))
        self._told = self._told | {what} if now else self._told - {what}

    def _on_clock_break(self, one: Break) -> None:
        self._last_stamp = Stamp(0) if one.kind == "host step" else self._last_stamp
        what = {"reset": "has gone back", "jump": "leapt", "host step": "goes on, but the host's was set back"}
        sentence = f"DVL clock {what[one.kind]} at {one.ticks} us (by {one.shift_s:.3f} s)"
        self._troubles.append(Trouble(one.arrival, f"{sentence}; stamps restart"))

    def tick(self, stamp: Stamp) -> list[Output]:
        """Detect silence and foreign data; ask for the settings again while no answer has come."""
        outputs: list[Output] = [*self._silence.tick(stamp)]
        if self._configured or not self._identity or seconds_between(self._asked, stamp) < ASK_EVERY_S:
            return outputs
        self._asked, self._asks = stamp, self._asks + 1
        if self._asks <= TRIES:
            outputs.append(Send(protocol.command("get_config")))
        elif self._asks == TRIES + 1:
            outputs.append(Trouble(stamp, f"DVL: no answer to get_config after {TRIES} requests; settings unknown"))
        return outputs


def _refuse(_report: Mapping[str, object], _stamp: Stamp) -> Sequence[Output]:
    """Refuse a report of another kind."""
    raise protocol.ReportError(RejectCode.TYPE, "report")


def _same(found: object, wanted: object) -> bool:
    """Whether a setting is as wanted; the speed of sound is a whole number in some firmware, in others not."""
    if isinstance(wanted, bool) or not isinstance(wanted, int):
        return bool(found == wanted)
    return isinstance(found, int | float) and not isinstance(found, bool) and abs(found - wanted) < 1.0


DRIVER = Driver(A50Knobs, lambda knobs, _mount, vehicle: A50(knobs, vehicle.water), looking={"configure": False})
