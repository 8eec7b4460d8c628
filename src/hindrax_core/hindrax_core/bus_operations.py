"""A register bus as data: a driver yields bus operations, and the owner of the bus performs them.

A `Program` is a generator that yields operations and returns its result. Nothing in it knows a port, a clock or a
thread, so the same program runs on a Raspberry Pi, against an emulator and in a test transcript.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TypeAlias, TypeVar


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
read of 12 bytes gives the number of its rising edges and the time of the newest, `>Iq`, in ns of the bus's clock."""

Transaction: TypeAlias = Write | Read | WriteRead
Operation: TypeAlias = Transaction | Pause

ResultT = TypeVar("ResultT")
Program: TypeAlias = Generator[Operation, bytes, ResultT]


class DeviceError(Exception):
    """A bus or device that violates its datasheet. The host retries; the operator reads the text."""


def no_tap(*_: object) -> None:
    """Record nothing."""


def advance(
    program: Program[ResultT],
    transfer: Callable[[Transaction], bytes],
    tap: Callable[[Transaction, bytes], None] = no_tap,
) -> Pause:
    """Run a program up to its next pause, and return that; StopIteration, with its result, at its end.

    `transfer` does one transaction and returns the bytes read (empty for a write) or raises DeviceError, which is
    thrown into the program at the operation that failed. `tap` is called for every transaction that succeeded.
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
    """Run one program to its end on a bus; see `advance`."""
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
