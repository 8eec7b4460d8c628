"""ICM-20948 and AK09916 against the numbers of their data sheet."""

import math
import struct
from pathlib import Path
from typing import Any

import pytest
import yaml

from hindrax_core.bus_operations import DeviceError, Operation, Pause, Write, WriteRead
from hindrax_core.events import Rejected, Stamp, Stamped, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Inertial, Magnetic
from hindrax_core.testing import rehearse
from hindrax_drivers.devices.icm20948 import Icm20948
from hindrax_drivers.devices.imu import icm20948_registers as r
from hindrax_drivers.devices.imu.ak09916 import Ak09916
from hindrax_drivers.devices.imu.ak09916 import self_test as ak09916_self_test
from hindrax_drivers.devices.imu.icm20948_samples import Icm20948Knobs
from hindrax_drivers.devices.imu.icm20948_selftest import SelfTest, self_test
from hindrax_drivers.imu_calibration import Correction

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())
NARROW = Icm20948Knobs(gyro_range_dps="250", accel_range_g="2", magnetometer=False)

Line = tuple[Operation, bytes | DeviceError]


def write(*data: int) -> Line:
    return (Write(0x68, bytes(data)), b"")


def read(register: int, answer: str) -> Line:
    data = bytes.fromhex(answer)
    return (WriteRead(0x68, bytes([register]), len(data)), data)


RESET: list[Line] = [
    write(0x7F, 0x00),
    read(0x00, CASES["who_am_i"]),
    write(0x06, 0x80),
    (Pause(0.1), b""),
    write(0x7F, 0x00),
    read(0x06, "41"),
    write(0x06, 0x01),
    (Pause(0.035), b""),
    write(0x07, 0x00),
    write(0x05, 0x00),
]


def converters(divider: int, gyro: int, accel: int) -> list[Line]:
    return [
        write(0x7F, 0x20),
        write(0x00, divider),
        write(0x01, gyro),
        write(0x10, 0),
        write(0x11, divider),
        write(0x14, accel),
        write(0x09, 1),
        read(0x01, bytes([gyro]).hex()),
        read(0x14, bytes([accel]).hex()),
        write(0x7F, 0x00),
    ]


BYPASS: list[Line] = [write(0x03, 0x00), write(0x0F, 0x02), (Pause(0.001), b"")]
MAG: list[Line] = [
    (Write(0x0C, b"\x32\x01"), b""),
    (Pause(0.001), b""),
    (WriteRead(0x0C, b"\x00", 2), bytes.fromhex(CASES["mag_identity"])),
    (Write(0x0C, b"\x31\x08"), b""),
]
TEMPERATURE = read(0x39, CASES["temperature"][1]["data"])
FIFO: list[Line] = [
    write(0x66, 0x00),
    write(0x67, 0x1E),
    write(0x69, 0x00),
    write(0x03, 0x40),
    write(0x68, 0x1F),
    write(0x68, 0x00),
]


@pytest.mark.parametrize("row", CASES["gyro"], ids=lambda row: row["range_dps"])
def test_gyro_scales(row: dict[str, Any]) -> None:
    select = r.GYRO_RANGES.index(row["range_dps"])
    assert r.GYRO_LSB_PER_DPS[select] == row["lsb_per_dps"]
    assert r.gyro_radps_per_lsb(select) == pytest.approx(row["radps_per_lsb"], rel=1e-5)


@pytest.mark.parametrize("row", CASES["accel"], ids=lambda row: row["range_g"])
def test_accel_scales(row: dict[str, Any]) -> None:
    assert r.accel_mps2_per_lsb(r.ACCEL_RANGES.index(row["range_g"])) == pytest.approx(row["mps2_per_lsb"], rel=1e-5)


@pytest.mark.parametrize(("divider", "rate_Hz"), CASES["rates"].items())
def test_rates(divider: int, rate_Hz: float) -> None:
    assert Icm20948Knobs(divider=divider).rate_Hz == pytest.approx(rate_Hz, rel=1e-6)


@pytest.mark.parametrize("row", CASES["temperature"], ids=lambda row: row["data"])
def test_temperature(row: dict[str, Any]) -> None:
    raw = int.from_bytes(bytes.fromhex(row["data"]), "big")
    assert r.temperature_C(raw) == pytest.approx(row["celsius"], abs=1e-4)


def test_configuration_states_what_the_data_sheet_wants_in_its_order() -> None:
    config = int(CASES["config_500dps_4g_filter_3"], 16)
    lines = RESET + converters(4, config, config) + BYPASS + MAG + [TEMPERATURE] + FIFO
    identity = rehearse(Icm20948().configure(), lines)
    assert identity.text == "ICM-20948 at 0x68, AK09916, 225 Hz, 500 dps, 4 g"


