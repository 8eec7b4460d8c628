"""PCA9685 as a register model, with an inexact 25 MHz oscillator. Data sheet: NXP PCA9685 rev. 4, section 7.

`pulse_us(channel)` is the pulse at a speed controller; `changes` remembers when it changed. What the data sheet
forbids or leaves undefined is not played through but written down in `violations`.
"""

import struct
from collections import deque
from dataclasses import dataclass

from hindrax_sim.devices.emulator import FurtherAddress, NackError

CHANNELS = 16
STEPS = 4096
MODE1, MODE2, SUBADR1, LED0, LED15_LAST = 0x00, 0x01, 0x02, 0x06, 0x45
ALL_LED, ALL_LED_LAST, PRE_SCALE = 0xFA, 0xFD, 0xFE
RESTART, EXTCLK, AUTO_INCREMENT, SLEEP, ALLCALL = 0x80, 0x40, 0x20, 0x10, 0x01
WAKE_S = 0.0005
SOFTWARE_RESET = b"\x06"
_COUNTS = struct.Struct("<2H")
CHANGES_KEPT, VIOLATIONS_KEPT = 20_000, 100


@dataclass(frozen=True, slots=True)
class Change:
    """Pulse of every channel from this time on [us]; None where there are no pulses."""

    now_s: float
    pulses_us: tuple[float | None, ...]


