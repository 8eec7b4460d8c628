"""Thrusters that do not push as the vehicle file has it: turned round, exchanged, or without force.

A wrong direction gives forces that nobody applied, and coefficients that look like any others. The motion knows it:
with the right wrench the thrust explains how the velocities change, with a wrong one it does not.

Notation: f (n, k) forces of the thrusters, B (6, k) wrench per newton, so that row a of B f is the thrust on axis a; L
is a first-order lag T. The equation of an axis, m dv/dt = B_a f - k_l v - k_q |v| v + c, has no derivative of a
measurement behind the lag: m (v - L v) / T = L B_a f - k_l L v - k_q L |v| v + c (the filtered regression of Slotine
and Li 1991, section 8.7). Righting adds L sin(angle) in roll and pitch, and the masses of other axes add L of products
of velocities. With all terms but the thrust projected out, y (n,) is left of the left side, and F (n, k) of L f. The
share of y that the thrust explains is the squared correlation of y and F B_a, and none where they are opposite. It
needs y'y, F'y and F'F alone, once per axis; so a hundred ways to wire the thrusters cost no more than one.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from hindrax_analysis.records.recording import Recording
from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_core.vehicle import AXES, Thruster, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.objections import Code, Objection, objection
from hindrax_ident.model.motion_model import rigid_mass
from hindrax_ident.model.thrust_lag import LaggedThrust

FILTER_S, DELAY_S = 0.7, 0.1
"""Lag T of the regression, and usual delay of a motion behind its command."""
FEWEST_SAMPLES = 50
COUPLED = (((1, 5), (2, 4)), ((0, 5), (2, 3)), ((0, 4), (1, 3)), ((4, 5), (1, 2)), ((3, 5), (0, 2)), ((3, 4), (0, 1)))
"""By axis: the pairs of velocities whose product is a Coriolis force or a Munk moment on it (Fossen 2011 eq. 6.43)."""
LEAST_GAIN, LEAST_EXPLAINED = 1.0, 0.5
"""By how much the logarithm of what is unexplained, summed over the axes, must fall for one change, and the share that
the thrust then explains at least. Of 24 records of three vehicles in MuJoCo's fluid, no change to the true wiring gains
more than 0.01. Of the same records with a wrong file, one thruster turned round is named in 174 of 192, two in all 672,
two exchanged ones in 574 of 672 (uprights of whirls hardly turn the vehicle), and no other one ever."""
MASSES = (0.3, 10.0)
"""Range of the total mass, in that of the body alone. Without it, a PX4 log of surge whose sway is an echo of 1 % was
explained by two thrusters turned round (`test_identify_logs.py`)."""
ALIKE = 0.3
"""Changes whose gains differ by less cannot be told apart."""
LEAST_CHANGE = 0.1
"""Of the wrench on an axis per newton, in its largest."""
MOST_CHANGES, MOST_ALIKE = 3, 3
"""So many changes are searched one after the other; and no more alike are named."""


@dataclass(frozen=True, slots=True)
class _Change:
    """One change of the wiring: what is wrong in words, the remedy, the thrusters it is about."""

    what: str
    remedy: str
    thrusters: tuple[int, ...]
    B: Array
    """(6, k), with the change."""


@dataclass(frozen=True, slots=True)
class _Moments:
    """Of one axis: y'y, F'y (k,) and F'F (k, k), with all other terms projected out, and the mass of the body alone."""

    mass: float
    yy: float
    Fy: Array
    FF: Array

    def explained(self, row: Array) -> float:
        """Share of y that the thrust of a row (k,) of B explains [-]; nothing by a mass that no vehicle has."""
        along, size = float(self.Fy @ row), float(row @ self.FF @ row)
        # The slope of y against the thrust is one over the total mass: it is huge where an axis echoes another one.
        if not (along > 0.0 and MASSES[0] < size / along / self.mass < MASSES[1]):
            return 0.0
        return along**2 / (size * self.yy)


def wrong_thrusters(recordings: Sequence[Recording], vehicle: Vehicle) -> Mapping[int, Objection]:
    """Objections to the axes whose thrust is another than the vehicle file makes of the forces.

    Parameters
    ----------
    recordings
        Those without forces of single thrusters say nothing.
    vehicle
        By whose file they were read.

    Returns
    -------
    Mapping[int, Objection]
        By axis; empty where the thrusters push as they should, or the record cannot tell.
    """
    usable = [one for one in recordings if one.forces.shape[1:] == (len(vehicle.thrusters),) and len(one.forces)]
    found = {axis: moments for axis in range(6) if (moments := _moments(usable, vehicle, axis))}
    if not found:
        return {}
    as_told = array(np.array(effectiveness(vehicle)))
    B = as_told
    whats: list[str] = []
    remedies: list[str] = []
    size, changed = np.abs(as_told).max(axis=1), np.zeros(6, dtype=bool)
    while len(whats) < MOST_CHANGES:
        gains = _simplest([(_unexplained(found, B) - _unexplained(found, one.B), one) for one in _changes(B, vehicle)])
        best, change = max(gains, key=itemgetter(0))
        alike = [one for gain, one in gains if gain > best - ALIKE]
        if best < LEAST_GAIN or len(alike) > MOST_ALIKE:
            break
        whats.append(" or ".join(one.what for one in alike))
        remedies.append(" or ".join(one.remedy for one in alike))
        changed |= np.any([np.abs(one.B - B).max(axis=1) > LEAST_CHANGE * size for one in alike], axis=0)
        B = change.B
    shares = {axis: (one.explained(as_told[axis]), one.explained(B[axis])) for axis, one in found.items()}
    shown = max(shares, key=lambda axis: shares[axis][1] - shares[axis][0])
    if not whats or shares[shown][1] < LEAST_EXPLAINED:
        return {}
    before, after = shares[shown]
    about = objection(
        Code.WRONG_THRUSTERS, what=", ".join(whats), axis=AXES[shown], before=before, after=after,
        remedy=" and ".join(remedies),
    )  # fmt: skip
    return {axis: about for axis in range(6) if changed[axis]}


