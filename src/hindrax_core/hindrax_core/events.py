"""Output of a decoder: readings with the time at which they were valid, and rejected bytes."""

from dataclasses import dataclass
from typing import Generic, NewType, TypeVar

from hindrax_core.rejects import Reject

Stamp = NewType("Stamp", int)
"""Nanoseconds of ROS time (int, so that adding a sample period never rounds)."""

ReadingT_co = TypeVar("ReadingT_co", covariant=True)

NS_PER_S = 1_000_000_000
EARLIEST = Stamp(-(2**62))
"""Before every stamp: nothing has been seen yet. Differences to it fit into 64 bits."""


def stamp_from_s(seconds: float) -> Stamp:
    """Nearest nanosecond to a time in seconds."""
    return Stamp(round(seconds * NS_PER_S))


def to_s(stamp: int) -> float:
    """Seconds as a float: for differences and plots, never to be turned back into a stamp."""
    return stamp / NS_PER_S


def after(stamp: Stamp, seconds: float) -> Stamp:
    """Return the stamp shifted by the given seconds, which may be negative."""
    return Stamp(stamp + round(seconds * NS_PER_S))


def seconds_between(earlier: Stamp, later: Stamp) -> float:
    """Signed seconds from the first stamp to the second."""
    return (later - earlier) / NS_PER_S


@dataclass(frozen=True, slots=True)
class Stamped(Generic[ReadingT_co]):
    """A reading and the time at which it was valid (not the time at which it arrived)."""

    stamp: Stamp
    reading: ReadingT_co


@dataclass(frozen=True, slots=True)
class Rejected:
    """Rejected bytes with the reason, a `Reject` of ours or words of another package; the bytes are cut to 64."""

    stamp: Stamp
    reason: str
    data: bytes = b""

    @property
    def key(self) -> str:
        """What it is counted by; words without a code count for themselves."""
        return self.reason.key if isinstance(self.reason, Reject) else self.reason

    def __post_init__(self) -> None:
        """Limit the memory that invalid bytes can take."""
        object.__setattr__(self, "data", bytes(self.data[:64]))
