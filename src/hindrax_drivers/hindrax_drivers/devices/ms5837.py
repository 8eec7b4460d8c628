"""TE MS5837-30BA and -02BA: absolute pressure and water temperature.

Sources: TE MS5837-30BA rev C2 (12/2019) pages 7, 9, 11; MS5837-02BA pages 6, 7, 9; second order as the Blue Robotics
MS5837 library computes it. All divisions round down: only so does the datasheet's example come out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from hindrax_core.bus_operations import Pause, Program, Write
from hindrax_core.driver_interface import Identity
from hindrax_core.events import Rejected, Stamp, Stamped, after, seconds_between
from hindrax_core.knobs import choice, knob
from hindrax_core.readings import Pressure, Reading
from hindrax_core.rejects import Reject, RejectCode, reject
from hindrax_drivers.driver import Driver, RegisterPart

Model: TypeAlias = Literal["30BA", "02BA"]

ADDRESS = 0x76
RESET = 0x1E
PROM_READ = 0xA0
ADC_READ = 0x00
CONVERT_D1 = 0x40
CONVERT_D2 = 0x50
PROM_WORDS = 7
RELOAD_S = 0.01

OSRS = ("256", "512", "1024", "2048", "4096", "8192")
CONVERSION_S = (0.00064, 0.00128, 0.00256, 0.0051, 0.0102, 0.0205)
"""2.5 us per sample of oversampling, as the vendor's own library waits; the longest conversion is 2.2 us per sample."""

C1_LOWEST, C1_BORDER, C1_HIGHEST = 26_000, 37_000, 49_000
"""C1 distinguishes the models where the product number does not: fielded 30BA parts carry zero there."""

LIMITS_Pa = {"30BA": (0.0, 3.1e6), "02BA": (1_000.0, 250_000.0)}
"""Measuring range of the part: 30 bar and 2 bar, with a margin for the weather."""
LIMITS_C = (-40.0, 85.0)
FASTEST_Kps = 10.0
"""From air into cold water the housing takes a second or two."""
LEAST_STEP_Pa = 500.0
"""Three times the noise at oversampling 256: a smaller step is no damage however short the period. DS 30BA page 3."""
REPEATS = 10
"""The noise is tens of counts, so this many equal conversions in a row are a device that has hung."""
HUNG_AFTER = 50
ACCEPT_AFTER = 3
"""A leap this often confirmed was real, however large."""


@dataclass(frozen=True, slots=True)
class Ms5837Knobs:
    """Settings of the pressure sensor."""

    model: str = choice("auto", ("auto", "30BA", "02BA"), "which part it is; auto: by its calibration")
    oversampling: str = choice("4096", OSRS, "samples per conversion; 4096 lets 50 Hz be reached")
    period_s: float = knob(0.02, 0.002, 1.0, "time between two readings [s]")
    temperature_every: int = knob(10, 1, 1000, "the temperature is converted for every n-th reading [-]")
    fastest_Paps: float = knob(50_000.0, 1_000.0, 1e7, "faster changes between two readings are damage [Pa/s]")


DEFAULT_KNOBS = Ms5837Knobs()


@dataclass(frozen=True, slots=True)
class Prom:
    """The part's own calibration: words C1 to C6, and the model they were read as."""

    model: Model
    c: tuple[int, int, int, int, int, int]


def crc4(words: Sequence[int]) -> int:
    """Checksum over seven PROM words, the four bits that hold it left out. DS 30BA page 9."""
    remainder = 0
    for word in (words[0] & 0x0FFF, *words[1:PROM_WORDS], 0):
        for byte in (word >> 8, word & 0xFF):
            remainder ^= byte
            for _ in range(8):
                remainder = (remainder << 1 ^ 0x3000 if remainder & 0x8000 else remainder << 1) & 0xFFFF
    return remainder >> 12


def model_of(c1: int) -> Model | None:
    """Model by the pressure sensitivity C1; None where no part of either model lies."""
    if not C1_LOWEST <= c1 <= C1_HIGHEST:
        return None
    return "02BA" if c1 > C1_BORDER else "30BA"


