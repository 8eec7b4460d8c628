"""Reported parameters: which parameters of a model a motion reports, and under which names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Index
from hindrax_ident.model.motion_model import Model, Motion, coefficients


@dataclass(frozen=True, slots=True)
class ReportedParameters:
    """Indices of the model's parameters in the order of the coefficients `names`, with units and bounds.

    `square` indexes the block of these rows in a covariance; `mass` is the index of the added mass, which is the
    total mass minus the body's own.
    """

    rows: Index
    square: tuple[Index, Index]
    names: tuple[str, ...]
    units: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    mass: int


def reported_parameters(model: Model, motion: Motion) -> ReportedParameters:
    """Reported parameters of one motion."""
    own = model.names_of(motion.side)
    rows = np.array([model.names.index(name) for name in own], dtype=np.intp)
    names = tuple(name.removesuffix("_negative").replace("mass", "added_mass") for name in own)
    known = coefficients(model.axis)
    return ReportedParameters(
        rows=rows,
        square=(rows[:, None], rows[None, :]),
        names=names,
        units=tuple(known[name].unit for name in names),
        low=tuple(known[name].low for name in names),
        high=tuple(known[name].high for name in names),
        mass=names.index("added_mass"),
    )
