"""Refused input of other programs: counted by source, with the last sentence, shown in /diagnostics."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

LONGEST = 300
"""Limit of a kept sentence [characters]: invalid input may be long."""


@dataclass(slots=True)
class Refusals:
    """Refusals of one node. `things` are our own names (topics, sensors), never received text."""

    counts: Counter[str] = field(default_factory=Counter)
    last: str = ""
    _told: int = 0

    def add(self, thing: str, why: str) -> str:
        """Count a refusal and return its sentence."""
        self.counts[thing] += 1
        self.last = f"{thing}: {why}"[:LONGEST]
        return self.last

    def values(self) -> dict[str, str]:
        """Keys and values for /diagnostics; empty without refusals."""
        counted = {f"refused: {thing}": str(count) for thing, count in sorted(self.counts.items())}
        return counted | {"last refused": self.last} if counted else {}

    def new_refusals(self) -> list[str]:
        """Return the last sentence if anything was refused since the previous call."""
        told, self._told = self._told, self.counts.total()
        return [f"refused: {self.last}"] if self._told > told else []
