"""What a maneuver is asked to fly."""

from __future__ import annotations

from dataclasses import dataclass

ENDINGS = ("hold", "neutral")
PLATEAUS = "plateaus"


@dataclass(frozen=True, slots=True)
class Goal:
    """Motions to fly, in order, how they are excited, and how a cancelled or aborted maneuver ends.

    `levels`: plateaus of the one motion, from 0, the slowest, to 1, the fastest; empty: those of the plan.
    """

    motions: tuple[str, ...]
    excitation: str = PLATEAUS
    seed: int = 0
    on_cancel: str = "hold"
    levels: tuple[float, ...] = ()
