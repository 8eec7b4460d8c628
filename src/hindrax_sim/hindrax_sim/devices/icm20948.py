"""ICM-20948 as a register model: banks, reset and sleep, FIFO, status, bypass and inner I2C master.

Samples are computed on access, from the history of truths. Source: TDK DS-000189 r1.3, independent of the driver.
"""

import math
import struct
from collections.abc import Callable

from hindrax_core.bus_operations import EDGES
from hindrax_core.readings import DeviceText, Inertial, Magnetic
from hindrax_core.vehicle import Mount, chip_and_line
from hindrax_sim.devices.emulator import Emulator, FurtherAddress, NackError, Part
from hindrax_sim.devices.imu import imu_signal
from hindrax_sim.devices.imu.ak09916 import Ak09916
from hindrax_sim.devices.imu.icm20948_fifo_master import MAG_ADDRESS, Fifo, InnerMaster
from hindrax_sim.devices.imu.imu_signal import Converters, ImuSignal, ImuTruth, SensorErrors
from hindrax_sim.world import Mounting, World

WHO_AM_I, USER_CTRL, LP_CONFIG, PWR_MGMT_1, PWR_MGMT_2, INT_PIN_CFG = 0x00, 0x03, 0x05, 0x06, 0x07, 0x0F
INT_ENABLE_1 = 0x11
I2C_MST_STATUS, INT_STATUS_1, INT_STATUS_2 = 0x17, 0x1A, 0x1B
DATA_FIRST, TEMP_OUT, EXTERNAL_FIRST, EXTERNAL_LAST = 0x2D, 0x39, 0x3B, 0x52
FIFO_EN_2, FIFO_RST, FIFO_MODE, FIFO_COUNTH, FIFO_COUNTL, FIFO_R_W = 0x67, 0x68, 0x69, 0x70, 0x71, 0x72
DATA_RDY_STATUS, BANK_SELECT = 0x74, 0x7F
SELF_TEST_GYRO, SELF_TEST_ACCEL = 0x02, 0x0E
GYRO_CONFIG_1, ACCEL_CONFIG = 0x01, 0x14

DEVICE_RESET, SLEEP = 0x80, 0x40
ACCEL_OFF, GYRO_OFF = 0x38, 0x07
NO_PULSE = 0xA0
"""INT_PIN_CFG: active low, or a level that is held until the status is read."""
FIFO_EN, I2C_MST_EN, FIFO_HOLD, BYPASS_EN = 0x40, 0x20, 0x01, 0x02
TEMPORARY = 0x0E
"""Bits of USER_CTRL that start something and clear themselves."""
READ_ONLY = frozenset((WHO_AM_I, I2C_MST_STATUS, *range(INT_STATUS_1, INT_STATUS_2 + 1), *range(0x2D, 0x53)))

IDENTITY, MPU9250 = 0xEA, 0x71
RESET_S = 0.005
WAKE_S = 0.02


