"""The wrench guard: which wrenches may reach the allocator, and what of them.

A wrench that is stale, from the future, out of order or in a foreign frame is refused whole; an axis that is not finite
is refused alone; an axis beyond the vehicle's limits is brought back to them. Every refusal has a reason.
"""

import math
from dataclasses import dataclass

from hindrax_core.events import Stamp, seconds_between
from hindrax_core.input_checks import StampWindow
from hindrax_core.knobs import knob
from hindrax_core.readings import Vec6, vec6
from hindrax_core.rotation import FLU, FSD, half_turn, unprefixed
from hindrax_core.signals import ZERO6
from hindrax_core.text.refusals import NOTHING, Reason, Refusal
from hindrax_core.vehicle import WRENCH_SYMBOLS, Vehicle

LIMITED_TOGETHER = ((0, 1), (2,), (3,), (4,), (5,))
"""Surge and sway shrink together, so that the direction of travel stays."""


@dataclass(frozen=True, slots=True)
class WrenchGuardKnobs:
    """Age and lead at which a wrench is refused."""

    max_age_s: float = knob(0.5, 0.02, 5.0, "age at which a wrench is refused [s]")
    max_lead_s: float = knob(0.1, 0.0, 5.0, "lead of a stamp over the clock at which a wrench is refused [s]")


@dataclass(frozen=True, slots=True)
class Accepted:
    """Output of the guard: a finite wrench in base_link_fsd [N, N m], or None; and the refused parts."""

    wrench: Vec6 | None
    refused: tuple[Refusal, ...] = ()
    asked: Vec6 = ZERO6
    """Finite part of the requested wrench, in the same axes, before the limits."""


class WrenchGuard:
    """Judges one wrench after the other; keeps only the stamp of the last one it let through."""

    def __init__(self, vehicle: Vehicle, knobs: WrenchGuardKnobs | None = None) -> None:
        self._limits = vehicle.limits.wrench
        knobs = knobs or WrenchGuardKnobs()
        self._window = StampWindow(knobs.max_age_s, knobs.max_lead_s)
        self._last: Stamp | None = None

    def step(self, wrench: Vec6, frame: str, stamp: Stamp, now: Stamp) -> Accepted:
        """Judge a wrench at the border of the vehicle or of the allocator.

        Parameters
        ----------
        wrench : [N, N m]
            About the center of mass, in the axes of `frame`.
        frame
            base_link or base_link_fsd, with or without the vehicle's prefix.
        stamp, now
            When it was made, and the time of the vehicle.

        Returns
        -------
        Accepted
            The wrench in base_link_fsd within limits, or None; and what of it was refused.
        """
        refusal = self._out_of_time(stamp, now)
        axes = unprefixed(frame)
        if not refusal and axes not in (FSD, FLU):
            refusal = Refusal(Reason.FRAME, f"wrench: found frame {frame!r}, wanted {FSD} or {FLU}")
        if refusal:
            return Accepted(None, (refusal,))
        self._last = stamp
        finite, refused = finite_axes(half_turn(wrench) if axes == FLU else wrench)
        limited, clipped = _limited(finite, self._limits)
        return Accepted(limited, refused + clipped, finite)

    def _out_of_time(self, stamp: Stamp, now: Stamp) -> Refusal:
        wrong_stamp = self._window.judge(stamp, now)
        if wrong_stamp is not None:
            return wrong_stamp.refusal.within("wrench: ")
        older_s = 0.0 if self._last is None else seconds_between(stamp, self._last)
        if not older_s > 0.0:
            return NOTHING
        sentence = f"wrench: {older_s:.2f} s older than the one before it, wanted a newer one"
        return Refusal(Reason.OUT_OF_ORDER, sentence)


def finite_axes(wrench: Vec6) -> tuple[Vec6, tuple[Refusal, ...]]:
    """Return the wrench with zero where it is not finite, and "axis: reason" for each axis that was refused."""
    refused = tuple(
        Refusal(Reason.NOT_FINITE, f"{symbol}: found {value}, wanted a finite number")
        for symbol, value in zip(WRENCH_SYMBOLS, wrench, strict=True)
        if not math.isfinite(value)
    )
    return vec6(value if math.isfinite(value) else 0.0 for value in wrench), refused


def _limited(wrench: Vec6, limits: Vec6) -> tuple[Vec6, tuple[Refusal, ...]]:
    values, notes = list(wrench), list[Refusal]()
    for axes in LIMITED_TOGETHER:
        kept = min((limits[axis] / abs(wrench[axis]) for axis in axes if abs(wrench[axis]) > limits[axis]), default=1.0)
        for axis in axes:
            values[axis] = wrench[axis] * kept
        over = [axis for axis in axes if abs(wrench[axis]) > limits[axis]]
        for i in over:
            sentence = f"{WRENCH_SYMBOLS[i]}: found {wrench[i]:.4g}, limited to {limits[i]:.4g}"
            notes.append(Refusal(Reason.LIMITED, sentence))
    return vec6(values), tuple(notes)
