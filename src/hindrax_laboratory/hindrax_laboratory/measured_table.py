"""A thrust table from sweeps: dead band found in the data, thrust made to rise, and only the knots that are needed."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hindrax_core.errors import HindraxError
from hindrax_core.thrust.table import ThrustTable
from hindrax_ident.arrays import Array, array
from hindrax_laboratory.thruster_sheets import Sheet

ZERO_PART = 1e-3
"""Force about the stop pulse that counts as none, as a part of the largest."""
TOLERANCE_PART, TOLERANCE_N = 0.015, 0.05
"""What leaving out a knot may cost: this part of the force there, and this force."""
DIGITS = 3
BASIC_ESC_us = 25.0
"""Half width of the dead band of a Basic ESC, where a sweep has no pulse without thrust."""
STEP_us = 1.0
"""Of a pulse: from the last one without thrust to the first that pushes, at the least."""


@dataclass(frozen=True, slots=True)
class MeasuredTable:
    """The table, and what it misses of the sweeps."""

    table: ThrustTable
    dead_us: tuple[tuple[float, float], ...]
    """Ends of the dead band at each voltage."""
    residual_N: float
    """Root mean square of measured less tabulated force."""
    samples: int


def quiet(forces_N: Array) -> NDArray[np.bool_]:
    """Which forces of a sweep count as none: (n,), bool."""
    return np.asarray(np.abs(forces_N) <= ZERO_PART * np.max(np.abs(forces_N)))


def measured_table(
    sheets: Sequence[Sheet], stop_us: float = 1500.0, dead_band_us: float | None = None
) -> MeasuredTable:
    """Make a table of sweeps.

    Parameters
    ----------
    sheets
        Sweeps, by rising voltage.
    stop_us
        Pulse at which the thruster stands [us].
    dead_band_us
        Half the width of the dead band [us]; pulses in it are left out. By default out to the last pulse without
        thrust, or that of a Basic ESC.

    Returns
    -------
    MeasuredTable
        Forces that rise with the pulse, with only the knots that are needed.

    Raises
    ------
    HindraxError
        Where a sweep holds no thrust curve.
    """
    rising = [_rising(sheet, stop_us, dead_band_us) for sheet in sheets]
    low, high = max(float(one[0][0]) for one in rising), min(float(one[0][-1]) for one in rising)
    every = np.unique(np.concatenate([pulses for pulses, *_ in rising] + [np.array([stop_us])]))
    every = every[(every >= low) & (every <= high)]
    rows = array(np.array([np.interp(every, pulses, forces) for pulses, forces, _ in rising]))
    needed = {float(every[0]), float(every[-1]), stop_us}
    for _, _, ends in rising:
        inner = np.searchsorted(every, ends)
        needed |= {float(every[at]) for at in (inner[0] - 1, inner[0], inner[1], inner[1] + 1) if 0 <= at < every.size}
    knots = _knots(every, rows, needed)
    table = ThrustTable(
        tuple(map(float, knots)),
        tuple(sheet.supply_V for sheet in sheets),
        tuple(tuple(np.round(np.interp(knots, every, row), DIGITS).tolist()) for row in rows),
    )
    problems = table.problems(stop_us)
    if problems:
        raise HindraxError(f"thrust table: {'; '.join(problems[:3])}; remove outliers, or tare the load cell")
    missed = [
        (sheet.force_N - np.interp(sheet.pulse_us, knots, row))[
            (sheet.pulse_us <= ends[0]) | (sheet.pulse_us >= ends[1])
        ]
        for sheet, row, (*_, ends) in zip(sheets, table.force_N, rising, strict=True)
    ]
    rms_N = float(np.sqrt(np.mean(np.concatenate(missed) ** 2)))
    return MeasuredTable(table, tuple(ends for *_, ends in rising), rms_N, sum(sheet.pulse_us.size for sheet in sheets))


def _rising(sheet: Sheet, stop_us: float, dead_band_us: float | None) -> tuple[Array, Array, tuple[float, float]]:
    """Pulses and forces of a sweep that rise outside the dead band, and its ends."""
    pulses, places = np.unique(sheet.pulse_us, return_inverse=True)
    forces = np.bincount(places, sheet.force_N) / np.bincount(places)
    where = f"thrust table, {sheet.supply_V:g} V"
    if not pulses[0] < stop_us < pulses[-1]:
        raise HindraxError(
            f"{where}: found pulses from {pulses[0]:g} to {pulses[-1]:g} us, wanted both sides of {stop_us:g}"
        )
    still = quiet(forces)
    if dead_band_us is not None:
        still |= np.abs(pulses - stop_us) < dead_band_us
    back = pulses[(pulses < stop_us) & ~still]
    forth = pulses[(pulses > stop_us) & ~still]
    if back.size < 2 or forth.size < 2:
        raise HindraxError(
            f"{where}: found {back.size} and {forth.size} pulses with thrust, wanted two in each direction"
        )
    # Every pulse between the innermost two that push is without thrust.
    idle = pulses[(pulses > back[-1]) & (pulses < forth[0])]
    if dead_band_us is None and idle.size:
        ends = (min(float(idle[0]), stop_us), max(float(idle[-1]), stop_us))
    else:
        half_us = BASIC_ESC_us if dead_band_us is None else dead_band_us
        inner = (float(back[-1]) + STEP_us, float(forth[0]) - STEP_us)
        ends = (min(max(stop_us - half_us, inner[0]), stop_us), max(min(stop_us + half_us, inner[1]), stop_us))
    below, above = pulses <= back[-1], pulses >= forth[0]
    negative = _strict(pulses[below], forces[below], where)
    mirrored = _strict(2.0 * stop_us - pulses[above][::-1], -forces[above][::-1], where)
    at = np.concatenate((negative[0], np.unique((ends[0], stop_us, ends[1])), 2.0 * stop_us - mirrored[0][::-1]))
    values = np.concatenate((negative[1], np.zeros(np.unique((ends[0], stop_us, ends[1])).size), -mirrored[1][::-1]))
    return array(at), array(values), ends


def _strict(pulses: Array, forces: Array, where: str) -> tuple[Array, Array]:
    """Knots of the negative direction, from full thrust to the dead band, whose force rises (isotonic regression).

    Pulses that share a force become one knot: at their middle, or at the one nearest to the dead band where they begin
    or end the direction. The end of full thrust keeps its pulse, and is flat up to that knot.
    """
    from scipy.optimize import isotonic_regression  # noqa: PLC0415  # slow to import

    fit = isotonic_regression(np.minimum(forces, 0.0))
    starts = fit.blocks[:-1]
    values = fit.x[starts]
    middles = np.array([np.mean(pulses[a:b]) for a, b in zip(starts, fit.blocks[1:], strict=True)])
    middles[0], middles[-1] = pulses[fit.blocks[1] - 1], pulses[-1]
    running = values < 0.0
    middles, values = middles[running], values[running]
    if values.size < 2:
        raise HindraxError(
            f"{where}: thrust does not grow with the pulse; change the sign of the force, or remove outliers"
        )
    if middles[0] > pulses[0]:
        middles, values = np.concatenate((pulses[:1], middles)), np.concatenate((values[:1], values))
    return array(middles), array(values)


def _knots(every: Array, rows: Array, needed: set[float]) -> Array:
    """Pulses between which every row is straight within the tolerance: the worst one is added until it is."""
    allowed = TOLERANCE_N + TOLERANCE_PART * np.abs(rows)
    while True:
        knots = np.array(sorted(needed))
        missed = (
            np.array([np.abs(row - np.interp(every, knots, np.interp(knots, every, row))) for row in rows]) / allowed
        )
        worst = int(np.argmax(missed.max(axis=0)))
        if missed[:, worst].max() <= 1.0:
            return array(knots)
        needed.add(float(every[worst]))