def test_a_reset_is_waited_for_ten_times() -> None:
    busy = [read(0x06, "C1"), (Pause(0.01), b"")]
    lines = RESET[:5] + busy * 9 + RESET[5:] + converters(4, 0x19, 0x19) + BYPASS + [TEMPERATURE] + FIFO
    assert rehearse(Icm20948(NARROW).configure(), lines).text.startswith("ICM-20948 at 0x68")
    with pytest.raises(DeviceError, match="address 0x68: does not come out of its reset; power-cycle it"):
        rehearse(Icm20948(NARROW).configure(), RESET[:5] + busy * 10)


def test_the_data_ready_line_is_watched_and_then_pulses() -> None:
    """INT_ENABLE_1 is 0x11 with RAW_DATA_0_RDY_EN in bit 0 (DS-000189, bank 0; SparkFun's ICM_20948_REGISTERS.h)."""
    config = int(CASES["config_500dps_4g_filter_3"], 16)
    line = [(Write(0x80 + 17, b"pinctrl-bcm2711"), b""), write(0x11, 0x01)]
    sensor = Icm20948(Icm20948Knobs(data_ready="pinctrl-bcm2711:17"))
    identity = rehearse(
        sensor.configure(), RESET + converters(4, config, config) + BYPASS + MAG + [TEMPERATURE] + FIFO + line
    )
    assert identity.text.endswith("4 g, timed by line 17 of pinctrl-bcm2711")


def narrow() -> Icm20948:
    sensor = Icm20948(NARROW)
    rehearse(sensor.configure(), RESET + converters(4, 0x19, 0x19) + BYPASS + [TEMPERATURE] + FIFO)
    return sensor


def test_samples_of_the_fifo() -> None:
    data = [row["data"] for row in CASES["samples"]]
    lines = [read(0x70, f"{12 * len(data):04x}"), read(0x72, " ".join(data))]
    outputs = rehearse(narrow().cycle(stamp_from_s(1.0)), lines)
    for output, row in zip(outputs, CASES["samples"], strict=True):
        assert isinstance(output, Stamped)
        assert isinstance(output.reading, Inertial)
        assert output.reading.specific_force_mps2 == pytest.approx([g * GRAVITY_mps2 for g in row["accel_g"]], abs=1e-6)
        assert output.reading.rate_radps == pytest.approx([math.radians(rate) for rate in row["gyro_dps"]], abs=1e-8)
        assert output.reading.temperature_C == pytest.approx(CASES["temperature"][1]["celsius"], abs=1e-4)


def magnetometer() -> Ak09916:
    mag = Ak09916(Correction())
    assert rehearse(mag.configure(), MAG) == "AK09916"
    return mag


def test_the_magnetic_field_comes_in_the_axes_of_the_inertial_sensor() -> None:
    block = bytes.fromhex(CASES["mag"]["data"])
    (output,) = rehearse(magnetometer().read(Stamp(0)), [(WriteRead(0x0C, b"\x10", 9), block)])
    assert isinstance(output, Stamped)
    assert isinstance(output.reading, Magnetic)
    assert output.reading.field_T == pytest.approx([1e-6 * field for field in CASES["mag"]["field_uT"]], abs=1e-12)


def test_an_overflow_of_the_magnetometer_is_no_reading() -> None:
    block = bytes.fromhex(CASES["mag_overflow"])
    (output,) = rehearse(magnetometer().read(Stamp(0)), [(WriteRead(0x0C, b"\x10", 9), block)])
    assert output == Rejected(Stamp(0), "magnetometer: field too strong (overflow)", block)


def test_another_chip_at_the_address_is_named() -> None:
    with pytest.raises(DeviceError, match="found WHO_AM_I 0x68, wanted 0xea"):
        rehearse(Icm20948().configure(), [write(0x7F, 0x00), read(0x00, "68")])


def test_the_delay_of_each_filter_is_that_of_its_corner() -> None:
    for config, corner_Hz in enumerate(CASES["gyro_corners_Hz"]):
        lag_s = 1.0 / (2.0 * math.pi * corner_Hz)
        assert Icm20948Knobs(filter=config).filter_delay_s == pytest.approx(lag_s, abs=0.00026)


def magnetic_self_test(*blocks: str | DeviceError) -> list[Line]:
    """AK09916 data sheet, section 9.4.4: CNTL2 31h, power down 00h, self-test 10h; ST1 at 10h; CNTL3 32h, reset."""
    lines: list[Line] = [
        (Write(0x0C, b"\x31\x00"), b""),
        (Pause(0.001), b""),
        (Write(0x0C, b"\x31\x10"), b""),
    ]
    for block in blocks:
        answer = block if isinstance(block, DeviceError) else bytes.fromhex(block)
        lines += [(Pause(0.01), b""), (WriteRead(0x0C, b"\x10", 9), answer)]
    return lines


