"""Significant digits of a number, by its standard deviation or by the limit that it exceeds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

TWO_SIDED_95 = 1.96
"""Standard deviations on each side of a 95 % band."""
PLUS_MINUS = "+-: half of the 68 % interval"
"""Meaning of +- wherever a number has it: of a symmetric distribution, one standard deviation. The ends of a 95 %
interval are written out."""
IN_FLIGHT = f"{PLUS_MINUS}, from the noise so far; the result adds calibration, water and tether"
LAST_PLACE = -5
"""Power of ten of the last digit of a number that is written without one."""


@dataclass(frozen=True, slots=True)
class Value:
    """A number and its standard deviation, in the same unit."""

    value: float
    std: float

    def __format__(self, spec: str) -> str:
        """Both numbers in the given format: `f"{mass:.3f}"` is '12.080 +- 0.120'."""
        return f"{self.value:{spec}} +- {self.std:{spec}}"


def measured(value: float, std: float) -> str:
    """A value with the digits that its standard deviation, rounded to two, leaves it: 2.338 +- 0.047."""
    return " +- ".join(rounded(value, std))


def rounded(value: float, std: float) -> tuple[str, str]:
    """The same as two texts; a deviation below 0.0001 and its value have powers of ten."""
    if not (math.isfinite(value) and math.isfinite(std) and std > 0.0):
        return f"{value:.4g}", f"{std:.2g}"
    place = last_place(std, 2)
    if place < LAST_PLACE and value:
        digits = max(0, math.floor(math.log10(abs(value))) - place)
        return f"{value:.{digits}e}", f"{std:.1e}"
    return f"{value:.{max(0, -place)}f}", f"{std:.{max(0, -place)}f}"


def last_place(number: float, digits: int) -> int:
    """Power of ten of the last digit of a number above zero that is rounded to so many: -3 for 0.0471 and two."""
    return math.floor(math.log10(float(f"{number:.{digits - 1}e}"))) - digits + 1


def unlike(found: float, limit: float, places: int) -> tuple[str, str]:
    """Print two numbers so that a reader sees which is larger.

    Parameters
    ----------
    found, limit
        The numbers, in one unit.
    places
        Decimal places; up to three more where the two would look alike.

    Returns
    -------
    tuple[str, str]
        Both, with equally many places.
    """
    pairs = [(f"{found:z.{digits}f}", f"{limit:z.{digits}f}") for digits in range(places, places + 4)]
    return next((pair for pair in pairs if pair[0] != pair[1]), pairs[0])


def above(words: str, found: float, most: float, places: int) -> str:
    """Say that a number is above its limit.

    Parameters
    ----------
    words
        Two places for the numbers: "{} m deep, wanted at most {} m".
    found, most
        Number and limit, in one unit.
    places
        Decimal places, as in `unlike`.

    Returns
    -------
    str
        The words with both numbers; empty where `found` is not above `most`, or not a number.
    """
    return words.format(*unlike(found, most, places)) if found > most else ""


def below(words: str, found: float, least: float, places: int) -> str:
    """Say that a number is below its limit.

    Parameters
    ----------
    words
        Two places for the numbers: "{} V, wanted at least {} V".
    found, least
        Number and limit, in one unit.
    places
        Decimal places, as in `unlike`.

    Returns
    -------
    str
        The words with both numbers; empty where `found` is not below `least`, or not a number.
    """
    return words.format(*unlike(found, least, places)) if found < least else ""


def stretches_told(begins_s: Sequence[float]) -> str:
    """Say how many stretches of a record there are, and where the first is.

    Parameters
    ----------
    begins_s : (n,) [s]
        When each begins, in order; one at least.

    Returns
    -------
    str
        Without what they are.
    """
    many = f"{len(begins_s)} stretches, the first" if len(begins_s) > 1 else "one stretch,"
    return f"{many} after {begins_s[0]:.4g} s"
