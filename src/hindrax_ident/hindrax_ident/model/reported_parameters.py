"""What a motion reports: which parameters of a model, under which names, and their most likely values within bounds.

And back: the parameters of a model from the coefficients that its motions report.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array, Index, array
from hindrax_ident.model.motion_model import Model, Motion, coefficient_units, motions_of

NOT_NEGATIVE = ("k_q", "added_mass")


@dataclass(frozen=True, slots=True)
class ReportedParameters:
    """Indices of the model's parameters in the order of the coefficients `names`, with units and lower bounds.

    `square` indexes the block of these rows in a covariance; `mass` is the index of the added mass, which is the
    total mass minus the body's own.
    """

    rows: Index
    square: tuple[Index, Index]
    names: tuple[str, ...]
    units: tuple[str, ...]
    low: tuple[float, ...]
    mass: int


def reported_parameters(model: Model, motion: Motion) -> ReportedParameters:
    """Reported parameters of one motion."""
    own = model.names_of(motion.side)
    rows = np.array([model.names.index(name) for name in own], dtype=np.intp)
    names = tuple(name.removesuffix("_negative").replace("mass", "added_mass") for name in own)
    return ReportedParameters(
        rows=rows,
        square=(rows[:, None], rows[None, :]),
        names=names,
        units=tuple(coefficient_units(model.axis)[name] for name in names),
        low=tuple(0.0 if name in NOT_NEGATIVE else -math.inf for name in names),
        mass=names.index("added_mass"),
    )


def parameters_of(model: Model, coefficients: Mapping[str, Mapping[str, float]]) -> Array:
    """Parameters of a model (p,), in the order of its names, from the coefficients of each motion.

    UsageError names what is missing.
    """
    found: dict[str, float] = {}
    for motion in motions_of(model.axis):
        reported, known = reported_parameters(model, motion), coefficients.get(motion.name, {})
        rows = zip(reported.rows.tolist(), reported.names, strict=True)
        found |= {model.names[row]: known[name] for row, name in rows if name in known}
    lacking = [name for name in model.names if name not in found]
    if lacking:
        *others, last = (name.replace("mass", "mass (added_mass)") for name in lacking)
        names = f"{', '.join(others)} or {last}" if others else last
        raise UsageError(f"{AXES[model.axis]}: found no {names} in the coefficients")
    found["mass"] += model.rigid
    return array([found[name] for name in model.names])


def bounded(values: Array, covariance: Array, low: Sequence[float]) -> Array:
    """Most likely parameters not below `low`: (p,), in the units of `values`.

    The most violated bound is enforced first; the other parameters follow through their correlation, then the next
    bound is enforced. Values within all bounds are returned unchanged.
    """
    theta, C = np.array(values, float), np.array(covariance, float)
    if all(least <= x for least, x in zip(low, theta.tolist(), strict=True)):
        return theta
    for _ in range(len(theta)):
        limits = np.maximum(theta, low)
        sigma = np.sqrt(np.maximum(np.diag(C), 0.0))
        excess = (limits - theta) / np.where(sigma > 0.0, sigma, np.inf)
        worst = int(np.argmax(excess))
        if excess[worst] <= 0.0:
            break
        gain = C[:, worst] / C[worst, worst]
        theta = theta + gain * (limits[worst] - theta[worst])
        theta[worst] = limits[worst]
        C = C - np.outer(gain, C[worst])
        C[worst, :] = C[:, worst] = 0.0
    return array(np.maximum(theta, low))
