"""The parameters of a model: what a motion reports of them, within bounds, and their prior before a run.

Reported are coefficients by name; the parameters of a model also follow from the coefficients that its motions report.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, Index, array
from hindrax_ident.model.motion_model import Model, Motion, coefficient_units, motions_of, restoring

NOT_NEGATIVE = ("k_q", "added_mass")
WIDE_DRAG, CROSS_FLOW = 30.0, 2.0
"""Prior deviations of a drag coefficient, and of that by the speed across, in the drag of a plate of this size [-]."""
OnlineEstimates = Mapping[str, tuple[Array, Array]]
"""Parameters and their covariance, by the name of the method: (p,), (p, p)."""


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
    """Parameters of a model from the coefficients of each motion.

    Parameters
    ----------
    model
        Of one axis.
    coefficients
        Values by motion, then by name, as `results.json` has them.

    Returns
    -------
    Array
        (p,), in the order of the model's names.

    Raises
    ------
    UsageError
        Names what is missing.
    """
    # Only records that move across have k_w.
    found = {"k_w": 0.0} if model.crossed else {}
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
    """Most likely parameters not below their bounds.

    The most violated bound is enforced first; the other parameters follow through their correlation, then the next
    bound is enforced. Values within all bounds are returned unchanged.

    Parameters
    ----------
    values : (p,)
        Estimates.
    covariance : (p, p)
        Of the estimates.
    low : (p,)
        Bounds, -inf for none.

    Returns
    -------
    Array
        (p,), in the units of `values`.
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


def newton_step(normal: Array, gradient: Array, room: float, at: int = -1) -> Array:
    """Solution of the normal equations with a bound on one parameter.

    At its bound it stays, and the others take their best step.

    Parameters
    ----------
    normal : (p, p)
        Normal matrix.
    gradient : (p,)
        Downhill.
    room
        Least step of the bounded parameter, mostly negative.
    at
        Its index.

    Returns
    -------
    Array
        (p,).
    """
    step = array(np.linalg.solve(normal, gradient))
    if step[at] < room:
        others = np.delete(np.arange(len(step)), at)
        step[others] = np.linalg.solve(normal[np.ix_(others, others)], gradient[others] - normal[others, at] * room)
        step[at] = room
    return step


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

    Parameters
    ----------
    vehicle
        Envelope, mass and water.
    model
        Of one axis.

    Returns
    -------
    Prior
        Values and deviations (p,), in the order of the model's names.
    """
    length = vehicle.characteristic_length_m
    rotational = model.axis >= 3
    unit = 0.5 * vehicle.water.density_kgpm3 * length ** (5 if rotational else 2)
    drag = [2.0 * unit, 0.0] * (model.drags // 2)
    across = [0.0] if model.crossed else []
    rest = [restoring(vehicle)] if model.restores else []
    values = [*drag, 0.0, *across, *rest, 1.8 * model.rigid]
    sigmas = [WIDE_DRAG * unit] * (len(values) - 1) + [3.0 * model.rigid]
    if model.crossed:
        sigmas[model.drags + 1] = _cross_flow(vehicle, model)
    if model.restores:
        sigmas[-2] += abs(values[-2])
    return Prior(np.array(values), np.array(sigmas))


def _cross_flow(vehicle: Vehicle, model: Model) -> float:
    """Prior deviation of k_w: that of a plate of this size, at half of the longest side in a turn."""
    lever_m = 0.5 * max(vehicle.envelope_m) if model.axis >= 3 else 1.0
    return CROSS_FLOW * 0.5 * vehicle.water.density_kgpm3 * vehicle.characteristic_length_m**2 * lever_m**3


def one_sided(model: Model, prior: Prior, online: OnlineEstimates, side: int) -> tuple[Model, Prior, OnlineEstimates]:
    """One direction of a split model, for a heave record that has no other.

    Parameters
    ----------
    model, prior
        Of both directions.
    online
        Estimates with covariances, by the name of the estimator.
    side
        +1 or -1: the direction kept.

    Returns
    -------
    tuple[Model, Prior, OnlineEstimates]
        The same without the drag of the other direction.
    """
    drag = [0, 1] if side > 0 else [2, 3]
    rows = [*drag, *range(4, len(model.names))]
    narrowed = {name: (theta[rows], C[np.ix_(rows, rows)]) for name, (theta, C) in online.items()}
    plain = replace(model, split=False)
    return plain, Prior(prior.values[rows], prior.sigmas[rows]), narrowed


def crossed(
    vehicle: Vehicle, model: Model, prior: Prior, online: OnlineEstimates
) -> tuple[Model, Prior, OnlineEstimates]:
    """The model with the drag by the speed across, k_w, for a record that moves along several axes at once.

    Parameters
    ----------
    vehicle
        Envelope and water.
    model, prior
        Without it.
    online
        Estimates with covariances, by the name of the estimator.

    Returns
    -------
    tuple[Model, Prior, OnlineEstimates]
        The same with it; online estimates know nothing of it.
    """
    at, sigma = model.drags + 1, _cross_flow(vehicle, model)
    wider = {}
    for name, (theta, C) in online.items():
        covariance = np.insert(np.insert(C, at, 0.0, axis=0), at, 0.0, axis=1)
        covariance[at, at] = sigma**2
        wider[name] = np.insert(theta, at, 0.0), covariance
    values, sigmas = np.insert(prior.values, at, 0.0), np.insert(prior.sigmas, at, sigma)
    return replace(model, crossed=True), Prior(values, sigmas), wider


def uncrossed(model: Model, prior: Prior, online: OnlineEstimates) -> tuple[Model, Prior, OnlineEstimates]:
    """The model without the drag by the speed across, for a record that hardly has any.

    Parameters
    ----------
    model, prior
        With it.
    online
        Estimates with covariances, by the name of the estimator.

    Returns
    -------
    tuple[Model, Prior, OnlineEstimates]
        The same without it; what it may be stays in the covariances of the others.
    """
    at = model.drags + 1
    less = {
        name: (np.delete(theta, at), np.delete(np.delete(C, at, axis=0), at, axis=1))
        for name, (theta, C) in online.items()
    }
    return replace(model, crossed=False), Prior(np.delete(prior.values, at), np.delete(prior.sigmas, at)), less
