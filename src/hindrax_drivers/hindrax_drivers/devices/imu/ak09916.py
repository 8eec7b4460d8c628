"""The AK09916 magnetometer inside an ICM-20948, on the host's bus by the bypass. TDK DS-000189 r1.3, section 13.

It is a separate die that can fail alone: the inertial sensor then continues without it, and it is set up again.
"""

import struct
from collections.abc import Sequence

from hindrax_core.bus_operations import DeviceError, Pause, Program, Write, WriteRead
from hindrax_core.events import Rejected, Stamp, Stamped, after, seconds_between
from hindrax_core.readings import Magnetic
from hindrax_core.rejects import Reject, RejectCode, reject
from hindrax_drivers.devices.imu import icm20948_registers as r
from hindrax_drivers.imu_calibration import Correction

PART = "magnetometer"
SET_UP_EVERY_S = 1.0
SILENT_S = 0.5
REPEATS = 20
"""The field is noisy to about two counts per axis, so this many equal samples in a row are a device that has hung."""

LEAST_STEP_LSB = 130
FASTEST_LSBps = 3250
"""20 uT in 40 ms: more than a turn of 8 rad/s does, and so damage on the wire."""
ACCEPT_AFTER = 3
"""A leap this often confirmed was real, however large."""

# Mode 100 Hz: a sample is at most 10 ms old when it is read, and the measurement before it took 7.2 ms.
MEAN_AGE_S = 0.5 * 0.01 + 0.5 * 0.0072

SELF_TEST_TRIES = 5

_FIELD = struct.Struct("<3h")

MagOutputs = Sequence[Stamped[Magnetic] | Rejected]


class Ak09916:
    """Set-up and reading of the magnetometer; `read` returns bus errors as data."""

    def __init__(self, correction: Correction) -> None:
        self._correction = correction
        self._ready, self._tried = False, Stamp(0)

    def configure(self) -> Program[str]:
        """Reset, identify, measure at 100 Hz. Returns the identity, or the reason for no answer."""
        self._ready = False
        try:
            yield Write(r.MAG_ADDRESS, bytes([r.MAG_CNTL3, r.MAG_RESET]))
            yield Pause(0.001)
            identity = yield WriteRead(r.MAG_ADDRESS, bytes([r.MAG_WIA1]), 2)
            if identity != r.MAG_IDENTITY:
                return f"no AK09916 (found identity {identity.hex()}, wanted {r.MAG_IDENTITY.hex()})"
            yield Write(r.MAG_ADDRESS, bytes([r.MAG_CNTL2, r.MAG_100_HZ]))
        except DeviceError as error:
            return f"no AK09916 ({error})"
        self._ready = True
        self._sampled_at = self._accepted_at = Stamp(0)
        self._last = b""
        self._accepted: tuple[int, ...] | None = None
        self._repeats = self._leaps = 0
        return "AK09916"

    def read(self, stamp: Stamp) -> Program[MagOutputs]:
        """Read the newest sample, if any; a lost magnetometer is set up again once a second."""
        if not self._ready:
            return (yield from self._set_up_again(stamp))
        try:
            block = yield WriteRead(r.MAG_ADDRESS, bytes([r.MAG_ST1]), r.MAG_BLOCK)
        except DeviceError as error:
            return self._lost(stamp, reject(RejectCode.BUS, PART, found=str(error)))
        return self._decode(block, stamp)

    def _set_up_again(self, stamp: Stamp) -> Program[MagOutputs]:
        if 0.0 <= seconds_between(self._tried, stamp) < SET_UP_EVERY_S:
            return ()
        self._tried = stamp
        found = yield from self.configure()
        return () if self._ready else (Rejected(stamp, reject(RejectCode.NO_DEVICE, PART, found=found)),)

    def _decode(self, block: bytes, stamp: Stamp) -> MagOutputs:
        """Decode a sample that is ready, has not overflowed and is not stuck."""
        if not block[0] & r.MAG_READY:
            self._sampled_at = self._sampled_at if 0 < self._sampled_at <= stamp else stamp
            if seconds_between(self._sampled_at, stamp) <= SILENT_S:
                return ()
            return self._lost(stamp, reject(RejectCode.SILENT, PART, found=f"no sample for {SILENT_S} s"))
        self._sampled_at = stamp
        if block[8] & r.MAG_OVERFLOW:
            return (Rejected(stamp, reject(RejectCode.TOO_STRONG, PART), block),)
        field = block[1:7]
        self._repeats = self._repeats + 1 if field == self._last else 0
        self._last = field
        if self._repeats >= REPEATS:
            return self._lost(stamp, reject(RejectCode.REPEATED, PART, found=f"{self._repeats} equal samples"), block)
        counts = _FIELD.unpack(field)
        if self._jumps(counts, stamp):
            return (Rejected(stamp, reject(RejectCode.LEAP, PART, found="leap, no vehicle turns like that"), block),)
        return (Stamped(after(stamp, -MEAN_AGE_S), self._magnetic(*counts)),)

    def _jumps(self, counts: tuple[int, ...], stamp: Stamp) -> bool:
        last, span_s = self._accepted, seconds_between(self._accepted_at, stamp)
        most = max(LEAST_STEP_LSB, FASTEST_LSBps * span_s)
        far = last is not None and any(abs(a - b) > most for a, b in zip(counts, last, strict=True))
        if far and self._leaps < ACCEPT_AFTER:
            self._leaps += 1
            return True
        self._accepted, self._accepted_at, self._leaps = counts, stamp, 0
        return False

    def _magnetic(self, x: int, y: int, z: int) -> Magnetic:
        """To tesla and into the axes of the inertial sensor: y and z of the two dies point in opposite directions."""
        scale = r.MAG_T_PER_LSB
        return Magnetic(self._correction.apply(scale * x, -scale * y, -scale * z))

    def _lost(self, stamp: Stamp, reason: Reject, data: bytes = b"") -> MagOutputs:
        self._ready, self._tried = False, stamp
        return (Rejected(stamp, reason, data),)


def self_test() -> Program[tuple[int, int, int] | None]:
    """Measure the field that the die makes itself; the bypass must be on; resets the die.

    Sequence of the data sheet of the AK09916, section 9.4.4: power down, self-test mode, data ready, read.

    Yields
    ------
    Transaction | Pause
        What it wants from the bus; it returns counts of three axes, None when none comes.
    """
    try:
        yield Write(r.MAG_ADDRESS, bytes([r.MAG_CNTL2, 0]))
        yield Pause(0.001)
        yield Write(r.MAG_ADDRESS, bytes([r.MAG_CNTL2, r.MAG_SELF_TEST]))
        for _ in range(SELF_TEST_TRIES):
            yield Pause(0.01)
            block = yield WriteRead(r.MAG_ADDRESS, bytes([r.MAG_ST1]), r.MAG_BLOCK)
            if block[0] & r.MAG_READY:
                yield Write(r.MAG_ADDRESS, bytes([r.MAG_CNTL3, r.MAG_RESET]))
                x, y, z = _FIELD.unpack(block[1:7])
                return x, y, z
    except DeviceError:
        return None
    return None
