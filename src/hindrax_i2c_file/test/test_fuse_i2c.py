"""Third-party programs on the virtual bus: smbus2 unmodified, plain ioctl, read and write, through the kernel."""

import errno
import fcntl
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from smbus2 import SMBus, i2c_msg

from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp
from hindrax_i2c_file.fuse_i2c import FuseI2c
from hindrax_sim.buses import i2cdev_abi as abi
from hindrax_sim.buses.virtual_i2c import VirtualI2c

POSSIBLE = os.geteuid() == 0 and Path("/dev/fuse").exists()

pytestmark = [pytest.mark.root, pytest.mark.skipif(not POSSIBLE, reason="needs root and /dev/fuse")]


class Memory:
    """A register file of 256 bytes with an address pointer."""

    def __init__(self) -> None:
        self.cells = bytearray(range(256))
        self._at = 0

    def write(self, data: bytes, now_s: float) -> None:
        assert now_s == 7.0
        self._at = data[0] if data else self._at
        self.cells[self._at : self._at + len(data) - 1] = data[1:]

    def read(self, count: int, now_s: float) -> bytes:
        assert now_s == 7.0
        return bytes(self.cells[(self._at + index) % 256] for index in range(count))


class Served:
    """A bus as a file, served by a thread, with one memory at 0x50."""

    def __init__(self, path: Path) -> None:
        self.path, self.bus = str(path), VirtualI2c()
        self.bus.attach(0x50, Memory())
        try:
            self.file = FuseI2c(self.path, self.bus.transfer, lambda: Stamp(7_000_000_000))
        except HindraxError as error:
            pytest.skip(str(error))
        self._stopping = False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stopping:
            self.file.serve(0.02)

    def close(self) -> None:
        self._stopping = True
        self._thread.join()
        self.file.close()


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    one = Served(tmp_path / "i2c-9")
    yield one
    one.close()


def test_smbus2_reads_and_writes_in_every_way_it_knows(served: Served) -> None:
    with SMBus(served.path) as bus:
        assert bus.read_byte_data(0x50, 0x10) == 0x10
        assert bus.read_word_data(0x50, 0x20) == 0x2120
        assert bus.read_i2c_block_data(0x50, 0x30, 5) == [0x30, 0x31, 0x32, 0x33, 0x34]
        bus.write_byte_data(0x50, 0x10, 0xAA)
        bus.write_word_data(0x50, 0x20, 0xBBCC)
        bus.write_i2c_block_data(0x50, 0x30, [1, 2, 3])
        assert bus.read_i2c_block_data(0x50, 0x10, 1) + bus.read_i2c_block_data(0x50, 0x20, 2) == [0xAA, 0xCC, 0xBB]
        bus.write_byte(0x50, 0x31)
        assert bus.read_byte(0x50) == 2
        bus.write_quick(0x50)
        bus.write_block_data(0x50, 0x70, [7, 8])
        assert bus.read_i2c_block_data(0x50, 0x70, 4) == [2, 7, 8, 0x73]
        read = i2c_msg.read(0x50, 300)
        bus.i2c_rdwr(i2c_msg.write(0x50, [0x30]), read)
        assert bytes(read)[:4] == b"\x01\x02\x03\x33"
        assert len(bytes(read)) == 300
        one, two = i2c_msg.read(0x50, 2), i2c_msg.read(0x50, 3)
        bus.i2c_rdwr(i2c_msg.write(0x50, [0x00]), one, i2c_msg.write(0x50, [0x40]), two)
        assert bytes(one) + bytes(two) == b"\x00\x01\x40\x41\x42"


def test_a_missing_device_is_errno_121(served: Served) -> None:
    with SMBus(served.path) as bus:
        for attempt in (lambda: bus.read_byte(0x51), lambda: bus.i2c_rdwr(i2c_msg.read(0x51, 1))):
            with pytest.raises(OSError, match="Remote I/O error") as caught:
                attempt()
            assert caught.value.errno == errno.EREMOTEIO


def test_plain_reads_and_writes_after_the_address_is_set(served: Served) -> None:
    descriptor = os.open(served.path, os.O_RDWR)
    fcntl.ioctl(descriptor, abi.I2C_SLAVE, 0x50)
    assert os.write(descriptor, b"\x60\x11\x22") == 3
    assert os.write(descriptor, b"\x60") == 1
    assert os.read(descriptor, 3) == b"\x11\x22\x62"
    os.close(descriptor)


def test_reads_and_writes_at_a_place_are_as_good(served: Served) -> None:
    """Node's i2c-bus calls pread and pwrite at place 0; others open the file once to read and once to write."""
    descriptor = os.open(served.path, os.O_RDWR)
    fcntl.ioctl(descriptor, abi.I2C_SLAVE, 0x50)
    assert os.pwrite(descriptor, b"\x60", 0) == 1
    assert os.pread(descriptor, 2, 0) == b"\x60\x61"
    os.close(descriptor)
    path = Path(served.path)
    with path.open("wb", buffering=0) as writer, path.open("rb", buffering=0) as reader:
        for one in (writer, reader):
            fcntl.ioctl(one, abi.I2C_SLAVE, 0x50)
        writer.write(b"\x70")
        assert reader.read(2) == b"\x70\x71"


def test_what_i2c_dev_would_refuse_is_refused(served: Served) -> None:
    descriptor = os.open(served.path, os.O_RDWR)
    for request, argument, wanted in (
        (abi.I2C_SLAVE, 0x80, errno.EINVAL),
        (0x5401, 0, errno.ENOTTY),
        (abi.I2C_RDWR, 0, errno.EFAULT),
        (abi.I2C_TENBIT, 1, errno.ENOTTY),
    ):
        with pytest.raises(OSError, match=os.strerror(wanted)) as caught:
            fcntl.ioctl(descriptor, request, argument)
        assert caught.value.errno == wanted
    with pytest.raises(OSError, match="Remote I/O"):
        os.read(descriptor, 1)
    os.close(descriptor)


def test_another_process_sees_the_same_bus(served: Served) -> None:
    program = f"from smbus2 import SMBus; print(SMBus({served.path!r}).read_i2c_block_data(0x50, 1, 3))"
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=20, check=True)
    assert found.stdout == "[1, 2, 3]\n"


def test_the_file_is_gone_afterwards(tmp_path: Path) -> None:
    one = Served(tmp_path / "i2c-9")
    assert (tmp_path / "i2c-9").exists()
    one.close()
    one.file.close()
    assert not (tmp_path / "i2c-9").exists()
    assert str(tmp_path / "i2c-9") not in Path("/proc/self/mounts").read_text()


def test_a_mount_that_a_killed_process_left_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "i2c-9"
    program = (
        "import time; from hindrax_i2c_file.fuse_i2c import FuseI2c\n"
        f"one = FuseI2c({str(path)!r}, lambda *_: b'', lambda: 0); print('up', flush=True); time.sleep(60)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(one for one in sys.path if one)}
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, env=environment) as victim:
        assert victim.stdout is not None
        assert victim.stdout.readline() == b"up\n"
        victim.send_signal(signal.SIGKILL)
    with pytest.raises(OSError, match="not connected"):
        path.stat()
    again = Served(path)
    with SMBus(str(path)) as bus:
        assert bus.read_byte_data(0x50, 9) == 9
    again.close()
    path.unlink()


def test_a_real_bus_is_never_hidden(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "i2c-1")
    with pytest.raises(HindraxError, match="no regular file; a mock never hides a real bus"):
        FuseI2c(str(tmp_path / "i2c-1"), VirtualI2c().transfer, lambda: Stamp(0))
