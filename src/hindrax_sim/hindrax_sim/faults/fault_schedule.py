"""Schedule of faults: when each starts and ends."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeAlias, TypeVar

FaultT = TypeVar("FaultT")
Switch: TypeAlias = Callable[[Any, bool, float], object]
"""Acts on a device as its fault starts (true), and as it ends, at a time."""


@dataclass(frozen=True, slots=True)
class Scheduled(Generic[FaultT]):
    """A fault with its start and end time."""

    fault: FaultT
    start_s: float
    end_s: float


class FaultSchedule(Generic[FaultT]):
    """Starts and ends faults by time; `active` are the running ones, in order of their start."""

    def __init__(self, schedule: Sequence[Scheduled[FaultT]]) -> None:
        self._waiting = sorted(schedule, key=lambda one: one.start_s)
        self._lasting: list[Scheduled[FaultT]] = []
        self._change_s = self._next_change_s()

    @property
    def active(self) -> list[FaultT]:
        """Faults that are active now."""
        return [one.fault for one in self._lasting]

    def advance(self, now_s: float) -> list[tuple[FaultT, bool]]:
        """Advance to now; return the faults that start (true), then those that end (false)."""
        if now_s < self._change_s:  # nearly always, and every device asks at every step
            return []
        started = [one for one in self._waiting if one.start_s <= now_s]
        del self._waiting[: len(started)]
        self._lasting += started
        ended = [one for one in self._lasting if one.end_s <= now_s]
        self._lasting = [one for one in self._lasting if one.end_s > now_s]
        self._change_s = self._next_change_s()
        return [*((one.fault, True) for one in started), *((one.fault, False) for one in ended)]

    def _next_change_s(self) -> float:
        """Time of the next start or end; infinite where none comes."""
        starts_s = (one.start_s for one in self._waiting[:1])
        return min((*starts_s, *(one.end_s for one in self._lasting)), default=math.inf)
