"""Questions and answers of the benchmark, as they stand in JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias, TypedDict

Pair: TypeAlias = tuple[float, float | None]
"""A value and its standard deviation; None of a tool that has none."""


class AxisAnswer(TypedDict, total=False):
    """Of one axis: drag at the three speeds that were asked, and added mass; `inertia` where that is to follow."""

    drag: list[Pair]
    added_mass: Pair
    inertia: Pair


class Truth(TypedDict):
    """Of one record, by axis: drag at the three speeds, and added mass."""

    drag: list[list[float]]
    added_mass: list[float]


Answer: TypeAlias = Mapping[str, AxisAnswer]
"""By axis; one that is left out was refused."""
