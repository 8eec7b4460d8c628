"""Monitor of a serial line: reports silence and undecodable data once per episode."""

from __future__ import annotations

from typing import Literal, TypeAlias

from hindrax_core.driver_interface import Trouble
from hindrax_core.events import Stamp, seconds_between

Condition: TypeAlias = Literal["well", "silent", "foreign"]


class SilenceMonitor:
    """Times of the last byte and of the last valid message.

    `name` is the device for the operator, `wanted` the expected data. Silence is reported after
    `stall_s`, foreign data after twice that.
    """

    def __init__(self, name: str, wanted: str, stall_s: float) -> None:
        self._name, self._wanted, self._stall_s = name, wanted, stall_s
        self.restart(Stamp(0))

    def restart(self, stamp: Stamp) -> None:
        """Reset after the line was opened."""
        self.last_byte = self.last_valid = stamp
        self.condition: Condition = "well"

    def tick(self, stamp: Stamp) -> list[Trouble]:
        """Update the condition; a new silent or foreign condition is returned as a Trouble."""
        before, self.condition = self.condition, self._condition_at(stamp)
        if self.condition in ("well", before):
            return []
        found = "bytes arrive but none of them verify", "check line speed and device"
        if self.condition == "silent":
            found = f"no byte for {self._stall_s:g} s", "check power, cable and port"
        return [Trouble(stamp, f"{self._name}: {found[0]}, wanted {self._wanted}; {found[1]}")]

    def _condition_at(self, stamp: Stamp) -> Condition:
        if seconds_between(self.last_byte, stamp) > self._stall_s:
            return "silent"
        if seconds_between(self.last_valid, stamp) > 2.0 * self._stall_s:
            return "foreign"
        return "well"
