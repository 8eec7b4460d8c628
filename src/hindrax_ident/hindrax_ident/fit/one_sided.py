"""Heave records with one direction only: the drag of the other is omitted from the model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hindrax_ident.arrays import Array
from hindrax_ident.model.motion_model import Model
from hindrax_ident.model.prior import Prior
from hindrax_ident.records.axis_record import Record

SHARE = 0.25
"""Share of the highest speed that the other direction must reach."""


def side_of(record: Record) -> int:
    """0: both directions; 1 or -1: only that one."""
    v = record.mean_velocities()
    if not len(v):
        return 1
    up, down = float(np.percentile(v, 98.0)), float(np.percentile(v, 2.0))
    if min(up, -down) > SHARE * max(up, -down):
        return 0
    return 1 if up >= -down else -1


OnlineEstimates = Mapping[str, tuple[Array, Array]]


def one_sided(model: Model, belief: Prior, online: OnlineEstimates, side: int) -> tuple[Model, Prior, OnlineEstimates]:
    """Model, prior and estimates of one direction of a split model."""
    drag = [0, 1] if side > 0 else [2, 3]
    rows = [*drag, *range(4, len(model.names))]
    narrowed = {name: (theta[rows], C[np.ix_(rows, rows)]) for name, (theta, C) in online.items()}
    plain = Model(model.axis, model.rigid, split=False, restores=model.restores)
    return plain, Prior(belief.values[rows], belief.sigmas[rows]), narrowed
