"""Standard normal draws, taken from numpy a block at a time: ten times cheaper than one by one."""

import math
import zlib

import numpy as np

BLOCK = 1024


class NormalDraws:
    """An endless sequence that a name and a seed fix."""

    __slots__ = ("_block", "_generator")

    def __init__(self, name: str, seed: int) -> None:
        self._generator = np.random.default_rng([zlib.crc32(name.encode()), abs(seed)])
        self._block: list[float] = []

    def normal(self) -> float:
        """One draw."""
        if not self._block:
            self._block = self._generator.standard_normal(BLOCK).tolist()
        return self._block.pop()

    def uniform(self) -> float:
        """One draw between 0 and 1, all alike: the share of normal draws that lie below one."""
        return 0.5 * (1.0 + math.erf(self.normal() / math.sqrt(2.0)))

    def three(self, sigma: float) -> tuple[float, float, float]:
        """Three draws of a standard deviation."""
        normal = self.normal
        return (sigma * normal(), sigma * normal(), sigma * normal())
