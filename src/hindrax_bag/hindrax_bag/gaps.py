"""Messages that never came, by the gaps in the numbers that every publisher gives its own.

A middleware tells of messages that were lost on the wire, but not of those that it dropped from a queue that was full.
"""

from __future__ import annotations

from collections.abc import Callable


class Gaps:
    """One topic. Numbers do not tell which publisher gave them, so they are taken for the next of one that is known."""

    def __init__(self, publishers: Callable[[], int]) -> None:
        """`publishers`: how many the topic has; asked only when a number is not the next of any."""
        self.lost = 0
        self._publishers = publishers
        self._last: list[int] = []

    def hear(self, number: int) -> None:
        """Take the number of the next message."""
        last = self._last
        if len(last) == 1 and last[0] + 1 == number:
            last[0] = number
        elif number - 1 in last:
            last[last.index(number - 1)] = number
        else:
            self._leap(number)

    def _leap(self, number: int) -> None:
        last = self._last
        if not last or len(last) < self._publishers():
            last.append(number)
            return
        before = [one for one in last if one < number]
        if before:
            self.lost += number - max(before) - 1
            last.remove(max(before))
        else:
            # One has begun anew.
            last.remove(min(last))
        last.append(number)
