"""What an ArduSub measures, over MAVLink: inertial samples, magnetic field, pressure of the water, leak.

On a line of its own (`udpin:0.0.0.0:14551`, `tcp:127.0.0.1:5763`, a telemetry port), or without a `port` on that of the
thruster output. It asks for its streams, and for nothing else: it is a companion, no ground station.

The depth sensor of a BlueROV2 is the second barometer, beside that of the autopilot's board. A board without one has it
as the first; so has a SITL, whose second is one of the air with a noise of 0.2 m. A second one that is silent, or
noisier than a sensor of depth can be, is no depth, and said. So is one that the autopilot calls unhealthy: it sends the
last pressure of that for good. The first is taken only where it is named: on a board it
measures the air of a sealed hull, in which a vehicle never gets deeper.

The autopilot's IMU is read as any other: the navigator finds attitude and velocities from its samples, which come at
100 Hz, filtered by `INS_GYRO_FILTER`: twice as often as its ticks, which then keep to their grid. Stamps are mapped
from the time since power-up in the messages.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from hindrax_core.driver_interface import Output, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, seconds_between
from hindrax_core.knobs import knob
from hindrax_core.readings import Inertial, Leak, Magnetic, Pressure, Reading
from hindrax_core.rejects import RejectCode, reject
from hindrax_drivers.devices.ardupilot.companion import Companion
from hindrax_drivers.devices.ardupilot.link import LATENCY_S, SECOND_COMPUTER, Handlers
from hindrax_drivers.driver import Driver
from hindrax_drivers.protocols.ardupilot import (
    RAW_IMU,
    SCALED_PRESSURE,
    SCALED_PRESSURE2,
    SCALED_PRESSURE3,
    SYS_STATUS,
    Barometer,
    RawImu,
    Supply,
)
from hindrax_drivers.protocols.mavlink import StatusText
from hindrax_drivers.timebase import Timebase

BAROMETERS = (SCALED_PRESSURE, SCALED_PRESSURE2, SCALED_PRESSURE3)
BESIDE_BOARD = 2
NOISY_Pa, LOOK_S = 500.0, 1.0
"""Noise of a barometer that is none of depth, 0.05 m (a Bar30 has 0.002 m), and the time in which it shows."""
NO_SECOND_S = 3.0
REPEATED_S = 0.3
"""Time for which an equal pressure is the same measurement; one that stays is then one after all."""
DEPTH_SENSOR, HEALTH_Hz = 1 << 3, 2.0
"""MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE, by which ArduSub means its sensor of depth."""
LEAK = "Leak Detected"
DRY_AFTER_S, LEAK_EVERY_S = 25.0, 1.0
"""ArduSub repeats its warning of a leak every 20 s."""
FULL_SCALE_mps2, FULL_SCALE_radps = 16.5 * 9.80665, math.radians(2100.0)
"""Ends of the scale of the IMUs in use, 16 g and 2000 deg/s."""


@dataclass(frozen=True, slots=True)
class ArduSubKnobs:
    """Settings of the streams; nothing is changed in the autopilot's parameters."""

    imu_Hz: float = knob(100.0, 10.0, 400.0, "inertial samples that are asked for [Hz]")
    pressure_Hz: float = knob(20.0, 1.0, 50.0, "pressures that are asked for [Hz]")
    field_Hz: float = knob(10.0, 1.0, 50.0, "magnetic fields that are passed on, at most [Hz]")
    barometer: int | None = knob(
        None,
        1,
        3,
        "number of the barometer in the water: SCALED_PRESSURE, 2 or 3; none: 2, if it can be one [-]",
    )
    largest_Pa: float = knob(3.1e6, 1e5, 1e8, "pressure at the end of the barometer; a Bar30 reads 30 bar [Pa]")
    latency_s: float = knob(LATENCY_S, 0.0, 0.5, "measurement to arrival at the least [s]")
    stall_s: float = knob(1.5, 0.5, 60.0, "silence that is reported [s]")


