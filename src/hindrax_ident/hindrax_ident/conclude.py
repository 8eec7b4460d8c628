"""From the record of one axis to the results of its motions: refinement, the paper's way beside it, bands, verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.belief import Belief
from hindrax_ident.bounds import bounded
from hindrax_ident.calibration import (
    by_masses,
    by_tilt,
    tilt_sigma_rad,
    with_calibration,
    with_known_buoyancy,
    with_velocity_gain,
)
from hindrax_ident.delay import by_delays, settled
from hindrax_ident.faces import Face, face_of
from hindrax_ident.gusts import common_noise
from hindrax_ident.misfit import (
    CurrentCheck,
    FormCheck,
    LagCheck,
    check_current,
    check_form,
    check_lag,
    check_latency,
    check_slow,
)
from hindrax_ident.models import HORIZONTAL, Model, Motion, coefficients
from hindrax_ident.omitted import by_omission
from hindrax_ident.plateaus import BatchFit, Plateaus, measure
from hindrax_ident.plateaus import fit as fit_plateaus
from hindrax_ident.quality import (
    Evidence,
    Validation,
    Whiteness,
    excitation,
    reasons_against,
    validation,
    whiteness,
)
from hindrax_ident.record import Record
from hindrax_ident.refine import Fit, refine, reweighted
from hindrax_ident.results import DragBand, MotionResult, Number
from hindrax_ident.sides import Online
from hindrax_ident.tuning import Tuning

SPEEDS = 21
LAG_ROUNDS = 3
LONGEST_LAG_S = 2.0
MASS_SHARE = 0.3
"""Relative standard deviation above which the mass is not reported."""
METHOD = "output-error"
CONTRADICTION = 1e-4
"""Probability with which two values of one quantity may be called different."""


@dataclass(frozen=True, slots=True)
class Conclusion:
    """Everything about one axis at the end: for the report, beyond what the results carry."""

    record: Record
    fit: Fit
    calibrated: Array
    lag: LagCheck
    form: FormCheck
    current: CurrentCheck
    omitted: Array
    plateaus: Plateaus
    whiteness: Whiteness
    validation: Validation | None
    online: Online


@dataclass(frozen=True, slots=True)
class Draft:
    """A record, with the lag and latency that its residuals ask for (`moved`: not those it was told), and its fit.

    `online`: parameters and covariance of each online method, by its name.
    """

    record: Record
    fit: Fit
    belief: Belief
    online: Online
    moved: bool


def draft(model: Model, record: Record, belief: Belief, online: Online, lag_doubt_s: float = 0.0) -> Draft:
    """Refine a record from the last online estimate. ValueError when it holds too few samples.

    With `lag_doubt_s` its lag and latency are only believed to within that.
    """
    start = list(online.values())[-1][0] if online else belief.values
    if lag_doubt_s > 0.0:
        return Draft(*settled(record, start, model, belief, lag_doubt_s), belief, online, moved=False)
    record, fit, moved = _with_lag(record, refine(model, record, start, belief), belief)
    return Draft(record, fit, belief, online, moved)


def together(drafts: Mapping[int, Draft]) -> dict[int, Draft]:
    """Drafts of all axes of a run, weighed by what they say of the thrusters together."""
    known = {axis: one.fit for axis, one in drafts.items() if len(one.record.effort)}
    better = {axis: reweighted(known[axis], noise, drafts[axis].belief) for axis, noise in common_noise(known).items()}
    weighed = {axis: replace(one, fit=better.get(axis, one.fit)) for axis, one in drafts.items()}
    return weighed | _with_one_stiffness({axis: one for axis, one in weighed.items() if one.fit.model.restores})


def _with_one_stiffness(drafts: Mapping[int, Draft]) -> dict[int, Draft]:
    """Roll and pitch have one k_r, buoyancy times its height (Fossen 2011 eq. 4.6): tell each what the other found.

    Not where they contradict each other: then an arm or a thrust of one of them is not what the vehicle file says.
    """
    at = -2
    found = {axis: (float(one.fit.theta[at]), float(one.fit.covariance[at, at])) for axis, one in drafts.items()}
    if len(found) < 2:
        return {}
    (value, variance), (other, its_variance) = found.values()
    if (value - other) ** 2 > float(chi2.isf(CONTRADICTION, 1)) * (variance + its_variance):
        return {}
    told = dict(zip(found, reversed(found.values()), strict=True))
    return {axis: replace(one, fit=_told(one, at, *told[axis])) for axis, one in drafts.items()}


def _told(drafted: Draft, index: int, value: float, variance: float) -> Fit:
    return reweighted(drafted.fit, drafted.fit.noise, drafted.belief.told(index, value, math.sqrt(variance)))


def conclude(vehicle: Vehicle, drafted: Draft, *, tuning: Tuning) -> Conclusion:
    """Check a draft for what it does not know of, and widen its bands accordingly."""
    record, belief, online = drafted.record, drafted.belief, drafted.online
    fit = drafted.fit
    if tuning.thrust_doubt > 0.0:
        fit = replace(fit, covariance=array(check_slow(fit) * fit.covariance))
    fit, lag = _with_doubt(record, fit, moved=drafted.moved, lag_doubt_s=tuning.lag_doubt_s)
    form, current = check_form(fit), check_current(fit)
    if form.significant:
        fit = replace(fit, covariance=fit.covariance + np.outer(form.bias, form.bias))
    if current.significant:
        fit = replace(
            fit, covariance=fit.covariance + current.current**2 * np.outer(current.per_unit, current.per_unit)
        )
    late = check_latency(record, fit)
    unseen = by_tilt(vehicle, fit, tilt_sigma_rad(vehicle, tuning)) + by_masses(record, fit)
    unseen = unseen + lag.covariance(tuning.timing_sigma_s) + late.covariance(tuning.timing_sigma_s)
    unseen = unseen + tuning.stamp_doubt_s**2 * np.outer(lag.per_s, lag.per_s)
    omitted = by_omission(record, fit, tuning.thrust_doubt)
    systematic = omitted + by_tilt(vehicle, fit, tuning.mount_sigma_rad) + current.covariance(tuning.current_sigma_mps)
    fit = replace(fit, covariance=fit.covariance + unseen)
    calibrated = with_calibration(vehicle, record, fit) + systematic
    calibrated = with_velocity_gain(calibrated, fit, tuning.velocity_gain_sigma)
    # Every term of the equation of motion scales with the wrench, so every parameter does.
    calibrated = array(calibrated + tuning.wrench_gain_sigma**2 * np.outer(fit.theta, fit.theta))
    return Conclusion(
        record=record,
        fit=fit,
        calibrated=calibrated,
        lag=lag,
        form=form,
        current=current,
        omitted=omitted,
        plateaus=measure(record),
        whiteness=whiteness(fit),
        validation=validation(record, fit, belief),
        online={name: (theta, array(covariance + unseen)) for name, (theta, covariance) in online.items()},
    )


def _with_lag(record: Record, fit: Fit, belief: Belief) -> tuple[Record, Fit, bool]:
    """Where the residuals contradict the lag of the vehicle file or the stamps, use theirs; and whether they do.

    Both let the motion come late. The one that explains the residuals better is taken.
    """
    moved = False
    for _ in range(LAG_ROUNDS):
        lag, latency = check_lag(record, fit), check_latency(record, fit)
        which = lag if lag.distance >= latency.distance else latency
        unsettled = moved and abs(which.missing_s) > which.sigma_s
        if not (which.significant or unsettled):
            break
        if which is latency:
            later = replace(record, late_s=min(LONGEST_LAG_S, max(-LONGEST_LAG_S, record.late_s + latency.missing_s)))
        else:
            later = replace(record, lag_s=min(LONGEST_LAG_S, max(0.0, record.lag_s + lag.missing_s)))
        if (later.lag_s, later.late_s) == (record.lag_s, record.late_s):
            break
        record, moved = later, True
        # The noise anew: what came late was taken for unknown forces.
        fit = refine(fit.model, record, fit.theta, belief)
    return record, fit, moved


def _with_doubt(record: Record, fit: Fit, *, moved: bool, lag_doubt_s: float) -> tuple[Fit, LagCheck]:
    """Let the uncertainty of a lag that was found be felt, and of one that is hardly known."""
    lag = check_lag(record, fit)
    if lag_doubt_s > 0.0:
        fit = replace(fit, covariance=fit.covariance + by_delays(record, fit, lag_doubt_s))
    elif moved or lag.significant:
        doubt = lag.per_s * math.hypot(lag.sigma_s, lag.missing_s)
        fit = replace(fit, covariance=fit.covariance + np.outer(doubt, doubt))
    return fit, lag


def result_of(motion: Motion, vehicle: Vehicle, conclusion: Conclusion, tuning: Tuning) -> MotionResult:
    """Result of one motion of an axis."""
    fit, model = conclusion.fit, conclusion.fit.model
    theta, calibrated = fit.theta, conclusion.calibrated
    if tuning.buoyancy_sigma_N > 0.0 and model.axis == 2:
        index = model.names.index("b")
        _, calibrated = with_known_buoyancy(theta, calibrated, index, vehicle.net_buoyancy_N, tuning.buoyancy_sigma_N)
    face = face_of(model, motion)
    covariance, widened = fit.covariance[face.square], calibrated[face.square]
    k = theta[face.rows[:2]]
    numbers = numbers_of(model, motion, theta, fit.covariance, calibrated)
    offered = excitation(fit, motion.side)
    evidence = Evidence(
        k=k,
        covariance=(fit.covariance + conclusion.current.covariance(tuning.current_sigma_mps) + conclusion.omitted)[
            face.square
        ][:2, :2],
        excitation=offered,
        effective_samples=fit.effective_samples,
        noise=fit.sigmas[0] if math.isfinite(fit.sigmas[0]) else 0.0,
        mass_gap=(float(theta[-1]) - model.rigid) / max(1e-12, math.sqrt(widened[face.mass, face.mass])),
        converged=fit.converged,
        validation=conclusion.validation,
        form=conclusion.form,
        current=tuning.current_sigma_mps if model.axis in HORIZONTAL else 0.0,
        offset=_least_offset(theta, widened, face) if model.axis in HORIZONTAL else 0.0,
    )
    reasons = tuple(reasons_against(evidence))
    return MotionResult(
        motion=motion.name,
        method=METHOD,
        coefficients=numbers,
        names=face.names,
        covariance=covariance,
        samples=fit.samples,
        effective_samples=fit.effective_samples,
        identifiable=not reasons,
        reasons=reasons,
        speeds=(offered.low, offered.high),
        drag=_band(k, covariance[:2, :2], widened[:2, :2], offered.low, offered.high),
        methods=_methods(motion, conclusion),
        quality=_quality(conclusion),
    )


def _least_offset(theta: Array, covariance: Array, face: Face) -> float:
    """Size of b less three standard deviations."""
    at = face.names.index("b")
    return max(0.0, abs(float(theta[face.rows[at]])) - 3.0 * math.sqrt(max(0.0, float(covariance[at, at]))))


def numbers_of(
    model: Model, motion: Motion, theta: Array, covariance: Array, calibrated: Array | None = None
) -> dict[str, Number]:
    """Coefficients of one motion from the parameters of its axis; a mass that is hardly known is left out."""
    face = face_of(model, motion)
    block = covariance[face.square]
    values = theta[face.rows]
    values[face.mass] -= model.rigid
    values = _within(values, block, face)
    sigmas = _sigmas(block)
    wide = np.full(len(values), math.nan) if calibrated is None else _sigmas(calibrated[face.square])
    numbers = {
        name: Number(value, std, std_calibrated, unit=unit)
        for name, value, std, std_calibrated, unit in zip(
            face.names, values.tolist(), sigmas.tolist(), wide.tolist(), face.units, strict=True
        )
    }
    if not 0.0 < numbers["added_mass"].std < MASS_SHARE * float(theta[-1]):
        del numbers["added_mass"]
    return numbers


def _sigmas(covariance: Array) -> Array:
    return array(np.sqrt(np.maximum(0.0, np.diag(covariance))))


def _within(values: Array, block: Array, face: Face) -> Array:
    """Respect bounds that are violated by chance only; a clear violation is shown as it is."""
    if np.any(values < np.array(face.low) - 3.0 * _sigmas(block)):
        return values
    return bounded(values, block, face.low, face.high)


def _band(k: Array, covariance: Array, widened: Array, low: float, high: float) -> DragBand | None:
    if not high > low > 0.0:
        return None
    speed = np.linspace(low, high, SPEEDS)
    gradient = np.stack([speed**2, speed], axis=1)
    spread = [array(np.sqrt(np.maximum(0.0, np.sum(gradient @ C * gradient, axis=1)))) for C in (covariance, widened)]
    return DragBand(array(speed), array(gradient @ k), spread[0], spread[1])


def _methods(motion: Motion, conclusion: Conclusion) -> dict[str, dict[str, Number]]:
    model = conclusion.fit.model
    out = {name: numbers_of(model, motion, *found) for name, found in conclusion.online.items()}
    batch = fit_plateaus(conclusion.plateaus.on_side(motion.side))
    if batch is not None:
        out["plateaus"] = _batch_numbers(batch, model)
    return out


def _batch_numbers(batch: BatchFit, model: Model) -> dict[str, Number]:
    known = coefficients(model.axis)
    sigmas = np.sqrt(np.diag(batch.covariance)).tolist()
    triples = zip(("k_q", "k_l", "b"), batch.theta.tolist(), sigmas, strict=True)
    return {name: Number(value, sigma, unit=known[name].unit) for name, value, sigma in triples}


def _quality(conclusion: Conclusion) -> dict[str, float]:
    fit, checked = conclusion.fit, conclusion.validation
    out = {
        "residual_std": fit.sigmas[0] if math.isfinite(fit.sigmas[0]) else fit.sigmas[1],
        "ljung_box": conclusion.whiteness.statistic,
        "ljung_box_expected": conclusion.whiteness.expected,
        "largest_inflation": float(fit.inflation.max()),
        "plateaus": float(len(conclusion.plateaus.v)),
        "other_form": conclusion.form.share if conclusion.form.significant else 0.0,
        "lag_s": conclusion.record.lag_s,
        "latency_s": conclusion.record.late_s,
        "lag_missing_s": conclusion.lag.missing_s,
        "lag_missing_sigma_s": conclusion.lag.sigma_s,
    }
    if math.isfinite(conclusion.current.sigma):
        out |= {"current_mps": conclusion.current.current, "current_sigma_mps": conclusion.current.sigma}
    if checked is not None:
        out |= {"held_out_fit": checked.fit, "held_out_excess": checked.excess}
    return out


def unidentified(motion: Motion, reason: str) -> MotionResult:
    """Result of a motion whose record holds nothing to fit."""
    return MotionResult(
        motion=motion.name,
        method="none",
        coefficients={},
        names=(),
        covariance=np.zeros((0, 0)),
        samples=0,
        effective_samples=0.0,
        identifiable=False,
        reasons=(reason,),
        speeds=(0.0, 0.0),
        drag=None,
    )
