"""Colored noise: autoregressive models of residuals, and the effective sample size.

Residuals r_k = a_1 r_k-1 + ... + a_q r_k-q + e_k with white innovations e. With L the lower triangular matrix of
"r_k - a_1 r_k-1 - ...", L r = e, and the covariance of r is Omega = L^-1 L^-T at unit innovation. `color_backward` is
L^-T: the recursion run backward in time. Records have gaps, so all take pieces (n,), and no lag reaches from one
piece into another.
"""

import math
from collections.abc import Sequence

import numpy as np

from hindrax_ident.arrays import Array

HIGHEST_ORDER = 4
LAGS = 40


def fit_autoregression(pieces: Sequence[Array], highest_order: int = HIGHEST_ORDER) -> Array:
    """Fit r_k = a_1 r_k-1 + ... + a_q r_k-q + e_k over all pieces; the order q is that of the Bayesian criterion.

    Parameters
    ----------
    pieces : (n,) each
        Residuals without gaps; no lag reaches from one piece into another.
    highest_order
        Largest q that is tried.

    Returns
    -------
    Array
        a, (q,) [-]; empty when the residuals are white or too few.
    """
    usable = [piece for piece in pieces if len(piece) > 2 * highest_order]
    if sum(len(piece) for piece in usable) < 20 * (highest_order + 1):
        return np.zeros(0)
    rows = np.concatenate([_lagged(piece, highest_order) for piece in usable])
    now, past = rows[:, 0], rows[:, 1:]
    # All orders predict the same samples, or a higher one would win by having fewer. A pole at the unit circle is
    # drift, whose variance has no bound.
    best, best_score = np.zeros(0), _score(now, 0)
    for order in range(1, highest_order + 1):
        found, *_ = np.linalg.lstsq(past[:, :order], now, rcond=None)
        score = _score(now - past[:, :order] @ found, order)
        if score < best_score and np.all(np.abs(np.roots(np.concatenate([[1.0], -found]))) < 0.995):
            best, best_score = found, score
    return best


def _lagged(piece: Array, order: int) -> Array:
    """Columns r_k, r_k-1, ... r_k-order: (n - order, order + 1)."""
    windows = np.lib.stride_tricks.sliding_window_view(piece, order + 1)
    return np.asarray(windows[:, ::-1])


def _score(errors: Array, order: int) -> float:
    """Bayesian criterion: n log(variance) + order log(n). Akaike's would take noise for color in one record of six."""
    variance = float(errors @ errors) / len(errors)
    return len(errors) * math.log(max(variance, 1e-300)) + order * math.log(len(errors))


def color_backward(a: Array, x: Array) -> Array:
    """Transposed coloring filter over the columns of one piece, (n, m): x'x becomes x' Omega x at unit innovation."""
    if not len(a):
        return x
    # One forward substitution; `lfilter` is the same, and its import takes longer than the fit of a record.
    bands = np.repeat(np.concatenate([[1.0], -a])[:, None], len(x), axis=1)
    from scipy.linalg.lapack import dtbtrs  # noqa: PLC0415  # slow, and the live estimate does without

    solved, _ = dtbtrs(bands, x[::-1], uplo="L", diag="U")
    return np.asarray(solved[::-1])


def autocorrelation(pieces: Sequence[Array], lags: int = LAGS) -> Array:
    """Autocorrelation, without unit, at lags 0 to `lags` over all pieces, (n,) each: (lags + 1,); zero without data."""
    sums = np.zeros(lags + 1)
    for piece in pieces:
        centered = piece - piece.mean() if len(piece) else piece
        for lag in range(min(lags + 1, len(piece))):
            sums[lag] += centered[lag:] @ centered[: len(centered) - lag]
    return sums / sums[0] if sums[0] > 0.0 else sums


def effective_samples(pieces: Sequence[Array]) -> float:
    """Equivalent number of independent samples for a mean: n / (1 + 2 sum of autocorrelations).

    The sum ends where the autocorrelation first falls to zero: beyond that it is noise.

    Parameters
    ----------
    pieces : (n,) each
        Samples without gaps.

    Returns
    -------
    float
        At most n where neighbors are alike; more where they alternate.
    """
    centered = [piece - piece.mean() for piece in pieces if len(piece) > 1]
    n = sum(len(piece) for piece in centered)
    power = sum(float(piece @ piece) for piece in centered)
    total = 0.0
    for lag in range(1, max((len(piece) for piece in centered), default=0)):
        product = sum(float(piece[lag:] @ piece[:-lag]) for piece in centered if len(piece) > lag)
        if not product > 0.0:
            break
        total += product / power
    return n / (1.0 + 2.0 * total)


class Correlator:
    """Running autocorrelation of residuals, and the factor by which it reduces the sample size."""

    __slots__ = ("_past", "_sums", "lags")

    def __init__(self, lags: int = 12) -> None:
        """`lags`: largest lag of the correlation [samples]."""
        self.lags = lags
        self.restart()
        self._sums = [0.0] * (lags + 1)

    def restart(self) -> None:
        """Start a new sequence of samples; the sums stay."""
        self._past: list[float] = []

    def add(self, residual: float) -> None:
        """Add a residual, in time order."""
        sums = self._sums
        sums[0] += residual * residual
        for lag, old in enumerate(self._past, 1):
            sums[lag] += residual * old
        self._past.insert(0, residual)
        del self._past[self.lags :]

    @property
    def factor(self) -> float:
        """Variance of a mean over that of white noise: 1 + 2 sum of autocorrelations (Bartlett); 0.2 to 1000."""
        power = self._sums[0]
        if power <= 0.0:
            return 1.0
        # A truncated sum of estimated autocorrelations may make the factor negative; with Bartlett's weights it cannot.
        total = sum((1.0 - lag / (self.lags + 1)) * self._sums[lag] for lag in range(1, self.lags + 1))
        return min(1000.0, max(0.2, 1.0 + 2.0 * total / power))


def ljung_box(pieces: Sequence[Array], lags: int = 20) -> tuple[float, float]:
    """Statistic of Ljung and Box (Biometrika 1978) over the first lags, and its expectation for white noise."""
    n = sum(len(piece) for piece in pieces)
    rho = autocorrelation(pieces, lags)[1:]
    weights = 1.0 / np.maximum(n - np.arange(1, lags + 1), 1)
    return float(n * (n + 2) * np.sum(rho * rho * weights)), float(lags)
