"""Registers, bits and scales of the ICM-20948 and of the AK09916 inside it. Source: TDK DS-000189 r1.3."""

import math

from hindrax_core.hydrostatics import GRAVITY_mps2

ADDRESS = 0x68
IDENTITY = 0xEA

BANK = 0x7F
"""Bank select, present in every bank; the value is the bank number times 16."""

# Bank 0
WHO_AM_I = 0x00
USER_CTRL = 0x03
LP_CONFIG = 0x05
PWR_MGMT_1 = 0x06
PWR_MGMT_2 = 0x07
INT_PIN_CFG = 0x0F
INT_ENABLE_1 = 0x11
INT_STATUS_1 = 0x1A
ACCEL_XOUT_H = 0x2D
TEMP_OUT_H = 0x39
FIFO_EN_1 = 0x66
FIFO_EN_2 = 0x67
FIFO_RST = 0x68
FIFO_MODE = 0x69
FIFO_COUNTH = 0x70
FIFO_R_W = 0x72

# Bank 1
SELF_TEST_GYRO = 0x02
SELF_TEST_ACCEL = 0x0E

# Bank 2
GYRO_SMPLRT_DIV = 0x00
GYRO_CONFIG_1 = 0x01
GYRO_CONFIG_2 = 0x02
ODR_ALIGN_EN = 0x09
ACCEL_SMPLRT_DIV_1 = 0x10
ACCEL_SMPLRT_DIV_2 = 0x11
ACCEL_CONFIG = 0x14
ACCEL_CONFIG_2 = 0x15

DEVICE_RESET = 0x80
CLOCK_AUTO = 0x01
USER_FIFO_EN = 0x40
BYPASS_EN = 0x02
RAW_DATA_READY = 0x01
"""In INT_STATUS_1, and in INT_ENABLE_1 for a pulse of 50 us on INT1, active high unless INT_PIN_CFG says else."""
FIFO_GYRO_AND_ACCEL = 0x1E
FIFO_ALL = 0x1F
GYRO_SELF_TEST = 0x38
ACCEL_SELF_TEST = 0x1C
FCHOICE = 0x01
"""Low-pass filter on, which also makes the sample rate divider work."""

FILTER_DELAY_S = (0.001, 0.001, 0.0015, 0.003, 0.0065, 0.0135, 0.028, 0.0005)
"""Lag of a first-order filter, 1 / (2 pi f), to half a millisecond, by the gyroscope's corner f: the data sheet has
corners (196.6, 151.8, 119.5, 51.2, 23.9, 11.6, 5.7 and 361.4 Hz, bank 2, GYRO_CONFIG_1), but no delays."""

BASE_RATE_Hz = 1125.0
FIFO_BYTES = 512
SAMPLE_BYTES = 12
"""FIFO layout of one sample: accel x, y, z, gyro x, y, z, each signed 16 bit, high byte first."""

TEMPERATURE_LSB_PER_K = 333.87
TEMPERATURE_OFFSET_C = 21.0

GYRO_RANGES = ("250", "500", "1000", "2000")
GYRO_LSB_PER_DPS = (131.0, 65.5, 32.8, 16.4)
ACCEL_RANGES = ("2", "4", "8", "16")
ACCEL_LSB_PER_G = (16384.0, 8192.0, 4096.0, 2048.0)

MAG_ADDRESS = 0x0C
MAG_IDENTITY = b"\x48\x09"
MAG_WIA1 = 0x00
MAG_ST1 = 0x10
MAG_CNTL2 = 0x31
MAG_CNTL3 = 0x32
MAG_RESET = 0x01
MAG_SELF_TEST = 0x10
MAG_100_HZ = 0x08
MAG_READY = 0x01
MAG_OVERFLOW = 0x08
MAG_BLOCK = 9
"""ST1, field x, y, z (low byte first), a dummy, and ST2, which must be read last: it releases the data registers."""

MAG_T_PER_LSB = 0.15e-6


def gyro_radps_per_lsb(select: int) -> float:
    """Angular rate of one count for a full-scale select (0 to 3)."""
    return math.radians(1.0) / GYRO_LSB_PER_DPS[select]


def accel_mps2_per_lsb(select: int) -> float:
    """Specific force of one count for a full-scale select (0 to 3)."""
    return GRAVITY_mps2 / ACCEL_LSB_PER_G[select]


def config_byte(filter_config: int, select: int) -> int:
    """GYRO_CONFIG_1 and ACCEL_CONFIG: filter in bits 5:3, full scale in bits 2:1, filter on."""
    return filter_config << 3 | select << 1 | FCHOICE


def temperature_C(raw: int) -> float:
    """Die temperature of a count."""
    return raw / TEMPERATURE_LSB_PER_K + TEMPERATURE_OFFSET_C
