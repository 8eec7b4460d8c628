"""The last screen of a result: what each motion is worth, and the one experiment that would improve the result most."""

import math
from collections.abc import Mapping, Sequence

from hindrax_analysis.terminal import print_table
from hindrax_core.text.digits import TWO_SIDED_95, last_place
from hindrax_core.text.screen_text import print_fitted, print_whole
from hindrax_ident.assess.assessment import FLY_TWICE
from hindrax_ident.assess.quality import FORCE_SHARE
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.model.motion_model import MOTIONS, axis_units

ERROR, STILL = "held_out_rmse", "held_out_rmse_stays_still"
TITLE = (
    f"Verdict: drag at the highest speed (a std below {FORCE_SHARE:.0%} is twice as good as a guess from the envelope),"
    " RMS error of the held-out motion in the unit of the speed (and of a guess that it stays still)"
)
HELD_OUT = "error (still)"


def show_verdicts(motions: Mapping[str, MotionResult], predicted: Mapping[str, float]) -> None:
    """Print a line for each motion: drag with its 95 % interval, its deviation, error of the held-out prediction."""
    rehearsed, doubtful = bool(predicted), not all(one.identifiable for one in motions.values())
    numbers = ("drag", "95 % interval", "std", *(("rehearsed",) if rehearsed else ()), HELD_OUT)
    rows = []
    for motion, result in motions.items():
        before = (f"{predicted[motion]:.0%}" if motion in predicted else "",) if rehearsed else ()
        answer = ("yes" if result.identifiable else "no",) if doubtful else ()
        rows.append((motion, *_drag(result), *before, _held_out(result), *answer))
    if rows:
        columns = (*numbers, *(("identified",) if doubtful else ()))
        print_table(TITLE, ("motion",), columns, rows, spare=("rehearsed", HELD_OUT))


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
    share = f"{std / force:.0%}" if force > 0.0 else ""
    return f"{force:.{digits}f} {unit} at {speed:.2g} {rate}", f"{low} to {high}", share


def _held_out(result: MotionResult) -> str:
    error, still = (result.quality.get(name, math.nan) for name in (ERROR, STILL))
    if not (math.isfinite(error) and math.isfinite(still)):
        return ""
    return f"{error:.2g} ({still:.2g})"


def show_next(motions: Mapping[str, MotionResult], fly: Sequence[str]) -> None:
    """Print the experiment that improves the worst drag most, and what it buys; `fly`: words of a flight, if any."""
    known = [(share, one) for one in motions.values() if (share := _share(one)) is not None]
    # Of a motion that hardly moved nothing would be known after the next step either.
    known = [(share, one) for share, one in known if share < 1.0] or known
    if not known:
        return
    share, worst = max(known, key=lambda pair: pair[0])
    step, drag = worst.next_step, worst.drag
    assert step is not None
    assert drag is not None
    then = step.std / drag.quoted(-1)[0]
    print_fitted(f"next: {step.remedy}; the drag of {worst.motion} would be known to {then:.1%} instead of {share:.1%}")
    if step.remedy == FLY_TWICE and fly:
        motion = worst.motion.partition("_")[0]
        print_whole(f"  {' '.join(fly)} --dof {motion}")


def _share(result: MotionResult) -> float | None:
    """Deviation of the drag of a motion as a share of it; None where there is no drag or nothing to do next."""
    if result.drag is None or result.next_step is None:
        return None
    force, std = result.drag.quoted(-1)
    if not force > 0.0:
        return None
    share = std / force
    return share if math.isfinite(share) else None
