"""NXP PCA9685, 16 channels of pulses, as the output to the speed controllers. Data sheet: NXP PCA9685 rev. 4.

Every channel of the vehicle goes out in one burst; the chip changes all of them together at its STOP (MODE2.OCH = 0).
The oscillator has no tight specification: 1.7 % moves a 1500 us pulse out of the dead band of a Basic ESC, so the clock
is a measured number of the vehicle file, and `applied` returns the pulses of the counts with it.
"""

import math
import struct
from collections.abc import Sequence

from hindrax_core.bus_operations import DeviceError, Pause, Program, Write
from hindrax_core.driver_interface import Identity
from hindrax_core.vehicle import Output, Vehicle
from hindrax_drivers.driver import RegisterPart

MODE1, MODE2, LED0, PRE_SCALE = 0x00, 0x01, 0x06, 0xFE
RESTART, EXTCLK, AUTO_INCREMENT, SLEEP = 0x80, 0x40, 0x20, 0x10
TOTEM_POLE = 0x04  # OUTDRV; OCH = 0: all outputs change at STOP
STEPS = 4096
NOMINAL_CLOCK_Hz = 25e6
FULL_OFF = STEPS  # bit 12 of LEDn_OFF: full OFF
WAKE_S = 0.0005
LARGEST_RATE_Hz = 400.0  # Basic ESC: highest update rate


