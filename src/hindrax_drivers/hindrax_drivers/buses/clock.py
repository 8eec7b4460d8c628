"""Clocks a host can wait on, and buses with one: the system's, or mock hardware (see `mock_bus`); `ports` opens one.

Every sleep can be ended by `wake()` from another thread or by a readable file descriptor.
"""

import contextlib
import os
import select
from collections.abc import Callable
from typing import Protocol, TypeAlias

from hindrax_core.bus_operations import Transaction
from hindrax_core.events import NS_PER_S, Stamp, after
from hindrax_core.stack_time import StackTime

MOCK_PREFIX = "mock:"
EPOCH = Stamp(0)
LAST_STAMP = Stamp(2**63 - 1)

Meanwhile: TypeAlias = Callable[[], None]


def nothing() -> None:
    """Do nothing."""


class Clock(Protocol):
    """A clock that can be read and waited on."""

    def now(self) -> Stamp:
        """Time of this clock."""

    def sleep_until(self, stamp: Stamp, readable: int | None = None, meanwhile: Meanwhile = nothing) -> None:
        """Sleep; check why it returned.

        Parameters
        ----------
        stamp
            It returns when this time has come, or after `wake()`.
        readable
            A descriptor: it returns when that has bytes; None: none.
        meanwhile
            Called once, at the start, for work that no device waits for. A mock's time advances by then.
        """

    def wake(self) -> None:
        """End the sleep of another thread; if none sleeps, the next sleep ends at once."""

    def close(self) -> None:
        """Close the descriptors. Afterwards only `now` may be used, and `wake` does nothing."""


class RegisterBus(Clock, Protocol):
    """A register bus and its clock. Not for use by two threads at once, except `wake()` and `now()`."""

    def transfer(self, transaction: Transaction) -> bytes:
        """Run one transaction and return the bytes read (empty for a write); DeviceError names port, address, error."""


def pause(clock: Clock, seconds: float) -> None:
    """Sleep for so long, however often the clock is woken."""
    end = after(clock.now(), seconds)
    while clock.now() < end:
        clock.sleep_until(end)


class Alarm:
    """A counter of the kernel that turns `set()` in one thread into a readable descriptor in another."""

    def __init__(self) -> None:
        self._descriptor = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)

    def fileno(self) -> int:
        """Descriptor that is readable after `set`."""
        return self._descriptor

    def set(self) -> None:
        """Make the descriptor readable; nothing after `close`, whoever has the number of the descriptor by then."""
        if self._descriptor >= 0:
            os.eventfd_write(self._descriptor, 1)

    def clear(self) -> None:
        """Make the descriptor unreadable again, however often it was set."""
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._descriptor)

    def close(self) -> None:
        """Close the descriptor."""
        closed, self._descriptor = self._descriptor, -1  # before it: a signal may call `set` between the two
        os.close(closed)


class SystemClock:
    """The time of the stack, as every node of the graph and the bag stamp with it; outside of one, the wall clock.

    A sleep is measured as a duration: when the wall clock is set, a sleep neither hangs for hours nor ends early by
    more than itself.
    """

    def __init__(self) -> None:
        self._time = StackTime.of(os.environ)
        self._alarm = Alarm()

    def now(self) -> Stamp:
        """Nanoseconds since 1970."""
        return self._time.now()

    def sleep_until(self, stamp: Stamp, readable: int | None = None, meanwhile: Meanwhile = nothing) -> None:
        """Sleep at most as long as the stamp lies ahead now.

        Parameters
        ----------
        stamp, readable, meanwhile
            As of `Clock`.
        """
        meanwhile()
        left_s = (stamp - self.now()) / NS_PER_S
        if left_s > 0.0:
            wanted = [self._alarm.fileno()] if readable is None else [self._alarm.fileno(), readable]
            ready, _, _ = select.select(wanted, (), (), left_s)
            if self._alarm.fileno() in ready:
                self._alarm.clear()

    def wake(self) -> None:
        """End the current or the next sleep."""
        self._alarm.set()

    def close(self) -> None:
        """Close the alarm."""
        self._alarm.close()
