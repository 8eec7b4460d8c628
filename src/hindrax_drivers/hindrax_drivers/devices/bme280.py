"""Bosch BME280 and BMP280: pressure, temperature and humidity of the air in a dry hull.

Sources: Bosch BST-BME280-DS002-15 rev 1.6, pages and sections named below; BST-BMP280-DS001-11 for its identity. The
calibration has no checksum, so it is read twice.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_core.bus_operations import Pause, Program
from hindrax_core.driver_interface import Identity
from hindrax_core.events import Rejected, Stamp, Stamped, after
from hindrax_core.knobs import knob
from hindrax_core.readings import Air, Reading
from hindrax_core.rejects import Reject, RejectCode, reject
from hindrax_drivers.driver import Driver, RegisterPart

ADDRESS = 0x77
CALIBRATION, IDENTITY, RESET, CALIBRATION_H, CTRL_HUM, CTRL_MEAS = 0x88, 0xD0, 0xE0, 0xE1, 0xF2, 0xF4
PARTS = {0x60: "BME280", 0x58: "BMP280"}
RESET_WORD = 0xB6
START_UP_S = 0.002
"""Table 1, page 8."""
UPDATING, MEASURING = 0x01, 0x08
HUMIDITY_ONCE = 0x01
FORCED_T1_P4 = 0x2D
"""Temperature once, pressure four times, forced mode: section 5.4.5."""
ASLEEP_T1_P4 = FORCED_T1_P4 & ~0x03
MEASUREMENT_S = 0.0167
"""Longest: 1.25 + 2.3 + (2.3 * 4 + 0.575) + (2.3 + 0.575) ms, section 9.1."""
REPEATS, HUNG_AFTER = 5, 15
"""The noise is several counts of 20 bits, so this many equal measurements in a row are a device that has hung."""

LIMITS_Pa, LIMITS_C = (30_000.0, 110_000.0), (-40.0, 85.0)
LARGEST_STEP_C, LARGEST_STEP_HUMIDITY = 1.0, 0.05


@dataclass(frozen=True, slots=True)
class Bme280Knobs:
    """Settings of the barometer in the hull."""

    period_s: float = knob(0.2, 0.05, 10.0, "time between two readings [s]")
    largest_step_Pa: float = knob(300.0, 10.0, 1e5, "larger steps between two readings are damage [Pa]")


@dataclass(frozen=True, slots=True)
class Calibration:
    """The part's own coefficients dig_T1 to dig_H6, section 4.2.2; `h` is empty for a BMP280."""

    t: tuple[int, ...]
    p: tuple[int, ...]
    h: tuple[int, ...]