def compensate(prom: Prom, d1: int, d2: int) -> tuple[int, int]:
    """Compensate both conversions: the steps of the datasheets, in integers that round down, to second order.

    DS 30BA page 7 and 11, DS 02BA page 7 and 9.

    Parameters
    ----------
    prom
        Coefficients C1 to C6, and the model.
    d1, d2
        Raw pressure and temperature, 24 bits.

    Returns
    -------
    tuple[int, int]
        Temperature [0.01 C] and pressure [0.1 mbar of a 30BA, 0.01 mbar of a 02BA].
    """
    c1, c2, c3, c4, c5, c6 = prom.c
    dt = d2 - (c5 << 8)
    temperature = 2000 + (dt * c6 >> 23)
    if prom.model == "30BA":
        offset, sensitivity, shift = (c2 << 16) + (c4 * dt >> 7), (c1 << 15) + (c3 * dt >> 8), 13
        ti, offset_i, sensitivity_i = _second_order_30(dt, temperature)
    else:
        offset, sensitivity, shift = (c2 << 17) + (c4 * dt >> 6), (c1 << 16) + (c3 * dt >> 7), 15
        ti, offset_i, sensitivity_i = _second_order_02(dt, temperature)
    pressure = (d1 * (sensitivity - sensitivity_i) >> 21) - (offset - offset_i) >> shift
    return temperature - ti, pressure


def _second_order_30(dt: int, temperature: int) -> tuple[int, int, int]:
    """Corrections Ti, OFFi and SENSi of a 30BA, which is off below 20 C and more so below -15 C. DS 30BA page 11."""
    warm = temperature - 2000
    if warm >= 0:
        return 2 * dt * dt >> 37, warm * warm >> 4, 0
    offset, sensitivity = 3 * warm * warm >> 1, 5 * warm * warm >> 3
    if temperature < -1500:
        cold = temperature + 1500
        offset, sensitivity = offset + 7 * cold * cold, sensitivity + 4 * cold * cold
    return 3 * dt * dt >> 33, offset, sensitivity


def _second_order_02(dt: int, temperature: int) -> tuple[int, int, int]:
    """Corrections Ti, OFFi and SENSi of a 02BA below 20 C. DS 02BA page 9."""
    warm = temperature - 2000
    if warm >= 0:
        return 0, 0, 0
    return 11 * dt * dt >> 35, 31 * warm * warm >> 3, 63 * warm * warm >> 5


def reading_of(prom: Prom, d1: int, d2: int) -> Pressure:
    """Compensated conversions, in SI.

    Parameters
    ----------
    prom, d1, d2
        As of `compensate`.

    Returns
    -------
    Pressure
        [Pa], [C].
    """
    temperature_cC, pressure_steps = compensate(prom, d1, d2)
    return Pressure(pressure_steps * (10.0 if prom.model == "30BA" else 1.0), temperature_cC * 0.01)


