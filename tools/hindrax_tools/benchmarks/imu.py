"""Speed of the inertial sensor's driver: decoding alone, and with its bus transactions through smbus2.

The peers of the decoder do less: they neither stamp nor check anything. The peer with the bus polls sample by sample,
as drivers without a FIFO do; both talk to the same chip in memory, behind the kernel's binary interface.
"""

import itertools
import math
import struct
import timeit
from collections.abc import Callable, Sequence

import numpy as np
from smbus2 import SMBus, i2c_msg
from smbus2 import __version__ as smbus2_version

from hindrax_core.bus_operations import run
from hindrax_core.events import after, stamp_from_s
from hindrax_drivers.buses.i2cdev import Smbus2Bus
from hindrax_drivers.devices.icm20948 import Icm20948
from hindrax_drivers.devices.imu import icm20948_registers as registers
from hindrax_drivers.devices.imu.icm20948_samples import SAMPLE, Icm20948Knobs, SampleDecoder
from hindrax_drivers.imu_calibration import Correction
from hindrax_sim.buses.ioctl_seam import seam
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_tools.benchmarks import row

RATE_Hz = 225.0
BATCH = 5
BATCHES = 200
REPEATS = 15
SEED = 1
START = stamp_from_s(1.0)
PORT = "/dev/i2c-1"
GYRO = registers.gyro_radps_per_lsb(1)
ACCEL = registers.accel_mps2_per_lsb(1)


def rows() -> list[dict[str, object]]:
    """Cost per sample [us], best of 15 passes: a shared machine must not be measured instead of the code."""
    batches = _noise()
    ours = _best_us(lambda: _decode(batches))
    struct_us, numpy_us = (
        _best_us(lambda peer=peer: [peer(data) for data in batches])  # type: ignore[misc]  # bound now, called later
        for peer in (_by_struct, _by_numpy)
    )
    bus = VirtualI2c()
    bus.attach(registers.ADDRESS, _Chip(batches))
    with seam(PORT, bus):
        fetched, polled = _best_us(_fetch()), _best_us(_poll)
    return [
        row("IMU decode, per sample", ours, "struct and a loop, no stamp and no check", struct_us),
        row("IMU decode, per sample", ours, f"numpy {np.__version__} per batch, no stamp and no check", numpy_us),
        row("IMU with its bus, per sample", fetched, f"smbus2 {smbus2_version}, polled sample by sample", polled),
    ]


def _noise() -> list[bytes]:
    """Batches at rest with the sensor's noise."""
    rng = np.random.default_rng(SEED)
    level = np.array([0.0, 0.0, 8192.0, 0.0, 0.0, 0.0])
    raw = np.rint(level + 8.0 * rng.standard_normal((BATCHES, BATCH, 6))).astype(int)
    return [b"".join(SAMPLE.pack(*row) for row in batch) for batch in raw.tolist()]


def _decode(batches: Sequence[bytes]) -> None:
    samples = SampleDecoder(Icm20948Knobs(), Correction())
    for turn, data in enumerate(batches):
        samples.decode(data, after(START, turn * BATCH / RATE_Hz))


def _by_struct(data: bytes) -> list[tuple[list[float], list[float]]]:
    found = []
    for at in range(0, len(data), SAMPLE.size):
        six = struct.unpack_from(">hhhhhh", data, at)
        found.append(([one / 8192.0 * 9.80665 for one in six[:3]], [math.radians(one / 65.5) for one in six[3:]]))
    return found


def _by_numpy(data: bytes) -> tuple[object, object]:
    raw = np.frombuffer(data, dtype=">i2").reshape(-1, 6)
    return raw[:, :3] * ACCEL, raw[:, 3:] * GYRO


class _Chip:
    """As much of an ICM-20948 as both drivers ask for, at no cost of its own; every batch is new."""

    def __init__(self, batches: Sequence[bytes]) -> None:
        self._batches, self._turn, self._register = batches, 0, 0
        self._memory = bytearray(256)
        self._memory[registers.WHO_AM_I] = registers.IDENTITY
        self._memory[registers.INT_STATUS_1] = registers.RAW_DATA_READY

    def write(self, data: bytes, _now_s: float) -> None:
        self._register = data[0]
        if len(data) == 2 and self._register in (registers.GYRO_CONFIG_1, registers.ACCEL_CONFIG):
            self._memory[self._register] = data[1]

    def read(self, count: int, _now_s: float) -> bytes:
        if self._register == registers.FIFO_COUNTH:
            return (BATCH * SAMPLE.size).to_bytes(2, "big")
        if self._register == registers.FIFO_R_W:
            self._turn = (self._turn + 1) % len(self._batches)
            return self._batches[self._turn]
        return bytes(self._memory[self._register : self._register + count])


def _fetch() -> Callable[[], None]:
    """Our driver: count and burst, five samples at a time."""
    bus, sensor = Smbus2Bus(PORT), Icm20948(Icm20948Knobs(magnetometer=False))
    run(sensor.configure(), bus.transfer, lambda _: None)
    stamps = (after(START, turn * BATCH / RATE_Hz) for turn in itertools.count(1))

    def fetch() -> None:
        for stamp in itertools.islice(stamps, BATCHES):
            run(sensor.cycle(stamp), bus.transfer, lambda _: None)

    return fetch


def _poll() -> None:
    """Data ready? Then accel, gyro and temperature: two transactions per sample."""
    bus = SMBus(PORT)
    for _ in range(BATCH * BATCHES):
        if _get(bus, registers.INT_STATUS_1, 1)[0] & 1:
            _by_struct(_get(bus, registers.ACCEL_XOUT_H, 14)[: SAMPLE.size])


def _get(bus: SMBus, register: int, count: int) -> bytes:
    answer = i2c_msg.read(registers.ADDRESS, count)
    bus.i2c_rdwr(i2c_msg.write(registers.ADDRESS, [register]), answer)
    return bytes(answer)


def _best_us(once: Callable[[], object]) -> float:
    """Time per sample [us] of a call that handles all batches."""
    return min(timeit.repeat(once, number=1, repeat=REPEATS)) / (BATCHES * BATCH) * 1e6
