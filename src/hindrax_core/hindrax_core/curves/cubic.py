"""Closed-form inverse of a monotone piece of a polynomial of degree three or less.

The work that does not depend on the value is done once, so that one inverse is one or two calls into the C library.
"""

import math
from collections.abc import Callable
from typing import TypeAlias

Coefficients: TypeAlias = tuple[float, float, float, float]
"""c1, c2, c3, c4 of c4 x^3 + c3 x^2 + c2 x + c1, the order of COB-2023-1394 Table 2."""

Inverse: TypeAlias = Callable[[float], float]


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
    """Return the inverse on [low, high], where the polynomial must be strictly monotone.

    A value beyond that of an end gives that end, exactly.
    """
    c1, c2, c3, c4 = c
    if c4 == 0.0:
        solve = _quadratic(c, 0.5 * (low + high)) if c3 else (lambda y: (y - c1) / c2)
        return _clipped(solve, c, low, high)
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
