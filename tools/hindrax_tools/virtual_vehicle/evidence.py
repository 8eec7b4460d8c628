"""What a check found, and what the witness of the pulses says: pure, without a machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the outcome."""

    check: str
    good: bool
    figure: str

    def line(self) -> str:
        """Return it for a person."""
        return f"{'good' if self.good else 'BAD '}  {self.check:44}  {self.figure}"


@dataclass(frozen=True, slots=True)
class Seen:
    """What was on the wires at one time."""

    wall_s: float
    monotonic_s: float
    thrust: bool


def seen_in(lines: Sequence[str]) -> list[Seen]:
    """What the devices wrote; the last line may be cut off."""
    words = [line.split() for line in lines]
    whole = [one for one in words if len(one) == 3 and one[2] in ("neutral", "thrust")]
    return [Seen(float(wall), float(monotonic), word == "thrust") for wall, monotonic, word in whole]


def thrust_after_s(seen: Sequence[Seen], since_s: float) -> float | None:
    """How long there was thrust after a time of the monotonic clock [s]; None when it never ended."""
    after = [one for one in seen if one.monotonic_s >= since_s]
    if not after or after[-1].thrust:
        return None
    ends = [now.monotonic_s for before, now in pairwise(after) if before.thrust and not now.thrust]
    return max(ends, default=since_s) - since_s
