"""AK09916 magnetometer as a register model: modes, data ready and overrun, locking by ST2. TDK DS-000189 section 13."""

import struct

from hindrax_core.readings import Vec3
from hindrax_sim.devices.imu.imu_signal import ImuSignal

WIA1, WIA2, ST1, HXL, TMPS, ST2, CNTL2, CNTL3 = 0x00, 0x01, 0x10, 0x11, 0x17, 0x18, 0x31, 0x32
ORDER = (0x00, 0x01, 0x02, 0x03, *range(ST1, ST2 + 1))
"""Addresses in the order in which a burst runs through them, and begins again."""

IDENTITY = b"\x48\x09"
READY, OVERRUN, TOO_STRONG = 0x01, 0x02, 0x08
SINGLE, SELF_TEST = 0x01, 0x10
PERIOD_S = {0x02: 0.1, 0x04: 0.05, 0x06: 0.02, 0x08: 0.01}
MEASUREMENT_S = 0.0072
T_PER_LSB = 0.15e-6
LARGEST_COUNT = 32752
LARGEST_SUM_T = 4912e-6
NOISE_LSB = 2.0
SATURATED = (32767, -32767, 32767)
SELF_TEST_FIELD = (0, 0, -500)


class Ak09916:
    """The second die, with converters that may hang or saturate."""

    def __init__(self, signal: ImuSignal) -> None:
        self._signal = signal
        self.hung = self.saturated = False
        self.power_cycle()

    def power_cycle(self) -> None:
        """Power down mode, nothing measured."""
        self._mode = 0
        self._since_s = 0.0
        self._taken = 0
        self._status = 0
        self._data = bytes(6)
        self._strong = False
        self._locked = False
        self._pointer = 0

    def write(self, data: bytes, now_s: float) -> None:
        """Register address, then values for it and the registers after it."""
        self._advance(now_s)
        if data:
            self._pointer = data[0]
        for offset, value in enumerate(data[1:]):
            self._set(self._pointer + offset, value, now_s)

    def read(self, count: int, now_s: float) -> bytes:
        """Bytes from the register address on."""
        self._advance(now_s)
        found = bytearray()
        at = ORDER.index(self._pointer) if self._pointer in ORDER else -1
        for offset in range(count):
            found.append(self._get(ORDER[(at + offset) % len(ORDER)] if at >= 0 else self._pointer + offset))
        return bytes(found)

    def _set(self, register: int, value: int, now_s: float) -> None:
        if register == CNTL2:
            # Drivers in the field read single measurements without ST2: starting the next one releases the lock too.
            self._mode, self._since_s, self._taken, self._locked = value & 0x1F, now_s, 0, False
        elif register == CNTL3 and value & 0x01:
            self.power_cycle()

    def _get(self, register: int) -> int:
        if register in (WIA1, WIA2):
            return IDENTITY[register]
        if register == ST1:
            return self._status
        if HXL <= register <= TMPS:
            self._locked = True
            self._status = 0
            return self._data[register - HXL] if register < TMPS else 0
        if register == ST2:
            self._locked = False
            self._status = 0
            return TOO_STRONG if self._strong else 0
        return self._mode if register == CNTL2 else 0

    def _advance(self, now_s: float) -> None:
        """Take the newest measurement that is finished; one that is being read stays until ST2 releases it."""
        elapsed_s = now_s - self._since_s
        if self._mode in (SINGLE, SELF_TEST):
            if elapsed_s >= MEASUREMENT_S:
                self._measure(SELF_TEST_FIELD if self._mode == SELF_TEST else self._counts())
                self._mode = 0
        elif self._mode in PERIOD_S:
            taken = int(elapsed_s / PERIOD_S[self._mode])
            if taken > self._taken:
                self._status |= OVERRUN if self._status & READY or taken > self._taken + 1 else 0
                self._taken = taken
                self._measure(self._counts())

    def _measure(self, counts: tuple[int, int, int]) -> None:
        if self._locked:
            self._status |= OVERRUN
            return
        x, y, z = SATURATED if self.saturated else counts
        self._strong = (abs(x) + abs(y) + abs(z)) * T_PER_LSB >= LARGEST_SUM_T
        if not self.hung:
            self._data = struct.pack("<3h", *(max(-LARGEST_COUNT, min(LARGEST_COUNT, one)) for one in (x, y, z)))
        self._status |= READY

    def _counts(self) -> tuple[int, int, int]:
        """Field in the axes of this die: y and z point against those of the inertial sensor."""
        truth, part = self._signal.truth.field_T, self._signal.imperfections
        noise = part.noise * NOISE_LSB
        x, y, z = (one + iron for one, iron in zip(truth, part.hard_iron_T, strict=True))
        own: Vec3 = (x, -y, -z)
        a, b, c = (round(one / T_PER_LSB + noise * self._signal.normal()) for one in own)
        return (a, b, c)
