"""Ports of the mock: what is on them for whoever opens them late, and that they come and go at one place."""

import contextlib
import os
import time
from pathlib import Path

import pytest

from hindrax_sim.buses.serial_ends import Pty


def line(number: int) -> bytes:
    return b"%07d %s\n" % (number, b"x" * 55)


def test_who_opens_late_reads_nothing_that_is_long_past(tmp_path: Path) -> None:
    pty = Pty(tmp_path / "dvl")
    for number in range(5000):
        pty.write(line(number))
    port = os.open(tmp_path / "dvl", os.O_RDWR | os.O_NONBLOCK)
    found, number = b"", 5000
    while line(number - 1) not in found and number < 5500:  # the kernel moves bytes along when it likes
        pty.write(line(number))
        number += 1
        time.sleep(0.01)
        with contextlib.suppress(BlockingIOError):
            found += os.read(port, 65536)
    numbers = [int(one[:7]) for one in found.split(b"\n") if len(one) == 63]
    assert numbers[-1] >= 5000
    assert numbers[0] > 4000
    os.close(port)
    pty.close()


def test_bytes_go_both_ways_unchanged(tmp_path: Path) -> None:
    pty = Pty(tmp_path / "ping")
    port = os.open(tmp_path / "ping", os.O_RDWR)
    everything = bytes(range(256))
    pty.write(everything)
    assert os.read(port, 256) == everything
    os.write(port, everything)
    assert pty.read() == everything
    os.close(port)
    pty.close()


def test_an_unplugged_port_is_gone_and_comes_back_at_its_place(tmp_path: Path) -> None:
    pty = Pty(tmp_path / "dvl")
    port = os.open(tmp_path / "dvl", os.O_RDWR)
    pty.plug(in_place=False)
    assert not (tmp_path / "dvl").exists()
    with pytest.raises(OSError, match="Input/output error"):
        os.write(port, b"?")
    os.close(port)
    pty.write(b"nobody hears this")
    assert pty.read() == b""
    pty.plug(in_place=True)
    assert (tmp_path / "dvl").exists()
    pty.close()
