"""A kernel in the same process: `smbus2` opens an adapter, and a virtual bus receives its ioctls.

Covers the binary interface of <linux/i2c-dev.h> without hardware, root or files: the messages are taken from and put
into the memory of the ctypes structures that smbus2 passes, as the kernel would.
"""

import contextlib
import ctypes
import errno
import os
from collections.abc import Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any
from unittest import mock

from smbus2.smbus2 import i2c_rdwr_ioctl_data

from hindrax_core.events import Stamp
from hindrax_sim.buses.i2cdev_abi import FUNCTIONS, I2C_FUNCS, I2C_RDWR, message, transact
from hindrax_sim.buses.virtual_i2c import VirtualI2c

DESCRIPTOR = 4242


class IoctlSeam:
    """Replaces open, close and ioctl of an adapter at one path; the time is set by the test."""

    def __init__(self, path: str, bus: VirtualI2c) -> None:
        self._path, self._bus = path, bus
        self.now = Stamp(0)

    def open(self, path: str, _flags: int) -> int:
        """Open as the kernel would: OSError ENOENT for another path."""
        if path != self._path:
            raise OSError(errno.ENOENT, os.strerror(errno.ENOENT), path)
        return DESCRIPTOR

    def close(self, descriptor: int) -> None:
        """Close as the kernel would: OSError EBADF for another descriptor."""
        if descriptor != DESCRIPTOR:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))

    def ioctl(self, descriptor: int, request: int, argument: Any) -> int:
        """Serve I2C_FUNCS and I2C_RDWR on the caller's structures.

        Parameters
        ----------
        descriptor
            As of `open`.
        request
            Number of the ioctl.
        argument
            ctypes structure of the request; what is read is stored in its buffers.

        Returns
        -------
        int
            As of ioctl(2).

        Raises
        ------
        OSError
            EBADF for another descriptor, ENOTTY for another request.
        """
        if descriptor != DESCRIPTOR:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        if request == I2C_FUNCS:
            argument.value = FUNCTIONS
            return 0
        if request != I2C_RDWR:
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        return self._rdwr(argument)

    def _rdwr(self, argument: i2c_rdwr_ioctl_data) -> int:
        raw = [argument.msgs[index] for index in range(argument.nmsgs)]
        messages = [message(one.addr, one.flags, one.len, partial(ctypes.string_at, one.buf, one.len)) for one in raw]
        for one, answer in zip(raw, transact(self._bus.transfer, messages, self.now), strict=True):
            if answer is not None:
                ctypes.memmove(one.buf, answer, len(answer))
        return len(raw)


@contextlib.contextmanager
def seam(path: str, bus: VirtualI2c) -> Iterator[IoctlSeam]:
    """Put a virtual bus at a path within the block; only `smbus2` sees it."""
    kernel = IoctlSeam(path, bus)
    files = SimpleNamespace(open=kernel.open, close=kernel.close, O_RDWR=os.O_RDWR)
    with mock.patch.multiple("smbus2.smbus2", ioctl=kernel.ioctl, os=files):
        yield kernel