class Icm20948(Part[ImuTruth]):
    """One part. Attach it at 0x68 or 0x69, and its `magnetometer` at 0x0C. Disguised, it is an MPU-9250."""

    def __init__(self, seed: int = 0, imperfections: SensorErrors | None = None) -> None:
        super().__init__(ImuTruth())
        self.signal = ImuSignal(imu_signal.typical(seed) if imperfections is None else imperfections, seed)
        self.compass = Ak09916(self.signal)
        self.magnetometer = FurtherAddress(
            lambda data, now_s: self._bypassed().write(data, now_s),
            lambda count, now_s: self._bypassed().read(count, now_s),
        )
        self._converters = Converters(self.signal)
        self._master = InnerMaster(self.compass)
        self.data_ready = DataReadyLine(self)
        self._fifo = Fifo()
        self.power_cycle(0.0)

    def set_truth(self, truth: ImuTruth, now_s: float) -> None:
        """Set the truth at a time, not earlier than the last one."""
        self.signal.set_truth(truth, now_s)

    def saturate(self, on: bool) -> None:
        """Fault: all converters at the end of their scale."""
        self._converters.saturated = on
        self.compass.saturated = on

    def hang(self, on: bool) -> None:
        """Fault: the converters repeat the last sample."""
        self._converters.hung = on
        self.compass.hung = on

    def power_cycle(self, now_s: float) -> None:
        """Reset all dies to their power-on state: asleep. A brown-out in mid-stream does the same."""
        self.compass.power_cycle()
        self._reset(now_s)

    def _reset(self, now_s: float) -> None:
        self._banks = [bytearray(128) for _ in range(4)]
        self._banks[0][PWR_MGMT_1], self._banks[0][LP_CONFIG] = SLEEP | 0x01, 0x40
        self._banks[1][SELF_TEST_GYRO : SELF_TEST_GYRO + 3] = imu_signal.SELF_TEST_CODES
        self._banks[1][SELF_TEST_ACCEL : SELF_TEST_ACCEL + 3] = imu_signal.SELF_TEST_CODES
        self._banks[2][GYRO_CONFIG_1] = self._banks[2][ACCEL_CONFIG] = 0x01
        self._bank = self._pointer = 0
        self._sample = bytes(12)
        self._ready = False
        self._ready_until_s = now_s + RESET_S
        self._served_s = now_s
        self._fifo.empty()
        self._master.power_cycle()
        self._converters.stop()
        self._converters.configure(self._banks[2])

    # ---- the bus

    def write(self, data: bytes, now_s: float) -> None:
        """Register address, then values for it and the registers after it."""
        self._advance(now_s)
        if data:
            self._pointer = data[0] & 0x7F
        for value in data[1:]:
            self._set(self._pointer, value, now_s)
            self._pointer = (self._pointer + 1) & 0x7F

    def read(self, count: int, now_s: float) -> bytes:
        """Bytes from the register address on; at FIFO_R_W the address stays and the FIFO is read."""
        self._advance(now_s)
        found = bytearray()
        while len(found) < count:
            if self._bank == 0 and self._pointer == FIFO_R_W:
                return bytes(found) + self._fifo.pop(count - len(found))
            found.append(self._get(self._pointer, now_s))
            self._pointer = (self._pointer + 1) & 0x7F
        return bytes(found)

    # ---- time

    def _advance(self, now_s: float) -> None:
        bank = self._banks[0]
        filling = bank[USER_CTRL] & FIFO_EN and not bank[FIFO_RST] & FIFO_HOLD
        pulsing = bank[INT_ENABLE_1] & 0x01 and not bank[INT_PIN_CFG] & NO_PULSE
        for taken_s, sample in self._converters.advance(now_s):
            if pulsing:
                self.data_ready.rise(taken_s)
            self._sample, self._ready = self._switched(sample), True
            if filling:
                self._fifo.push(self._sample, self._temperature(), bank[FIFO_EN_2], bank[FIFO_MODE])
        if self._mastering() and now_s - self._served_s >= self._converters.period_s:
            self._serve(now_s)

    def _switched(self, sample: bytes) -> bytes:
        """Sample in which axes switched off by PWR_MGMT_2 keep their last value."""
        off = self._banks[0][PWR_MGMT_2]
        if off & ACCEL_OFF == ACCEL_OFF:
            sample = self._sample[:6] + sample[6:]
        return sample[:6] + self._sample[6:] if off & GYRO_OFF == GYRO_OFF else sample

    def _serve(self, now_s: float) -> None:
        self._served_s = now_s
        self._master.serve(self._banks[3], now_s)

    def _mastering(self) -> bool:
        return bool(self._banks[0][USER_CTRL] & I2C_MST_EN)

    def _bypassed(self) -> Ak09916:
        """The magnetometer on the host's bus, while the bypass connects it."""
        if self._mastering() or not self._banks[0][INT_PIN_CFG] & BYPASS_EN:
            raise NackError
        return self.compass

    # ---- registers

    def _get(self, register: int, now_s: float) -> int:
        if register == BANK_SELECT:
            return self._bank << 4
        if self._bank != 0:
            return self._banks[self._bank][register]
        if DATA_FIRST <= register < TEMP_OUT:
            return self._sample[register - DATA_FIRST]
        if TEMP_OUT <= register < EXTERNAL_FIRST:
            return self._temperature()[register - TEMP_OUT]
        if EXTERNAL_FIRST <= register <= EXTERNAL_LAST:
            return self._master.external[register - EXTERNAL_FIRST]
        return self._status(register, now_s)

    def _status(self, register: int, now_s: float) -> int:
        """Status registers of bank 0; all others return what was written."""
        value = self._banks[0][register]
        if register == WHO_AM_I:
            value = MPU9250 if self._disguised else IDENTITY
        elif register == PWR_MGMT_1 and now_s < self._ready_until_s:
            value |= DEVICE_RESET
        elif register in (INT_STATUS_1, DATA_RDY_STATUS):
            value, self._ready = int(self._ready), self._ready and register != INT_STATUS_1
        elif register == INT_STATUS_2:
            value, self._fifo.overflowed = int(self._fifo.overflowed), False
        elif register == I2C_MST_STATUS:
            value, self._master.status = self._master.status, 0
        elif register in (FIFO_COUNTH, FIFO_COUNTL):
            value = len(self._fifo) >> (8 if register == FIFO_COUNTH else 0) & 0xFF
        return value

    def _temperature(self) -> bytes:
        raw = round((self.signal.truth.temperature_C - 21.0) * 333.87)
        return struct.pack(">h", max(-32768, min(32767, raw)))

    def _set(self, register: int, value: int, now_s: float) -> None:
        if register == BANK_SELECT:
            self._bank = value >> 4 & 3
        elif self._bank == 0:
            self._control(register, value, now_s)
        else:
            self._banks[self._bank][register] = value
            if self._bank == 2:
                self._converters.configure(self._banks[2])
            elif self._bank == 3 and self._mastering():
                self._master.serve_once(self._banks[3], now_s)

    def _control(self, register: int, value: int, now_s: float) -> None:
        if register in READ_ONLY:
            return
        old = self._banks[0][register]
        self._banks[0][register] = value & ~TEMPORARY if register == USER_CTRL else value
        if register == PWR_MGMT_1:
            self._power(value, old, now_s)
        elif register == USER_CTRL and self._mastering() and not old & I2C_MST_EN:
            self._master.serve_once(self._banks[3], now_s)
            self._serve(now_s)
        elif register == FIFO_RST and value:
            self._fifo.empty()

    def _power(self, value: int, old: int, now_s: float) -> None:
        if value & DEVICE_RESET:
            self._reset(now_s)
        elif value & SLEEP:
            self._converters.stop()
        elif old & SLEEP:
            self._converters.start(now_s + WAKE_S)