class Pca9685:
    """One chip. `clock_error` is the relative error of its oscillator; an `external_Hz` clock may be wired to it."""

    def __init__(self, *, clock_error: float = 0.0, external_Hz: float = 0.0) -> None:
        self.clock_error = clock_error
        self.violations: deque[str] = deque(maxlen=VIOLATIONS_KEPT)
        self.changes: deque[Change] = deque(maxlen=CHANGES_KEPT)
        self._external_Hz = external_Hz
        self._pulses_us: tuple[float | None, ...] = (None,) * CHANNELS
        self._noted: tuple[bytes, int, bool, bool] | None = None
        self._enabled = True
        self.all_call, self.general_call = FurtherAddress(self._on_all_call), FurtherAddress(self._on_general_call)
        self.power_cycle(0.0)

    def power_cycle(self, now_s: float) -> None:
        """All registers to their values at power-on: asleep, 200 Hz, all channels off, all-call on."""
        self._registers = bytearray(256)
        self._registers[MODE1], self._registers[MODE2] = SLEEP | ALLCALL, 0x04
        self._registers[SUBADR1 : SUBADR1 + 4] = b"\xe2\xe4\xe8\xe0"
        self._registers[LED0 : LED15_LAST + 1] = b"\x00\x00\x00\x10" * CHANNELS
        self._registers[PRE_SCALE] = 0x1E
        self._pointer = 0
        self._woken_s = float("-inf")
        self._resumed = False
        self._note(now_s)

    def enable(self, now_s: float, *, low: bool) -> None:
        """Level of the output-enable line, OE: while it is high, all channels are low (section 7.4)."""
        if low is not self._enabled:
            self._enabled = low
            self._note(now_s)

    @property
    def rate_Hz(self) -> float:
        """Pulses per second, with the actual frequency of the oscillator."""
        return self._clock_Hz / (STEPS * (self._registers[PRE_SCALE] + 1))

    def pulse_us(self, channel: int) -> float | None:
        """Length of the pulses on a channel; None while it is steady, low or high."""
        return self._pulses_us[channel]

    def pulses_us(self) -> tuple[float | None, ...]:
        """Pulses of all channels."""
        return self._pulses_us

    def write(self, data: bytes, now_s: float) -> None:
        """First the register, then values; outputs change at the STOP that ends the write."""
        if not data:
            return
        self._pointer = data[0]
        for value in data[1:]:
            self._set(self._pointer, value, now_s)
            self._advance()
        self._note(now_s)

    def _on_all_call(self, data: bytes, now_s: float) -> None:
        """Address 0x70, where a write goes to every chip of the bus while its MODE1 enables it."""
        if not self._registers[MODE1] & ALLCALL:
            raise NackError
        self.write(data, now_s)

    def _on_general_call(self, data: bytes, now_s: float) -> None:
        """Address 0x00: one byte is the software reset."""
        if data != SOFTWARE_RESET:
            raise NackError
        self.power_cycle(now_s)

    def read(self, count: int, _now_s: float) -> bytes:
        """Bytes from the register last written or read on."""
        found = bytearray()
        for _ in range(count):
            # ALL_LED registers are write-only and read as zero.
            found.append(0 if ALL_LED <= self._pointer <= ALL_LED_LAST else self._registers[self._pointer])
            self._advance()
        return bytes(found)

    @property
    def _clock_Hz(self) -> float:
        if self._registers[MODE1] & EXTCLK:
            return self._external_Hz
        return 25e6 * (1.0 + self.clock_error)

    def _made_us(self, on: int, off: int) -> float | None:
        stopped = self._registers[MODE1] & SLEEP or not self._resumed or not self._enabled or self._clock_Hz <= 0.0
        if stopped or (on | off) & STEPS or on == off:
            return None
        return ((off - on) % STEPS) * 1e6 * (self._registers[PRE_SCALE] + 1) / self._clock_Hz

    def _advance(self) -> None:
        if self._registers[MODE1] & AUTO_INCREMENT:
            self._pointer = 0 if self._pointer in (LED15_LAST, 0xFF) else self._pointer + 1

    def _set(self, register: int, value: int, now_s: float) -> None:
        if register == MODE1:
            self._set_mode1(value, now_s)
        elif register == PRE_SCALE:
            self._set_prescale(value)
        elif LED0 <= register <= LED15_LAST:
            self._set_channel(register, value, now_s)
        elif ALL_LED <= register <= ALL_LED_LAST:
            for channel in range(CHANNELS):
                self._set_channel(LED0 + 4 * channel + register - ALL_LED, value, now_s)
        elif register < LED0:
            self._registers[register] = value
        else:
            self.violations.append(f"wrote {value:#04x} to reserved register {register:#04x}")

    def _set_mode1(self, value: int, now_s: float) -> None:
        before = self._registers[MODE1]
        # EXTCLK is accepted only while asleep, and stays until power-off or a software reset.
        external = before & EXTCLK or (value & EXTCLK if before & SLEEP and value & SLEEP else 0)
        restart = before & RESTART
        if value & SLEEP and not before & SLEEP and self._resumed:
            restart, self._resumed = RESTART, False
        if before & SLEEP and not value & SLEEP:
            self._woken_s = now_s
        if value & RESTART and restart and not value & SLEEP:
            restart, self._resumed = 0, True
        self._registers[MODE1] = value & ~(RESTART | EXTCLK) | external | restart

    def _set_prescale(self, value: int) -> None:
        if self._registers[MODE1] & SLEEP:
            self._registers[PRE_SCALE] = max(3, value)
        else:
            self.violations.append("wrote PRE_SCALE while awake: it is ignored")

    def _set_channel(self, register: int, value: int, now_s: float) -> None:
        self._start_outputs(now_s)
        self._registers[register] = value & (0x1F if register % 2 else 0xFF)

    def _start_outputs(self, now_s: float) -> None:
        mode1 = self._registers[MODE1]
        if not mode1 & SLEEP:
            if now_s - self._woken_s < WAKE_S - 1e-9:
                self.violations.append(f"wrote a channel {now_s - self._woken_s:.6f} s after waking")
            # A write to a channel while awake starts the outputs and makes a restart moot (section 7.3.1.1).
            self._resumed = True
            self._registers[MODE1] = mode1 & ~RESTART

    def _note(self, now_s: float) -> None:
        """Recompute the pulses after a change of their registers."""
        state = (bytes(self._registers[: LED15_LAST + 1]), self._registers[PRE_SCALE], self._resumed, self._enabled)
        if state == self._noted:
            return
        self._noted = state
        counts = list(_COUNTS.iter_unpack(self._registers[LED0 : LED15_LAST + 1]))
        pulses = tuple(self._made_us(on, off) for on, off in counts)
        alike = ((channel, on) for channel, (on, off) in enumerate(counts) if on == off)
        self.violations.extend(f"channel {channel}: ON and OFF are both {on}" for channel, on in alike)
        if not self.changes or pulses != self._pulses_us:
            self.changes.append(Change(now_s, pulses))
        self._pulses_us = pulses


class LoopBack:
    """A channel that is wired back to a GPIO, whose rising edges a kernel counts and stamps, at EDGES and the line."""

    def __init__(self, chip: Pca9685, channel: int) -> None:
        self._chip, self._channel = chip, channel
        self._since_s = 0.0

    def write(self, _data: bytes, now_s: float) -> None:
        """Be watched from now on; the name of the chip does not matter."""
        self._since_s = now_s

    def read(self, count: int, now_s: float) -> bytes:
        """Count and time of the edges, as if the pulses had been there since the line is watched."""
        if self._chip.pulse_us(self._channel) is None:
            return bytes(count)
        edges = int((now_s - self._since_s) * self._chip.rate_Hz)
        return struct.pack(">Iq", edges, round(1e9 * (self._since_s + edges / self._chip.rate_Hz)))[:count]
