"""The band of the online estimate: as wide as the estimate is off, in records as short as a pool test's."""

from __future__ import annotations

import numpy as np
from synthetic_runs import back_and_forth, fly

from hindrax_ident.arrays import Array, array
from hindrax_ident.model.motion_model import Model
from hindrax_ident.model.prior import Prior
from hindrax_ident.online.axis_estimator import AxisEstimator
from hindrax_ident.tuning import Tuning

MODEL, THETA = Model(0, 15.22), np.array([66.48, 1.25, 0.0, 27.3])
LAG_S, HELD_S, RUNS = 0.15, 0.1, 60


def deviations(seed: int, forgetting: float = 1.0) -> Array:
    """Errors in the deviations that are told, (p,): thrust is 6 % off, the DVL has 1 cm/s."""
    rng = np.random.default_rng(seed)
    plan = back_and_forth((14.0, 0.8, 5.4), 10.0, 60.0)
    held = round(HELD_S / 0.02)
    flight = fly(MODEL, THETA, plan, LAG_S, np.repeat(0.06 * rng.standard_normal(round(60.0 / HELD_S) + 1), held))
    prior = Prior(np.array([60.0, 2.0, 0.0, 30.0]), np.array([60.0, 60.0, 5.0, 30.0]))
    estimator = AxisEstimator(MODEL, LAG_S, prior, Tuning(forgetting=forgetting))
    for at_s, force in zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True):
        estimator.thrust(at_s, force)
    step = round(0.1 / float(flight.grid.times_s[1]))
    for at_s, v in zip(flight.grid.times_s[::step].tolist(), flight.path.v[::step].tolist(), strict=True):
        estimator.velocity(at_s, v + 0.01 * float(rng.standard_normal()))
    found, covariance = estimator.estimate()
    return array((found - THETA) / np.sqrt(np.diag(covariance)))


def test_short_records_tell_bands_that_hold() -> None:
    z = np.array([deviations(seed) for seed in range(RUNS)])
    assert np.sqrt(np.mean(z**2, axis=0)).max() < 1.5
    assert np.mean(np.abs(z) < 1.96) > 0.84


def test_with_forgetting_they_are_bands_too() -> None:
    z = np.array([deviations(seed, forgetting=0.99) for seed in range(5)])
    assert np.all(np.isfinite(z))
    assert np.abs(z).max() < 5.0
