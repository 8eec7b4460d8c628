"""A virtual I2C bus as a file that answers real ioctls, so that third-party programs run on it unchanged.

The file is the root of a FUSE file system without any other file, mounted over an existing path. The kernel hands
every open, ioctl, read and write on it to this server through /dev/fuse; what ioctl arguments point at is fetched from
and stored into the memory of the caller. Linux, 64 bit, root only (mount, and access to the memory of other processes).

Source: Linux uapi header fuse.h (protocol 7), i2c-dev.h; no FUSE library is used.
"""

import contextlib
import ctypes
import errno
import os
import select
import stat
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path

from hindrax_core.bus_operations import Read, Write
from hindrax_core.errors import HindraxError, cause
from hindrax_core.events import Stamp
from hindrax_sim.buses import i2cdev_abi as abi
from hindrax_sim.buses.mounted_file import SOURCE, Transfer, is_mounted

DEVICE = "/dev/fuse"

GETATTR, SETATTR, OPEN, READ, WRITE, RELEASE, FLUSH = 3, 4, 14, 15, 16, 18, 25
FORGET, INIT, ACCESS, INTERRUPT, IOCTL, BATCH_FORGET = 2, 26, 34, 36, 39, 42
WITHOUT_ANSWER = frozenset((FORGET, INTERRUPT, BATCH_FORGET))
DIRECT_IO = 0x01
REQUEST_BYTES = 1 << 17
LONGEST_WRITE = 1 << 16
MINOR = 31

MS_NOSUID, MS_NODEV, MNT_DETACH = 2, 4, 2

_IN_HEADER = struct.Struct("=IIQQIIIHH")
_OUT_HEADER = struct.Struct("=IiQ")
_INIT_OUT = struct.Struct("=IIIIHHIIHHI28x")
_ATTR_OUT = struct.Struct("=QI4x" + "QQQ" + "QQQ" + "III" + "IIIIIII")
_OPEN_OUT = struct.Struct("=QI4x")
_HANDLE = struct.Struct("=Q")
_READ_IN = struct.Struct("=QQI")
_WRITE_IN = struct.Struct("=QQI4xQI4x")
_WRITE_OUT = struct.Struct("=I4x")
_IOCTL_IN = struct.Struct("=QIIQII")
_IOCTL_OUT = struct.Struct("=iIII")
_FUNCTIONS = struct.Struct("=Q")

ATTRIBUTES = _ATTR_OUT.pack(3600, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, stat.S_IFREG | 0o666, 1, 0, 0, 0, 4096, 0)
"""Of the only file: empty, readable and writable for everyone."""

_libc = ctypes.CDLL(None, use_errno=True)