MAG_RESET: Line = (Write(0x0C, b"\x32\x01"), b"")
NOT_READY, FIELD = "00 0000 0000 0000 00 00", "01 0400 feff 0cfe 00 00"
"""Field of 4, -2, -500 counts."""


def test_the_magnetometer_tests_itself_as_its_data_sheet_states() -> None:
    ready = [*magnetic_self_test(*[NOT_READY] * 4, FIELD), MAG_RESET]
    assert rehearse(ak09916_self_test(), ready) == (4, -2, -500)
    assert rehearse(ak09916_self_test(), magnetic_self_test(*[NOT_READY] * 5)) is None
    assert rehearse(ak09916_self_test(), magnetic_self_test(DeviceError("no acknowledge"))) is None


def test_the_self_test_takes_the_steps_and_the_limits_of_the_embedded_motion_driver() -> None:
    """inv_icm20948_run_selftest of TDK: 250 dps and 2 g with filter 7, divider 10, 200 readings 10 ms apart."""

    def to(*data: int) -> Line:
        return (Write(0x69, bytes(data)), b"")

    def of(register: int, data: bytes) -> Line:
        return (WriteRead(0x69, bytes([register]), len(data)), data)

    def readings(*axes: tuple[int, int]) -> list[Line]:
        """200 readings that are one of two values in turn."""
        samples = [struct.pack(">6h", *(two[turn] for two in axes)) for turn in (0, 1)]
        return [line for _ in range(100) for one in samples for line in (of(0x2D, one), (Pause(0.01), b""))]

    settled: list[Line] = [to(0x7F, 0x00), (Pause(0.02), b"")]
    lines = [
        to(0x7F, 0x10),
        of(0x02, bytes([1, 2, 3])),
        of(0x0E, bytes([1, 0, 101])),
        to(0x7F, 0x20),
        to(0x00, 10, 0x39),
        to(0x10, 0, 10),
        to(0x14, 0x39),
        *settled,
        *readings((-10, 10), (5, 5), (0, 0), (100, 102), (0, 0), (0, 0)),
        *(to(0x7F, 0x20), to(0x02, 0x38), to(0x15, 0x1C), *settled),
        *readings((2610, 2630), (4000, 4000), (-7086, -7086), (1411, 1411), (-2646, -2646), (0, 0)),
        *(to(0x7F, 0x20), to(0x02, 0x00), to(0x15, 0x00), *settled),
        *magnetic_self_test(FIELD),
        MAG_RESET,
    ]
    found = rehearse(self_test(0x69), lines)
    assert found.accel == pytest.approx((1.0, 0.0, 1.0), rel=1e-4)  # codes 1, none, 101: 2620 and 2620 * 1.01^100
    assert found.gyro == pytest.approx((0.5, 1.0, 0.0), rel=1e-4)
    assert found.mag == (4, -2, -500)


@pytest.mark.parametrize("axis", range(3))
def test_limits_of_the_responses(axis: int) -> None:
    """Of the accelerometer half to one and a half of the factory's; of the gyroscope at least half."""

    def passed(*, gyro: float = 1.0, accel: float = 1.0) -> bool:
        gx, gy, gz = (gyro if one == axis else 1.0 for one in range(3))
        ax, ay, az = (accel if one == axis else 1.0 for one in range(3))
        return SelfTest((gx, gy, gz), (ax, ay, az), (0, 0, -500)).passed

    assert [passed(gyro=share) for share in (0.49, 0.5, 9.0)] == [False, True, True]
    assert [passed(accel=share) for share in (0.49, 0.5, 1.5, 1.51)] == [False, True, True, False]


def test_the_self_test_is_reported_in_shares_and_counts() -> None:
    reported = "response of the gyroscope 100%, 90%, 110%, of the accelerometer 50%, 100%, 149% of the factory's"
    gyro, accel = (1.0, 0.9, 1.1), (0.5, 1.0, 1.49)
    good, bad = SelfTest(gyro, accel, (1, -2, -500)), SelfTest(gyro, accel, None)
    assert str(good) == f"self test passed: {reported}; magnetometer 1, -2, -500 counts"
    assert str(bad) == f"self test failed: {reported}; magnetometer no answer"


def test_limits_of_the_magnetometer_s_self_test() -> None:
    limits = CASES["mag_self_test"]
    for at, (low, high) in enumerate(limits):
        for count, passed in ((low - 1, False), (low, True), (high, True), (high + 1, False)):
            x, y, z = (count if axis == at else sum(limits[axis]) // 2 for axis in range(3))
            assert SelfTest((1.0, 1.0, 1.0), (1.0, 1.0, 1.0), (x, y, z)).passed is passed
