"""Third-party programs on an I2C adapter, through the kernel: smbus2, plain calls, sleeps by the wall clock.

Steps and waiting times are those of the data sheets: TE MS5837-30BA rev. C2 (conversions), TDK DS-000189 r1.3
(bypass), NXP PCA9685 rev. 4 section 7.3, Bosch BST-BME280-DS002 section 5.3, TI SBOS547 tables 1 and 2,
TI SBAS444E section 9.6.
"""

import contextlib
import fcntl
import os
import struct
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from smbus2 import SMBus, i2c_msg

from hindrax_bringup.share_files import hindrax_with
from hindrax_core.errors import HindraxError
from hindrax_i2c_file.fuse_i2c import FuseI2c
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle
from hindrax_sim.testing.mock_wires import repeated

POSSIBLE = os.geteuid() == 0 and Path("/dev/fuse").exists()
I2C_SLAVE = 0x0703

pytestmark = [pytest.mark.root, pytest.mark.skipif(not POSSIBLE, reason="needs root and /dev/fuse")]


@contextlib.contextmanager
def mock_bus(folder: Path, *sensors: str) -> Iterator[tuple[MockVehicle, str]]:
    """The whole mock vehicle with further sensors, stepped by a thread, with its bus as a file."""
    with MockVehicle(Hardware(hindrax_with(*sensors), 1), folder, rate=1.0) as mock:
        try:
            file = mock.offer_file(partial(FuseI2c, str(folder / "i2c-9")))
        except HindraxError as error:
            pytest.skip(str(error))
        with contextlib.closing(file), repeated(mock.step):
            yield mock, str(folder / "i2c-9")


@pytest.fixture(scope="module")
def mocked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[MockVehicle, str]]:
    with mock_bus(tmp_path_factory.mktemp("mock"), "bme280", "ina226") as found:
        yield found


@pytest.fixture
def path(mocked: tuple[MockVehicle, str]) -> str:
    return mocked[1]


