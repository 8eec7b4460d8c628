"""The last screen of a result: what each motion is worth, and the one experiment that would improve the result most."""

import math
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from hindrax_analysis.identification.pool_session import WEIGHED
from hindrax_analysis.next_step import UNKNOWN, lacking, misread, quoted_share, shares_of_step
from hindrax_analysis.terminal import print_table
from hindrax_core.text.digits import TWO_SIDED_95, last_place
from hindrax_core.text.screen_text import print_fitted, print_whole
from hindrax_ident.assess.quality import FORCE_SHARE
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.model.motion_model import MOTIONS, axis_units
from hindrax_ident.remedies import FLY_TWICE, WEIGH_THRUST, Remedy

ERROR, STILL = "held_out_rmse", "held_out_rmse_stays_still"
TITLE = f"Verdict: drag at highest speed (std below {FORCE_SHARE:.0%} is good), held-out error (still)"
"""One line on a screen; docs/have-a-log.md says against what it is good, and what the error is of."""
HELD_OUT, REHEARSED = "error (still)", "rehearsed std"
REJECTED = "*"
"""Mark of a motion that is not identifiable, in the tables and before its reasons."""
SESSION, WEIGHING = "--session", "weigh the thrust, in the guided session of a pool day"
SIMULATOR, POOL = "--simulator", "pool"
LOAD_N, LEVER_M = 15.0, 0.15
"""Weight in water and lever of a known-weight test, as the page of a pool day has them."""


class NextCommand(Protocol):
    """Knows the command of a next step."""

    def words(self, motion: str, remedy: Remedy, /) -> list[str]:
        """The command that does a step for a motion; none where it takes more than a command."""


@dataclass(frozen=True, slots=True)
class NextFlight:
    """What a next flight would fly, so that its command can be printed whole."""

    mock: Sequence[str] = ()
    """Options of the mock vehicle; empty for one in water."""
    world: str = ""
    """Of the mock; empty for its usual one."""
    vehicle: str = ""
    """File or name; empty for the default."""
    again: Sequence[str] = ()
    """Options of a flight behind an autopilot, as they were given: no session flies such a vehicle."""

    def words(self, motion: str, remedy: Remedy) -> list[str]:
        """The command that does a step for a motion, or flies it again after the step."""
        axis, words, world = motion.partition("_")[0], ["./hindrax", "pool-test"], self.world
        if remedy == WEIGH_THRUST and axis in WEIGHED and self.again:
            return ["./hindrax", "weigh", "--help"]
        if remedy == WEIGH_THRUST and axis in WEIGHED:
            lever = ("--lever", f"{LEVER_M:g}") if axis == "yaw" else ()
            words += [SESSION, *(() if self.mock else ("--load", f"{LOAD_N:g}", *lever))]
        elif remedy.command:
            return remedy.command.split()
        elif self.mock and SIMULATOR not in self.mock and remedy.condition:
            world = f"{self.world or POOL},{remedy.condition}=0"  # there nobody can lead a tether away
        if self.again:
            return [*words, *map(shlex.quote, self.again), "--dof", axis]
        vehicle = ("--vehicle", shlex.quote(self.vehicle)) if self.vehicle else ()
        return [*words, *self.mock, *(("--world", world) if world else ()), *vehicle, "--dof", axis]


@dataclass(frozen=True, slots=True)
class NextReport:
    """A record that this stack did not fly: what each step would buy is in a report of it."""

    command: str
    """That writes the report; empty where it is written."""
    is_here: Callable[[str], bool] = lambda _name: True
    """Whether a command is installed; the wheel has none that needs ROS."""

    def words(self, _motion: str, remedy: Remedy) -> list[str]:
        """The command of a step at the desk, else that of the report."""
        desk = remedy.command if remedy != WEIGH_THRUST else ""
        if desk and not self.is_here(desk.split()[1]):
            desk = ""
        return [one for one in (desk or self.command,) if one]


def shared(sentences: Mapping[str, Sequence[str]]) -> list[tuple[list[str], str]]:
    """Each sentence of all motions once, in their order, with the names of all motions that it is about."""
    names: dict[str, list[str]] = {}
    for motion, said in sentences.items():
        for sentence in said:
            names.setdefault(sentence, []).append(motion)
    return [(of, sentence) for sentence, of in names.items()]


def show_reasons(reasons: Mapping[str, Sequence[str]]) -> None:
    """Print why motions are not identifiable, those with the same reasons in one line."""
    for names, why in shared({motion: ["; ".join(found)] for motion, found in reasons.items() if found}):
        print_fitted(f"{REJECTED} {', '.join(names)}: not identifiable: {why}")