class DataReadyLine:
    """INT1 as a GPIO whose rising edges a kernel counts and stamps, at an address from EDGES on."""

    def __init__(self, part: Icm20948) -> None:
        self._part = part
        self._edges, self._newest_s = 0, 0.0
        self.cut = False
        """Fault: the wire is broken."""
        self.wired_to: Callable[[float], None] = lambda _taken_s: None
        """What else sees each edge: a pin of a real kernel."""

    def rise(self, taken_s: float) -> None:
        """A sample is ready."""
        if not self.cut:
            self._edges, self._newest_s = self._edges + 1, taken_s
            self.wired_to(taken_s)

    def write(self, _data: bytes, now_s: float) -> None:
        """Be watched from now on; the name of the chip does not matter."""
        self._part.read(0, now_s)
        self._edges, self._newest_s = 0, 0.0

    def read(self, count: int, now_s: float) -> bytes:
        """Count and time of the edges."""
        self._part.read(0, now_s)
        return struct.pack(">Iq", self._edges, round(1e9 * self._newest_s))[:count]


def _also_at(part: Icm20948, mount: Mount) -> dict[int, object]:
    line = {EDGES + chip_and_line(mount.data_ready, "data_ready")[1]: part.data_ready} if mount.data_ready else {}
    return {MAG_ADDRESS: part.magnetometer, **line}


def _truth(world: World, at: Mounting) -> ImuTruth:
    force, rate = world.inertial(at)
    return ImuTruth(force, rate, world.magnetic_T(at), 24.0)


def _agrees(truth: ImuTruth, reading: object) -> bool:
    """Offsets (25 mg an axis) and noise are small; the rest is damage that looks like motion, which no check finds.

    One flipped bit of half a g is such damage: a contact of the vehicle gives as much.
    """
    if isinstance(reading, Inertial):
        force = math.dist(reading.specific_force_mps2, truth.specific_force_mps2)
        return force < 5.5 and math.dist(reading.rate_radps, truth.rate_radps) < 1.0
    if isinstance(reading, Magnetic):
        return math.dist(reading.field_T, truth.field_T) < 30e-6
    return isinstance(reading, DeviceText)


EMULATOR = Emulator(
    lambda seed: Icm20948(seed=seed),
    _truth,
    lambda seconds: ImuTruth((0.5, -0.5, 9.7), (0.1, 0.0, -0.1 + 0.05 * math.sin(0.5 * seconds))),
    _agrees,
    address=0x68,  # DS-000189, section 6.2, with AD0 low
    also_at=_also_at,
)
