"""Lost messages, by gaps in the sequence numbers of their publishers.

A middleware reports messages lost on the wire, but not those dropped from a full queue.
"""

from __future__ import annotations

from collections.abc import Callable


class PublicationGaps:
    """Gaps of one topic. A number does not name its publisher; it is assigned to the one whose next number it is."""

    def __init__(self, publishers: Callable[[], int]) -> None:
        """`publishers`: how many the topic has; asked only when a number is not the next of any."""
        self.lost = 0
        self._publishers = publishers
        self._last: list[int] = []

    def count(self, number: int) -> None:
        """Count the next message by its number."""
        last = self._last
        if number - 1 in last:
            last[last.index(number - 1)] = number
        else:
            self._count_gap(number)

    def _count_gap(self, number: int) -> None:
        last = self._last
        if not last or len(last) < self._publishers():
            last.append(number)
            return
        before = [one for one in last if one < number]
        if before:
            self.lost += number - max(before) - 1
            last.remove(max(before))
        else:
            # A publisher has restarted.
            last.remove(min(last))
        last.append(number)
