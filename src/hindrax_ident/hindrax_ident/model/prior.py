"""The prior of an axis: wide, from the size of the vehicle."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array
from hindrax_ident.model.motion_model import Model, restoring

WIDE = 30.0
OnlineEstimates = Mapping[str, tuple[Array, Array]]
"""Parameters and their covariance, by the name of the method: (p,), (p, p)."""


@dataclass(frozen=True, slots=True)
class Prior:
    """Values and standard deviations of a model's parameters, (p,) each, in the model's order."""

    values: Array
    sigmas: Array

    @property
    def information(self) -> Array:
        """Inverse covariance: (p, p)."""
        return np.diag(1.0 / self.sigmas**2)


def wide_prior(vehicle: Vehicle, model: Model) -> Prior:
    """Prior from the size alone: drag coefficient 2 +- 30, total mass 1.8 +- 3 body masses.

    It keeps a poor record solvable; the first seconds of any run outweigh it.
    """
    length = vehicle.characteristic_length_m
    rotational = model.axis >= 3
    unit = 0.5 * vehicle.water.density_kgpm3 * length ** (5 if rotational else 2)
    drag = [2.0 * unit, 0.0] * (model.drags // 2)
    rest = [restoring(vehicle)] if model.restores else []
    values = [*drag, 0.0, *rest, 1.8 * model.rigid]
    sigmas = [WIDE * unit] * (len(values) - 1) + [3.0 * model.rigid]
    if model.restores:
        sigmas[-2] += abs(values[-2])
    return Prior(np.array(values), np.array(sigmas))


def one_sided(model: Model, prior: Prior, online: OnlineEstimates, side: int) -> tuple[Model, Prior, OnlineEstimates]:
    """Model, prior and estimates of one direction of a split model: for a heave record that has no other."""
    drag = [0, 1] if side > 0 else [2, 3]
    rows = [*drag, *range(4, len(model.names))]
    narrowed = {name: (theta[rows], C[np.ix_(rows, rows)]) for name, (theta, C) in online.items()}
    plain = Model(model.axis, model.rigid, split=False, restores=model.restores)
    return plain, Prior(prior.values[rows], prior.sigmas[rows]), narrowed
