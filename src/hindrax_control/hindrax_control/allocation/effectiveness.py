"""Thruster capability: the effectiveness matrix, its condition, the axes that they serve, forces that cancel."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES, Vehicle

Matrix: TypeAlias = npt.NDArray[np.float64]

INDEPENDENT = 1e-3
"""An axis is served when at least this fraction of its row is independent of the rows served before it."""

WORST_CONDITION = 1e4
"""Beyond this the thrusters fight each other for next to nothing; well-built vehicles stay below a hundred."""

NEED = (2, 5, 0, 1, 3, 4)
"""Axes as a statically stable vehicle needs them: of two that depend on each other, the later is lost."""


def effectiveness(vehicle: Vehicle) -> Matrix:
    """Wrench about the center of mass per newton of each thruster: (6, n), rows [-]*3, [m]*3. COB-2023-1394 eq. 9."""
    columns = np.zeros((6, len(vehicle.thrusters)))
    for index, thruster in enumerate(vehicle.thrusters):
        arm_m = np.subtract(thruster.position_m, vehicle.center_of_mass_m)
        columns[:3, index] = thruster.direction
        columns[3:, index] = np.cross(arm_m, thruster.direction)
    # What geometry makes zero must be zero: rounding would pass for a lever arm.
    columns[np.abs(columns) < 1e-12] = 0.0
    return columns


def served_axes(B: Matrix, order: Sequence[int] = NEED) -> tuple[int, ...]:
    """Indices of the axes that can be served independently of each other, taken in this order.

    Gram-Schmidt over the rows of B: a row that depends on those before it is an axis that is lost to them. With rank
    below six the choice is not unique, so the order decides which axes a vehicle with few thrusters keeps.

    Parameters
    ----------
    B : (6, n)
        Effectiveness, rows [-]*3, [m]*3.
    order
        Axes, the most important first.

    Returns
    -------
    tuple[int, ...]
        Rising indices, 0 to 5.
    """
    kept: list[int] = []
    directions: list[Matrix] = []
    for axis in order:
        row = B[axis]
        length = float(np.linalg.norm(row))
        rest = row.copy()
        for direction in directions * 2:  # twice, so that rounding does not pass for independence
            rest = rest - float(direction @ rest) * direction
        rest_length = float(np.linalg.norm(rest))
        if rest_length > INDEPENDENT * max(length, 1e-9):
            kept.append(axis)
            directions.append(rest / rest_length)
    return tuple(sorted(kept))


def condition(B: Matrix) -> float:
    """Condition of a layout on the axes that it serves.

    Parameters
    ----------
    B : (6, n)
        Effectiveness, rows [-]*3, [m]*3. Moments are divided by the largest lever arm, to compare them with forces.

    Returns
    -------
    float
        Largest by smallest singular value [-]; infinite if no axis is served.
    """
    served = served_axes(B)
    if not served:
        return math.inf
    arm_m = float(np.max(np.abs(B[3:]), initial=0.0)) or 1.0
    scaled = B / np.array([1.0, 1.0, 1.0, arm_m, arm_m, arm_m])[:, None]
    singular = np.linalg.svd(scaled[list(served)], compute_uv=False)
    return float(singular[0] / singular[-1])


def checked_effectiveness(vehicle: Vehicle) -> Matrix:
    """Effectiveness of the thrusters, if they serve any axis well enough to fly.

    Parameters
    ----------
    vehicle
        Positions and directions of its thrusters.

    Returns
    -------
    Matrix
        (6, n), rows [-]*3, [m]*3: wrench about the center of mass per newton of each thruster.

    Raises
    ------
    UsageError
        Where there is no thruster, or the condition is too bad; it names both.
    """
    B = effectiveness(vehicle)
    if not vehicle.thrusters:
        raise UsageError(f"{vehicle.name}: thrusters: found none, wanted at least one")
    found = condition(B)
    if found > WORST_CONDITION:
        raise UsageError(
            f"{vehicle.name}: thrusters: condition of the effectiveness matrix is {found:.3g},"
            f" wanted at most {WORST_CONDITION:g}; check positions and angles"
        )
    return B


@dataclass(frozen=True, slots=True)
class NullPattern:
    """Forces without wrench, as (thruster, share) pairs; the largest share is one."""

    shares: tuple[tuple[int, float], ...]

    def size_in(self, forces_N: Sequence[float]) -> float:
        """Amplitude of the pattern in given forces [N]."""
        energy = sum(share * share for _, share in self.shares)
        return sum(share * forces_N[index] for index, share in self.shares) / energy


def patterns(B: Matrix) -> tuple[NullPattern, ...]:
    """Sparse null vectors of B (rows, m): each involves as few thrusters as elimination finds."""
    if B.shape[1] == 0:
        return ()
    _, singular, rows = np.linalg.svd(B)
    rank = int(np.sum(singular > 1e-9 * max(1.0, float(singular[0]))))
    found = []
    for vector in _reduced(rows[rank:].copy()):
        scaled = vector / vector[int(np.argmax(np.abs(vector)))]
        found.append(
            NullPattern(tuple((index, float(share)) for index, share in enumerate(scaled) if abs(share) > 1e-9))
        )
    return tuple(found)


def _reduced(rows: Matrix) -> Matrix:
    """Rows (r, m) [-] reduced by Gauss-Jordan with the largest pivot of each row, which makes them sparse."""
    for turn in range(len(rows)):
        pivot = int(np.argmax(np.abs(rows[turn])))
        rows[turn] /= rows[turn, pivot]
        for other in range(len(rows)):
            if other != turn:
                rows[other] -= rows[other, pivot] * rows[turn]
    return rows


class ThrusterLayout:
    """The thrusters in use (m of n) and what they can do, as far as it does not depend on the wrench.

    `used`: their indices; `pseudo_inverse` (m, 6): least forces for a wrench, zero for lost axes;
    `groups`: axes of equal priority, highest first, without lost ones; `patterns`: sparse, all that has no wrench.
    """

    def __init__(self, B: Matrix, used: Sequence[int], priority: Sequence[int]) -> None:
        """`B` (6, n) is that of all thrusters; axes of lower priority numbers are served first."""
        mine = B[:, list(used)]
        served = served_axes(mine)
        mine = np.where(np.isin(np.arange(6), served)[:, None], mine, 0.0)
        levels = sorted({priority[axis] for axis in served})
        self.used = tuple(used)
        self.pseudo_inverse: Matrix = np.ascontiguousarray(np.linalg.pinv(mine))
        self.groups = tuple(tuple(axis for axis in served if priority[axis] == level) for level in levels)
        self.patterns = patterns(mine)
        self.lost_axes = tuple(name for index, name in enumerate(AXES) if index not in served)
