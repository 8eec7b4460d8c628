"""Recursive least squares, numerically stable in long runs: UD factors, directional forgetting, an information gate.

The covariance is kept as P = U D U' (U unit upper triangular, D diagonal) and changed by Bierman's rank-one update
(Bierman 1977, Factorization Methods for Discrete Sequential Estimation, section V.3), so it cannot lose definiteness.
Forgetting acts only in the direction of the sample (Kulhavy and Karny 1984, IFAC World Congress) and only while the
sample adds more information than forgetting removes: the covariance never grows, so there is no wind-up when the
vehicle is parked or repeats one motion. Quantities are in units of the noise: the update assumes unit variance,
`variance` is the ratio of the measured to the assumed variance (COB-2023-1394 eq. 8).

Symbols. theta (n,) estimates, x (n,) regressor, y response, mu the forgetting factor, e = y - x . theta innovation,
P = U D U'. With f = U' x and v = D f, the information of the sample is r = x' P x = f . v, and P x = U v. Usual least
squares would change P to P - P x x' P / (1 + r); the estimate moves by P x e / (1 + r).

Directional forgetting divides only the part of P along the sample: it is the usual update with the noise variance

    a = r / (mu r - 1 + mu)    instead of 1,    which is positive as long as r > (1 - mu) / mu

and that bound is the gate: below it, the sample tells less than forgetting takes, and P would grow. Exponential
forgetting was left because P of the directions that are not excited grows by 1 / mu at each sample, without end.
"""

import functools
import math
from collections.abc import Callable, Sequence
from typing import TypeAlias, cast

import numpy as np

from hindrax_ident.arrays import Array, Index, array

State: TypeAlias = tuple[float, ...]
"""Estimates, rows of the strict upper triangle of U, diagonal of D, weighted squares of the residuals, weight."""
Update: TypeAlias = Callable[[State, Sequence[float], float, float], tuple[State, float]]
Evaluate: TypeAlias = Callable[[State, Sequence[float], float], tuple[float, float]]


