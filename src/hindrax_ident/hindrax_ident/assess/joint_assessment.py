"""Joint fit to results: added mass as a matrix, drag of each axis, admitted terms, budgets and verdicts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hindrax_core.text.digits import measured
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.assessment import MASS_SHARE, SPEEDS
from hindrax_ident.assess.axis_fit import YAW
from hindrax_ident.assess.objections import Code, Objection, objection, to_json
from hindrax_ident.assess.results import Contribution, DragBand, Number
from hindrax_ident.fit.joint import JointFit
from hindrax_ident.fit.joint_problem import LAG
from hindrax_ident.model.motion_model import HORIZONTAL, Motion, motions_of, rigid_mass
from hindrax_ident.model.six_axes import CROSS, symmetric
from hindrax_ident.remedies import FLY_TWICE

LEAST_SPEED = 0.2
"""Share of the highest speed from which the drag is reported [-]."""
MOST_SIGMA = 0.35
"""Deviation of the drag at the highest speed, as a share of it, above which an axis is not identified [-]."""
SLOWEST_S, MOST_LATER_S = 0.45, 0.3
"""Lag of a thrust beyond which it is none of a thruster, and how much more than known it may be: of the record of a
pilot that a filter of 1 s had smoothed it was 0.56 s, with masses wrong by 3 to 6 deviations, all identified [s]."""
MOST_UNKNOWN = 0.5
"""Unknown force, of the largest thrust, above which the model is not that of the vehicle [-]."""

LEAST_FREQUENCIES = 3.0
"""An axis has six numbers of its own: mass, two of drag, its force at rest, lag and latency. Three sines determine six.
With two, forces that the model lacks pass for masses: of whirls in MuJoCo half of the masses were wrong by up to seven
deviations; legs, chirps and pilots spread over six sines and more."""


@dataclass(frozen=True, slots=True)
class JointMotion:
    """One motion of a joint fit; deviations with calibration."""

    coefficients: Mapping[str, Number]
    drag: DragBand
    budget: tuple[Contribution, ...]
    """Of the drag at the highest speed, largest first."""
    reasons: tuple[Objection, ...]


@dataclass(frozen=True, slots=True)
class CrossTerm:
    """A term that the record admitted, with the logarithm of how much likelier the record is with it."""

    number: Number
    evidence: float


@dataclass(frozen=True, slots=True)
class JointResults:
    """What a record says of all axes together.

    `added_mass`, `added_mass_std` (6, 6) [kg, kg m, kg m^2]: NaN on axes that were not fitted; the deviation of a term
    that was not admitted is 0.
    """

    motions: Mapping[str, JointMotion]
    added_mass: Array
    added_mass_std: Array
    terms: Mapping[str, CrossTerm]
    delays: Mapping[str, Number]
    converged: bool

    def to_json(self) -> dict[str, object]:
        """Plain data: keys `M_A`, `M_A_std`, `terms`, `delays`, `motions`; null where nothing is known."""

        def rows(table: Array) -> list[list[float | None]]:
            """Numbers of a table."""
            return [[value if math.isfinite(value) else None for value in row] for row in table.tolist()]

        return {
            "M_A": rows(self.added_mass),
            "M_A_std": rows(self.added_mass_std),
            "terms": {name: {**one.number.to_json(), "evidence": one.evidence} for name, one in self.terms.items()},
            "delays": {name: number.to_json() for name, number in self.delays.items()},
            "converged": self.converged,
            "motions": {
                name: {
                    **{key: number.to_json() for key, number in one.coefficients.items()},
                    "drag_force": one.drag.to_json(),
                    "budget": {row.influence: row.std for row in one.budget},
                    "identifiable": not one.reasons,
                    **to_json("reason", one.reasons),
                }
                for name, one in self.motions.items()
            },
        }


def joint_results(fit: JointFit, vehicle: Vehicle) -> JointResults:
    """Results of a joint fit."""
    wide = fit.covariance + fit.by_doubt @ fit.by_doubt.T
    numbers = {
        term.name: Number(value, std, std_calibrated, unit=term.unit)
        for term, value, std, std_calibrated in zip(
            fit.terms, fit.theta.tolist(), _deviations(fit.covariance), _deviations(wide), strict=True
        )
    }
    added = fit.M - np.diag([rigid_mass(vehicle, axis) for axis in range(6)])
    std = np.zeros((6, 6))
    for term in fit.terms:
        if term.mass:
            std += numbers[term.name].std_calibrated * symmetric(term.mass)
    unknown = np.array([axis not in fit.axes for axis in range(6)])
    for table in (added, std):
        table[unknown], table[:, unknown] = math.nan, math.nan
    return JointResults(
        motions={one.name: _motion(fit, one, vehicle, numbers) for axis in fit.axes for one in motions_of(axis)},
        added_mass=added,
        added_mass_std=std,
        terms={
            term.name: CrossTerm(numbers[term.name], fit.odds[term.name]) for term in fit.terms if term.kind == CROSS
        },
        delays={term.name: numbers[term.name] for term in fit.terms if term.unit == "s"},
        converged=fit.converged,
    )


def _deviations(covariance: Array) -> list[float]:
    return [float(one) for one in np.sqrt(np.maximum(0.0, np.diag(covariance)))]


def _motion(fit: JointFit, motion: Motion, vehicle: Vehicle, numbers: Mapping[str, Number]) -> JointMotion:
    """One motion of the joint fit: numbers, interval of its drag, budget at the highest speed, and objections.

    The drag is linear in the parameters, so its variance by noise is g' C g with g = (v^2, v) at their places; a doubt
    shifts it by its effect on the parameters, and where it is one about the law itself by that as well.
    """
    axis, name = motion.axis, AXES[motion.axis]
    places = [fit.index(f"{motion.name} {key}") for key in ("k_q", "k_l")]
    top = float(fit.scales.speed[axis])
    speed = array(np.linspace(LEAST_SPEED * top, top, SPEEDS))
    gradient = np.zeros((SPEEDS, len(fit.terms)))
    gradient[:, places[0]], gradient[:, places[1]] = speed**2, speed
    force, noise = gradient @ fit.theta, np.sum(gradient @ fit.covariance * gradient, axis=1)
    # A doubt about the law of the drag is one about the drag at a speed as well.
    shift = array(gradient @ fit.by_doubt) + _own_doubts(fit, name, speed, float(force[-1]))
    std, calibrated = np.sqrt(noise), np.sqrt(noise + np.sum(shift**2, axis=1))
    rows = [("noise of this record", float(std[-1]), str(FLY_TWICE))]
    rows += [(one.name, abs(by), str(one.remedy)) for one, by in zip(fit.doubts, shift[-1].tolist(), strict=True)]
    budget = sorted((Contribution(*row) for row in rows), key=lambda row: -row.std)
    mass = numbers[f"M_{'XYZKMN'[axis]}{'uvwpqr'[axis]}"]
    of_motion = {key: numbers[fit.terms[place].name] for key, place in zip(("k_q", "k_l"), places, strict=True)}
    if axis in (3, 4):
        of_motion["k_r"] = numbers[f"{name} k_r"]
    at_rest = numbers["net buoyancy" if axis == 2 else f"{name} b"]
    body = rigid_mass(vehicle, axis)
    if mass.std_calibrated < MASS_SHARE * mass.value:
        of_motion["added_mass"] = Number(mass.value - body, mass.std, mass.std_calibrated, unit=mass.unit)
    reasons = []
    if not fit.converged:
        reasons.append(objection(Code.JOINT_NOT_CONVERGED))
    if not calibrated[-1] < MOST_SIGMA * force[-1]:
        shown = measured(float(force[-1]), float(calibrated[-1]))
        reasons.append(objection(Code.JOINT_UNKNOWN_DRAG, shown=shown))
    spread = float(fit.frequencies[fit.axes.index(axis)])
    if spread < LEAST_FREQUENCIES:
        reasons.append(objection(Code.FEW_FREQUENCIES, found=spread, wanted=LEAST_FREQUENCIES))
    lag = fit.terms[LAG]
    most_s = max(SLOWEST_S, lag.mean + MOST_LATER_S)
    if fit.theta[LAG] > most_s:
        reasons.append(objection(Code.SLOW_THRUST, lag_s=float(fit.theta[LAG]), wanted_s=most_s))
    # Thrusters that push forward and aside turn as well: one that is wired backwards shows there most.
    for other in dict.fromkeys((axis, YAW if axis in HORIZONTAL else axis)):
        if other in fit.axes and fit.force_sigma[fit.axes.index(other)] > MOST_UNKNOWN * fit.scales.pull[other]:
            reasons.append(objection(Code.UNKNOWN_FORCES, where="" if other == axis else f" in {AXES[other]}"))
            break
    return JointMotion(
        {**of_motion, "b": at_rest},
        DragBand(array(speed), array(force), array(std), array(calibrated)),
        tuple(budget),
        tuple(reasons),
    )


def _own_doubts(fit: JointFit, axis: str, speed: Array, top_drag: float) -> Array:
    """Change of the drag at speeds per deviation of each doubt, where that is one about its law: (n, m)."""
    # Of an axis that never moved there is no drag, and none to bend.
    x = speed / speed[-1] if speed[-1] > 0.0 else np.ones_like(speed)
    bent = top_drag * x**2 * np.log(x)
    mine = [one.sigma * (one.name == f"{axis}: exponent of the drag") for one in fit.doubts]
    return np.outer(bent, mine)
