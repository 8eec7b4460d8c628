"""Record of one axis to results of its motions: refinement, plateau fit, uncertainty bands, verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.model_misfit import (
    CurrentCheck,
    FormCheck,
    LagCheck,
    check_current,
    check_form,
    check_lag,
    check_latency,
    slow_force_ratio,
)
from hindrax_ident.assess.quality import (
    Evidence,
    Validation,
    Whiteness,
    excitation,
    reasons_against,
    validation,
    whiteness,
)
from hindrax_ident.assess.results import DragBand, MotionResult, Number
from hindrax_ident.assess.thrust_calibration import (
    coriolis_covariance,
    tilt_covariance,
    tilt_sigma_rad,
    with_calibration,
    with_known_buoyancy,
    with_velocity_gain,
)
from hindrax_ident.assess.unmodeled_forces import unmodeled_force_covariance
from hindrax_ident.fit.delay import delay_covariance, fit_with_delays
from hindrax_ident.fit.disturbance_noise import common_noise
from hindrax_ident.fit.one_sided import OnlineEstimates
from hindrax_ident.fit.output_error import OutputErrorFit, refine, reweighted
from hindrax_ident.fit.plateaus import BatchFit, Plateaus, measure
from hindrax_ident.fit.plateaus import fit as fit_plateaus
from hindrax_ident.model.motion_model import HORIZONTAL, Model, Motion, coefficients
from hindrax_ident.model.parameter_bounds import bounded
from hindrax_ident.model.prior import Prior
from hindrax_ident.model.sign_dependent import ReportedParameters, reported_parameters
from hindrax_ident.records.axis_record import Record
from hindrax_ident.tuning import Tuning

SPEEDS = 21
LAG_ROUNDS = 3
LONGEST_LAG_S = 2.0
MASS_SHARE = 0.3
"""Relative standard deviation above which the mass is not reported."""
METHOD = "output-error"
CONTRADICTION = 1e-4
"""Significance level at which two values of one quantity contradict each other."""


@dataclass(frozen=True, slots=True)
class Assessment:
    """Final assessment of one axis: for the report, beyond the results."""

    record: Record
    fit: OutputErrorFit
    calibrated: Array
    lag: LagCheck
    form: FormCheck
    current: CurrentCheck
    unmodeled: Array
    plateaus: Plateaus
    whiteness: Whiteness
    validation: Validation | None
    online: OnlineEstimates


@dataclass(frozen=True, slots=True)
class DraftFit:
    """A record and its fit; `moved`: lag or latency were estimated from the residuals.

    `online`: parameters and covariance of each online method, by name.
    """

    record: Record
    fit: OutputErrorFit
    belief: Prior
    online: OnlineEstimates
    moved: bool


def draft(model: Model, record: Record, belief: Prior, online: OnlineEstimates, lag_doubt_s: float = 0.0) -> DraftFit:
    """Refine a record from the last online estimate. ValueError when it holds too few samples.

    `lag_doubt_s`: prior standard deviation of lag and latency; 0: both are known.
    """
    start = list(online.values())[-1][0] if online else belief.values
    if lag_doubt_s > 0.0:
        return DraftFit(*fit_with_delays(record, start, model, belief, lag_doubt_s), belief, online, moved=False)
    record, fit, moved = _with_lag(record, refine(model, record, start, belief), belief)
    return DraftFit(record, fit, belief, online, moved)


def combine_drafts(drafts: Mapping[int, DraftFit]) -> dict[int, DraftFit]:
    """Drafts of all axes of a run, refitted with a common thruster noise and a common restoring moment."""
    known = {axis: one.fit for axis, one in drafts.items() if len(one.record.effort)}
    better = {axis: reweighted(known[axis], noise, drafts[axis].belief) for axis, noise in common_noise(known).items()}
    weighed = {axis: replace(one, fit=better.get(axis, one.fit)) for axis, one in drafts.items()}
    return weighed | _with_common_stiffness({axis: one for axis, one in weighed.items() if one.fit.model.restores})


def _with_common_stiffness(drafts: Mapping[int, DraftFit]) -> dict[int, DraftFit]:
    """Roll and pitch share k_r, buoyancy times its height (Fossen 2011 eq. 4.6): refit each with that of the other.

    Not where they contradict each other: then a lever or a thrust differs from the vehicle file.
    """
    at = -2
    found = {axis: (float(one.fit.theta[at]), float(one.fit.covariance[at, at])) for axis, one in drafts.items()}
    if len(found) < 2:
        return {}
    (value, variance), (other, its_variance) = found.values()
    if (value - other) ** 2 > float(chdtri(1, CONTRADICTION)) * (variance + its_variance):
        return {}
    exchanged = dict(zip(found, reversed(found.values()), strict=True))
    return {axis: replace(one, fit=_refit_with(one, at, *exchanged[axis])) for axis, one in drafts.items()}


def _refit_with(drafted: DraftFit, index: int, value: float, variance: float) -> OutputErrorFit:
    return reweighted(drafted.fit, drafted.fit.noise, drafted.belief.combined_with(index, value, math.sqrt(variance)))


def assess(vehicle: Vehicle, drafted: DraftFit, *, tuning: Tuning) -> Assessment:
    """Check a draft for unmodeled effects, and widen its bands accordingly."""
    record, belief, online = drafted.record, drafted.belief, drafted.online
    fit = drafted.fit
    if tuning.thrust_doubt > 0.0:
        fit = replace(fit, covariance=array(slow_force_ratio(fit) * fit.covariance))
    fit, lag = _with_lag_uncertainty(record, fit, moved=drafted.moved, lag_doubt_s=tuning.lag_doubt_s)
    form, current = check_form(fit), check_current(fit)
    if form.significant:
        fit = replace(fit, covariance=fit.covariance + np.outer(form.bias, form.bias))
    if current.significant:
        fit = replace(
            fit, covariance=fit.covariance + current.current**2 * np.outer(current.per_unit, current.per_unit)
        )
    late = check_latency(record, fit)
    unobservable = tilt_covariance(vehicle, fit, tilt_sigma_rad(vehicle, tuning)) + coriolis_covariance(record, fit)
    unobservable = unobservable + lag.covariance(tuning.timing_sigma_s) + late.covariance(tuning.timing_sigma_s)
    unobservable = unobservable + tuning.stamp_doubt_s**2 * np.outer(lag.per_s, lag.per_s)
    unmodeled = unmodeled_force_covariance(record, fit, tuning.thrust_doubt)
    systematic = (
        unmodeled + tilt_covariance(vehicle, fit, tuning.mount_sigma_rad) + current.covariance(tuning.current_sigma_mps)
    )
    fit = replace(fit, covariance=fit.covariance + unobservable)
    calibrated = with_calibration(vehicle, record, fit) + systematic
    calibrated = with_velocity_gain(calibrated, fit, tuning.velocity_gain_sigma)
    # Every term of the equation of motion scales with the wrench, so every parameter does.
    calibrated = array(calibrated + tuning.wrench_gain_sigma**2 * np.outer(fit.theta, fit.theta))
    return Assessment(
        record=record,
        fit=fit,
        calibrated=calibrated,
        lag=lag,
        form=form,
        current=current,
        unmodeled=unmodeled,
        plateaus=measure(record),
        whiteness=whiteness(fit),
        validation=validation(record, fit, belief),
        online={name: (theta, array(covariance + unobservable)) for name, (theta, covariance) in online.items()},
    )


def _with_lag(record: Record, fit: OutputErrorFit, belief: Prior) -> tuple[Record, OutputErrorFit, bool]:
    """Refit with estimated lag or latency where the residuals contradict the vehicle file; and whether they do.

    Both delay the motion. The one that explains the residuals better is used.
    """
    moved = False
    for _ in range(LAG_ROUNDS):
        lag, latency = check_lag(record, fit), check_latency(record, fit)
        which = lag if lag.distance >= latency.distance else latency
        unsettled = moved and abs(which.missing_s) > which.sigma_s
        if not (which.significant or unsettled):
            break
        if which is latency:
            later = replace(
                record, latency_s=min(LONGEST_LAG_S, max(-LONGEST_LAG_S, record.latency_s + latency.missing_s))
            )
        else:
            later = replace(record, lag_s=min(LONGEST_LAG_S, max(0.0, record.lag_s + lag.missing_s)))
        if (later.lag_s, later.latency_s) == (record.lag_s, record.latency_s):
            break
        record, moved = later, True
        # Estimate the noise again: delays appeared as unknown forces.
        fit = refine(fit.model, record, fit.theta, belief)
    return record, fit, moved


def _with_lag_uncertainty(
    record: Record, fit: OutputErrorFit, *, moved: bool, lag_doubt_s: float
) -> tuple[OutputErrorFit, LagCheck]:
    """Widen the covariance by the uncertainty of an estimated or poorly known lag."""
    lag = check_lag(record, fit)
    if lag_doubt_s > 0.0:
        fit = replace(fit, covariance=fit.covariance + delay_covariance(record, fit, lag_doubt_s))
    elif moved or lag.significant:
        doubt = lag.per_s * math.hypot(lag.sigma_s, lag.missing_s)
        fit = replace(fit, covariance=fit.covariance + np.outer(doubt, doubt))
    return fit, lag


def result_of(motion: Motion, vehicle: Vehicle, assessment: Assessment, tuning: Tuning) -> MotionResult:
    """Result of one motion of an axis."""
    fit, model = assessment.fit, assessment.fit.model
    theta, calibrated = fit.theta, assessment.calibrated
    if tuning.buoyancy_sigma_N > 0.0 and model.axis == 2:
        index = model.names.index("b")
        _, calibrated = with_known_buoyancy(theta, calibrated, index, vehicle.net_buoyancy_N, tuning.buoyancy_sigma_N)
    reported = reported_parameters(model, motion)
    covariance, widened = fit.covariance[reported.square], calibrated[reported.square]
    k = theta[reported.rows[:2]]
    numbers = numbers_of(model, motion, theta, fit.covariance, calibrated)
    excited = excitation(fit, motion.side)
    evidence = Evidence(
        k=k,
        covariance=(fit.covariance + assessment.current.covariance(tuning.current_sigma_mps) + assessment.unmodeled)[
            reported.square
        ][:2, :2],
        excitation=excited,
        effective_samples=fit.effective_samples,
        noise=fit.sigmas[0] if math.isfinite(fit.sigmas[0]) else 0.0,
        added_mass_sigmas=(float(theta[-1]) - model.rigid)
        / max(1e-12, math.sqrt(widened[reported.mass, reported.mass])),
        converged=fit.converged,
        validation=assessment.validation,
        form=assessment.form,
        current=tuning.current_sigma_mps if model.axis in HORIZONTAL else 0.0,
        offset=_least_offset(theta, widened, reported) if model.axis in HORIZONTAL else 0.0,
    )
    reasons = tuple(reasons_against(evidence))
    return MotionResult(
        motion=motion.name,
        method=METHOD,
        coefficients=numbers,
        names=reported.names,
        covariance=covariance,
        samples=fit.samples,
        effective_samples=fit.effective_samples,
        identifiable=not reasons,
        reasons=reasons,
        speeds=(excited.low, excited.high),
        drag=_band(k, covariance[:2, :2], widened[:2, :2], excited.low, excited.high),
        methods=_methods(motion, assessment),
        quality=_quality(assessment),
    )


def _least_offset(theta: Array, covariance: Array, reported: ReportedParameters) -> float:
    """Magnitude of b minus three standard deviations [N]."""
    at = reported.names.index("b")
    return max(0.0, abs(float(theta[reported.rows[at]])) - 3.0 * math.sqrt(max(0.0, float(covariance[at, at]))))


def numbers_of(
    model: Model, motion: Motion, theta: Array, covariance: Array, calibrated: Array | None = None
) -> dict[str, Number]:
    """Coefficients of one motion from the parameters of its axis; a poorly known mass is omitted."""
    reported = reported_parameters(model, motion)
    block = covariance[reported.square]
    values = theta[reported.rows]
    values[reported.mass] -= model.rigid
    values = _within(values, block, reported)
    sigmas = _sigmas(block)
    wide = np.full(len(values), math.nan) if calibrated is None else _sigmas(calibrated[reported.square])
    numbers = {
        name: Number(value, std, std_calibrated, unit=unit)
        for name, value, std, std_calibrated, unit in zip(
            reported.names, values.tolist(), sigmas.tolist(), wide.tolist(), reported.units, strict=True
        )
    }
    if not 0.0 < numbers["added_mass"].std < MASS_SHARE * float(theta[-1]):
        del numbers["added_mass"]
    return numbers


def _sigmas(covariance: Array) -> Array:
    """Standard deviations: (p,), in the units of the parameters."""
    return array(np.sqrt(np.maximum(0.0, np.diag(covariance))))


def _within(values: Array, block: Array, reported: ReportedParameters) -> Array:
    """Coefficients within bounds, (p,), where the violation is within noise; a clear violation stays visible."""
    if np.any(values < np.array(reported.low) - 3.0 * _sigmas(block)):
        return values
    return bounded(values, block, reported.low, reported.high)


def _band(k: Array, covariance: Array, widened: Array, low: float, high: float) -> DragBand | None:
    if not high > low > 0.0:
        return None
    speed = np.linspace(low, high, SPEEDS)
    gradient = np.stack([speed**2, speed], axis=1)
    spread = [array(np.sqrt(np.maximum(0.0, np.sum(gradient @ C * gradient, axis=1)))) for C in (covariance, widened)]
    return DragBand(array(speed), array(gradient @ k), spread[0], spread[1])


def _methods(motion: Motion, assessment: Assessment) -> dict[str, dict[str, Number]]:
    model = assessment.fit.model
    out = {name: numbers_of(model, motion, *found) for name, found in assessment.online.items()}
    batch = fit_plateaus(assessment.plateaus.on_side(motion.side))
    if batch is not None:
        out["plateaus"] = _batch_numbers(batch, model)
    return out


def _batch_numbers(batch: BatchFit, model: Model) -> dict[str, Number]:
    known = coefficients(model.axis)
    sigmas = np.sqrt(np.diag(batch.covariance)).tolist()
    triples = zip(("k_q", "k_l", "b"), batch.theta.tolist(), sigmas, strict=True)
    return {name: Number(value, sigma, unit=known[name].unit) for name, value, sigma in triples}


def _quality(assessment: Assessment) -> dict[str, float]:
    fit, checked = assessment.fit, assessment.validation
    out = {
        "residual_std": fit.sigmas[0] if math.isfinite(fit.sigmas[0]) else fit.sigmas[1],
        "ljung_box": assessment.whiteness.statistic,
        "ljung_box_expected": assessment.whiteness.expected,
        "largest_inflation": float(fit.inflation.max()),
        "plateaus": float(len(assessment.plateaus.v)),
        "other_form": assessment.form.share if assessment.form.significant else 0.0,
        "lag_s": assessment.record.lag_s,
        "latency_s": assessment.record.latency_s,
        "lag_missing_s": assessment.lag.missing_s,
        "lag_missing_sigma_s": assessment.lag.sigma_s,
    }
    if math.isfinite(assessment.current.sigma):
        out |= {"current_mps": assessment.current.current, "current_sigma_mps": assessment.current.sigma}
    if checked is not None:
        out |= {"held_out_fit": checked.fit, "held_out_excess": checked.excess}
    return out


def unidentified(motion: Motion, reason: str) -> MotionResult:
    """Result of a motion without usable data."""
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