class Rls:
    """Least squares of y = x . theta + noise, one sample at a time.

    `values` and `sigmas` are the prior mean and its standard deviation, the latter in units of the noise's standard
    deviation. With `forgetting` 1 the result equals batch least squares.

    `n`: number of parameters; `samples` used so far.
    """

    __slots__ = ("_evaluate", "_forgetting", "_state", "_update", "n", "samples")

    def __init__(self, values: Sequence[float], sigmas: Sequence[float], forgetting: float = 1.0) -> None:
        """`forgetting` is the weight kept per sample, within (0, 1]."""
        if len(values) != len(sigmas) or not values:
            raise ValueError(f"prior has {len(values)} values and {len(sigmas)} sigmas, wanted as many of each")
        if not all(math.isfinite(sigma) and sigma > 0.0 for sigma in sigmas):
            raise ValueError(f"prior sigmas are {tuple(sigmas)}, wanted finite numbers above zero")
        if not 0.0 < forgetting <= 1.0:
            raise ValueError(f"forgetting is {forgetting:g}, wanted above 0 and at most 1")
        self.n, self.samples, self._forgetting = len(values), 0, forgetting
        self._state: State = (*values, *[0.0] * (self.n * (self.n - 1) // 2), *(s * s for s in sigmas), 0.0, 0.0)
        self._update, self._evaluate = _unrolled(self.n)

    def update(self, x: Sequence[float], y: float) -> float:
        """Learn from a sample unless it is not finite.

        Below the gate of information the estimate changes but not the covariance.

        Parameters
        ----------
        x : (n,)
            Regressor.
        y
            Response.

        Returns
        -------
        float
            The innovation y - x . theta, before learning.
        """
        state, innovation = self._update(self._state, x, y, self._forgetting)
        if state is not self._state:
            self._state = state
            self.samples += 1
        return innovation

    def evaluate(self, x: Sequence[float], y: float) -> tuple[float, float]:
        """Innovation y - x . theta and information x' P x of a sample, without learning from it."""
        return self._evaluate(self._state, x, y)

    @property
    def values(self) -> tuple[float, ...]:
        """Estimates, in the order of the regressor."""
        return self._state[: self.n]

    @property
    def unit_covariance(self) -> Array:
        """Covariance for noise of variance one: (n, n). COB-2023-1394 eq. 7 without s2."""
        U = np.eye(self.n)
        U[_above_diagonal(self.n)] = self._state[self.n : -self.n - 2]
        return np.asarray((U * self._state[-self.n - 2 : -2]) @ U.T)

    @property
    def variance(self) -> float:
        """Residual variance, sum of squares over degrees of freedom (COB-2023-1394 eq. 8); NaN until there are any."""
        return _variance(self._state[-2], self)

    @property
    def weight(self) -> float:
        """Sum of the sample weights after forgetting; equals `samples` without forgetting."""
        return self._state[-1]


class WideRls:
    """The same for many parameters, by numpy: a line of text per element takes four times as long at n = 28.

    The covariance is kept as P = S S' (Potter 1963; Bierman 1977 section II.7), changed by one column times one row:
    with f = S' x and the noise variance a, S becomes S - S f f' / (b + sqrt(a b)), b = a + f' f.
    """

    __slots__ = ("_S", "_forgetting", "_squares", "_values", "n", "samples", "weight")

    def __init__(self, values: Sequence[float], sigmas: Sequence[float], forgetting: float = 1.0) -> None:
        """As of `Rls`."""
        self.n, self.samples, self._forgetting = len(values), 0, forgetting
        self._values, self._S = array(np.array(values)), array(np.diag(np.array(sigmas)))
        self._squares = self.weight = 0.0

    def evaluate(self, x: Sequence[float], y: float) -> tuple[float, float]:
        """Innovation y - x . theta and information x' P x of a sample, without learning from it."""
        row = np.array(x)
        f = row @ self._S
        return float(y - row @ self._values), float(f @ f)

    def update(self, x: Sequence[float], y: float) -> float:
        """As of `Rls`: learn from a sample unless it is not finite; the innovation before."""
        row, mu = np.array(x), self._forgetting
        f = row @ self._S
        innovation, r = float(y - row @ self._values), float(f @ f)
        if not (math.isfinite(innovation) and math.isfinite(r)):
            return innovation
        share, along = innovation / (1.0 + r), self._S @ f
        self._squares, self.weight = mu * self._squares + innovation * share, mu * self.weight + 1.0
        if r > (1.0 - mu) / mu:
            a = 1.0 if mu == 1.0 else r / (mu * r - 1.0 + mu)
            self._S = self._S - np.outer(along, f / (a + r + math.sqrt(a * (a + r))))
        self._values = self._values + along * share
        self.samples += 1
        return innovation

    @property
    def values(self) -> tuple[float, ...]:
        """Estimates, in the order of the regressor."""
        return tuple(self._values.tolist())

    @property
    def unit_covariance(self) -> Array:
        """Covariance for noise of variance one: (n, n)."""
        return array(self._S @ self._S.T)

    @property
    def variance(self) -> float:
        """As of `Rls`."""
        return _variance(self._squares, self)


def _variance(squares: float, of: Rls | WideRls) -> float:
    """Weighted squares of the residuals over degrees of freedom; NaN until there are any."""
    # Forgetting shrinks both the sum and the weight, so the share of the parameters shrinks alike.
    freedom = of.weight * (1.0 - of.n / of.samples) if of.samples > of.n else 0.0
    return squares / freedom if freedom > 0.0 else math.nan


@functools.cache
def _above_diagonal(n: int) -> tuple[Index, Index]:
    """Rows and columns of the strict upper triangle, (n (n - 1) / 2,) each; numpy takes longer for them than for P."""
    rows, columns = np.triu_indices(n, 1)
    return rows, columns


@functools.cache
def _unrolled(n: int) -> tuple[Update, Evaluate]:
    """Update and evaluation for n parameters, generated with every loop unrolled: five times faster than loops.

    numpy spends on the start of one product of this size what the whole update takes, about a microsecond; a compiled
    extension would have to be built for each machine. The text
    that is executed is made of the number n alone, never of data: `_project` and `_update` below write one line per
    element, in the names t (theta), u (U above its diagonal), d (D), x, f, v, b (P x) of the formulas above.
    """
    names = [*(f"t{i}" for i in range(n)), *(f"u{i}_{j}" for i in range(n) for j in range(i + 1, n))]
    state = ", ".join([*names, *(f"d{i}" for i in range(n)), "squares, weight"])
    project, update = [f"{state} = state", *_project(n)], _update(n)
    text = [
        *_block("def evaluate(state, x, y):", [*project, "return e, r"]),
        *_block("def update(state, x, y, mu):", [*project, *update, f"return ({state}), e"]),
    ]
    scope: dict[str, object] = {}
    exec(compile("\n".join(text), f"<rls of {n}>", "exec"), scope)  # noqa: S102  # our own text
    return cast("tuple[Update, Evaluate]", (scope["update"], scope["evaluate"]))


def _block(head: str, lines: Sequence[str]) -> list[str]:
    return [head, *("    " + line for line in lines)]


def _project(n: int) -> list[str]:
    """Lines for f = U' x, v = D f, innovation e = y - x . theta, information r = x' P x."""
    lines = ["".join(f"x{i}, " for i in range(n)) + "= x"]
    lines += [f"f{j} = " + "".join(f"u{i}_{j} * x{i} + " for i in range(j)) + f"x{j}" for j in range(n)]
    lines += [f"v{j} = d{j} * f{j}" for j in range(n)]
    lines.append("e = y - (" + " + ".join(f"t{j} * x{j}" for j in range(n)) + ")")
    lines.append("r = " + " + ".join(f"f{j} * v{j}" for j in range(n)))
    return lines


def _update(n: int) -> list[str]:
    """Lines for one sample: rejected when not finite; below the gate the estimate changes but not the covariance."""
    lines = ["if e - e != 0.0 or r - r != 0.0: return state, e"]
    lines += ["share = e / (1.0 + r)", "squares = mu * squares + e * share", "weight = mu * weight + 1.0"]
    lines += [*_block("if r > (1.0 - mu) / mu:", _shrink(n)), *_block("else:", _hold(n))]
    return [*lines, *(f"t{i} += b{i} * share" for i in range(n))]


def _shrink(n: int) -> list[str]:
    """Bierman's update with the noise variance that makes the forgetting directional; leaves P x in b.

    Column by column of U, with a = noise + f_0 v_0 + ... + f_j v_j so far: D_j shrinks by (a before) / (a after), the
    column of U moves by b (-f_j / a before), and b gathers U v. Only products of positive numbers make D, so it stays
    positive in any rounding; P itself is never formed.
    """
    lines = ["a = 1.0 if mu == 1.0 else r / (mu * r - 1.0 + mu)"]
    for j in range(n):
        if j:
            lines.append(f"c = -f{j} / a")
        lines += ["was = a", f"a += f{j} * v{j}", f"d{j} *= was / a", f"b{j} = v{j}"]
        for i in range(j):
            lines += [f"old = u{i}_{j}", f"u{i}_{j} = old + b{i} * c", f"b{i} += old * v{j}"]
    return lines


def _hold(n: int) -> list[str]:
    """P x in b, with P as it is."""
    return [f"b{i} = v{i}" + "".join(f" + u{i}_{j} * v{j}" for j in range(i + 1, n)) for i in range(n)]
