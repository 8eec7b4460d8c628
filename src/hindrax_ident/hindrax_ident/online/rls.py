"""Recursive least squares, numerically stable in long runs: UD factors, directional forgetting, an information gate.

The covariance is kept as P = U D U' (U unit upper triangular, D diagonal) and changed by Bierman's rank-one update
(Bierman 1977, Factorization Methods for Discrete Sequential Estimation, section V.3), so it cannot lose definiteness.
Forgetting acts only in the direction of the sample (Kulhavy and Karny 1984, IFAC World Congress) and only while the
sample adds more information than forgetting removes: the covariance never grows, so there is no wind-up when the
vehicle is parked or repeats one motion. Quantities are in units of the noise: the update assumes unit variance,
`variance` is the ratio of the measured to the assumed variance (COB-2023-1394 eq. 8).
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias, cast

import numpy as np

from hindrax_ident.arrays import Array

Update: TypeAlias = Callable[[Sequence[float], float], float]
Evaluate: TypeAlias = Callable[[Sequence[float], float], tuple[float, float]]
State: TypeAlias = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...], float, float, int]


class Rls:
    """Least squares of y = x . theta + noise, one sample at a time.

    `values` and `sigmas` are the prior mean and its standard deviation, the latter in units of the noise's standard
    deviation. With `forgetting` 1 the result equals batch least squares.
    """

    __slots__ = ("_above", "_read", "evaluate", "n", "update")

    def __init__(self, values: Sequence[float], sigmas: Sequence[float], forgetting: float = 1.0) -> None:
        """`forgetting` is the weight kept per sample, within (0, 1]."""
        if len(values) != len(sigmas) or not values:
            raise ValueError(f"prior has {len(values)} values and {len(sigmas)} sigmas, wanted as many of each")
        if not all(math.isfinite(sigma) and sigma > 0.0 for sigma in sigmas):
            raise ValueError(f"prior sigmas are {tuple(sigmas)}, wanted finite numbers above zero")
        if not 0.0 < forgetting <= 1.0:
            raise ValueError(f"forgetting is {forgetting:g}, wanted above 0 and at most 1")
        self.n = len(values)
        update, evaluate, read = _estimator(self.n)(tuple(values), tuple(s * s for s in sigmas), forgetting)
        self.update: Update = update
        self.evaluate: Evaluate = evaluate
        self._read: Callable[[], State] = read
        self._above = np.triu_indices(self.n, 1)

    @property
    def values(self) -> tuple[float, ...]:
        """Estimates, in the order of the regressor."""
        return self._read()[0]

    @property
    def unit_covariance(self) -> Array:
        """Covariance for noise of variance one: (n, n). COB-2023-1394 eq. 7 without s2."""
        _, upper, diagonal, *_ = self._read()
        U = np.eye(self.n)
        U[self._above] = upper
        return np.asarray((U * diagonal) @ U.T)

    @property
    def variance(self) -> float:
        """Residual variance, sum of squares over degrees of freedom (COB-2023-1394 eq. 8); NaN until there are any."""
        *_, squares, weight, samples = self._read()
        # Forgetting shrinks both the sum and the weight, so the share of the parameters shrinks alike.
        freedom = weight * (1.0 - self.n / samples) if samples > self.n else 0.0
        return squares / freedom if freedom > 0.0 else math.nan

    @property
    def samples(self) -> int:
        """Samples used so far."""
        return self._read()[5]

    @property
    def weight(self) -> float:
        """Sum of the sample weights after forgetting; equals `samples` without forgetting."""
        return self._read()[4]


@functools.cache
def _estimator(n: int) -> Callable[[tuple[float, ...], tuple[float, ...], float], tuple[Update, Evaluate, Any]]:
    """Generate and compile the estimator for n parameters, with every loop unrolled into scalars."""
    scope: dict[str, Any] = {}
    exec(compile(source(n), f"<rls of {n}>", "exec"), scope)  # noqa: S102  # our own text; unrolled it is ten times faster
    return cast("Callable[..., tuple[Update, Evaluate, Any]]", scope["make"])


def source(n: int) -> str:
    """Python source of `make(values, variances, mu)`, which returns the functions update, evaluate and read."""
    names = _Names(n)
    made = [
        *_initial(names),
        *_block("def update(x, y):", _update(names)),
        *_block("def evaluate(x, y):", [*_project(names), "return e, r"]),
        *_block(
            "def read():",
            [f"return ({names.all('t')}), ({names.uppers}), ({names.all('d')}), squares, weight, samples"],
        ),
        "return update, evaluate, read",
    ]
    return "\n".join(_block("def make(values, variances, mu):", made)) + "\n"


class _Names:
    """Names of the scalars: t0.. estimates, d0.. diagonal, u0_1.. upper triangle row by row."""

    def __init__(self, n: int) -> None:
        self.n = n
        self.pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]

    def all(self, letter: str) -> str:
        """`t0, t1, ` and so on: a tuple without its brackets."""
        return "".join(f"{letter}{i}, " for i in range(self.n))

    @property
    def uppers(self) -> str:
        """All of the strict upper triangle, as a tuple without its brackets."""
        return "".join(f"u{i}_{j}, " for i, j in self.pairs)


def _block(head: str, lines: Sequence[str]) -> list[str]:
    return [head, *("    " + line for line in lines)]


def _initial(names: _Names) -> list[str]:
    lines = [f"{names.all('t')}= values", f"{names.all('d')}= variances"]
    lines += [f"u{i}_{j} = 0.0" for i, j in names.pairs]
    return [*lines, "squares = weight = 0.0", "samples = 0", "gate = (1.0 - mu) / mu"]


def _project(names: _Names) -> list[str]:
    """Lines for f = U' x, v = D f, innovation e = y - x . theta, information r = x' P x."""
    n = names.n
    lines = [f"{names.all('x')}= x"]
    lines += [f"f{j} = " + "".join(f"u{i}_{j} * x{i} + " for i in range(j)) + f"x{j}" for j in range(n)]
    lines += [f"v{j} = d{j} * f{j}" for j in range(n)]
    lines.append("e = y - (" + " + ".join(f"t{j} * x{j}" for j in range(n)) + ")")
    lines.append("r = " + " + ".join(f"f{j} * v{j}" for j in range(n)))
    return lines


def _update(names: _Names) -> list[str]:
    """One sample: rejected when not finite; below the gate the estimate changes but not the covariance."""
    state = f"{names.all('t')}{names.uppers}{names.all('d')}squares, weight, samples"
    lines = [f"nonlocal {state}", *_project(names), "if e - e != 0.0 or r - r != 0.0: return e"]
    lines += ["share = e / (1.0 + r)", "squares = mu * squares + e * share"]
    lines += ["weight = mu * weight + 1.0", "samples += 1"]
    lines += [*_block("if r > gate:", _shrink(names)), *_block("else:", _hold(names))]
    lines += [f"t{i} += b{i} * share" for i in range(names.n)]
    return [*lines, "return e"]


def _shrink(names: _Names) -> list[str]:
    """Bierman's update with the noise variance that makes the forgetting directional; leaves P x in b."""
    n = names.n
    lines = ["a = 1.0 if mu == 1.0 else r / (mu * r - 1.0 + mu)"]
    for j in range(n):
        if j:
            lines.append(f"c = -f{j} / a")
        lines += ["was = a", f"a += f{j} * v{j}", f"d{j} *= was / a", f"b{j} = v{j}"]
        for i in range(j):
            lines += [f"old = u{i}_{j}", f"u{i}_{j} = old + b{i} * c", f"b{i} += old * v{j}"]
    return lines


def _hold(names: _Names) -> list[str]:
    n = names.n
    return [f"b{i} = v{i}" + "".join(f" + u{i}_{j} * v{j}" for j in range(i + 1, n)) for i in range(n)]
