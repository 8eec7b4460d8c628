"""Record of one axis to results of its motions: refinement, plateau fit, intervals, verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hindrax_core.text.digits import measured
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.axis_fit import FOUND_DELAY_S, AxisFit
from hindrax_ident.assess.influences import DIFFERENCES, INFLUENCES, LAG, LATENCY, MODEL, RUN
from hindrax_ident.assess.objections import Code, Objection, objection
from hindrax_ident.assess.posterior import Draws
from hindrax_ident.assess.quality import (
    CONTRADICTED,
    Evidence,
    Excitation,
    Validation,
    Whiteness,
    excitation,
    measured_speed,
    measurement_noise,
    reasons_against,
    validation,
    whiteness,
)
from hindrax_ident.assess.results import Contribution, DragBand, MotionResult, NextStep, Number
from hindrax_ident.assess.uncertainty_budget import ALL, Budget, budget_of
from hindrax_ident.fit.delay import fit_with_delays, fit_with_uneven_lag, lags_differ
from hindrax_ident.fit.disturbance_noise import common_noise
from hindrax_ident.fit.output_error import OutputErrorFit, refine, reweighted
from hindrax_ident.fit.output_error_problem import nearest_start
from hindrax_ident.fit.plateaus import Plateaus, measure
from hindrax_ident.fit.plateaus import fit as fit_plateaus
from hindrax_ident.fit.scores import slow_force_ratio
from hindrax_ident.fit.smoothing import with_smoothing
from hindrax_ident.model.model_parameters import (
    OnlineEstimates,
    Prior,
    ReportedParameters,
    bounded,
    reported_parameters,
)
from hindrax_ident.model.motion_model import HORIZONTAL, Model, Motion, axis_units, coefficient_units
from hindrax_ident.records.axis_record import LATER, Record
from hindrax_ident.remedies import FLY_TWICE, Remedy
from hindrax_ident.tuning import Tuning

SPEEDS = 21
CONTRADICTION_SIGMAS = 5.0
"""Water that is not the model has shown delays of four that were none."""
LEAST_DELAY_S = 0.005
"""Error of a delay below which it is left alone."""
BOUND_SIGMAS = 3.0
"""Deviations beyond a bound from which a value is not due to noise, and is shown as it is."""
MASS_SHARE = 0.3
"""Relative standard deviation above which the mass is not reported."""
LEAST_CONTRIBUTION = 0.01
"""Contribution, relative to the largest, below which a row of a budget is left out."""
METHOD = "output-error"
MEANS = {1: "a moving mean", 2: "a filter forward and backward"}
"""What leaves the sum of so many means (`Record.means`)."""


@dataclass(frozen=True, slots=True)
class Assessment:
    """Final assessment of one axis: for the report, beyond the results.

    Covariances (p, p): `noise` of the fit alone; that of `fit` with the influences redrawn in each run; `separable`
    with all but those that scale every force alike; `calibrated` with all. `draws`: of the posterior of the influences
    and of the noise.
    """

    record: Record
    fit: OutputErrorFit
    calibrated: Array
    separable: Array
    budget: Budget
    draws: Draws
    noise: Array
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
    prior: Prior
    online: OnlineEstimates
    moved: bool


def draft(
    vehicle: Vehicle, model: Model, record: Record, prior: Prior, online: OnlineEstimates, *, tuning: Tuning
) -> DraftFit:
    """Refine a record from the last online estimate, or from the prior where that predicts it better.

    Parameters
    ----------
    vehicle
        Whose influences decide whether lag and latency contradict its file.
    model
        Model of the axis, with p parameters.
    record
        Record of the axis.
    prior
        Of the parameters.
    online
        Estimates of the online methods, by name; the last one is a start.
    tuning
        `lag_doubt_s`: deviation of lag and latency where neither is known; None: refitted only where they contradict.

    Returns
    -------
    DraftFit
        Record (with the delays found), fit, prior and online estimates.

    Raises
    ------
    ValueError
        When the record holds too few samples.
    """
    live = [theta for theta, _ in list(online.values())[-1:]]
    start = nearest_start(model, record, [*live, prior.values])
    if tuning.lag_doubt_s is not None:
        record, fit = fit_with_delays(record, start, model, prior, tuning.lag_doubt_s)
        record, fit = with_smoothing(record, fit, model, prior, tuning.lag_doubt_s)
        return DraftFit(record, fit, prior, online, moved=False)
    first = DraftFit(record, refine(model, record, start, prior), prior, online, moved=False)
    return _with_delays(vehicle, first, tuning)


def combine_drafts(drafts: Mapping[int, DraftFit]) -> dict[int, DraftFit]:
    """Drafts of all axes of a run, refitted with a common thruster noise."""
    known = {axis: one.fit for axis, one in drafts.items() if len(one.record.effort)}
    try:
        noises = common_noise(known)
        better = {axis: reweighted(known[axis], noise, drafts[axis].prior) for axis, noise in noises.items()}
    except ValueError:  # one of them is no motion of the model; each keeps its own noise
        better = {}
    return {axis: replace(one, fit=better.get(axis, one.fit)) for axis, one in drafts.items()}


def assess(
    vehicle: Vehicle,
    drafts: Mapping[int, DraftFit],
    *,
    tuning: Tuning,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[dict[int, Assessment], dict[int, ValueError]]:
    """Bands of the drafts of a run from their uncertainty budgets, and why there are none.

    All motions were flown in one water, so what one record shows of it counts for all: the log evidence of the waters
    is summed over the axes, and each budget is taken again in that water. So does what their thrusters share.

    Parameters
    ----------
    vehicle
        Of the run.
    drafts
        By axis (0 to 5).
    tuning
        Doubts in stamps, lag and thrust.
    progress
        Called with a sentence about what begins.

    Returns
    -------
    tuple[dict[int, Assessment], dict[int, ValueError]]
        By axis: what was assessed, and the errors of what could not be.
    """
    budgets: dict[int, Budget] = {}
    failed: dict[int, ValueError] = {}
    for index, (axis, one) in enumerate(drafts.items(), start=1):
        progress(f"uncertainty of {AXES[axis]}, {index} of {len(drafts)}")
        try:
            budgets[axis] = budget_of(_axis_fit(vehicle, one, tuning))
        except ValueError as error:
            failed[axis] = error
    votes = array(sum(one.vote for one in budgets.values()))
    found: dict[int, Assessment] = {}
    for axis, budget in budgets.items():
        others = [one for one in budgets.values() if one is not budget]
        try:
            told = budget.told_by(others).in_water(array(votes - budget.vote + budget.evidence))
            found[axis] = _assess(drafts[axis], told)
        except ValueError as error:
            failed[axis] = error
    return found, failed


def _axis_fit(vehicle: Vehicle, draft_fit: DraftFit, tuning: Tuning) -> AxisFit:
    fit = draft_fit.fit
    if tuning.thrust_doubt is not None and tuning.thrust_doubt > 0.0:
        fit = replace(fit, covariance=slow_force_ratio(fit) * fit.covariance)
    return AxisFit(vehicle, draft_fit.record, fit, tuning, draft_fit.moved)


def _assess(draft_fit: DraftFit, budget: Budget) -> Assessment:
    record, fit, prior, online = draft_fit.record, budget.case.fit, draft_fit.prior, draft_fit.online
    own = budget.band_of_run()
    return Assessment(
        record=record,
        fit=replace(fit, covariance=fit.covariance + own),
        calibrated=fit.covariance + budget.band(),
        separable=fit.covariance + budget.band((RUN, MODEL)),
        budget=budget,
        draws=budget.draws(fit.covariance),
        noise=fit.covariance,
        plateaus=measure(record),
        whiteness=whiteness(fit),
        validation=validation(record, fit, prior),
        online={name: (theta, covariance + own) for name, (theta, covariance) in online.items()},
    )


def _with_delays(vehicle: Vehicle, draft_fit: DraftFit, tuning: Tuning) -> DraftFit:
    """Fit the delays as well, where the record contradicts those of the vehicle file.

    Residuals of a fit with wrong delays show that they are wrong, but not by how much: the mass has taken their place,
    down to its bound. A mass below that of the body is such a contradiction itself.
    """
    record, fit = draft_fit.record, draft_fit.fit
    # With one lag: a latency looks like lags that differ, whose prior is wider, and would hide behind them.
    rows = [one for one in INFLUENCES if one.name != DIFFERENCES]
    budget = budget_of(AxisFit(vehicle, record, fit, tuning, draft_fit.moved), rows)
    missing = (budget.found(name) for name in (LAG, LATENCY))
    off = [abs(error_s) > max(LEAST_DELAY_S, CONTRADICTION_SIGMAS * sigma_s) for error_s, sigma_s in missing]
    if not any(off) and not _below_body(fit.theta[-1], fit.covariance[-1, -1], fit.model.rigid):
        return draft_fit
    record, fit = fit_with_delays(record, fit.theta, fit.model, draft_fit.prior, FOUND_DELAY_S)
    if lags_differ(record, fit, FOUND_DELAY_S):
        record, fit = fit_with_uneven_lag(record, fit, draft_fit.prior, FOUND_DELAY_S)
    return replace(draft_fit, record=record, fit=fit, moved=True)


def _below_body(mass: float, variance: float, rigid: float) -> bool:
    """Whether a total mass is clearly below that of the body, for the noise of its record."""
    return mass < rigid - BOUND_SIGMAS * math.sqrt(max(0.0, variance))


def result_of(motion: Motion, assessment: Assessment) -> MotionResult:
    """Result of one motion of an axis."""
    fit, model = assessment.fit, assessment.fit.model
    theta, calibrated = fit.theta, assessment.calibrated
    reported = reported_parameters(model, motion)
    covariance, widened = fit.covariance[reported.square], calibrated[reported.square]
    k = theta[reported.rows[:2]]
    excited = excitation(fit, motion.side)
    drag = _drag(motion, assessment, excited)
    true = _corrected(assessment, reported)
    interval = assessment.draws.interval(true)
    # The sensitivities are those of a fit that is off by this share: to first order in it is the correction known.
    doubt = drag.off * (interval.center - theta[reported.rows] + _own_mass(model, reported))
    interval = interval.widened(np.abs(doubt))
    numbers = {
        name: replace(number, corrected=interval.at(reported.names.index(name)))
        for name, number in numbers_of(model, motion, theta, fit.covariance, calibrated).items()
    }
    evidence = Evidence(
        k=k,
        covariance=assessment.separable[reported.square][:2, :2],
        excitation=excited,
        effective_samples=fit.effective_samples,
        noise=fit.sigmas[0] if math.isfinite(fit.sigmas[0]) else 0.0,
        added_mass_sigmas=(float(theta[-1]) - model.rigid)
        / max(1e-12, math.sqrt(widened[reported.mass, reported.mass])),
        converged=fit.converged,
        validation=assessment.validation,
        drag_std=drag.separable_std,
        largest=drag.largest,
        current=assessment.budget.prior("current"),
        offset=_least_offset(theta, widened, reported) if model.axis in HORIZONTAL else 0.0,
        measured_speed=measured_speed(assessment.record, motion.side),
        measurement_noise=measurement_noise(assessment.record),
        units=axis_units(model.axis),
    )
    reasons = tuple(reasons_against(evidence))
    return MotionResult(
        motion=motion.name,
        method=METHOD,
        coefficients=numbers,
        names=reported.names,
        covariance=covariance,
        covariance_calibrated=widened,
        covariance_corrected=assessment.draws.covariance(true) + np.outer(doubt, doubt),
        samples=fit.samples,
        effective_samples=fit.effective_samples,
        identifiable=not reasons,
        reasons=reasons,
        speeds=(excited.low, excited.high),
        drag=drag.band,
        methods=_methods(motion, assessment),
        quality=_quality(assessment),
        budget={**_budget(assessment, reported), "drag": drag.budget},
        next_step=drag.next_step,
        warnings=(
            *_at_bounds(theta, covariance, model.rigid, reported),
            *_other_mass(model, theta, covariance, widened, reported),
            *(() if any(one.code in CONTRADICTED for one in reasons) else _causes(assessment)),
            *_unseen(assessment, reported, drag),
        ),
    )


def _causes(assessment: Assessment) -> tuple[Objection, ...]:
    """Objections to smoothed velocities, to thrust that is no lag of its command, and to influences that it shows."""
    record, smoothed = assessment.record, list[Objection]()
    if record.smoothing_s > 0.0:
        smoothed.append(objection(Code.SMOOTHED_VELOCITY, smoothing_s=record.smoothing_s))
    if record.means:
        how, over_s = MEANS[len(record.means)], record.means[0][1]
        smoothed.append(objection(Code.MEAN_VELOCITY, how=how, mean_s=over_s))
    if record.filter_doubt_s > 0.0:
        smoothed.append(objection(Code.PERHAPS_SMOOTHED, filter_s=record.filter_doubt_s))
    if any(record.later_s):
        goes_s, turns_s = record.later_s
        smoothed.append(objection(Code.UNEVEN_LAG, goes_s=goes_s, turns_s=turns_s))
    if record.ramps_s > 0.0:
        smoothed.append(objection(Code.RAMPING_THRUST, ramp_s=record.ramps_s))
    return (*smoothed, *assessment.budget.warnings())


def _corrected(assessment: Assessment, reported: ReportedParameters) -> Array:
    """Draws (n, coefficients) of what the coefficients are: the fit less its errors, within their bounds.

    Where the fit itself is beyond a bound, the contradiction stays visible.
    """
    fit, draws = assessment.fit, assessment.draws
    errors = draws.influences @ assessment.budget.shifts[reported.rows].T + draws.noise[:, reported.rows]
    fitted = fit.theta[reported.rows]
    own, low = _own_mass(fit.model, reported), np.array(reported.low)
    return array(np.maximum(fitted - own - errors, np.where(fitted - own >= low, low, -np.inf)))


def _own_mass(model: Model, reported: ReportedParameters) -> Array:
    """What a parameter has of the body: (coefficients,); the total mass has its own one, the others have nothing."""
    return np.where(np.arange(len(reported.names)) == reported.mass, model.rigid, 0.0)


def _at_bounds(theta: Array, covariance: Array, rigid: float, reported: ReportedParameters) -> tuple[Objection, ...]:
    """One objection for each coefficient that is reported at its bound, and what the record alone would make of it."""
    values = theta[reported.rows]
    values[reported.mass] -= rigid
    sigmas, within = _sigmas(covariance), _within(values, covariance, reported)
    return tuple(
        objection(Code.AT_BOUND, name=name, bound=least, unit=unit, shown=measured(value, sigma))
        for name, unit, least, value, sigma, shown in zip(
            reported.names, reported.units, reported.low, values.tolist(), sigmas.tolist(), within.tolist(), strict=True
        )
        if shown == least and value < least
    )


def _other_mass(
    model: Model, theta: Array, covariance: Array, calibrated: Array, reported: ReportedParameters
) -> tuple[Objection, ...]:
    """Objection to the mass of the vehicle file, where the record has clearly less than the body alone."""
    at = reported.mass, reported.mass
    if not _below_body(theta[-1], covariance[at], model.rigid):
        return ()
    shown = measured(theta[-1], math.sqrt(max(0.0, calibrated[at])))
    unit, key = reported.units[reported.mass], "inertia_kgm2" if model.axis >= 3 else "mass_kg"
    return (objection(Code.OTHER_MASS, shown=shown, unit=unit, known=model.rigid, key=key),)


def _unseen(assessment: Assessment, reported: ReportedParameters, drag: _Drag) -> tuple[Objection, ...]:
    """Influences that no record shows and that make most of the interval of drag (highest speed) or added mass."""
    mass = int(reported.rows[reported.mass])
    of_mass = assessment.budget.shifts[mass], float(assessment.noise[mass, mass])
    return assessment.budget.unseen({"the drag": drag.top, "the added mass": of_mass})


def _least_offset(theta: Array, covariance: Array, reported: ReportedParameters) -> float:
    """Magnitude of b minus three standard deviations [N]."""
    at = reported.names.index("b")
    return max(0.0, abs(float(theta[reported.rows[at]])) - 3.0 * math.sqrt(max(0.0, float(covariance[at, at]))))


def numbers_of(
    model: Model, motion: Motion, theta: Array, covariance: Array, calibrated: Array | None = None
) -> dict[str, Number]:
    """Coefficients of one motion from the parameters of its axis; a poorly known mass is omitted.

    Parameters
    ----------
    model
        Of the axis, with p parameters.
    motion
        Axis and direction.
    theta : (p,)
        Parameters; the last one is the total mass.
    covariance, calibrated : (p, p)
        Of the parameters by this record alone, and with all influences; None: not known.

    Returns
    -------
    dict[str, Number]
        By coefficient (k_q, k_l, b, added_mass), within bounds where noise explains the violation. The added mass is
        the total less the body's own; it is left out where its deviation exceeds MASS_SHARE of the total.
    """
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
    if np.any(values < np.array(reported.low) - BOUND_SIGMAS * _sigmas(block)):
        return values
    return bounded(values, block, reported.low)


class _Drag(NamedTuple):
    """Drag force of a motion; `separable_std`: at the highest speed, without what scales every force alike.

    `largest`: the largest contribution to that.
    """

    band: DragBand | None
    separable_std: float
    largest: Contribution
    budget: list[Contribution]
    next_step: NextStep
    off: float
    """Share of the drag at the highest speed that is corrected [-]."""
    top: tuple[Array, float]
    """Of the drag at the highest speed: sensitivity to the influences (m,), and variance by the noise."""


def _drag(motion: Motion, assessment: Assessment, excited: Excitation) -> _Drag:
    """Drag D = k_q v^2 + k_l v at speeds (n,) between the lowest and the highest that were flown, and what it is worth.

    Its error is a linear function of those of the parameters, gradient (n, p), and of the influences, sensitivity
    (n, m): so intervals are variances of both, and the posterior of D is D of the fit less these errors, draw by draw.
    """
    fit, budget, draws = assessment.fit, assessment.budget, assessment.draws
    k_q, k_l, *_ = reported_parameters(fit.model, motion).rows
    speed = np.linspace(excited.low, excited.high, SPEEDS)
    gradient = np.zeros((SPEEDS, len(fit.theta)))
    gradient[:, k_q], gradient[:, k_l] = speed**2, speed
    noise, own = (np.maximum(0.0, np.sum(gradient @ C * gradient, axis=1)) for C in (assessment.noise, fit.covariance))
    sensitivity = budget.drag_sensitivity(array(gradient), array(speed * (motion.side or 1)))
    wide, separable = (np.sqrt(noise + budget.variance(sensitivity, scopes)) for scopes in (ALL, (RUN, MODEL)))
    force = gradient @ fit.theta
    corrected = draws.interval(force - draws.influences @ sensitivity.T - draws.noise @ gradient.T)
    off = min(1.0, abs(float((corrected.center[-1] - force[-1]) / force[-1]))) if force[-1] else 1.0
    corrected = corrected.widened(off * np.abs(corrected.center - force))
    band = DragBand(array(speed), force, array(np.sqrt(own)), array(wide), corrected)
    known = excited.high > excited.low > 0.0
    top, variance = sensitivity[-1], float(noise[-1])
    largest = _with_noise(variance, budget.contributions(top, (RUN, MODEL)))[0]
    rows_of_top = _with_noise(variance, budget.contributions(top))
    remaining = variance + float(top @ budget.covariance @ top)
    next_step = _next_step(variance, remaining, budget.variance_without(top))
    return _Drag(band if known else None, float(separable[-1]), largest, rows_of_top, next_step, off, (top, variance))


def _next_step(noise: float, variance: float, without: Mapping[Remedy, float]) -> NextStep:
    """The remedy that leaves the least of a variance, of which `noise` is that of the record."""
    left = {remedy: noise + rest for remedy, rest in without.items()} | {FLY_TWICE: variance - 0.5 * noise}
    remedy = min(left, key=lambda one: left[one])
    return NextStep(remedy, math.sqrt(max(0.0, left[remedy])))


def _with_noise(variance: float, rows: list[Contribution]) -> list[Contribution]:
    """Rows of a budget that count, with that of the noise, largest first."""
    noise = Contribution("noise of the record", math.sqrt(max(0.0, variance)), "fly longer, or more runs")
    ordered = sorted([noise, *rows], key=lambda row: -row.std)
    return [row for row in ordered if row.std >= LEAST_CONTRIBUTION * ordered[0].std]


def _budget(assessment: Assessment, reported: ReportedParameters) -> dict[str, list[Contribution]]:
    """Contributions to each coefficient of a motion, largest first."""
    shifts, noise = assessment.budget.shifts, assessment.noise
    return {
        name: _with_noise(float(noise[at, at]), assessment.budget.contributions(shifts[at]))
        for name, at in zip(reported.names, reported.rows.tolist(), strict=True)
    }


def _methods(motion: Motion, assessment: Assessment) -> dict[str, dict[str, Number]]:
    model = assessment.fit.model
    out = {name: numbers_of(model, motion, *found) for name, found in assessment.online.items()}
    batch = fit_plateaus(assessment.plateaus.on_side(motion.side))
    if batch is not None:
        triples = zip(("k_q", "k_l", "b"), batch.theta.tolist(), _sigmas(batch.covariance).tolist(), strict=True)
        units = coefficient_units(model.axis)
        out["plateaus"] = {name: Number(value, sigma, unit=units[name]) for name, value, sigma in triples}
    return out


def _quality(assessment: Assessment) -> dict[str, float]:
    fit, checked = assessment.fit, assessment.validation
    out = {
        "residual_std": fit.sigmas[0] if math.isfinite(fit.sigmas[0]) else fit.sigmas[1],
        "ljung_box": assessment.whiteness.statistic,
        "ljung_box_expected": assessment.whiteness.expected,
        "largest_inflation": float(fit.inflation.max()),
        "plateaus": float(len(assessment.plateaus.v)),
        "lag_s": assessment.record.lag_s,
        "latency_s": assessment.record.latency_s,
    }
    names = "smoothing_s", "filter_doubt_s", "filter_hint_s", "ramps_s"
    filters_s = {name: getattr(assessment.record, name) for name in names}
    if means := assessment.record.means:
        filters_s["mean_over_s" if len(means) == 1 else "flat_over_s"] = means[0][1]
    out |= {name: time_s for name, time_s in filters_s.items() if time_s > 0.0}
    if any(later_s := assessment.record.later_s):
        out |= dict(zip(LATER, later_s, strict=True))
    current, sigma = assessment.budget.found("current")
    if math.isfinite(current):
        out |= {"current_mps": current, "current_sigma_mps": sigma}
    if checked is not None:
        out |= {"held_out_fit": checked.fit, "held_out_excess": checked.excess}
        out |= {f"held_out_{name}": error for name, error in checked.prediction.errors.items()}
    return out


def unidentified(motion: Motion, reason: Objection) -> MotionResult:
    """Result of a motion without usable data."""
    return MotionResult(motion.name, "none", {}, identifiable=False, reasons=(reason,))