def marked(result: MotionResult) -> str:
    """Name of a motion, with the mark of one that is not identifiable."""
    return result.motion if result.identifiable else f"{result.motion}{REJECTED}"


def show_verdicts(motions: Mapping[str, MotionResult], predicted: Mapping[str, float], *, dense: bool = False) -> None:
    """Print a line for each motion: drag with its 95 % interval, its deviation, error of the held-out prediction.

    Parameters
    ----------
    motions
        Results by motion.
    predicted
        Deviation of the drag of each motion as a share of it, as a rehearsal predicted it [-]; empty without one.
    dense
        Whether the table is drawn without lines, for a screen that is full.
    """
    numbers = ("drag", "95 % interval", "std", *((REHEARSED,) if predicted else ()), HELD_OUT)
    rows = []
    for motion, result in motions.items():
        before = (quoted_share(predicted[motion], 0) if motion in predicted else "",) if predicted else ()
        rows.append((marked(result), *_drag(result), *before, _held_out(result)))
    if any(one.drag is not None for one in motions.values()):  # else the reasons say it all
        print_table(TITLE, ("motion",), numbers, rows, spare=(HELD_OUT, REHEARSED), dense=dense)


def _drag(result: MotionResult) -> tuple[str, str, str]:
    """Drag at the highest speed, its 95 % interval, its standard deviation as a share of it; empty where unknown."""
    if result.drag is None:
        return "", "", ""
    speed, (force, std) = float(result.drag.speed[-1]), result.drag.quoted(-1)
    rate, unit = axis_units(MOTIONS[result.motion].axis)
    if not (math.isfinite(force) and math.isfinite(std) and std > 0.0):
        return f"{force:.3g} {unit} at {speed:.2g} {rate}", "", ""
    digits = max(0, -last_place(std, 2))
    ends = (force - TWO_SIDED_95 * std, force + TWO_SIDED_95 * std)
    if result.drag.corrected is not None:
        ends = result.drag.corrected.at(-1).interval95
    low, high = (f"{end:z.{digits}f}" for end in ends)
    share = quoted_share(std / force, 0) if force > 0.0 else ""
    return f"{force:.{digits}f} {unit} at {speed:.2g} {rate}", f"{low} to {high}", share


def _held_out(result: MotionResult) -> str:
    error, still = (result.quality.get(name, math.nan) for name in (ERROR, STILL))
    if not (math.isfinite(error) and math.isfinite(still)):
        return ""
    return f"{_short(error)} ({_short(still)})"


def _short(error: float) -> str:
    """Two digits, and no more than three after the point: a screen of 80 columns has room for no more."""
    return f"{error:.{min(3, max(0, -last_place(error, 2)))}f}"


def show_next(motions: Mapping[str, MotionResult], following: NextCommand) -> None:
    """Print the best next step for the worst drag, what it buys at best, and its command.

    Where the drag of every motion stays unknown after it, print what the record of the nearest one lacks; where signs,
    axes or units are wrong, that.

    Parameters
    ----------
    motions
        Results by motion.
    following
        Knows the command of a step.
    """
    if wrong := shared({name: [why] for name, one in motions.items() if (why := misread(one))}):
        names, reason = wrong[0]
        print_fitted(f"best next step: {', '.join(names)}: {reason}")
        _print_command(following.words(names[0], FLY_TWICE))
        return
    steps = {name: shares for name, one in motions.items() if (shares := shares_of_step(one)) is not None}
    # Of a motion that hardly moved nothing would be known after the next step either.
    if known := {name: shares for name, shares in steps.items() if shares[0] < UNKNOWN}:
        worst = motions[max(known, key=known.__getitem__)]
    elif steps:
        worst = motions[min(steps, key=lambda name: steps[name][1])]
    else:
        return
    (now, then), step = steps[worst.motion], worst.next_step
    assert step is not None
    if then < UNKNOWN:
        words = following.words(worst.motion, step.remedy)
        what = WEIGHING if SESSION in words else step.remedy
        bought = f"std of the drag of {worst.motion} {quoted_share(now)} -> {quoted_share(then)} at best"
        print_fitted(f"best next step: {what}; {bought}")
    else:
        words = following.words(worst.motion, FLY_TWICE)
        print_fitted(f"best next step: another record of {worst.motion}; this one lacks: {lacking(worst)}")
    _print_command(words)


def _print_command(words: Sequence[str]) -> None:
    if words:
        print_whole(f"  {' '.join(words)}")