@pytest.mark.parametrize("oversampling", [256, 512, 1024, 2048, 4096, 8192])
def test_a_conversion_that_was_waited_for_is_there(path: str, oversampling: int) -> None:
    command = 2 * (oversampling // 256).bit_length() - 2
    with SMBus(path) as bus:
        bus.write_byte(0x76, 0x1E)
        time.sleep(0.01)
        for first in (0x40, 0x50):
            for _ in range(10):
                bus.write_byte(0x76, first + command)
                time.sleep(2.5e-6 * oversampling)
                assert bus.read_i2c_block_data(0x76, 0, 3) != [0, 0, 0]


def test_a_conversion_that_was_not_waited_for_is_zero(path: str) -> None:
    with SMBus(path) as bus:
        bus.write_byte(0x76, 0x4A)
        assert bus.read_i2c_block_data(0x76, 0, 3) == [0, 0, 0]


def test_the_inertial_sensor_wakes_and_lets_its_magnetometer_through(path: str) -> None:
    with SMBus(path) as bus:
        assert bus.read_byte_data(0x68, 0x00) == 0xEA
        with pytest.raises(OSError, match="Remote I/O"):
            bus.read_byte_data(0x0C, 0x01)
        bus.write_byte_data(0x68, 0x06, 0x01)
        bus.write_byte_data(0x68, 0x0F, 0x02)
        time.sleep(0.05)
        assert bus.read_i2c_block_data(0x0C, 0x00, 2) == [0x48, 0x09]
        bus.write_byte_data(0x0C, 0x31, 0x01)
        time.sleep(0.01)
        assert bus.read_i2c_block_data(0x0C, 0x10, 9)[0] & 0x01
        read = i2c_msg.read(0x68, 6)
        bus.i2c_rdwr(i2c_msg.write(0x68, [0x2D]), read)
        x, y, z = (int.from_bytes(bytes(read)[at : at + 2], "big", signed=True) for at in (0, 2, 4))
        assert (x * x + y * y + z * z) ** 0.5 / 16384 == pytest.approx(1.0, abs=0.05)


def test_the_magnetometer_tests_itself(path: str) -> None:
    """Steps and limits of AKM's own program for the AK09916."""
    with SMBus(path) as bus:
        bus.write_byte_data(0x68, 0x0F, 0x02)
        bus.write_byte_data(0x0C, 0x31, 0x00)
        bus.write_byte_data(0x0C, 0x31, 0x10)
        time.sleep(0.02)
        block = bytes(bus.read_i2c_block_data(0x0C, 0x10, 9))
        x, y, z = (int.from_bytes(block[at : at + 2], "little", signed=True) for at in (1, 3, 5))
        assert -200 <= x <= 200
        assert -200 <= y <= 200
        assert -1000 <= z <= -200


def test_the_pulse_generator_is_set_up_by_plain_calls(path: str) -> None:
    descriptor = os.open(path, os.O_RDWR)
    fcntl.ioctl(descriptor, I2C_SLAVE, 0x40)
    for written in (b"\x00\x30", b"\xfe\x79", b"\x00\x20"):
        os.write(descriptor, written)
    time.sleep(0.001)
    os.write(descriptor, b"\x06\x00\x00\x33\x01")
    os.write(descriptor, b"\xfe")
    assert os.read(descriptor, 1) == b"\x79"
    os.write(descriptor, b"\x06")
    assert os.read(descriptor, 4) == b"\x00\x00\x33\x01"
    os.close(descriptor)


def test_nobody_waits_for_a_program_of_others_as_for_a_control_loop(mocked: tuple[MockVehicle, str]) -> None:
    mock, path = mocked
    with SMBus(path) as bus:
        bus.write_byte_data(0x40, 0x00, 0x21)
        bus.write_i2c_block_data(0x40, 0x06, [0, 0, 0x33, 1])
    assert mock.hardware.output.pulse_us(0) is not None
    assert mock.last_write is None, "time would nearly stand still between two of its writes"


def test_the_barometer_is_measured_once_by_plain_calls(path: str) -> None:
    with SMBus(path) as bus:
        assert bus.read_byte_data(0x77, 0xD0) == 0x60
        bus.write_byte_data(0x77, 0xF2, 0x01)
        bus.write_byte_data(0x77, 0xF4, 0x25)
        time.sleep(0.0093)
        block = bus.read_i2c_block_data(0x77, 0xF3, 12)
        assert block[0] & 0x08 == 0
        first, second, third = struct.unpack("<H2h", bytes(bus.read_i2c_block_data(0x77, 0x88, 6)))
        raw = int.from_bytes(bytes(block[7:10]), "big") >> 4
        off = raw / 16384.0 - first / 1024.0
        celsius = (off * second + (off / 8.0) ** 2 * third) / 5120.0
        assert celsius == pytest.approx(30.0, abs=0.1)


def test_the_supply_is_measured_as_the_data_sheet_does(path: str) -> None:
    with SMBus(path) as bus:
        assert bus.read_i2c_block_data(0x41, 0xFE, 2) == [0x54, 0x49]
        assert bus.read_i2c_block_data(0x41, 0x00, 2) == [0x41, 0x27]
        time.sleep(0.0025)
        volts = int.from_bytes(bytes(bus.read_i2c_block_data(0x41, 0x02, 2)), "big") * 1.25e-3
        assert volts == pytest.approx(14.8, abs=0.02)


def test_a_converter_behind_a_power_sense_module_is_read_as_its_data_sheet_does(tmp_path: Path) -> None:
    with mock_bus(tmp_path, "ads1115") as (_, path), SMBus(path) as bus:
        bus.write_i2c_block_data(0x48, 0x01, [0xF3, 0x83])  # AIN3 against ground, 4.096 V, one conversion at 128 per s
        time.sleep(0.009)
        assert bus.read_i2c_block_data(0x48, 0x01, 2)[0] & 0x80, "the conversion is done"
        counts = int.from_bytes(bytes(bus.read_i2c_block_data(0x48, 0x00, 2)), "big", signed=True)
        assert 11.0 * 0.125e-3 * counts == pytest.approx(14.8, abs=0.1)
