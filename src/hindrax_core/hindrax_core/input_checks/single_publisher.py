"""The one publisher that is obeyed on a topic that anybody may publish: wrenches, or the state of the vehicle.

A message does not say who sent it, but the graph says who publishes. Where two do, neither is obeyed.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

UNKNOWN = "_NODE_NAME_UNKNOWN_"
"""What the middleware says of a publisher whose node it has not heard of yet, or that has none."""


@dataclass(slots=True)
class SinglePublisher:
    """Who is obeyed; `name` is empty until there is one. It changes only while the thrusters are disarmed."""

    name: str = ""

    def judge(self, publishers: Collection[str], *, armed: bool) -> str:
        """Why a message that just came is not taken, given the full names of all publishers; empty when it is."""
        listed = ", ".join(sorted(publishers))
        if len(publishers) != 1:
            return f"found {len(publishers)} publishers{listed and f' ({listed})'}, wanted one"
        if UNKNOWN in listed:
            return "found a publisher without a node, wanted one whose name the graph knows"
        if armed and self.name and self.name != listed:
            return f"found {listed}, wanted {self.name}, as when the thrusters were armed; disarm first"
        self.name = listed
        return ""

    def is_contested(self, publishers: Collection[str]) -> bool:
        """Whether another one publishes whose name the graph knows: that does not end by itself."""
        known = {one for one in publishers if UNKNOWN not in one}
        return bool(known - {self.name}) and (bool(self.name) or len(known) > 1)
