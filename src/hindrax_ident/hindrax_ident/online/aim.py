"""Aim of an experiment: motions, end, and first legs."""

from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES

LEVELS = {1.0: "fastest", 0.5: "middle", 0.0: "slowest"}
"""Plateaus that may be chosen, in shares of the way from the slowest of the pilot's plan to the fastest."""
FIRST = (1.0, 0.0, 1.0)
"""Levels that a motion begins with: the extremes are most informative, and a repeated leg shows drift."""
ENDINGS = ("hold", "neutral")
LONGEST_MIN = 50.0
LEAST_SHARE = 1e-4


@dataclass(frozen=True, slots=True)
class Aim:
    """End of an experiment: noise of the drag below `until` [-], or after `minutes`; None where nothing is asked."""

    until: float | None = None
    minutes: float | None = None

    @property
    def limit_s(self) -> float:
        """Time after which nothing is flown any more [s]."""
        return 60.0 * (LONGEST_MIN if self.minutes is None else self.minutes)

    def __str__(self) -> str:
        noise = "a third of the calibration uncertainty" if self.until is None else f"{100.0 * self.until:g} %"
        return f"until the noise of the drag is below {noise}, at most {self.limit_s / 60.0:g} minutes"


@dataclass(frozen=True, slots=True)
class ExperimentGoal:
    """Request of an operator to the identification node; `on_cancel`: hold or neutral."""

    motions: tuple[str, ...]
    aim: Aim
    on_cancel: str = "hold"


@dataclass(frozen=True, slots=True)
class Choice:
    """Legs to fly: LEVELS of a motion, each out and back."""

    motion: str
    levels: tuple[float, ...] = FIRST

    def __str__(self) -> str:
        return f"{self.motion}: {', '.join(LEVELS[level] for level in self.levels)}"


def plan_text(motions: Sequence[str], aim: Aim) -> str:
    """Text of the plan."""
    return f"{'; '.join(str(Choice(motion)) for motion in motions)}, each out and back; then most informative, {aim}"


def check_experiment(motions: Sequence[str], aim: Aim, on_cancel: str = "hold") -> None:
    """Check an experiment before it is begun.

    Parameters
    ----------
    motions
        Of AXES.
    aim
        What is wanted of their drag, and the time for it.
    on_cancel
        Ending of a cancelled maneuver: hold or neutral.

    Raises
    ------
    UsageError
        Names what is invalid, found and wanted.
    """
    if not motions:
        raise UsageError(f"goal: no motion, wanted some of {', '.join(AXES)}")
    for motion in motions:
        if motion not in AXES:
            raise UsageError(f"goal: motion {motion[:40]!r} unknown, wanted one of {', '.join(AXES)}")
    if len(set(motions)) < len(motions):
        raise UsageError(f"goal: {len(motions)} motions, one of them twice, wanted each once")
    if on_cancel not in ENDINGS:
        raise UsageError(f"goal: ending {on_cancel[:40]!r} unknown, wanted {' or '.join(ENDINGS)}")
    if aim.until is not None and not LEAST_SHARE <= aim.until <= 1.0:
        raise UsageError(f"goal: until {aim.until:g}, wanted {LEAST_SHARE:g} to 1; without it: by the calibration")
    if aim.minutes is not None and not 0.0 < aim.minutes <= LONGEST_MIN:
        raise UsageError(f"goal: minutes {aim.minutes:g}, wanted more than 0, at most {LONGEST_MIN:g}")