class FuseI2c:
    """The file at `path`. It must be closed, and is unmounted then.

    `transfer(transaction, now)` does a transaction and raises OSError as a kernel would; `now()` is the time of the
    mock, which programs that sleep by the wall clock need to run as that does.
    """

    def __init__(self, path: str, transfer: Transfer, now: Callable[[], Stamp]) -> None:
        self._path, self._transfer, self._now = Path(path), transfer, now
        self._addresses: dict[int, int] = {}
        self._handles = 0
        self._made = _prepare(self._path)
        self._fd = -1
        try:
            self._fd = _mount(self._path)
        except BaseException:
            self._clean()
            raise

    def fileno(self) -> int:
        """Descriptor that is readable when a request waits."""
        return self._fd

    def serve(self, timeout_s: float = 0.0) -> int:
        """Answer all requests, waiting at most `timeout_s` for the first; returns their number."""
        served = 0
        while select.select([self._fd], (), (), 0.0 if served else timeout_s)[0]:
            try:
                request = os.read(self._fd, REQUEST_BYTES)
            except (BlockingIOError, InterruptedError):
                return served
            except OSError as error:
                if error.errno == errno.ENOENT:  # the caller was killed between asking and our reading
                    continue
                raise
            self._answer(request)
            served += 1
        return served

    def close(self) -> None:
        """Unmount, and remove the file if it was created for this; closing twice is no error."""
        if self._fd >= 0:
            _unmount(self._path)
            os.close(self._fd)
            self._fd = -1
            self._clean()

    def _clean(self) -> None:
        if self._made:
            self._path.unlink(missing_ok=True)

    def _answer(self, request: bytes) -> None:
        _, opcode, unique, _, _, _, pid, _, _ = _IN_HEADER.unpack_from(request)
        if opcode in WITHOUT_ANSWER:
            return
        try:
            body, code = self._do(opcode, request[_IN_HEADER.size :], pid), 0
        except OSError as error:
            body, code = b"", error.errno or errno.EIO
        reply = _OUT_HEADER.pack(_OUT_HEADER.size + len(body), -code, unique) + body
        with contextlib.suppress(FileNotFoundError):  # the caller was killed meanwhile
            os.write(self._fd, reply)

    def _do(self, opcode: int, body: bytes, pid: int) -> bytes:
        """Answer one request; the caller gets an OSError as its errno."""
        if opcode == INIT:
            return _INIT_OUT.pack(7, MINOR, 0, 0, 1, 1, LONGEST_WRITE, 1, 0, 0, 0)
        if opcode in (GETATTR, SETATTR):
            return ATTRIBUTES
        if opcode == OPEN:
            self._handles += 1
            self._addresses[self._handles] = -1
            return _OPEN_OUT.pack(self._handles, DIRECT_IO)
        if opcode in (READ, WRITE, IOCTL):
            return self._use(opcode, body, pid)
        if opcode == RELEASE:
            self._addresses.pop(_HANDLE.unpack_from(body)[0], None)
        if opcode in (RELEASE, FLUSH, ACCESS):
            return b""
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    def _use(self, opcode: int, body: bytes, pid: int) -> bytes:
        """Handle read, write and ioctl; a plain read or write (after I2C_SLAVE) is one transaction."""
        if opcode == READ:
            handle, _, size = _READ_IN.unpack_from(body)
            return self._transfer(Read(self._address(handle), size), self._now())
        if opcode == WRITE:
            handle, _, size, _, _ = _WRITE_IN.unpack_from(body)
            data = body[_WRITE_IN.size : _WRITE_IN.size + size]
            self._transfer(Write(self._address(handle), data), self._now())
            return _WRITE_OUT.pack(len(data))
        handle, _, command, argument, _, _ = _IOCTL_IN.unpack_from(body)
        return _IOCTL_OUT.pack(self._ioctl(handle, command, argument, pid), 0, 0, 0)

    def _address(self, handle: int) -> int:
        address = self._addresses[handle]
        if address < 0:
            raise OSError(errno.EREMOTEIO, "no address set")
        return address

    def _ioctl(self, handle: int, command: int, argument: int, pid: int) -> int:
        """Handle an ioctl of <linux/i2c-dev.h>; returns its return value."""
        if command in (abi.I2C_SLAVE, abi.I2C_SLAVE_FORCE):
            if argument > 0x7F:
                raise OSError(errno.EINVAL, "7-bit addresses only")
            self._addresses[handle] = argument
        elif command == abi.I2C_FUNCS:
            abi.store(pid, argument, _FUNCTIONS.pack(abi.FUNCTIONS))
        elif command == abi.I2C_RDWR:
            return self._rdwr(argument, pid)
        elif command == abi.I2C_SMBUS:
            self._smbus(handle, argument, pid)
        elif command not in (abi.I2C_RETRIES, abi.I2C_TIMEOUT, abi.I2C_TENBIT, abi.I2C_PEC) or (
            command in (abi.I2C_TENBIT, abi.I2C_PEC) and argument
        ):
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        return 0

    def _rdwr(self, argument: int, pid: int) -> int:
        pointer, count = abi.RDWR_DATA.unpack(abi.fetch(pid, argument, abi.RDWR_DATA.size))
        if not 0 < count <= abi.MOST_MESSAGES:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        raw = list(abi.I2C_MSG.iter_unpack(abi.fetch(pid, pointer, count * abi.I2C_MSG.size)))
        messages = [
            abi.message(address, flags, length, partial(abi.fetch, pid, at, length))
            for address, flags, length, at in raw
        ]
        answers = abi.transact(self._transfer, messages, self._now())
        for (_, _, _, at), answer in zip(raw, answers, strict=True):
            if answer:
                abi.store(pid, at, answer)
        return len(raw)

    def _smbus(self, handle: int, argument: int, pid: int) -> None:
        direction, command, size, pointer = abi.SMBUS_DATA.unpack(abi.fetch(pid, argument, abi.SMBUS_DATA.size))
        data = abi.fetch(pid, pointer, abi.SMBUS_UNION_BYTES) if pointer else bytes(abi.SMBUS_UNION_BYTES)
        reads = direction == abi.SMBUS_READ
        answer = self._transfer(abi.smbus(self._address(handle), reads, command, size, data), self._now())
        if answer and pointer:
            abi.store(pid, pointer, abi.smbus_answer(size, answer))


def _prepare(path: Path) -> bool:
    """Ensure an ordinary file to mount over; returns whether it was created here."""
    if is_mounted(path):
        _unmount(path)
    if not path.exists():
        try:
            path.touch()
        except OSError as error:
            raise HindraxError(f"{path}: cannot be made ({cause(error)}); choose another place") from error
        return True
    if not path.is_file():
        raise HindraxError(f"{path}: exists already and is no regular file; a mock never hides a real bus")
    return False


def _mount(path: Path) -> int:
    remedy = "it needs root and /dev/fuse (in a container: --device /dev/fuse --cap-add SYS_ADMIN)"
    try:
        fd = os.open(DEVICE, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise HindraxError(f"{path}: cannot be mounted as a bus ({DEVICE}: {cause(error)}); {remedy}") from error
    options = f"fd={fd},rootmode={stat.S_IFREG | 0o666:o},user_id=0,group_id=0,allow_other"
    arguments = (SOURCE.encode(), str(path).encode(), b"fuse", MS_NOSUID | MS_NODEV, options.encode())
    if _libc.mount(*arguments) != 0:
        code = ctypes.get_errno()
        os.close(fd)
        raise HindraxError(f"{path}: cannot be mounted as a bus (mount: {os.strerror(code)}); {remedy}")
    return fd


def _unmount(path: Path) -> None:
    _libc.umount2(str(path).encode(), MNT_DETACH)
