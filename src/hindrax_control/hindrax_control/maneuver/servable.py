"""Which motions a vehicle can fly: those that its thrusters serve independently; the others with the reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix, effectiveness, served_axes
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES, Vehicle

SHARE = 0.05
"""A lost axis counts as bound to a served one that makes at least this share of its row."""


@dataclass(frozen=True, slots=True)
class ServableMotions:
    """Motions that can be flown, in the order they were asked for, and those left out, each with its reason."""

    flown: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        """One line: what is flown, what not, and why."""
        flown = f"can fly {', '.join(self.flown) or 'nothing'}"
        reasons = "; ".join(f"{motion}: {reason}" for motion, reason in self.left_out)
        return f"{flown}; cannot fly {reasons}" if reasons else flown


def servable_motions(
    motions: Sequence[str], vehicle: Vehicle, disabled: frozenset[str] = frozenset()
) -> ServableMotions:
    """Split motions (names of AXES) into those that the vehicle's enabled thrusters serve and those they do not."""
    whole = effectiveness(vehicle)
    B = whole[:, [thruster.name not in disabled for thruster in vehicle.thrusters]]
    reasons = _reasons(B)
    # A motion that no thruster of the vehicle serves is not lost to the disabled ones.
    lost_for_good = _reasons(whole)
    out = f"without {', '.join(sorted(disabled))} "
    left_out = {
        motion: ("" if lost_for_good[motion] else out) + reasons[motion]
        for motion in dict.fromkeys(motions)
        if reasons[motion]
    }
    return ServableMotions(tuple(one for one in dict.fromkeys(motions) if one not in left_out), tuple(left_out.items()))


def require_servable(motions: Sequence[str], vehicle: Vehicle, disabled: frozenset[str] = frozenset()) -> None:
    """UsageError that names the first motion that cannot be flown, why, and what can be flown instead."""
    left_out = servable_motions(motions, vehicle, disabled).left_out
    if not left_out:
        return
    motion, reason = left_out[0]
    flown = servable_motions(AXES, vehicle, disabled).flown
    wanted = f"some of {', '.join(flown)}" if flown else "thrusters that do"
    disables = reason.startswith("without ")
    mend = "`./hindrax thruster enable` what works" if disables else "correct `thrusters` in the vehicle file"
    raise UsageError(f"{motion}: {reason}, wanted {wanted}; {mend}{', or fly those' if flown else ''}")


def largest_wrench(vehicle: Vehicle) -> dict[str, float]:
    """Largest force [N] or moment [Nm] of each axis alone, the weaker direction; 0 where the axis is not served."""
    if not vehicle.thrusters:
        return dict.fromkeys(AXES, 0.0)
    B = effectiveness(vehicle)
    served = servable_motions(AXES, vehicle).flown
    ranges = [min(-curve.range_N[0], curve.range_N[1]) for curve in thrust_curves(vehicle)]
    alone = np.linalg.pinv(B)
    found = {}
    for axis, name in enumerate(AXES):
        shares = np.abs(alone[:, axis]) / np.array(ranges)
        found[name] = 1.0 / float(np.max(shares)) if name in served else 0.0
    return found


def require_lift(vehicle: Vehicle) -> None:
    """UsageError for a vehicle that its thrusters cannot hold at a depth."""
    net_N, reach_N = vehicle.net_buoyancy_N, largest_wrench(vehicle)["heave"]
    if abs(net_N) >= reach_N > 0.0:
        pull = "net buoyancy" if net_N > 0.0 else "net weight"
        raise UsageError(
            f"{vehicle.name}: found {abs(net_N):.0f} N of {pull}, wanted less than the {reach_N:.0f} N that its "
            "thrusters give in heave; trim it, or correct mass_kg and volume_m3 in the vehicle file"
        )


def motions_to_fly(dof: Sequence[str], vehicle: Vehicle) -> ServableMotions:
    """Motions that `--dof` asks for: `all` flies what can be flown; UsageError when a named one cannot be."""
    wanted = AXES if "all" in dof else tuple(dof)
    found = servable_motions(wanted, vehicle)
    if "all" not in dof or not found.flown:
        require_servable(wanted, vehicle)
    require_lift(vehicle)
    return found


def _reasons(B: Matrix) -> dict[str, str]:
    """For each axis, why thrusters with the effectiveness B (6, n) cannot fly it; empty when they can."""
    served = served_axes(B)
    return {name: _reason(B, axis, served) for axis, name in enumerate(AXES)}


def _reason(B: Matrix, axis: int, served: Sequence[int]) -> str:
    heave = AXES.index("heave")
    if axis in served:
        return "" if heave in served else "no thruster serves heave, which holds the depth meanwhile"
    row = B[axis]
    length = float(np.linalg.norm(row))
    if length == 0.0:
        return "no thruster serves it"
    shares, *_ = np.linalg.lstsq(B[list(served)].T, row, rcond=None)
    bound = [
        AXES[other]
        for share, other in zip(shares, served, strict=True)
        if abs(share) * float(np.linalg.norm(B[other])) >= SHARE * length
    ]
    return f"no thruster serves it independently of {' and '.join(bound)}"