DEFAULT_KNOBS = ArduSubKnobs()


class ArduSub(Companion):
    """Serial device: bytes of the link in; Inertial, Magnetic, Pressure and Leak out."""

    def __init__(self, knobs: ArduSubKnobs = DEFAULT_KNOBS) -> None:
        self._knobs = knobs
        self._imu_clock = Timebase(1e-6, latency_s=knobs.latency_s, on_break=self._on_break)
        self._baro_clock = Timebase(1e-3, latency_s=knobs.latency_s)
        self._barometer = BESIDE_BOARD if knobs.barometer is None else knobs.barometer
        self._pressed = self._said = False
        streams = {RAW_IMU: knobs.imu_Hz, BAROMETERS[self._barometer - 1]: knobs.pressure_Hz, SYS_STATUS: HEALTH_Hz}
        super().__init__("ardusub", SECOND_COMPUTER, streams, knobs.stall_s)

    def _handlers(self) -> Handlers:
        handlers = Handlers()
        handlers.on(RawImu, self._on_imu)
        handlers.on(Barometer, self._on_barometer)
        handlers.on(Supply, self._on_health)
        handlers.on(StatusText, self._on_text)
        return handlers

    def _clear(self) -> None:
        self._imu_clock.restart()
        self._baro_clock.restart()
        self._first_Pa: list[float] = []
        self._first_noise_Pa = 0.0
        self._pressure_Pa, self._new_at = math.nan, Stamp(0)
        self._plausible, self._healthy = False, True
        self._looking: Stamp | None = None
        self._ready_since: Stamp | None = None
        self._field_at = self._leak_at = Stamp(0)
        self._wet_at: Stamp | None = None

    def tick(self, stamp: Stamp) -> Iterable[Output]:
        """Heartbeat, requests, silence, and whether there is a leak."""
        outputs = [*super().tick(stamp), *self._report_leak(stamp)]
        self._ready_since = (self._ready_since or stamp) if self.ready else None
        since = stamp if self._pressed or self._ready_since is None else self._ready_since
        if seconds_between(since, stamp) > NO_SECOND_S:
            outputs += self._no_depth(stamp, "is silent")
        return outputs

    def _on_imu(self, one: RawImu, stamp: Stamp) -> list[Output]:
        if self._is_old("sample", one.boot_us):
            return [Rejected(stamp, reject(RejectCode.REPEATED, "sample"), b"")]
        if not _within(one.force_mps2, FULL_SCALE_mps2) or not _within(one.rate_radps, FULL_SCALE_radps):
            return [Rejected(stamp, reject(RejectCode.RANGE, "sample"), b"")]
        at = self._imu_clock.map(one.boot_us, stamp)
        outputs: list[Output] = [Stamped(at, Inertial(one.force_mps2, one.rate_radps, one.temperature_C))]
        if any(one.field_T) and seconds_between(self._field_at, at) >= 1.0 / self._knobs.field_Hz:
            self._field_at = at
            outputs.append(Stamped(at, Magnetic(one.field_T)))
        return outputs

    def _on_barometer(self, one: Barometer, stamp: Stamp) -> list[Output]:
        if one.number != self._barometer:
            return []
        self._pressed = True
        # Asked for more often than it measures, the autopilot sends one measurement twice, with another time.
        repeated = one.pressure_Pa == self._pressure_Pa and seconds_between(self._new_at, stamp) < REPEATED_S
        if repeated or self._is_old("pressure", 1000 * one.boot_ms) or not self._healthy:
            return [Rejected(stamp, reject(RejectCode.REPEATED, "pressure"), b"")]
        self._pressure_Pa, self._new_at = one.pressure_Pa, stamp
        if not 0.0 < one.pressure_Pa < self._knobs.largest_Pa:
            rejected = Rejected(stamp, reject(RejectCode.RANGE, "pressure"), b"")
            # Once it has measured water, each sample is only counted.
            return [rejected] if self._plausible else [rejected, *self._no_pressure(stamp, one.pressure_Pa)]
        self._plausible = True
        if self._knobs.barometer is None and not self._seen(one.pressure_Pa, stamp):
            return []
        if self._first_noise_Pa > NOISY_Pa:
            return self._no_depth(stamp, f"has a noise of {self._first_noise_Pa:.0f} Pa")
        return [Stamped(self._baro_clock.map(one.boot_ms, stamp), Pressure(one.pressure_Pa, one.temperature_C))]

    def _on_health(self, one: Supply, stamp: Stamp) -> list[Output]:
        before, self._healthy = self._healthy, not one.unhealthy & DEPTH_SENSOR
        if self._healthy == before:
            return []
        ill = "is not healthy, it says: no depth; check the sensor, its cable and its supply"
        return [Trouble(stamp, f"ardusub: the depth sensor {'is healthy again' if self._healthy else ill}")]

    def _seen(self, pressure_Pa: float, stamp: Stamp) -> bool:
        """Whether a barometer that nobody named was looked at for a while: only then its word counts."""
        self._looking = self._looking or stamp
        looked = seconds_between(self._looking, stamp) > LOOK_S
        if not looked:
            self._first_Pa.append(pressure_Pa)
        elif self._first_Pa:
            self._first_noise_Pa = _noise(self._first_Pa)
            self._first_Pa.clear()
        return looked

    def _no_depth(self, stamp: Stamp, why: str) -> list[Output]:
        """Say that the barometer is none of depth, and what to do where another is."""
        remedy = "check the depth sensor"
        if self._knobs.barometer is None:
            remedy += "; where it is barometer 1, as in a SITL: `--set NAME.barometer:=1`, NAME as in the vehicle file"
        return self._tell_once(stamp, f"barometer {self._barometer} {why}: no depth; {remedy}")

    def _no_pressure(self, stamp: Stamp, found_Pa: float) -> list[Output]:
        """Say that the barometer has given no pressure of water yet."""
        found, largest = f"{found_Pa / 100.0:.0f} hPa", f"{self._knobs.largest_Pa / 100.0:.0f}"
        return self._tell_once(
            stamp,
            f"barometer {self._barometer} gives {found}, wanted 0 to {largest}: no depth; check the depth sensor; a "
            "SITL must start at the level of the sea: `sim_vehicle.py -L RATBeach`",
        )

    def _tell_once(self, stamp: Stamp, sentence: str) -> list[Output]:
        """Say why there is no depth, the first time."""
        if self._said:
            return []
        self._said = True
        return [Trouble(stamp, f"ardusub: {sentence}")]

    def _on_text(self, one: StatusText, stamp: Stamp) -> list[Output]:
        if not one.text.startswith(LEAK):
            return []
        self._wet_at = self._leak_at = stamp
        return [Stamped(stamp, Leak(wet=True))]

    def _report_leak(self, stamp: Stamp) -> list[Output]:
        """Whether the autopilot warns of a leak, every second while it speaks."""
        if not self.ready or seconds_between(self._leak_at, stamp) < LEAK_EVERY_S:
            return []
        self._leak_at = stamp
        wet = self._wet_at is not None and seconds_between(self._wet_at, stamp) < DRY_AFTER_S
        reading: Reading = Leak(wet=wet)
        return [Stamped(stamp, reading)]


def _noise(values: Sequence[float]) -> float:
    """Standard deviation of noise, by the differences of distinct values: a slow dive is none."""
    steps = [later - sooner for sooner, later in pairwise(values) if later != sooner]
    return math.sqrt(0.5 * sum(step * step for step in steps) / max(1, len(steps)))


def _within(vector: tuple[float, float, float], most: float) -> bool:
    return max(map(abs, vector)) <= most


DRIVER = Driver(ArduSubKnobs, lambda knobs, _mount, _vehicle: ArduSub(knobs))
