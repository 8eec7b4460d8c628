"""Thrust curves of the vehicle file, the check of their validity, and the inverse of a cubic in closed form.

COB-2023-1394 eq. 1: F = c4 P^3 + c3 P^2 + c2 P + c1 with one cubic per direction; or a table (`table.py`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

from hindrax_core.knobs import fact, knob
from hindrax_core.thrust.table import Polyline, ThrustTable

Coefficients: TypeAlias = tuple[float, float, float, float]
"""c1, c2, c3, c4 of c4 x^3 + c3 x^2 + c2 x + c1, the order of COB-2023-1394 Table 2."""

Inverse: TypeAlias = Callable[[float], float]


@dataclass(frozen=True, slots=True)
class Branch:
    """One direction of a thrust curve: F = c4 P^3 + c3 P^2 + c2 P + c1, F in N, P in us. COB-2023-1394 eq. 1."""

    c: tuple[float, float, float, float] = fact(meaning="c1, c2, c3, c4 [N, N/us, N/us^2, N/us^3]")
    from_us: float = fact(500.0, 2500.0, "lower end of validity [us]")
    to_us: float = fact(500.0, 2500.0, "upper end of validity [us]")
    sigma: tuple[float, float, float, float] | None = knob(None, meaning="standard deviations of c, where known")

    def force_N(self, pulse_us: float) -> float:
        """Value of the cubic (Horner); no check of validity."""
        return value(self.c, pulse_us)

    def scaled(self, gain: float) -> "Branch":
        """The branch with every force multiplied by a gain."""
        c1, c2, c3, c4 = self.c
        return replace(self, c=(gain * c1, gain * c2, gain * c3, gain * c4))

    def reflected(self, stop_us: float) -> "Branch":
        """The branch with its pulses reflected about the stop: G(P) = F(2 stop - P), multiplied out."""
        c3, c4 = self.c[2:]
        a = 2.0 * stop_us
        c = (value(self.c, a), -slope(self.c, a), 3.0 * c4 * a + c3, -c4)
        return replace(self, c=c, from_us=a - self.to_us, to_us=a - self.from_us)

    def inverse(self) -> Inverse:
        """Pulse [us] of a force [N] within the branch, exactly; that of the end for a force beyond it."""
        return inverse(self.c, self.from_us, self.to_us)


NO_CUBIC = Branch((0.0, 0.0, 0.0, 0.0), 0.0, 0.0)
"""The branch of a curve that is a table."""


@dataclass(frozen=True, slots=True)
class Curve:
    """Thrust of one kind of thruster against the pulse: cubics at one supply voltage, or a table of one or several.

    Between dead band and branch, thrust rises evenly from nothing at the band to the branch's weakest.

    `positive: null` in the file means the mirror image of the negative branch about the stop pulse: an assumption,
    and marked as one. Thrust is scaled by (V / supply_V) ** supply_exponent; the default is what the published bollard
    data of a comparable thruster show at full command from 10 to 20 V (Blue Robotics T200, 2019: 28.7 to 65.9 N).
    A table is interpolated between its voltages and scaled by that law beyond them; its zeros are the dead band.
    """

    negative: Branch = knob(NO_CUBIC, meaning="negative branch; needed unless there is a table")
    positive: Branch | None = knob(None, meaning="positive branch; null: the mirror image of the negative one")
    stop_us: float = knob(1500.0, 1000.0, 2000.0, "stop pulse, which the output also writes at start and end [us]")
    dead_band_us: float = knob(25.0, 0.0, 200.0, "half width of the band about the stop pulse without thrust [us]")
    supply_V: float = knob(14.8, 5.0, 60.0, "supply voltage at which the curve holds [V]")
    supply_exponent: float = knob(1.2, 0.0, 3.0, "power of the supply voltage with which thrust grows [-]")
    gain_sigma: float = knob(0.02, 0.0, 0.5, "standard deviation of the gain of the whole curve [-]")
    source: str = knob("", meaning="source of the curve")
    table: ThrustTable | None = knob(None, meaning="measured forces in place of cubics, see below")

    def __post_init__(self) -> None:
        """Either cubics or a table, for two answers to one question would be one too many."""
        if (self.table is None) == (self.negative == NO_CUBIC):
            found = "neither" if self.table is None else "both"
            raise ValueError(f"found {found} of negative (a cubic) and table, wanted one of them")
        if self.table is not None and self.positive is not None:
            raise ValueError(
                "found positive (a cubic) beside a table, wanted the table alone: it holds both directions"
            )


@dataclass(frozen=True, slots=True)
class Running:
    """A curve at one supply voltage: both directions where they run, and the ends of the dead band between [us].

    From an end of the dead band to a branch that begins later, thrust rises evenly from nothing.
    """

    negative: Branch | Polyline
    positive: Branch | Polyline
    dead_us: tuple[float, float]

    @property
    def range_N(self) -> tuple[float, float]:
        """Largest force in each direction."""
        return self.negative.force_N(self.negative.from_us), self.positive.force_N(self.positive.to_us)

    def force_N(self, pulse_us: float) -> float:
        """Steady thrust of a pulse: zero within the dead band, that of the end beyond an end."""
        below_us, above_us = self.dead_us
        if below_us < pulse_us < above_us:
            return 0.0
        ahead = pulse_us >= above_us
        branch = self.positive if ahead else self.negative
        if branch.from_us <= pulse_us <= branch.to_us:
            return branch.force_N(pulse_us)
        if not self.negative.from_us <= pulse_us <= self.positive.to_us:
            return branch.force_N(branch.to_us if ahead else branch.from_us)
        edge_us, begin_us = (above_us, branch.from_us) if ahead else (below_us, branch.to_us)
        return branch.force_N(begin_us) * (pulse_us - edge_us) / (begin_us - edge_us)


def running(curve: Curve, supply_V: float | None = None, margin_us: float = 0.0) -> Running:
    """A valid curve as both of its branches run: force [N] over pulse [us].

    Parameters
    ----------
    curve
        As in the vehicle file: polynomials of both directions, or a table. A missing positive polynomial is the mirror
        image of the negative one.
    supply_V : [V]
        Polynomials scale with (supply / that of the curve) ** exponent, a table has rows by voltage; None: as measured.
    margin_us : [us]
        Widens the dead band by as much on both sides.

    Returns
    -------
    Running
        Backward and forward branch, and the pulses between which the thruster stands still.
    """
    if curve.table is not None:
        volts = curve.table.supply_V[0] if supply_V is None else supply_V
        back, forth, (below, above) = curve.table.at(volts, curve.stop_us, curve.supply_exponent)
        below, above = below - margin_us, above + margin_us
        if margin_us:
            back, forth = back.cut(back.from_us, below), forth.cut(above, forth.to_us)
        return Running(back, forth, (below, above))
    # One factor for all pulses: what is monotone stays so, and an inverse for one voltage serves all.
    gain = 1.0 if supply_V is None else float((supply_V / curve.supply_V) ** curve.supply_exponent)
    half_us = curve.dead_band_us + margin_us
    below, above = curve.stop_us - half_us, curve.stop_us + half_us
    negative = curve.negative
    positive = curve.positive or negative.reflected(curve.stop_us).scaled(-1.0)
    return Running(
        replace(negative, to_us=min(negative.to_us, below)).scaled(gain),
        replace(positive, from_us=max(positive.from_us, above)).scaled(gain),
        (below, above),
    )


def problems_of(curve: Curve) -> list[str]:
    """Reasons why a curve is not a valid thrust curve, one sentence each; empty when it is valid."""
    if curve.table is not None:
        return curve.table.problems(curve.stop_us)
    cubics = running(curve)
    sides = (("negative", cubics.negative, -1.0), ("positive", cubics.positive, 1.0))
    return [
        f"{name} branch {text}"
        for name, branch, sign in sides
        if isinstance(branch, Branch)
        for text in _branch_problems(branch, sign)
    ]


def _branch_problems(branch: Branch, sign: float) -> list[str]:
    if not all(math.isfinite(number) for number in (*branch.c, branch.from_us, branch.to_us)):
        return [f"has coefficients {branch.c}, wanted finite numbers"]
    if branch.from_us >= branch.to_us:
        return [f"runs from {branch.from_us:g} to {branch.to_us:g} us outside the dead band, wanted a rising range"]
    wanted = "positive" if sign > 0.0 else "negative"
    ends = ((pulse_us, branch.force_N(pulse_us)) for pulse_us in (branch.from_us, branch.to_us))
    wrong = [f"gives {force:.4g} N at {at:g} us, wanted a {wanted} force" for at, force in ends if force * sign < 0.0]
    low, high = branch.from_us, branch.to_us
    # A branch that turns has two pulses for one force: allocation could not be inverted.
    turns = [f"{point:.1f}" for point in stationary_points(branch.c) if low < point < high]
    if turns:
        return [f"is not monotone: it turns at {' and '.join(turns)} us, within {low:g} to {high:g} us", *wrong]
    if branch.force_N(low) >= branch.force_N(high):
        return [f"does not rise from {low:g} to {high:g} us, wanted thrust that grows with the pulse", *wrong]
    return wrong


def value(c: Coefficients, x: float) -> float:
    """c4 x^3 + c3 x^2 + c2 x + c1."""
    c1, c2, c3, c4 = c
    return ((c4 * x + c3) * x + c2) * x + c1


def slope(c: Coefficients, x: float) -> float:
    """Return the derivative 3 c4 x^2 + 2 c3 x + c2."""
    return (3.0 * c[3] * x + 2.0 * c[2]) * x + c[1]


def stationary_points(c: Coefficients) -> tuple[float, ...]:
    """Real roots of the derivative, ascending."""
    b, half, third = c[1], c[2], 3.0 * c[3]
    if third == 0.0:
        return () if half == 0.0 else (-b / (2.0 * half),)
    discriminant = half * half - third * b
    if discriminant < 0.0:
        return ()
    # The sum that does not cancel gives one root, the product of the roots gives the other.
    larger = -(half + math.copysign(math.sqrt(discriminant), half))
    roots = (larger / third, b / larger if larger else 0.0)
    return (min(roots), max(roots))


def inverse(c: Coefficients, low: float, high: float) -> Inverse:
    """Return the inverse of a polynomial on an interval where it is strictly monotone.

    The work that does not depend on the value is done once, so that one inverse is one or two calls into the C library.
    Which root of a cubic is meant depends on the interval alone: between both turning points (by sines), beyond them
    (by cosines), or anywhere where there are none (by hyperbolic sines).

    Parameters
    ----------
    c
        Coefficients of 1, x, x^2 and x^3.
    low, high
        Ends of the interval, in the unit of x.

    Returns
    -------
    Inverse
        From y to x. A value beyond that of an end gives that end, exactly.
    """
    c1, c2, c3, c4 = c
    if c4 == 0.0:
        solve = _quadratic(c, 0.5 * (low + high)) if c3 else (lambda y: (y - c1) / c2)
        return _clipped(solve, c, low, high)
    # Cardano and Viete: without the square, one trigonometric or hyperbolic identity gives the root.
    shift = -c3 / (3.0 * c4)
    # x = shift + t turns the cubic into t^3 + p t + q; only q depends on the value.
    p = c2 / c4 - 3.0 * shift * shift
    if p < 0.0 and abs(0.5 * (low + high) - shift) < math.sqrt(-p / 3.0):
        return _between(c, low, high, shift, p)
    q0 = value(c, shift) / c4
    if p == 0.0:
        return _clipped(lambda y: shift - math.cbrt(q0 - y / c4), c, low, high)
    if p > 0.0:
        return _clipped(_rising(shift, p, q0, c4), c, low, high)
    return _clipped(_outside(shift, p, q0, c4, 0.5 * (low + high)), c, low, high)


def _clipped(solve: Inverse, c: Coefficients, low: float, high: float) -> Inverse:
    ends = ((value(c, low), low), (value(c, high), high))
    (least, at_least), (most, at_most) = min(ends), max(ends)

    def clipped(y: float) -> float:
        if y <= least:
            return at_least
        return at_most if y >= most else solve(y)

    return clipped


def _quadratic(c: Coefficients, inside: float) -> Inverse:
    """Root of a quadratic on the side of its vertex where `inside` lies: y = turning + c3 (x - vertex)^2."""
    c1, c2, c3, _ = c
    vertex = -c2 / (2.0 * c3)
    side = math.copysign(1.0, inside - vertex)
    turning = c1 - c3 * vertex * vertex
    return lambda y: vertex + side * math.sqrt(max(0.0, (y - turning) / c3))


def _rising(shift: float, p: float, q0: float, c4: float) -> Inverse:
    """No stationary point: t = m sinh(asinh(-4 q / m^3) / 3)."""
    m = 2.0 * math.sqrt(p / 3.0)
    offset, scale = -4.0 * q0 / m**3, 4.0 / (m**3 * c4)
    return lambda y: shift + m * math.sinh(math.asinh(offset + scale * y) / 3.0)


def _between(c: Coefficients, low: float, high: float, shift: float, p: float) -> Inverse:
    """Between two stationary points, the usual case of a thrust curve: x = shift + m sin(asin(offset + scale y) / 3).

    It follows from sin 3a = 3 sin a - 4 sin^3 a. Sines that are not between (least, most) belong to values beyond the
    ends, whose x is `at_least` or `at_most`.
    """
    m = 2.0 * math.sqrt(-p / 3.0)
    offset, scale = 4.0 * value(c, shift) / (c[3] * m**3), -4.0 / (m**3 * c[3])
    ends = ((offset + scale * value(c, low), low), (offset + scale * value(c, high), high))
    (least, at_least), (most, at_most) = min(ends), max(ends)
    asin, sin, third = math.asin, math.sin, 1.0 / 3.0

    def solve(y: float) -> float:
        sine = offset + scale * y
        if least < sine < most:
            return shift + m * sin(asin(sine) * third)
        return at_least if sine <= least else at_most

    return solve


def _outside(shift: float, p: float, q0: float, c4: float, inside: float) -> Inverse:
    """Beyond both stationary points, on the side where `inside` lies: three real roots or one."""
    m = 2.0 * math.sqrt(-p / 3.0)
    side = math.copysign(1.0, inside - shift)
    offset, scale = -4.0 * q0 * side / m**3, 4.0 * side / (m**3 * c4)

    def solve(y: float) -> float:
        cosine = max(-1.0, offset + scale * y)
        if cosine <= 1.0:
            return shift + side * m * math.cos(math.acos(cosine) / 3.0)
        return shift + side * m * math.cosh(math.acosh(cosine) / 3.0)

    return solve
