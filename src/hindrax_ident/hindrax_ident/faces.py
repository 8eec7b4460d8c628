"""The face that a model shows to the outside: which of its parameters a motion reports, under which names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Index
from hindrax_ident.models import Model, Motion, coefficients


@dataclass(frozen=True, slots=True)
class Face:
    """Rows of the model's parameters in the order of the coefficients `names`, with units and bounds.

    `square` takes the block of these rows out of a covariance; `mass` is the place of the added mass, which is the
    total without the body's own.
    """

    rows: Index
    square: tuple[Index, Index]
    names: tuple[str, ...]
    units: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    mass: int


def face_of(model: Model, motion: Motion) -> Face:
    """Coefficients of one motion."""
    own = model.names_of(motion.side)
    rows = np.array([model.names.index(name) for name in own], dtype=np.intp)
    names = tuple(name.removesuffix("_negative").replace("mass", "added_mass") for name in own)
    known = coefficients(model.axis)
    return Face(
        rows=rows,
        square=(rows[:, None], rows[None, :]),
        names=names,
        units=tuple(known[name].unit for name in names),
        low=tuple(known[name].low for name in names),
        high=tuple(known[name].high for name in names),
        mass=names.index("added_mass"),
    )
