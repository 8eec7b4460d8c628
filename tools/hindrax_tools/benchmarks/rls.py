"""Speed of one recursive least-squares update with three and six parameters, compared with other libraries."""

from importlib.metadata import version
from itertools import cycle

import numpy as np
import padasip
from filterpy.kalman import KalmanFilter
from sysidentpy.parameter_estimation import RecursiveLeastSquares

from hindrax_ident.online.rls import Rls
from hindrax_tools.benchmarks import median_us, row

SAMPLES, REPEATS = 400, 9
WINDOW = 100
SEED = 1


def rows() -> list[dict[str, object]]:
    """One row per number of parameters and peer: name, ours_us, peer, peer_us, ratio. Medians over repeats."""
    return [one for n in (3, 6) for one in _compared(n)]


def _compared(n: int) -> list[dict[str, object]]:
    rng = np.random.default_rng(SEED)
    X = rng.standard_normal((SAMPLES, n))
    y = X @ np.arange(1.0, n + 1.0) + 0.1 * rng.standard_normal(SAMPLES)
    rls, numbers = Rls([0.0] * n, [1e4] * n), cycle(zip(map(tuple, X.tolist()), y.tolist(), strict=True))
    kalman, rows_of_one = KalmanFilter(dim_x=n, dim_z=1), cycle(zip(X[:, None, :], y, strict=True))
    kalman.P *= 1e4
    adaptive, samples = padasip.filters.FilterRLS(n, mu=0.999), cycle(zip(X, y, strict=True))
    batch = RecursiveLeastSquares(lam=0.999)

    def kalman_update() -> None:
        row, value = next(rows_of_one)
        kalman.update(value, R=1.0, H=row)

    def adapt() -> None:
        row, value = next(samples)
        adaptive.adapt(value, row)

    ours_us = median_us(lambda: rls.update(*next(numbers)), SAMPLES, REPEATS)
    # Whole batches only: its time is divided by the number of samples.
    batch_us = median_us(lambda: batch.optimize(X, y[:, None]), 1, REPEATS) / SAMPLES
    peers = {
        f"filterpy {version('filterpy')} KalmanFilter": median_us(kalman_update, SAMPLES, REPEATS),
        f"padasip {version('padasip')} FilterRLS": median_us(adapt, SAMPLES, REPEATS),
        f"sysidentpy {version('sysidentpy')} RecursiveLeastSquares": batch_us,
        f"numpy lstsq, {WINDOW} samples again": median_us(
            lambda: np.linalg.lstsq(X[:WINDOW], y[:WINDOW], rcond=None), SAMPLES, REPEATS
        ),
    }
    return [row(f"rls-{n}", ours_us, name, theirs_us) for name, theirs_us in peers.items()]
