"""A third-party GPIO library reads the emulated leak probe, by the binary interface of <linux/gpio.h>, version 2.

python-periphery makes the requests; what answers them is the kernel's part, played here: a test machine has no GPIO
chip, and a file cannot play one, because a request returns a new file descriptor.
"""

import errno
import os
import struct
from types import SimpleNamespace
from typing import Any

import pytest

from hindrax_core.bus_operations import Read, Write
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.readings import Leak
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.devices.sos_leak import SosLeak

cdev = pytest.importorskip("periphery.gpio_cdev2")

CHIP, LINE_FD, LINE = 4242, 4243, 27
GET_LINE, GET_VALUES = 0xC250B407, 0xC010B40E
"""_IOWR(0xB4, 7, struct gpio_v2_line_request) of 592 bytes and _IOWR(0xB4, 14, struct gpio_v2_line_values) of 16."""
FLAGS_AT, FD_AT = 288, 588
INPUT, PULL_UP = 1 << 2, 1 << 8


class GpioKernel:
    """Opens one chip and serves two requests on the caller's memory; the lines are those of a virtual bus."""

    def __init__(self, lines: VirtualI2c) -> None:
        self.lines, self.now = lines, Stamp(0)

    def open(self, path: str, _flags: int) -> int:
        if path != "/dev/gpiochip0":
            raise OSError(errno.ENOENT, os.strerror(errno.ENOENT), path)
        return CHIP

    def ioctl(self, descriptor: int, request: int, argument: Any) -> int:
        memory = memoryview(argument).cast("B")
        if (descriptor, request, len(memory)) == (CHIP, GET_LINE, 592):
            (line,) = struct.unpack_from("=I", memory, 0)
            (flags,) = struct.unpack_from("=Q", memory, FLAGS_AT)
            assert flags == INPUT | PULL_UP
            self.lines.transfer(Write(line, b"\x01"), self.now)
            struct.pack_into("=i", memory, FD_AT, LINE_FD)
        elif (descriptor, request, len(memory)) == (LINE_FD, GET_VALUES, 16):
            (level,) = self.lines.transfer(Read(LINE, 1), self.now)
            struct.pack_into("=Q", memory, 0, level)
        else:
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        return 0


def test_a_library_of_others_sees_the_probe_dry_wet_and_without_power(monkeypatch: pytest.MonkeyPatch) -> None:
    probe, lines = SosLeak(), VirtualI2c()
    lines.attach(LINE, probe)
    kernel = GpioKernel(lines)
    monkeypatch.setattr(cdev, "os", SimpleNamespace(open=kernel.open, close=lambda _descriptor: None))
    monkeypatch.setattr(cdev, "fcntl", SimpleNamespace(ioctl=kernel.ioctl))
    gpio = cdev.Cdev2GPIO("/dev/gpiochip0", LINE, "in", bias="pull_up")
    assert gpio.read() is False
    probe.set_truth(Leak(wet=True), 1.0)
    assert gpio.read() is True
    probe.set_truth(Leak(wet=False), 2.0)
    kernel.now = stamp_from_s(3.0)
    probe.power_cycle(3.0)
    assert gpio.read() is True, "the pull-up alone: told as a leak"
    kernel.now = stamp_from_s(4.0)
    assert gpio.read() is False
    gpio.close()
