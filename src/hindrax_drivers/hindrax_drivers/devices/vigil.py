"""Watch over a serial line: silence and talk that nobody understands are told once per episode."""

from __future__ import annotations

from typing import Literal, TypeAlias

from hindrax_core.device import Trouble
from hindrax_core.events import Stamp, seconds_between

Condition: TypeAlias = Literal["well", "silent", "foreign"]


class Vigil:
    """Knows when bytes last came and when something was last understood.

    `name` is the device as the operator knows it, `wanted` what its talk should look like. Silence is told after
    `stall_s`, foreign talk after twice that.
    """

    def __init__(self, name: str, wanted: str, stall_s: float) -> None:
        self._name = name
        self._wanted = wanted
        self._stall_s = stall_s
        self.restart(Stamp(0))

    def restart(self, stamp: Stamp) -> None:
        """The line has just been opened."""
        self.heard = self.understood = stamp
        self.condition: Condition = "well"

    def tick(self, stamp: Stamp) -> list[Trouble]:
        """Look at the clock; a condition that has just begun comes back as a Trouble."""
        before, self.condition = self.condition, self._look(stamp)
        if self.condition in ("well", before):
            return []
        return [Trouble(stamp, f"{self._name}: {self._sentence()}")]

    def _look(self, stamp: Stamp) -> Condition:
        if seconds_between(self.heard, stamp) > self._stall_s:
            return "silent"
        if seconds_between(self.understood, stamp) > 2.0 * self._stall_s:
            return "foreign"
        return "well"

    def _sentence(self) -> str:
        if self.condition == "silent":
            return f"no byte for {self._stall_s:g} s, wanted {self._wanted}; check power, cable and port"
        return f"bytes arrive but none of them verify, wanted {self._wanted}; check line speed and device"
