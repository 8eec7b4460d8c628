"""Which of the values of a table were measured, where those between them were interpolated along straight lines.

Tables of one time base are made so: a Doppler log of 2 Hz becomes velocities of 20 Hz, nine of ten on a line between
two. A fit takes each for a measurement, and a line for the motion. Noise puts no value on the line of its neighbors, to
the last digit; a motion without noise does, where the samples are dense, but then the lines bend.
"""

import numpy as np

from hindrax_ident.arrays import Array, Flags, stretches_of

MOST_DIGITS = 9
"""Decimals that are looked at; a table with more is as good as exact."""
FEWEST_KNOTS, LEAST_SHARE = 10, 0.35
"""Fewest values between lines, and least share of the others that lie on one: every second one, less some bends."""
SHARP = 4.0
"""Least bend between lines, the median, in what rounding makes of a straight one."""
LINEAR = 0.8
"""Least share of the values of lines that are on the chord."""


def measured_rows(t: Array, v: Array) -> Flags | None:
    """Rows whose values were measured.

    Parameters
    ----------
    t : (n,) [s]
        Increasing.
    v : (n,)
        Finite values in any unit.

    Returns
    -------
    Flags | None
        (n,); None where nothing was interpolated.
    """
    if len(t) <= 2 * FEWEST_KNOTS or not np.all(np.diff(t) > 0.0):
        return None
    rounding = 1.01 * 10.0 ** -_decimals(v)
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    off = np.abs(v[1:-1] - v[:-2] - share * (v[2:] - v[:-2]))
    flat = (np.diff(v)[1:] == 0.0) & (np.diff(v)[:-1] == 0.0)
    bends = off > rounding + np.abs(v[2:] - v[:-2]) / (t[2:] - t[:-2]) * _unevenness(t)
    moving = bends | ~flat
    straight = ~bends & ~flat
    if bends.sum() < FEWEST_KNOTS or straight.sum() < LEAST_SHARE * moving.sum():
        return None
    if float(np.median(off[bends])) < SHARP * rounding:
        return None
    on_line = [_on_chord(t[one], v[one], 2.0 * rounding) for one in _lines(straight)]
    return _knots(off, bends, len(v)) if np.mean(np.concatenate(on_line)) >= LINEAR else None


def _lines(straight: Flags) -> list[slice]:
    """Rows of each line: those that are straight, (n - 2,), with one at either end."""
    return [slice(one.start, one.stop + 2) for one in stretches_of(straight)]


def _on_chord(t: Array, v: Array, most: float) -> Flags:
    """Which values (n,) are on the line between the first and the last."""
    return np.asarray(np.abs(v - np.interp(t, t[[0, -1]], v[[0, -1]])) <= most)


def _decimals(v: Array) -> int:
    """Decimals of values (n,), as they were written."""
    for digits in range(MOST_DIGITS):
        if np.allclose(v, np.round(v, digits), rtol=0.0, atol=1e-12):
            return digits
    return MOST_DIGITS


def _unevenness(t: Array) -> float:
    """Error of times (n,) [s] that are rounded; 0 where they are even."""
    steps = np.diff(t)
    return 0.0 if float(np.ptp(steps)) < 1e-9 + 1e-6 * float(np.median(steps)) else 10.0 ** -_decimals(t)


def _knots(off: Array, bends: Flags, count: int) -> Flags:
    """Of the bends (n - 2,) next to each other the sharpest, and both ends: (n,)."""
    out = np.zeros(count, dtype=bool)
    out[[0, -1]] = True
    for one in stretches_of(bends):
        # A bend between two rows shows in both, more so in the nearer one; more in a row are measurements.
        pair = one.stop - one.start == 2
        out[1 + one.start + int(np.argmax(off[one])) if pair else slice(1 + one.start, 1 + one.stop)] = True
    return out
