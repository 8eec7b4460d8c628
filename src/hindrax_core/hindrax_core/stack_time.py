"""The time of a real stack: wall time as it was when the stack started, carried on by the monotonic clock.

A computer without a battery clock (every Raspberry Pi) gets its time from the network after it has booted, and its wall
clock then steps. Stamps of one stack do not: all its processes share the one offset that its tool measured.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from hindrax_core.events import NS_PER_S, Stamp

VARIABLE = "HINDRAX_EPOCH_NS"
"""Environment variable with the wall time at which the monotonic clock of this machine was zero [ns]."""
STEP_S = 0.1
"""A wall clock this far from the stack's time was stepped: orders that it stamps would be refused."""


def epoch_ns() -> int:
    """Wall time at which the monotonic clock was zero, by the wall clock as it is now.

    Of three looks the shortest counts: who was interrupted between the two clocks would see a step.

    Returns
    -------
    int
        Time since 1970 [ns].
    """
    return min(_look() for _ in range(3))[1]


def _look() -> tuple[int, int]:
    """Duration of a reading of the clocks, and the wall time at which the monotonic clock was zero [ns]."""
    before, wall, after = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
    return after - before, wall - before


@dataclass(frozen=True, slots=True)
class StackTime:
    """Time of a stack with this epoch; without one it is the wall clock, with its steps."""

    epoch_ns: int | None = None

    @classmethod
    def of(cls, environment: Mapping[str, str]) -> Self:
        """Time of the stack to which a process with this environment belongs."""
        epoch = environment.get(VARIABLE, "")
        return cls(int(epoch) if epoch else None)

    def now(self) -> Stamp:
        """Nanoseconds since 1970."""
        return Stamp(time.time_ns() if self.epoch_ns is None else self.epoch_ns + time.monotonic_ns())

    def at(self, monotonic_ns: int) -> Stamp:
        """Time of this clock when the monotonic clock stood there: what the kernel stamps by that clock.

        Parameters
        ----------
        monotonic_ns : [ns]
            Time of the monotonic clock.

        Returns
        -------
        Stamp
            Outside of a stack, by the wall clock as it is now.
        """
        return Stamp((epoch_ns() if self.epoch_ns is None else self.epoch_ns) + monotonic_ns)

    def step_s(self) -> float:
        """Lead of the wall clock over this time [s], the correction by a clock daemon."""
        return 0.0 if self.epoch_ns is None else (epoch_ns() - self.epoch_ns) / NS_PER_S

    def step_reason(self) -> str:
        """Step of the wall clock, as a reason; empty when it runs with this time."""
        step_s = self.step_s()
        if abs(step_s) <= STEP_S:
            return ""
        return f"the wall clock was set {'forward' if step_s > 0.0 else 'back'} by {abs(step_s):.1f} s"
