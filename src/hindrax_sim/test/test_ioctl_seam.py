"""Smbus2Bus against the kernel's binary interface, byte for byte, without a kernel."""

from collections.abc import Iterator

import pytest

from hindrax_core.bus_operations import DeviceError, Read, Transaction, Write, WriteRead
from hindrax_core.events import Stamp
from hindrax_drivers.buses.i2cdev import Smbus2Bus
from hindrax_drivers.buses.ports import open_bus
from hindrax_sim.buses import i2cdev_abi as abi
from hindrax_sim.buses.ioctl_seam import seam
from hindrax_sim.devices.emulator import BusStuckError
from hindrax_sim.testing.lock_step import LoggedI2c


class Memory:
    """A register file of 256 bytes with an address pointer."""

    def __init__(self) -> None:
        self.cells = bytearray(range(256))
        self._at = 0

    def write(self, data: bytes, now_s: float) -> None:
        assert now_s >= 0.0
        self._at = data[0] if data else self._at
        self.cells[self._at : self._at + len(data) - 1] = data[1:]

    def read(self, count: int, now_s: float) -> bytes:
        assert now_s >= 0.0
        return bytes(self.cells[(self._at + index) % 256] for index in range(count))


class Stuck:
    def write(self, data: bytes, now_s: float) -> None:
        del data, now_s
        raise BusStuckError

    def read(self, count: int, now_s: float) -> bytes:
        del count, now_s
        raise BusStuckError


@pytest.fixture
def wires() -> LoggedI2c:
    bus = LoggedI2c()
    bus.attach(0x50, Memory())
    bus.attach(0x51, Stuck())
    return bus


@pytest.fixture
def bus(wires: LoggedI2c) -> Iterator[Smbus2Bus]:
    with seam("/dev/i2c-1", wires):
        one = open_bus("/dev/i2c-1")
        assert isinstance(one, Smbus2Bus)
        yield one
        one.close()


def test_each_operation_is_one_transaction_on_the_wire(bus: Smbus2Bus, wires: LoggedI2c) -> None:
    operations: list[Transaction] = [
        Write(0x50, b"\x10\xaa\xbb"),
        WriteRead(0x50, b"\x0f", 4),
        Read(0x50, 2),
        Write(0x50, b""),
    ]
    assert [bus.transfer(one) for one in operations] == [b"", b"\x0f\xaa\xbb\x12", b"\x0f\xaa", b""]
    assert [transaction for _, transaction, _ in wires.log] == operations


def test_a_burst_may_be_longer_than_the_32_bytes_of_smbus(bus: Smbus2Bus) -> None:
    assert bus.transfer(WriteRead(0x50, b"\x00", 512)) == bytes(range(256)) * 2


@pytest.mark.parametrize(
    ("address", "words"),
    [(0x20, "no acknowledge.*EREMOTEIO, 121"), (0x51, "held low.*ETIMEDOUT, 110")],
)
def test_errors_name_port_address_and_errno(bus: Smbus2Bus, address: int, words: str) -> None:
    with pytest.raises(DeviceError, match=rf"/dev/i2c-1 address {address:#04x}: .*{words}"):
        bus.transfer(Read(address, 1))


def test_a_missing_bus_names_the_remedy(wires: LoggedI2c) -> None:
    with (
        seam("/dev/i2c-1", wires),
        pytest.raises(DeviceError, match=r"/dev/i2c-7: no such bus.*dtparam=i2c_arm=on.*doctor"),
    ):
        open_bus("/dev/i2c-7")


def test_structures_have_the_sizes_of_the_kernel() -> None:
    assert (abi.I2C_MSG.size, abi.RDWR_DATA.size, abi.SMBUS_DATA.size) == (16, 16, 16)


@pytest.mark.parametrize(
    ("reads", "size", "data", "wanted"),
    [
        (False, abi.QUICK, b"", Write(0x50, b"")),
        (True, abi.QUICK, b"", Read(0x50, 0)),
        (True, abi.BYTE, b"", Read(0x50, 1)),
        (False, abi.BYTE, b"", Write(0x50, b"\x07")),
        (True, abi.BYTE_DATA, b"", WriteRead(0x50, b"\x07", 1)),
        (False, abi.BYTE_DATA, b"\xaa", Write(0x50, b"\x07\xaa")),
        (True, abi.WORD_DATA, b"", WriteRead(0x50, b"\x07", 2)),
        (False, abi.WORD_DATA, b"\xaa\xbb", Write(0x50, b"\x07\xaa\xbb")),
        (True, abi.PROC_CALL, b"\xaa\xbb", WriteRead(0x50, b"\x07\xaa\xbb", 2)),
        (True, abi.I2C_BLOCK, b"\x03", WriteRead(0x50, b"\x07", 3)),
        (False, abi.I2C_BLOCK, b"\x02\xaa\xbb\xcc", Write(0x50, b"\x07\xaa\xbb")),
    ],
)
def test_smbus_requests_become_wire_transactions(reads: bool, size: int, data: bytes, wanted: object) -> None:
    assert abi.smbus(0x50, reads, 7, size, data.ljust(34, b"\0")) == wanted


def test_smbus_blocks_that_need_a_length_from_the_device_are_refused() -> None:
    with pytest.raises(OSError, match="not supported"):
        abi.smbus(0x50, True, 7, 5, bytes(34))


def test_too_many_and_too_long_messages_are_refused(wires: LoggedI2c) -> None:
    for flags in (0, abi.I2C_M_RD):
        with pytest.raises(OSError, match="Invalid argument"):
            abi.message(0x50, flags, 8193, bytes)
    with pytest.raises(OSError, match="Invalid argument"):
        abi.transact(wires.transfer, [Write(0x50, b"")] * 43, Stamp(0))
    with pytest.raises(OSError, match="Invalid argument"):
        abi.transact(wires.transfer, [], Stamp(0))
