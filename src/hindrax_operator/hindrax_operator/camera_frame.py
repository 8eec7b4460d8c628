"""A picture of a camera on its way from the graph to a page."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture of a camera as it was sent, and a number that no other has."""

    number: int
    content: bytes
