"""Self test of the ICM-20948 and its magnetometer: the response to a built-in stimulus against the factory's limits.

Procedure and limits as in TDK's embedded motion driver: full scales 250 dps and 2 g, 102 Hz, means of 200 readings
10 ms apart without and with the stimulus. The vehicle must stand still. Not to be run while the device is in a
schedule: remove it before, and configure it again afterwards.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_core.bus_operations import Pause, Program, Write, WriteRead
from hindrax_core.readings import Vec3
from hindrax_drivers.devices.imu import ak09916
from hindrax_drivers.devices.imu import icm20948_registers as r

READINGS = 200
SPACING_S = 0.01
SETTLE_S = 0.02
DIVIDER = 10
GYRO_LEAST = 0.5
ACCEL_SHARES = (0.5, 1.5)
MAG_LIMITS = ((-200, 200), (-200, 200), (-1000, -200))
"""Counts of x, y, z, with the sensitivity adjustment of 1. AKM's own self test of the AK09916 (FST_AK09916)."""

_SAMPLE = struct.Struct(">6h")


@dataclass(frozen=True, slots=True)
class SelfTest:
    """Response of each axis as a share of the factory's; 0 where the factory stored none.

    `mag` has counts of the magnetometer's own field; None where it did not answer.
    """

    gyro: Vec3
    accel: Vec3
    mag: tuple[int, int, int] | None

    @property
    def passed(self) -> bool:
        """Whether all nine axes respond within the limits."""
        low, high = ACCEL_SHARES
        magnetic = self.mag is not None and all(
            least <= one <= most for one, (least, most) in zip(self.mag, MAG_LIMITS, strict=True)
        )
        return magnetic and min(self.gyro) >= GYRO_LEAST and all(low <= one <= high for one in self.accel)

    def __str__(self) -> str:
        gyro, accel = (", ".join(f"{one:.0%}" for one in axes) for axes in (self.gyro, self.accel))
        verdict = "passed" if self.passed else "failed"
        mag = "no answer" if self.mag is None else "{}, {}, {} counts".format(*self.mag)
        return (
            f"self test {verdict}: response of the gyroscope {gyro}, of the accelerometer {accel} of the factory's; "
            f"magnetometer {mag}"
        )


def self_test(address: int = r.ADDRESS) -> Program[SelfTest]:
    """Test a part that is awake and has its bypass on. Takes 4 s."""
    codes = yield from _prepare(address)
    before = yield from _mean(address)
    yield from _stimulate(address, r.GYRO_SELF_TEST, r.ACCEL_SELF_TEST)
    during = yield from _mean(address)
    yield from _stimulate(address, 0, 0)
    moved = [abs(b - a) for a, b in zip(before, during, strict=True)]
    ax, ay, az, gx, gy, gz = (_share(one, code) for one, code in zip(moved, codes, strict=True))
    mag = yield from ak09916.self_test()
    return SelfTest((gx, gy, gz), (ax, ay, az), mag)


def _share(moved: float, code: int) -> float:
    """Share of the counts that the factory measured: 2620 * 1.01^(code - 1)."""
    return moved / (2620.0 * 1.01 ** (code - 1)) if code else 0.0


def _prepare(address: int) -> Program[bytes]:
    """Set scales and rate; returns the factory's codes: accel x, y, z, gyro x, y, z."""
    config = r.config_byte(7, 0)
    yield Write(address, bytes([r.BANK, 0x10]))
    gyro = yield WriteRead(address, bytes([r.SELF_TEST_GYRO]), 3)
    accel = yield WriteRead(address, bytes([r.SELF_TEST_ACCEL]), 3)
    yield Write(address, bytes([r.BANK, 0x20]))
    yield Write(address, bytes([r.GYRO_SMPLRT_DIV, DIVIDER, config]))
    yield Write(address, bytes([r.ACCEL_SMPLRT_DIV_1, 0, DIVIDER]))
    yield Write(address, bytes([r.ACCEL_CONFIG, config]))
    yield Write(address, bytes([r.BANK, 0x00]))
    yield Pause(SETTLE_S)
    return accel + gyro


def _stimulate(address: int, gyro: int, accel: int) -> Program[None]:
    yield Write(address, bytes([r.BANK, 0x20]))
    yield Write(address, bytes([r.GYRO_CONFIG_2, gyro]))
    yield Write(address, bytes([r.ACCEL_CONFIG_2, accel]))
    yield Write(address, bytes([r.BANK, 0x00]))
    yield Pause(SETTLE_S)


def _mean(address: int) -> Program[Sequence[float]]:
    sums = [0] * 6
    for _ in range(READINGS):
        raw = yield WriteRead(address, bytes([r.ACCEL_XOUT_H]), _SAMPLE.size)
        sums = [total + one for total, one in zip(sums, _SAMPLE.unpack(raw), strict=True)]
        yield Pause(SPACING_S)
    return [total / READINGS for total in sums]
