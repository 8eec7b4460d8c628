"""Memory of another process, as a kernel accesses it for an ioctl: process_vm_readv(2), process_vm_writev(2)."""

from __future__ import annotations

import ctypes
import errno
import os


class _Span(ctypes.Structure):
    """struct iovec."""

    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))


_libc = ctypes.CDLL(None, use_errno=True)
_CALL = (ctypes.c_int, ctypes.POINTER(_Span), ctypes.c_ulong, ctypes.POINTER(_Span), ctypes.c_ulong, ctypes.c_ulong)


def fetch(pid: int, address: int, count: int) -> bytes:
    """Read bytes at an address of a process; OSError EFAULT for an invalid address."""
    buffer = ctypes.create_string_buffer(count)
    _move("process_vm_readv", pid, buffer, address, count)
    return buffer.raw


def store(pid: int, address: int, data: bytes) -> None:
    """Write bytes at an address of a process; OSError EFAULT for an invalid address."""
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