def calibration_of(low: bytes, high: bytes) -> Calibration:
    """Coefficients from registers 0x88 to 0xA1 and 0xE1 to 0xE7 (empty: a BMP280). Table 16, page 24."""
    words = struct.unpack_from("<H2hH8h", low)
    if not high:
        return Calibration(words[:3], words[3:], ())
    # H4 and H5 have twelve bits each and share one byte, 0xE5: its low half belongs to H4, its high half to H5.
    h2, h3, h4_high, shared, h5_high, h6 = struct.unpack("<hBbBbb", high)
    return Calibration(
        words[:3], words[3:], (low[25], h2, h3, h4_high * 16 + shared % 16, h5_high * 16 + shared // 16, h6)
    )


def air_of(calibration: Calibration, raw: bytes) -> Air:
    """Compensate registers 0xF7 to 0xFE in floating point. Section 8.1, page 49."""
    pressure, temperature = int.from_bytes(raw[:3], "big") >> 4, int.from_bytes(raw[3:6], "big") >> 4
    t1, t2, t3 = calibration.t
    off = temperature / 16384.0 - t1 / 1024.0
    fine = off * t2 + (off / 8.0) ** 2 * t3
    humidity = _humidity(calibration.h, fine, int.from_bytes(raw[6:8], "big")) if calibration.h else math.nan
    return Air(_pressure(calibration.p, fine, pressure), fine / 5120.0, humidity)


def _pressure(p: Sequence[int], fine: float, raw: int) -> float:
    """Pressure [Pa] of a raw count, at the fine temperature: the double-precision formula of section 8.1."""
    p1, p2, p3, p4, p5, p6, p7, p8, p9 = p
    warm = fine / 2.0 - 64000.0
    offset = (warm * warm * p6 / 32768.0 + warm * p5 * 2.0) / 4.0 + p4 * 65536.0
    gain = (1.0 + (p3 * warm * warm / 524288.0 + p2 * warm) / 524288.0 / 32768.0) * p1
    # A calibration of zeros: the data sheet has the same case, against a division by zero.
    if gain == 0.0:
        return math.nan
    first = (1048576.0 - raw - offset / 4096.0) * 6250.0 / gain
    return first + (p9 * first * first / 2147483648.0 + first * p8 / 32768.0 + p7) / 16.0


def _humidity(h: Sequence[int], fine: float, raw: int) -> float:
    """Relative humidity, 0 to 1, of a raw count, at the fine temperature: as of section 8.1."""
    h1, h2, h3, h4, h5, h6 = h
    warm = fine - 76800.0
    gain = h2 / 65536.0 * (1.0 + h6 / 67108864.0 * warm * (1.0 + h3 / 67108864.0 * warm))
    percent = (raw - (h4 * 64.0 + h5 / 16384.0 * warm)) * gain
    return min(1.0, max(0.0, percent * (1.0 - h1 * percent / 524288.0) / 100.0))


class Bme280(RegisterPart):
    """The sensor at an address (0x77 where none is named); it sleeps between two measurements."""

    def __init__(self, knobs: Bme280Knobs, address: int | None = None) -> None:
        super().__init__(address, ADDRESS)
        self._knobs, self.period_s = knobs, knobs.period_s

    def configure(self) -> Program[Identity]:
        """Identify, reset, read the calibration twice."""
        found = (yield self.get(IDENTITY, 1))[0]
        if found not in PARTS:
            raise self.error(f"found id {found:#04x}, wanted 0x60 (BME280) or 0x58 (BMP280)")
        yield self.set(RESET, RESET_WORD)
        yield Pause(START_UP_S)
        # It has no checksum, and one wrong bit would shift every pressure without a trace.
        first, again = (yield from self._coefficients(found)), (yield from self._coefficients(found))
        if first != again or not any(first[0]) or set(first[0]) == {0xFF}:
            raise self.error("two reads of its calibration differ, or are empty: a disturbed bus, or a broken part")
        self._calibration = calibration_of(*first)
        self._last: Air | None = None
        self._last_raw, self._repeats = b"", 0
        # Section 5.4.3: a change of ctrl_hum takes effect with the next write of ctrl_meas, which every cycle makes.
        if self._calibration.h:
            yield self.set(CTRL_HUM, HUMIDITY_ONCE)
        return Identity(f"{PARTS[found]} at {self.address:#04x}")

    def cycle(self, stamp: Stamp) -> Program[Sequence[Stamped[Reading] | Rejected]]:
        """Measure once; the stamp is the middle of the measurement."""
        yield self.set(CTRL_MEAS, FORCED_T1_P4)
        # With slack: the result waits in the part, so it is fetched when the bus is awake anyway.
        yield Pause(MEASUREMENT_S, max(0.0, self._knobs.period_s - MEASUREMENT_S))
        humidity, status, settings, *_ = block = yield self.get(CTRL_HUM, 13)
        if status & (MEASURING | UPDATING):
            raise self.error(f"not done after {MEASUREMENT_S:g} s (status {status:#04x})")
        # After a brownout it answers as before, with oversampling off: its registers tell, its data do not.
        if settings != ASLEEP_T1_P4 or (self._calibration.h and humidity != HUMIDITY_ONCE):
            raise self.error(f"lost its settings (ctrl_hum {humidity:#04x}, ctrl_meas {settings:#04x})")
        raw = bytes(block[5:])
        self._repeats = self._repeats + 1 if raw == self._last_raw else 0
        last, self._last, self._last_raw = self._last, air_of(self._calibration, raw), raw
        if self._repeats >= HUNG_AFTER:
            raise self.error("repeats the same measurement")
        valid = after(stamp, 0.5 * MEASUREMENT_S)
        reason = self._refusal(last, self._last)
        if self._repeats >= REPEATS:
            reason = reject(RejectCode.REPEATED, found=f"{self._repeats + 1} equal measurements")
        if reason:
            return [Rejected(valid, reason, raw)]
        return [] if last is None else [Stamped(valid, self._last)]

    def _coefficients(self, part: int) -> Program[tuple[bytes, bytes]]:
        low = yield self.get(CALIBRATION, 26)
        return low, (yield self.get(CALIBRATION_H, 7)) if PARTS[part] == "BME280" else b""

    def _refusal(self, last: Air | None, new: Air) -> Reject | None:
        """Reason why a sample is implausible, also beside the one before it; None when it is plausible."""
        if not LIMITS_Pa[0] <= new.pressure_Pa <= LIMITS_Pa[1] or not LIMITS_C[0] <= new.temperature_C <= LIMITS_C[1]:
            return reject(RejectCode.RANGE)
        if last is None:
            return None
        steps = (
            abs(new.pressure_Pa - last.pressure_Pa) / self._knobs.largest_step_Pa,
            abs(new.temperature_C - last.temperature_C) / LARGEST_STEP_C,
            abs(new.humidity - last.humidity) / LARGEST_STEP_HUMIDITY,
        )
        return reject(RejectCode.LEAP) if any(step > 1.0 for step in steps) else None


DRIVER = Driver(Bme280Knobs, lambda knobs, mount, _vehicle: Bme280(knobs, mount.address))