def _simplest(gains: Sequence[tuple[float, _Change]]) -> list[tuple[float, _Change]]:
    """Changes without those of two thrusters that gain no more than one of the two: the other hardly pushed."""
    alone: dict[int, float] = {}
    for gain, one in gains:
        if len(one.thrusters) == 1:
            (i,) = one.thrusters
            alone[i] = max(gain, alone.get(i, 0.0))
    return [
        (gain, one)
        for gain, one in gains
        if len(one.thrusters) == 1 or gain > ALIKE + max(alone[i] for i in one.thrusters)
    ]


def _changes(B: Array, vehicle: Vehicle) -> Iterator[_Change]:
    """All changes of one thruster, and of two."""
    thrusters = vehicle.thrusters
    for i, one in enumerate(thrusters):
        still = B.copy()
        still[:, i] = 0.0
        yield _turned(B, thrusters, (i,))
        remedy = f"look at propeller and cable of {one.name}, record again"
        yield _Change(f"{one.name} does not push", remedy, (i,), still)
    for i, j in itertools.combinations(range(len(thrusters)), 2):
        exchanged = B.copy()
        exchanged[:, [i, j]] = B[:, [j, i]]
        yield _turned(B, thrusters, (i, j))
        if not np.allclose(exchanged, B):
            both = f"{thrusters[i].name} and {thrusters[j].name}"
            remedy = f"exchange `channel` of {both} in the vehicle file"
            yield _Change(f"{both} are exchanged", remedy, (i, j), exchanged)


def _turned(B: Array, thrusters: Sequence[Thruster], which: tuple[int, ...]) -> _Change:
    turned = B.copy()
    turned[:, list(which)] *= -1.0
    names = " and ".join(thrusters[i].name for i in which)
    keys = " and ".join(f"`reversed: {str(not thrusters[i].reversed).lower()}` of {thrusters[i].name}" for i in which)
    remedy = f"set {keys} in the vehicle file (of recorded forces, turn directions round)"
    return _Change(f"{names} {'pushes' if len(which) == 1 else 'push'} the other way", remedy, which, turned)


def _unexplained(found: Mapping[int, _Moments], B: Array) -> float:
    """Logarithm of the product of the shares that the thrust leaves unexplained."""
    return sum(math.log(max(1e-3, 1.0 - one.explained(B[axis]))) for axis, one in found.items())


def _moments(recordings: Sequence[Recording], vehicle: Vehicle, axis: int) -> _Moments | None:
    """Moments of an axis over all records; None where it was not measured, or hardly."""
    rows = [row for one in recordings if (row := _rows(one, axis)) is not None]
    if not rows or sum(len(row) for row in rows) < FEWEST_SAMPLES:
        return None
    found = np.concatenate(rows)
    k = recordings[0].forces.shape[1]
    y, F, Z = found[:, 0], found[:, 1 : 1 + k], found[:, 1 + k :]
    Q, _ = np.linalg.qr(Z[:, Z.any(axis=0)])
    y, F = y - Q @ (Q.T @ y), F - Q @ (Q.T @ F)
    return _Moments(rigid_mass(vehicle, axis), float(y @ y), array(y @ F), array(F.T @ F))


def _rows(recording: Recording, axis: int) -> Array | None:
    """Rows (n, 1 + k + terms) of the filtered regression: left side, forces, other terms; None without them."""
    moved = np.isfinite(recording.velocity[:, axis])
    if not moved.any():
        return None
    t, v = recording.velocity_t[moved], recording.velocity[moved, axis]

    def lagged(times: Array, values: Array, delay_s: float = 0.0) -> Array:
        """Values (n,) behind the lag at the times of the velocities."""
        return LaggedThrust(times, values, FILTER_S).force(array(t - delay_s))

    smooth = lagged(t, v)
    terms = [np.ones_like(t), smooth, lagged(t, array(np.abs(v) * v))]
    if axis in (3, 4):
        angle = recording.attitude[:, axis - 3]
        known = np.isfinite(angle)
        if not known.any():
            return None
        terms.append(lagged(recording.attitude_t[known], array(np.sin(angle[known]))))
    for pair in COUPLED[axis]:
        others = [np.isfinite(recording.velocity[:, other]) for other in pair]
        across = np.ones(len(t)) if all(one.any() for one in others) else np.zeros(len(t))
        for one, other in zip(others, pair, strict=True) if across.any() else ():
            across *= np.interp(t, recording.velocity_t[one], recording.velocity[one, other])
        terms.append(lagged(t, array(across)))
    forces = [lagged(recording.wrench_t, array(one), DELAY_S) for one in recording.forces.T]
    return array(np.column_stack([(v - smooth) / FILTER_S, *forces, *terms]))
