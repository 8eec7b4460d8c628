"""The kernel's side of <linux/i2c-dev.h> and <linux/i2c.h>: requests, structures, transactions, the caller's memory.

Shared by all kernel stand-ins. Sources: Linux uapi headers i2c.h and i2c-dev.h; the SMBus emulation follows
the kernel's documentation of the SMBus protocol (Documentation/i2c/smbus-protocol.rst). Memory of another process is
accessed as a kernel does for an ioctl: process_vm_readv(2), process_vm_writev(2).
"""

import ctypes
import errno
import os
import struct
from collections.abc import Callable, Sequence

from hindrax_core.bus_operations import Read, Transaction, Write, WriteRead
from hindrax_core.events import Stamp

I2C_RETRIES, I2C_TIMEOUT, I2C_SLAVE, I2C_TENBIT, I2C_FUNCS, I2C_SLAVE_FORCE, I2C_RDWR, I2C_PEC = range(0x0701, 0x0709)
I2C_SMBUS = 0x0720

I2C_M_RD = 0x0001
MOST_MESSAGES = 42
LONGEST_MESSAGE = 8192

# I2C_FUNC_I2C and the SMBus functions that a plain I2C adapter emulates (I2C_FUNC_SMBUS_EMUL), as on a Raspberry Pi.
FUNCTIONS = 0x0EFF0001

SMBUS_READ = 1
QUICK, BYTE, BYTE_DATA, WORD_DATA, PROC_CALL, BLOCK, I2C_BLOCK_BROKEN, I2C_BLOCK = 0, 1, 2, 3, 4, 5, 6, 8
BLOCK_MAX = 32
SMBUS_UNION_BYTES = BLOCK_MAX + 2

I2C_MSG = struct.Struct("=HHH2xQ")
"""struct i2c_msg on a 64-bit machine: addr, flags, len, padding, pointer."""
RDWR_DATA = struct.Struct("=QI4x")
"""struct i2c_rdwr_ioctl_data: pointer to messages, their number."""
SMBUS_DATA = struct.Struct("=BB2xIQ")
"""struct i2c_smbus_ioctl_data: read_write, command, padding, size, pointer to data."""


def message(address: int, flags: int, length: int, data: Callable[[], bytes]) -> Read | Write:
    """Return what one i2c_msg asks for (linux/i2c.h).

    Parameters
    ----------
    address
        7 bits.
    flags
        Only `I2C_M_RD` counts.
    length
        Bytes to read or write.
    data
        Takes what a write sends from the caller's buffer.

    Returns
    -------
    Read | Write
        For the virtual bus.

    Raises
    ------
    OSError
        EINVAL for a message that is longer than an adapter takes.
    """
    if length > LONGEST_MESSAGE:
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
    return Read(address, length) if flags & I2C_M_RD else Write(address, data())


def transact(
    transfer: Callable[[Transaction, Stamp], bytes], messages: Sequence[Read | Write], now: Stamp
) -> list[bytes | None]:
    """Run the messages of one I2C_RDWR.

    A write that is followed by a read of the same address is one transaction with a repeated START.

    Parameters
    ----------
    transfer
        Runs one transaction at a time, as `VirtualI2c.transfer`.
    messages
        In their order.
    now
        Time of the mock.

    Returns
    -------
    list[bytes | None]
        For each message the bytes read, None for a write.

    Raises
    ------
    OSError
        EINVAL for none, or more than an adapter takes.
    """
    if not 0 < len(messages) <= MOST_MESSAGES:
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
    answers: list[bytes | None] = []
    left = list(messages)
    while left:
        one = left.pop(0)
        then = left[0] if left else None
        if isinstance(one, Write) and isinstance(then, Read) and then.address == one.address:
            left.pop(0)
            answers += [None, transfer(WriteRead(one.address, one.data, then.count), now)]
        else:
            answer = transfer(one, now)
            answers.append(answer if isinstance(one, Read) else None)
    return answers


def smbus(address: int, reads: bool, command: int, size: int, data: bytes) -> Transaction:
    """Return the transaction of an SMBus request (I2C_SMBUS of i2c-dev).

    Parameters
    ----------
    address
        7 bits.
    reads
        Direction.
    command
        First byte on the wire, but for a quick command.
    size
        Kind of transaction: `QUICK`, `BYTE_DATA`, `WORD_DATA` and so on.
    data : 34 bytes
        The caller's union i2c_smbus_data.

    Returns
    -------
    Transaction
        For the virtual bus.

    Raises
    ------
    OSError
        EOPNOTSUPP for block reads whose length the device sends: a plain I2C adapter cannot do them.
    """
    head = bytes([command])
    if size == QUICK:
        return Read(address, 0) if reads else Write(address, b"")
    if size == BYTE:
        return Read(address, 1) if reads else Write(address, head)
    if size == BYTE_DATA:
        return WriteRead(address, head, 1) if reads else Write(address, head + data[:1])
    if size == WORD_DATA:
        return WriteRead(address, head, 2) if reads else Write(address, head + data[:2])
    if size == PROC_CALL:
        return WriteRead(address, head + data[:2], 2)
    if size in (I2C_BLOCK, I2C_BLOCK_BROKEN) or (size == BLOCK and not reads):
        return _block(address, reads, head + data[:1] if size == BLOCK else head, data)
    raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))


def smbus_answer(size: int, answer: bytes) -> bytes:
    """Pack the bytes read into the caller's union (words are little endian, blocks begin with a length)."""
    return bytes([len(answer)]) + answer if size in (I2C_BLOCK, I2C_BLOCK_BROKEN) else answer


def _block(address: int, reads: bool, head: bytes, data: bytes) -> Transaction:
    length = data[0]
    if not 0 < length <= BLOCK_MAX:
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
    return WriteRead(address, head, length) if reads else Write(address, head + data[1 : 1 + length])


class _Span(ctypes.Structure):
    """struct iovec."""

    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


_libc = ctypes.CDLL(None, use_errno=True)
_CALL = (ctypes.c_int, ctypes.POINTER(_Span), ctypes.c_ulong, ctypes.POINTER(_Span), ctypes.c_ulong, ctypes.c_ulong)


def fetch(pid: int, address: int, count: int) -> bytes:
    """Read bytes at an address of a process (process_vm_readv(2)).

    Parameters
    ----------
    pid, address, count
        Process, place in its memory, and number of bytes.

    Returns
    -------
    bytes
        All of them; OSError EFAULT for an invalid address.
    """
    buffer = ctypes.create_string_buffer(count)
    _move("process_vm_readv", pid, buffer, address, count)
    return buffer.raw


def store(pid: int, address: int, data: bytes) -> None:
    """Write bytes at an address of a process (process_vm_writev(2)); OSError EFAULT for an invalid address.

    Parameters
    ----------
    pid, address, data
        Process, place in its memory, and what to write there.
    """
    _move("process_vm_writev", pid, ctypes.create_string_buffer(data, len(data)), address, len(data))


def _move(name: str, pid: int, buffer: ctypes.Array[ctypes.c_char], address: int, count: int) -> None:
    if not count:
        return
    call = getattr(_libc, name)
    call.argtypes, call.restype = _CALL, ctypes.c_ssize_t
    here = _Span(ctypes.addressof(buffer), count)
    there = _Span(address, count)
    if call(pid, ctypes.byref(here), 1, ctypes.byref(there), 1, 0) != count:
        code = ctypes.get_errno() or errno.EFAULT
        raise OSError(code, f"{name} of {count} bytes of process {pid}: {os.strerror(code)}")
