"""Quality of a result: excitation, whiteness, prediction of a held-out part, and the verdict.

What speaks against a result has a code and the number behind it; its sentence is in `objections`.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hindrax_core.text.digits import measured
from hindrax_ident.arrays import Array, largest
from hindrax_ident.assess.objections import Code, Objection, objection
from hindrax_ident.assess.prediction import WINDOW_S, Prediction, predict, windows_of
from hindrax_ident.assess.results import Contribution
from hindrax_ident.fit.autoregression import autocorrelation, ljung_box
from hindrax_ident.fit.output_error import OutputErrorFit, retrained
from hindrax_ident.model.model_parameters import Prior
from hindrax_ident.model.motion_model import Model
from hindrax_ident.records.axis_record import EMPTY, Record, Series, Stretch

FEWEST_EFFECTIVE = 10.0
FORCE_SHARE = 0.20
"""Deviation of an identified drag, as a share of it: twice as good as a guess from the envelope [-]."""
UNKNOWN_SHARE = 1.0
"""Beyond it a number would pretend to be one."""
SPLIT_SHARE = 0.25
LEAST_FIT = 0.5
OFFSET_SHARE = 0.2
SAME_SPEED = 0.1
ONE_SPEED_SHARE = 0.7
LINEAR_SHARE = 0.1
HELD_OUT_SHARE = 0.25
STILL = Series(EMPTY, EMPTY)
MOST_HELD_OUT = 0.51
"""Share of the time that the last of several runs may have; two runs are seldom of one length."""
HELD_OUT_PAUSE_S = 300.0
"""A longer pause divides runs, of which the last is held out."""

CONTRADICTED = (
    Code.NOT_CONVERGED,
    Code.HARDLY_MOVED,
    Code.UNEXPLAINED_MOTION,
    Code.NO_DRAG,
    Code.NEGATIVE_DRAG,
    Code.MASS_BELOW_BODY,
    Code.POOR_PREDICTION,
)
"""Reasons by which the fit is none of this motion: what its residuals resemble is then no evidence of a cause."""

MOVED = 2.0
"""Speed, in the noise of one measurement, above which a record holds a motion."""


@dataclass(frozen=True, slots=True)
class Excitation:
    """Excitation in one direction: 5th percentile and the largest of the speeds in motion [m/s, rad/s].

    `share_at_one_speed`: share of the time above a tenth of the highest speed that was at nearly one speed.
    """

    low: float
    high: float
    share_at_one_speed: float = 0.0


def excitation(fit: OutputErrorFit, side: int) -> Excitation:
    """Excitation from the fitted motion, which has no noise."""
    v, steps = fit.linear.path.v, fit.problem.grid.steps_s
    own = np.abs(v) if side == 0 else np.maximum(0.0, side * v)
    high = largest(v, side)
    moving = own > 0.1 * max(high, 1e-12)
    low = float(np.percentile(own[moving], 5.0)) if moving.any() else 0.0
    return Excitation(low, high, _share_at_one_speed(own[moving], steps[moving]))


def measured_speed(record: Record, side: int) -> float:
    """Highest speed in a record but for spikes: in one direction, or in both [m/s, rad/s]."""
    return largest(record.mean_velocities(), side)


def measurement_noise(record: Record) -> float:
    """Noise of one velocity, from what it differs from the next; 0 where positions are measured [m/s, rad/s]."""
    changes = np.diff(record.velocity.y)
    return float(np.std(changes)) / math.sqrt(2.0) if len(changes) else 0.0


def _share_at_one_speed(speeds: Array, steps_s: Array) -> float:
    """Largest share of the time within a tenth of one speed [-]."""
    if not len(speeds):
        return 0.0
    order = np.argsort(speeds)
    sorted_, spent = speeds[order], np.concatenate([[0.0], np.cumsum(steps_s[order])])
    ends = np.searchsorted(sorted_, sorted_ * (1.0 + SAME_SPEED) / (1.0 - SAME_SPEED), side="right")
    return float((spent[ends] - spent[:-1]).max() / max(1e-12, spent[-1]))


@dataclass(frozen=True, slots=True)
class Whiteness:
    """Autocorrelation of the residuals from lag 0, and the Ljung-Box statistic with its expectation."""

    autocorrelation: Array
    statistic: float
    expected: float


def whiteness(fit: OutputErrorFit) -> Whiteness:
    """Whiteness of the innovations of the main channel."""
    problem = fit.problem
    own = problem.channel == problem.main
    pieces = [fit.linear.r[span][own[span]] for span in problem.spans]
    statistic, expected = ljung_box(pieces)
    return Whiteness(autocorrelation(pieces), statistic, expected)


@dataclass(frozen=True, slots=True)
class Validation:
    """Prediction of the last part of a record by a model fitted to the first, over windows of WINDOW_S.

    `fit` is 1 minus the ratio of the error to the motion (root mean squares), over whole stretches: 1 is perfect, 0 no
    better than the mean. `excess` is the ratio of that error to what was to be expected: that of the fitted part, and
    what the first part alone does not know of the coefficients.
    """

    prediction: Prediction
    fit: float
    excess: float


def validation(record: Record, fit: OutputErrorFit, prior: Prior) -> Validation | None:
    """Predict a part of a record by a model fitted to the rest.

    Parameters
    ----------
    record
        With its stretches.
    fit
        Of all of it: where the fit of the first part begins.
    prior
        Of the parameters.

    Returns
    -------
    Validation | None
        Over the last run of several, or over the last quarter of the motion of one; None when a part is too short.
    """
    first, last = held_out(record.stretches, record.motion())
    try:
        theta, covariance, sigmas = retrained(fit, record.with_stretches(first), prior)
        whole = predict(fit.model, theta, record.with_stretches(last))
        windows = windows_of(last, WINDOW_S)
        shown = predict(fit.model, theta, record.with_stretches(windows)) if windows else whole
    except ValueError:
        return None
    motion, error = float(np.std(whole.measured)), whole.rmse(whole.predicted)
    unknown = _unknown(fit.model, theta, covariance, record.with_stretches(last), whole)
    expected = math.hypot(sigmas[1 if whole.of_position else 0], unknown)
    return Validation(
        shown,
        fit=1.0 - error / motion if motion > 0.0 else 0.0,
        excess=error / max(expected, 1e-12),
    )


def _unknown(model: Model, theta: Array, covariance: Array, record: Record, predicted: Prediction) -> float:
    """Root mean square of what one deviation of each combination of the parameters changes of a prediction."""
    sizes, axes = np.linalg.eigh(covariance)
    changes = (math.sqrt(max(0.0, size)) * axis for size, axis in zip(sizes.tolist(), axes.T, strict=True))
    total = 0.0
    for change in changes:
        try:
            other = predict(model, theta + change, record)
        except ValueError:
            return math.inf
        total += float(np.mean((other.predicted - predicted.predicted) ** 2))
    return math.sqrt(total)


def held_out(stretches: tuple[Stretch, ...], moved: Series = STILL) -> tuple[tuple[Stretch, ...], tuple[Stretch, ...]]:
    """Split stretches so that the later part has a quarter of the motion; a stretch may be cut.

    A quarter of the clock may be one in which the axis rested, and then any error is more than its motion. Of several
    runs the later part is the last run, where that is no more than half of the time.

    Parameters
    ----------
    stretches
        In time order.
    moved
        Integral of the squared velocity over time (see `Record.motion`); without it a quarter of the time is held out.

    Returns
    -------
    tuple[tuple[Stretch, ...], tuple[Stretch, ...]]
        The first part and the part that is held out.
    """
    total = sum(one.end_s - one.start_s for one in stretches)
    runs = [at for at in range(1, len(stretches)) if stretches[at].start_s - stretches[at - 1].end_s > HELD_OUT_PAUSE_S]
    if runs and sum(one.end_s - one.start_s for one in stretches[runs[-1] :]) <= MOST_HELD_OUT * total:
        return stretches[: runs[-1]], stretches[runs[-1] :]
    cut_s = _cut_s(stretches, moved)
    first = tuple(replace(one, end_s=min(one.end_s, cut_s)) for one in stretches if one.start_s < cut_s)
    last = tuple(replace(one, start_s=max(one.start_s, cut_s)) for one in stretches if one.end_s > cut_s)
    return first, last


def _cut_s(stretches: Sequence[Stretch], moved: Series) -> float:
    """Time at which all but HELD_OUT_SHARE of the motion, or of the time, is over."""
    if not len(moved) or not moved.y[-1] > 0.0:
        ends = np.cumsum([0.0, *(one.end_s - one.start_s for one in stretches)])
        moved = Series(
            np.ravel([[one.start_s, one.end_s] for one in stretches]),
            np.ravel(list(itertools.pairwise(ends.tolist()))),
        )
    wanted = (1.0 - HELD_OUT_SHARE) * float(moved.y[-1])
    at = int(np.searchsorted(moved.y, wanted))
    (before_s, after_s), (less, more) = moved.t[at - 1 : at + 1].tolist(), moved.y[at - 1 : at + 1].tolist()
    return float(before_s + (after_s - before_s) * (wanted - less) / (more - less))


@dataclass(frozen=True, slots=True)
class Evidence:
    """Evidence for the verdict on one motion: k_q and k_l, (2,), their covariance, (2, 2), and further numbers."""

    k: Array
    covariance: Array
    excitation: Excitation
    effective_samples: float
    noise: float
    added_mass_sigmas: float
    converged: bool
    validation: Validation | None
    drag_std: float
    """Standard deviation of the drag at the highest speed, without what scales every force alike [N, N m]."""
    largest: Contribution
    """The largest contribution to it."""
    current: float = 0.0
    """Prior standard deviation of a current along the axis [m/s]."""
    offset: float = 0.0
    """Smallest constant force along a horizontal axis consistent with the record [N]."""
    measured_speed: float = 0.0
    """Highest speed in the record itself, whatever the fit makes of it [m/s, rad/s]."""
    measurement_noise: float = 0.0
    """Noise of one velocity in the record itself [m/s, rad/s]."""
    units: tuple[str, str] = ("m/s", "N")
    """Of the speed and of the drag."""


def reasons_against(evidence: Evidence) -> list[Objection]:
    """Return what speaks against k_q and k_l; empty when both are identified."""
    high, (unit, force_unit) = evidence.excitation.high, evidence.units
    gradient = np.array([high * high, high])
    force = float(evidence.k @ gradient)
    out = []
    if not evidence.converged:
        out.append(objection(Code.NOT_CONVERGED))
    if evidence.effective_samples < FEWEST_EFFECTIVE:
        out.append(objection(Code.FEW_SAMPLES, found=evidence.effective_samples, wanted=FEWEST_EFFECTIVE))
    if not high > evidence.noise:
        moved = evidence.measured_speed > MOVED * evidence.measurement_noise
        slow = Code.UNEXPLAINED_MOTION if moved else Code.HARDLY_MOVED
        return [*out, objection(slow, speed=evidence.measured_speed, unit=unit, explained=high)]
    if not force > 0.0:
        return [*out, objection(Code.NO_DRAG, speed=high, unit=unit, drag=force, force_unit=force_unit)]
    share, largest = evidence.drag_std / force, evidence.largest
    if share > FORCE_SHARE:
        poor = Code.POORLY_KNOWN_DRAG if share < UNKNOWN_SHARE else Code.UNKNOWN_DRAG
        by_most = {"influence": largest.influence, "remedy": largest.remedy}
        out.append(objection(poor, share=share, wanted=FORCE_SHARE, **by_most))
    return out + _separation(evidence, force) + _physics(evidence, force)


def _separation(evidence: Evidence, force: float) -> list[Objection]:
    """What speaks against k_q and k_l each, where their sum may be known well."""
    low, high, unit = evidence.excitation.low, evidence.excitation.high, evidence.units[0]
    if 2.0 * evidence.current > SPLIT_SHARE * high:
        current = evidence.current
        return [objection(Code.CURRENT, speed=high, unit=unit, current=current, share=2.0 * current / high)]
    if evidence.excitation.share_at_one_speed > ONE_SPEED_SHARE:
        return [objection(Code.ONE_SPEED, share=evidence.excitation.share_at_one_speed)]
    shares = np.sqrt(np.maximum(0.0, np.diag(evidence.covariance))) * np.array([high * high, high]) / force
    if shares.max() <= SPLIT_SHARE:
        return []
    return [objection(Code.NOT_SEPARATED, low=low, high=high, unit=unit, share=float(shares.max()))]


def _physics(evidence: Evidence, force: float) -> list[Objection]:
    """What no body in water does, and a model that does not predict."""
    out = []
    sigma = math.sqrt(max(0.0, float(evidence.covariance[0, 0])))
    if evidence.k[0] < -3.0 * sigma:
        out.append(objection(Code.NEGATIVE_DRAG, name="k_q", shown=measured(evidence.k[0], sigma)))
    sigma = math.sqrt(max(0.0, float(evidence.covariance[1, 1])))
    if evidence.k[1] < -3.0 * sigma and -evidence.k[1] * evidence.excitation.high > LINEAR_SHARE * force:
        out.append(objection(Code.NEGATIVE_DRAG, name="k_l", shown=measured(evidence.k[1], sigma)))
    if evidence.added_mass_sigmas < -3.0:
        out.append(objection(Code.MASS_BELOW_BODY, sigmas=-evidence.added_mass_sigmas))
    if evidence.offset > OFFSET_SHARE * force:
        out.append(objection(Code.CONSTANT_FORCE, force_N=evidence.offset, share=evidence.offset / force))
    checked = evidence.validation
    if checked is not None and checked.fit < LEAST_FIT and checked.excess > 1.5:
        out.append(objection(Code.POOR_PREDICTION, fit=checked.fit))
    return out
