"""The words of a next step: what it buys where the drag is known after it, else what the record lacks first."""

import math

from hindrax_ident.assess.objections import Code
from hindrax_ident.assess.results import MotionResult

UNKNOWN = 1.0
"""Standard deviation of a drag as a share of it from which on it is unknown: it may as well be none [-]."""
SYMPTOMS = (Code.UNKNOWN_DRAG, Code.POORLY_KNOWN_DRAG, Code.JOINT_UNKNOWN_DRAG)
"""They say that the drag is unknown, others why."""
MISREAD = (
    Code.AGAINST_THRUST, Code.WRONG_THRUSTERS, Code.SWAPPED_VELOCITIES, Code.TURNED_VELOCITY, Code.IMPLAUSIBLE_SPEED,
    Code.IMPLAUSIBLE_MASS, Code.IMPLAUSIBLE_DRAG,
)  # fmt: skip
"""They say that signs, axes or units are wrong: a longer record would be as wrong."""


def quoted_share(share: float, digits: int = 1) -> str:
    """Standard deviation as a share, for people: beyond the whole its size says nothing.

    Parameters
    ----------
    share
        Of the drag [-]; NaN: there is no drag.
    digits
        After the point.

    Returns
    -------
    str
        Such as 12.3%, >100%, or unknown.
    """
    if math.isnan(share):
        return "unknown"
    return f"{share:.{digits}%}" if share < UNKNOWN else ">100%"


def shares_of_step(result: MotionResult) -> tuple[float, float] | None:
    """Deviation of the drag at the highest speed now and after the next step, as shares of it; None without either."""
    if result.drag is None or result.next_step is None:
        return None
    force, std = result.drag.quoted(-1)
    if not force > 0.0:
        return None
    now, then = std / force, result.next_step.std / force
    return (now, then) if math.isfinite(now) else None


def misread(result: MotionResult) -> str:
    """What is wrong with signs, axes or units of a record; empty where nothing is known to be."""
    return next((one for one in result.reasons if one.code in MISREAD), "")


def lacking(result: MotionResult) -> str:
    """What the record of a motion lacks before any single step makes its drag known."""
    causes = [one for one in result.reasons if one.code not in SYMPTOMS]
    return next(iter(causes or result.reasons), "more of the motion: fly it faster, or for longer")