class Ms5837(RegisterPart):
    """The sensor at an address (0x76 where none is named). During its conversions the bus is free for others."""

    def __init__(self, knobs: Ms5837Knobs = DEFAULT_KNOBS, address: int | None = None) -> None:
        super().__init__(address, ADDRESS)
        self._knobs, self.period_s = knobs, knobs.period_s
        osr = OSRS.index(knobs.oversampling)
        self._command_d1, self._command_d2 = CONVERT_D1 + 2 * osr, CONVERT_D2 + 2 * osr
        self._wait_s = CONVERSION_S[osr]

    def configure(self) -> Program[Identity]:
        """Reset, read and check the calibration, return the model."""
        yield Write(self.address, bytes([RESET]))
        yield Pause(RELOAD_S)
        words = []
        for index in range(PROM_WORDS):
            words += [(yield from self.word(PROM_READ + 2 * index))]
        found, wanted = crc4(words), words[0] >> 12
        if found != wanted or not any(words):
            sums = f"PROM checksum {found:#x}, wanted {wanted:#x} as stored"
            raise self.error(f"{sums}; another device, or a disturbed bus")
        model, remark = self._model(words[1])
        self._prom = Prom(model, (words[1], words[2], words[3], words[4], words[5], words[6]))
        self._last: Stamped[Pressure] | None = None
        self._d2 = self._last_d1 = self._turn = self._repeats = self._leaps = 0
        return Identity(f"MS5837-{model} at {self.address:#04x}, C1 {words[1]}{remark}")

    def cycle(self, stamp: Stamp) -> Program[Sequence[Stamped[Reading] | Rejected]]:
        """Convert the temperature if due, then the pressure; the stamp is the middle of its conversion."""
        begin_s = 0.0
        if self._turn % self._knobs.temperature_every == 0:
            self._d2 = yield from self._convert(self._command_d2)
            begin_s = self._wait_s
        slack_s = max(0.0, self._knobs.period_s - begin_s - self._wait_s)
        d1 = yield from self._convert(self._command_d1, slack_s)
        self._turn += 1
        if self._repeats >= HUNG_AFTER:
            raise self.error("repeats the same conversion")
        reading = reading_of(self._prom, d1, self._d2)
        valid = after(stamp, begin_s + 0.5 * self._wait_s)
        reason = self._implausible(d1, Stamped(valid, reading))
        if reason:
            self._turn = 0  # the temperature may be wrong
            return [Rejected(valid, reason, d1.to_bytes(3, "big") + self._d2.to_bytes(3, "big"))]
        return [Stamped(valid, reading)]

    def _convert(self, command: int, slack_s: float = 0.0) -> Program[int]:
        """One conversion. The converter answers 0 when it is read too early, and the conversion is lost."""
        yield Write(self.address, bytes([command]))
        yield Pause(self._wait_s, slack_s)
        raw = yield self.get(ADC_READ, 3)
        value = int.from_bytes(raw, "big")
        if value == 0:
            raise self.error(f"conversion {command:#04x} gave 0: read early, or lost")
        return value

    def _model(self, c1: int) -> tuple[Model, str]:
        """Model from the knob or the calibration; the identity notes a contradiction."""
        found = model_of(c1)
        if self._knobs.model == "auto":
            if found is None:
                models = f"neither 30BA ({C1_LOWEST} to {C1_BORDER}) nor 02BA (to {C1_HIGHEST})"
                raise self.error(f"C1 {c1} fits {models}; set the parameter `model`")
            return found, ""
        model: Model = "02BA" if self._knobs.model == "02BA" else "30BA"
        return model, "" if found == model else f" (its calibration looks like {found or 'neither model'})"

    def _implausible(self, d1: int, stamped: Stamped[Pressure]) -> Reject | None:
        """Reason why a reading is implausible; None when it is plausible."""
        reading = stamped.reading
        lowest_Pa, highest_Pa = LIMITS_Pa[self._prom.model]
        if not lowest_Pa <= reading.pressure_Pa <= highest_Pa:
            return self._outside(f"{reading.pressure_Pa:.0f} Pa")
        if not LIMITS_C[0] <= reading.temperature_C <= LIMITS_C[1]:
            return self._outside(f"{reading.temperature_C:.1f} C")
        self._repeats = self._repeats + 1 if d1 == self._last_d1 else 0
        self._last_d1 = d1
        if self._repeats >= REPEATS:
            return reject(RejectCode.REPEATED, found=f"{self._repeats + 1} equal conversions")
        return self._jump(stamped)

    def _outside(self, found: str) -> Reject:
        return reject(RejectCode.RANGE, found=f"{found} is outside the range of an MS5837-{self._prom.model}")

    def _jump(self, stamped: Stamped[Pressure]) -> Reject | None:
        """Compare with the last accepted reading over the time between; a lasting jump is accepted."""
        reading, last = stamped.reading, self._last
        if last is not None and self._leaps < ACCEPT_AFTER:
            span_s = max(self._knobs.period_s, seconds_between(last.stamp, stamped.stamp))
            step_Pa = reading.pressure_Pa - last.reading.pressure_Pa
            step_C = reading.temperature_C - last.reading.temperature_C
            slowest_s = max(span_s, self._knobs.period_s * self._knobs.temperature_every)
            if (
                abs(step_Pa) > max(LEAST_STEP_Pa, self._knobs.fastest_Paps * span_s)
                or abs(step_C) > FASTEST_Kps * slowest_s
            ):
                self._leaps += 1
                steps = f"leap of {step_Pa:+.0f} Pa, {step_C:+.1f} K in {span_s:.3f} s"
                return reject(RejectCode.LEAP, found=f"{steps}: no vehicle moves like that")
        self._leaps, self._last = 0, stamped
        return None


DRIVER = Driver(Ms5837Knobs, lambda knobs, mount, _vehicle: Ms5837(knobs, mount.address))
