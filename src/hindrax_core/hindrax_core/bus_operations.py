"""A register bus as data: a driver yields bus operations, and the owner of the bus performs and records them.

A `Program` is a generator that yields operations and returns its result. Nothing in it knows a port, a clock or a
thread, so the same program runs on a Raspberry Pi, against an emulator and in a test transcript.
"""

import errno
import os
import struct
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias, TypeVar

from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp


@dataclass(frozen=True, slots=True)
class Write:
    """One I2C write transaction: START, address, data, STOP."""

    address: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Read:
    """One I2C read transaction of `count` bytes."""

    address: int
    count: int


@dataclass(frozen=True, slots=True)
class WriteRead:
    """A write and, after a repeated START, a read of `count` bytes in the same transaction."""

    address: int
    data: bytes
    count: int


@dataclass(frozen=True, slots=True)
class Pause:
    """Wait at least this long before the next operation; other programs may use the bus meanwhile.

    Up to `slack_s` more does no harm, so that a host may wake once for several devices.
    """

    seconds: float
    slack_s: float = 0.0


EDGES = 0x80
"""Addresses from here on are GPIO lines beside the bus, EDGES + line. A write of the chip's name watches the line; a
read of 12 bytes gives the number of its rising edges and the time of the newest, `EDGE`, in ns of the bus's clock."""
EDGE = struct.Struct(">Iq")

Transaction: TypeAlias = Write | Read | WriteRead
Operation: TypeAlias = Transaction | Pause

ResultT = TypeVar("ResultT")
Program: TypeAlias = Generator[Operation, bytes, ResultT]


_HEAD = struct.Struct("<BH")
_MEANING = {
    errno.EREMOTEIO: "no acknowledge: not wired, not powered, or another address",
    errno.ENXIO: "no acknowledge: not wired, not powered, or another address",
    errno.ETIMEDOUT: "timeout: the bus is held low; power-cycle its devices and check the pull-ups",
    errno.EAGAIN: "arbitration lost: another master or a short circuit on the bus",
}


class DeviceError(HindraxError):
    """A bus or device that violates its datasheet. A host retries, a command ends; the operator reads the text."""


def wire_error(port: str, address: int, code: int) -> DeviceError:
    """Describe a failed transaction in one sentence.

    Parameters
    ----------
    port
        Name of the bus.
    address
        Of the device, seven bits.
    code
        The `errno` of the system.

    Returns
    -------
    DeviceError
        Not raised: port, address, name of the error, likely cause.
    """
    name = errno.errorcode.get(code, "error")
    return DeviceError(f"{port} address {address:#04x}: {_MEANING.get(code, os.strerror(code))} ({name}, {code})")


def pack_transaction(transaction: Transaction) -> bytes:
    """Request of a transaction as a frame: `u8 address | u16 count, little endian | bytes written`.

    Parameters
    ----------
    transaction
        Count 0 is a write, no bytes a read, both a write and a read in one transaction.

    Returns
    -------
    bytes
        The request. The frame of the answer has the bytes read, none for a write.
    """
    count = 0 if isinstance(transaction, Write) else transaction.count
    data = b"" if isinstance(transaction, Read) else transaction.data
    return _HEAD.pack(transaction.address, count) + data


def unpack_transaction(frame: bytes) -> Transaction:
    """Decode a transaction, the inverse of `pack_transaction`; ValueError when the frame is too short."""
    if len(frame) < _HEAD.size:
        raise ValueError(f"found a transaction of {len(frame)} bytes, wanted at least {_HEAD.size}")
    address, count = _HEAD.unpack_from(frame)
    data = frame[_HEAD.size :]
    if count == 0:
        return Write(address, data)
    return WriteRead(address, data, count) if data else Read(address, count)


class FrameBatch(Protocol):
    """A RawFrames message, of the installed type or as a bag has it."""

    data: Sequence[int] | bytes
    """All frames, one behind the other."""
    directions: Sequence[int] | bytes
    lengths: Sequence[int]
    """Of each frame [bytes]."""
    stamps: Sequence[int]
    """Of each frame [ns]."""


def frames_in(batch: FrameBatch) -> Iterator[tuple[Stamp, int, bytes]]:
    """Stamp, direction and bytes of every frame of a RawFrames message."""
    start, data = 0, bytes(batch.data)
    for stamp, direction, length in zip(batch.stamps, bytes(batch.directions), batch.lengths, strict=True):
        yield Stamp(int(stamp)), direction, data[start : start + length]
        start += length


def no_tap(*_: object) -> None:
    """Record nothing."""


def advance(
    program: Program[ResultT],
    transfer: Callable[[Transaction], bytes],
    tap: Callable[[Transaction, bytes], None] = no_tap,
) -> Pause:
    """Run a program up to its next pause.

    Parameters
    ----------
    program
        Generator of bus operations, begun or not.
    transfer
        Does one transaction and returns the bytes read (empty for a write), or raises DeviceError, which is thrown into
        the program at the operation that failed.
    tap
        Called for every transaction that succeeded.

    Returns
    -------
    Pause
        How long to wait before the next call.

    Raises
    ------
    StopIteration
        With the program's result, at its end.
    """
    operation = next(program)
    while not isinstance(operation, Pause):
        try:
            answer = _checked(operation, transfer(operation))
        except DeviceError as error:
            operation = program.throw(error)
            continue
        tap(operation, answer)
        operation = program.send(answer)
    return operation


def run(
    program: Program[ResultT],
    transfer: Callable[[Transaction], bytes],
    pause: Callable[[float], None],
    tap: Callable[[Transaction, bytes], None] = no_tap,
) -> ResultT:
    """Run one program to its end on a bus.

    Parameters
    ----------
    program, transfer, tap
        As `advance` takes them.
    pause : [s]
        Waits.

    Returns
    -------
    ResultT
        Of the program.
    """
    try:
        while True:
            pause(advance(program, transfer, tap).seconds)
    except StopIteration as stop:
        result: ResultT = stop.value
        return result


def _checked(transaction: Transaction, answer: bytes) -> bytes:
    """Return the answer if it has the wanted length; DeviceError for a short read of any adapter."""
    wanted = 0 if isinstance(transaction, Write) else transaction.count
    if len(answer) != wanted:
        address = f"address {transaction.address:#04x}"
        raise DeviceError(f"{address}: short read, found {len(answer)} bytes, wanted {wanted}")
    return answer
