"""Speed, each figure beside a peer measured in the same run: every module offers `rows() -> list[dict]`."""

from __future__ import annotations

import os
import statistics
import timeit
from collections.abc import Callable
from pathlib import Path
from typing import Any


def row(name: str, ours_us: float, peer: str, peer_us: float) -> dict[str, Any]:
    """Row of a figure and its peer."""
    return {"name": name, "ours_us": ours_us, "peer": peer, "peer_us": peer_us, "ratio": peer_us / ours_us}


def median_us(call: Callable[[], object], number: int, repeats: int) -> float:
    """Median over repeats of the time of one call [us]."""
    return statistics.median(timeit.repeat(call, number=number, repeat=repeats)) / number * 1e6


def cpu_s(pid: int) -> float:
    """CPU time that a process has used, in user and system mode [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
