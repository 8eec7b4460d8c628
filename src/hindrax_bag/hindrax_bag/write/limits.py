"""Limits on the size of a bag."""

import shutil
from dataclasses import dataclass
from pathlib import Path

from hindrax_core.errors import HindraxError
from hindrax_core.knobs import choice, knob

BYTES_PER_S = 100_000
"""Bytes of the whole stack in a second of vehicle time: 63 kB were measured, with a margin."""

FILES_IN_BUDGET = 4
"""At least so many files share a budget from which the oldest is dropped."""


@dataclass(frozen=True, slots=True)
class BagLimits:
    """Limits of the bag. Zero disables a limit.

    The index of a file is kept in memory until the file ends, 0.3 MB for each minute.
    """

    split_MB: float = knob(1000.0, 0.0, 1e6, "size at which a new file of the bag begins [MB]")
    split_s: float = knob(900.0, 0.0, 1e6, "time after which a new file of the bag begins [s]")
    budget_MB: float = knob(0.0, 0.0, 1e7, "largest size of the bag, all files together [MB]")
    when_full: str = choice("stop", ("stop", "oldest"), "stop recording, or drop the oldest file of the bag")
    keep_free_MB: float = knob(200.0, 0.0, 1e6, "space kept free on the disk [MB]")
    planned_s: float = knob(0.0, 0.0, 1e6, "length of the planned run, for the check of free space [s]")

    def check_space(self, folder: Path) -> None:
        """HindraxError when the disk is too full for the planned run."""
        free_MB = free_bytes(folder) / 1e6
        run_MB = self.planned_s * BYTES_PER_S / 1e6
        if self.when_full == "oldest" and self.budget_MB:
            run_MB = min(run_MB, self.budget_MB)
        wanted_MB = self.keep_free_MB + run_MB
        if free_MB < wanted_MB:
            plan = f"{run_MB:.0f} MB for {self.planned_s:.0f} s of recording" if run_MB else "a start"
            raise HindraxError(
                f"{folder}: {free_MB:.0f} MB are free, {wanted_MB:.0f} MB are wanted ({plan}, and"
                f" {self.keep_free_MB:.0f} MB stay free); make room, or record elsewhere"
            )

    def split_due(self, size_bytes: int, age_s: float) -> bool:
        """Whether a file of this size and age is to be split."""
        split_MB = self.split_MB
        if self.budget_MB and self.when_full == "oldest":
            # Only complete files can be dropped, so a budget needs splitting.
            split_MB = min(split_MB or self.budget_MB, self.budget_MB / FILES_IN_BUDGET)
        large = bool(split_MB) and size_bytes >= split_MB * 1e6
        return large or (bool(self.split_s) and age_s >= self.split_s)

    def over_budget(self, bag_bytes: int) -> bool:
        """Whether the bag exceeds its budget on the disk."""
        return bool(self.budget_MB) and bag_bytes > self.budget_MB * 1e6


def free_bytes(folder: Path) -> int:
    """Free bytes on the disk of a folder."""
    return shutil.disk_usage(folder).free