class Pca9685(RegisterPart):
    """Programs for one chip. `channels` in the order of the pulses to be written; `rest_us` is their pulse at rest."""

    def __init__(self, channels: Sequence[int], rest_us: Sequence[float], output: Output) -> None:
        """ValueError for a rate that no speed controller follows and for channels that collide."""
        if not 24.0 <= output.rate_Hz <= LARGEST_RATE_Hz:
            raise ValueError(f"output.rate_Hz: found {output.rate_Hz:g}, wanted 24 to {LARGEST_RATE_Hz:g} Hz")
        if len(set(channels)) != len(channels) or not all(0 <= one < 16 for one in channels) or not channels:
            raise ValueError(f"output channels: found {list(channels)}, wanted different ones from 0 to 15")
        super().__init__(output.address, output.address)
        self._channels, self.rest_us = tuple(channels), tuple(rest_us)
        self._clock_Hz = NOMINAL_CLOCK_Hz if output.clock_Hz is None else output.clock_Hz
        self._prescale = _prescale(output.rate_Hz, self._clock_Hz)
        self.step_us = (self._prescale + 1) * 1e6 / self._clock_Hz
        """Length of one count."""
        self._awake = AUTO_INCREMENT | (EXTCLK if output.external_clock else 0)
        self._first = min(channels)
        self._slots = max(channels) - self._first + 1

    @property
    def rate_Hz(self) -> float:
        """Pulses per second that the nearest prescaler really makes."""
        return self._clock_Hz / (STEPS * (self._prescale + 1))

    def applied(self, pulses_us: Sequence[float]) -> tuple[float, ...]:
        """Pulses as the counts make them, with the clock as measured [us]."""
        return tuple(self._count(pulse) * self.step_us for pulse in pulses_us)

    def configure(self) -> Program[Identity]:
        """Set neutral pulses at the wanted rate, and verify by reading back.

        A chip that runs as wanted gets its neutral pulses first and is never put to sleep; otherwise its outputs are
        off until neutral is in all its registers. Clears the all-call address, on which a stranger could write.

        Yields
        ------
        Transaction | Pause
            What it wants from the bus; it returns the identity.
        """
        mode = (yield self.get(MODE1, 1))[0]
        prescale = (yield self.get(PRE_SCALE, 1))[0]
        if mode & (SLEEP | EXTCLK | AUTO_INCREMENT) == self._awake and prescale == self._prescale:
            yield from self.neutral()
        else:
            yield from self._wake_neutral()
        yield self.set(MODE1, self._awake)
        yield self.set(MODE2, TOTEM_POLE)
        yield from self.check(self.rest_us)
        name, rate = f"PCA9685 at {self.address:#04x}", f"{self.rate_Hz:.2f} Hz, {self.step_us:.3f} us per count"
        return Identity(f"{name}: {len(self._channels)} channels, {rate}")

    def write(self, pulses_us: Sequence[float]) -> Program[None]:
        """One pulse per channel, in one burst [us]. The speed controllers see all of them change together."""
        yield Write(self.address, bytes([LED0 + 4 * self._first]) + self._registers(pulses_us))

    def hold(self) -> Program[None]:
        """Set every channel to rest at once; if the chip is not as configured, configure it again."""
        yield from self.neutral()
        try:
            yield from self.check(self.rest_us)
        except DeviceError:
            yield from self.configure()

    def neutral(self) -> Program[None]:
        """Set every channel to rest in one burst."""
        yield from self.write(self.rest_us)

    def check(self, pulses_us: Sequence[float]) -> Program[None]:
        """Read back whether the chip is still set up.

        A mismatch means a supply loss, a foreign write, or a lost bit.

        Parameters
        ----------
        pulses_us : [us]
            That are to be in its channels.

        Yields
        ------
        Transaction | Pause
            What it wants from the bus.

        Raises
        ------
        DeviceError
            For a mismatch.
        """
        mode1, mode2 = yield self.get(MODE1, 2)
        (prescale,) = yield self.get(PRE_SCALE, 1)
        found = (mode1 & ~RESTART, mode2, prescale)
        wanted = (self._awake, TOTEM_POLE, self._prescale)
        if found != wanted:
            raise DeviceError(
                f"pca9685 at {self.address:#04x}: MODE1, MODE2, PRE_SCALE are {_hex(found)}, wanted {_hex(wanted)}: "
                "another device, or its supply was lost; check address and supply"
            )
        channels = self._registers(pulses_us)
        there = yield self.get(LED0 + 4 * self._first, len(channels))
        if there != channels:
            raise DeviceError(
                f"pca9685 at {self.address:#04x}: channels read back {there.hex()}, wanted {channels.hex()}; "
                "another device at this address, or a bad line"
            )

    def _wake_neutral(self) -> Program[None]:
        yield self.set(MODE1, SLEEP | AUTO_INCREMENT)
        if self._awake & EXTCLK:
            yield self.set(MODE1, SLEEP | self._awake)  # accepted only in a second write, while asleep
        yield self.set(PRE_SCALE, self._prescale)
        # Neutral before waking: the first pulse a speed controller sees is a whole one, of the right length.
        yield from self.neutral()
        yield self.set(MODE1, self._awake)
        yield Pause(WAKE_S)
        # The outputs stay low after sleep until a channel register is written.
        yield from self.neutral()

    def _registers(self, pulses_us: Sequence[float]) -> bytes:
        """LEDn_ON and LEDn_OFF from the first to the last channel in use; channels between them are off."""
        counts = [0, FULL_OFF] * self._slots
        for channel, pulse in zip(self._channels, pulses_us, strict=True):
            counts[2 * (channel - self._first) + 1] = self._count(pulse)
        return struct.pack(f"<{len(counts)}H", *counts)

    def _count(self, pulse_us: float) -> int:
        count = math.floor(pulse_us / self.step_us + 0.5)
        if not 0 < count < STEPS:
            raise ValueError(f"pulse of {pulse_us:g} us: wanted more than 0 and less than {STEPS * self.step_us:g} us")
        return count


def pca9685_of(vehicle: Vehicle, rest_us: Sequence[float]) -> Pca9685:
    """Chip of a vehicle file: the channels of its thrusters, in order, then those of its lights, and their rest."""
    return Pca9685(vehicle.output_channels(), rest_us, vehicle.output)


def _prescale(rate_Hz: float, clock_Hz: float) -> int:
    """Nearest prescaler, but never one that makes more pulses per second than a speed controller follows."""
    nearest = round(clock_Hz / (STEPS * rate_Hz)) - 1
    slow_enough = math.ceil(clock_Hz / (STEPS * LARGEST_RATE_Hz)) - 1
    return max(3, nearest, slow_enough)


def _hex(values: Sequence[int]) -> str:
    return " ".join(f"{value:02x}" for value in values)
