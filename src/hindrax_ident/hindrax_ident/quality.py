"""How far a result may be trusted: excitation, whiteness, prediction of what was held out, and the verdict.

A verdict is never a feeling: each reason against a result is a sentence with the number that made it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hindrax_ident.arrays import Array, array
from hindrax_ident.belief import Belief
from hindrax_ident.misfit import FormCheck
from hindrax_ident.noise import autocorrelation, ljung_box
from hindrax_ident.problem import Linear, Problem, linearize, pose, restarted, whitener_of
from hindrax_ident.record import Record, Stretch
from hindrax_ident.refine import Fit, retrained
from hindrax_ident.simulate import Trajectory
from hindrax_ident.whitening import Noise

FEWEST_EFFECTIVE = 10.0
FORCE_SHARE = 0.10
SPLIT_SHARE = 0.25
LEAST_FIT = 0.5
FORM_SHARE = 0.1
OFFSET_SHARE = 0.2
SAME_SPEED = 0.1
ALIKE_SHARE = 0.7
LINEAR_SHARE = 0.1
HELD_OUT_SHARE = 0.25


@dataclass(frozen=True, slots=True)
class Excitation:
    """What the motion offered on one side: speeds between the 5th and 98th percentile of those that moved [m/s, rad/s].

    `moving_s` is the time spent above a tenth of the highest speed, `alike` the part of it at nearly one speed,
    `acceleration` the root mean square acceleration.
    """

    low: float
    high: float
    moving_s: float
    acceleration: float
    both_ways: bool
    alike: float = 0.0


def excitation(fit: Fit, side: int) -> Excitation:
    """Read the speeds off the fitted motion, which has no noise."""
    v, steps = fit.linear.path.v, fit.problem.grid.steps_s
    own = np.abs(v) if side == 0 else np.maximum(0.0, side * v)
    high = float(np.percentile(own, 98.0)) if len(own) else 0.0
    moving = own > 0.1 * max(high, 1e-12)
    low = float(np.percentile(own[moving], 5.0)) if moving.any() else 0.0
    rise = np.divide(np.diff(v, prepend=v[:1]), steps, out=np.zeros_like(v), where=steps > 0.0)
    both = bool(np.percentile(v, 98.0) > 0.1 * high and np.percentile(v, 2.0) < -0.1 * high)
    moving_s = float(steps[moving].sum())
    return Excitation(low, high, moving_s, float(np.sqrt(np.mean(rise**2))), both, _alike(own[moving], steps[moving]))


def _alike(speeds: Array, steps_s: Array) -> float:
    """Largest part of the time that is spent within a tenth of one speed."""
    if not len(speeds):
        return 0.0
    order = np.argsort(speeds)
    sorted_, spent = speeds[order], np.concatenate([[0.0], np.cumsum(steps_s[order])])
    ends = np.searchsorted(sorted_, sorted_ * (1.0 + SAME_SPEED) / (1.0 - SAME_SPEED), side="right")
    return float((spent[ends] - spent[:-1]).max() / max(1e-12, spent[-1]))


@dataclass(frozen=True, slots=True)
class Whiteness:
    """Autocorrelation of the residuals from lag 0 on, and the Ljung-Box statistic with its expectation."""

    autocorrelation: Array
    statistic: float
    expected: float


def whiteness(fit: Fit) -> Whiteness:
    """Color of the innovations of the channel that the motion is judged by."""
    problem = fit.problem
    own = problem.channel == problem.main
    pieces = [fit.linear.r[span][own[span]] for span in problem.spans]
    statistic, expected = ljung_box(pieces)
    return Whiteness(autocorrelation(pieces), statistic, expected)


@dataclass(frozen=True, slots=True)
class Validation:
    """Prediction of the last part of a run by a model fitted to the first: times, measured, predicted.

    `fit` is 1 minus the ratio of the error to the motion (root mean squares): 1 is perfect, 0 no better than the mean.
    `excess` is the error over that of the part it was fitted to.
    """

    t_s: Array
    measured: Array
    predicted: Array
    fit: float
    excess: float


def validation(record: Record, fit: Fit, belief: Belief) -> Validation | None:
    """Hold out the last quarter of the record's time; None when either part is too short."""
    first, last = held_out(record.stretches)
    try:
        theta, sigmas = retrained(fit, record.within(first), belief)
        problem = pose(fit.model, record.within(last))
    except ValueError:
        return None
    white = whitener_of(problem, theta, problem.guess, Noise())
    linear = linearize(problem, theta, problem.guess, white)
    for _ in range(3):
        if linear is None:
            return None
        linear = linearize(problem, theta, _settled_start(problem, linear), white)
    if linear is None:
        return None
    own = problem.channel == problem.main
    measured, error = problem.y[own], linear.raw[own]
    motion = float(np.std(measured))
    size = float(np.sqrt(np.mean(error**2)))
    return Validation(
        t_s=problem.t[own],
        measured=measured,
        predicted=array(measured - error),
        fit=1.0 - size / motion if motion > 0.0 else 0.0,
        excess=size / max(sigmas[problem.main], 1e-12),
    )


def _settled_start(problem: Problem, linear: Linear) -> Trajectory:
    return restarted(problem, linear, np.zeros(linear.J.shape[1]))


def held_out(stretches: tuple[Stretch, ...]) -> tuple[tuple[Stretch, ...], tuple[Stretch, ...]]:
    """Split stretches so that the later part holds a quarter of their time; a stretch may be cut."""
    total = sum(one.end_s - one.start_s for one in stretches)
    left = (1.0 - HELD_OUT_SHARE) * total
    first: list[Stretch] = []
    last: list[Stretch] = []
    for one in stretches:
        span = one.end_s - one.start_s
        if left >= span:
            first.append(one)
        elif left > 0.0:
            cut = one.start_s + left
            first.append(Stretch(one.start_s, cut, one.motion, one.phase))
            last.append(Stretch(cut, one.end_s, one.motion, one.phase))
        else:
            last.append(one)
        left -= span
    return tuple(first), tuple(last)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the verdict on one motion rests on: k_q and k_l, (2,) and (2, 2), and the numbers beside them."""

    k: Array
    covariance: Array
    excitation: Excitation
    effective_samples: float
    noise: float
    mass_gap: float
    converged: bool
    validation: Validation | None
    form: FormCheck
    current: float = 0.0
    """Current that nobody would know of, along an axis on which there may be one [m/s]."""
    offset: float = 0.0
    """Least constant force along such an axis that agrees with the record [N]."""


def reasons_against(evidence: Evidence) -> list[str]:
    """Every reason why k_q and k_l should not be believed, one sentence each; empty when they may."""
    high = evidence.excitation.high
    gradient = np.array([high * high, high])
    force = float(evidence.k @ gradient)
    out = []
    if not evidence.converged:
        out.append("the fit did not converge")
    if evidence.effective_samples < FEWEST_EFFECTIVE:
        out.append(f"{evidence.effective_samples:.0f} independent samples, wanted {FEWEST_EFFECTIVE:.0f}")
    if not high > evidence.noise:
        return [*out, f"it hardly moved: at most {high:.2g}, less than the noise of one measurement"]
    if not force > 0.0:
        return [
            *out,
            f"the drag at {high:.2g} comes out as {force:.3g}: check the sign of the wrench",
        ]
    share = math.sqrt(max(0.0, float(gradient @ evidence.covariance @ gradient))) / force
    if share > FORCE_SHARE:
        out.append(f"the drag at the highest speed is known to {share:.0%} only, wanted {FORCE_SHARE:.0%}")
    out += _separation(evidence, force)
    out += _physics(evidence, force)
    return out


def _separation(evidence: Evidence, force: float) -> list[str]:
    low, high = evidence.excitation.low, evidence.excitation.high
    if 2.0 * evidence.current > SPLIT_SHARE * high:
        change = (
            f"an unnoticed current of {evidence.current:.2g} changes the drag by {2.0 * evidence.current / high:.0%}"
        )
        return [f"at speeds up to {high:.2g} {change}: k_q cannot be told from k_l"]
    if evidence.excitation.alike > ALIKE_SHARE:
        alike = f"{evidence.excitation.alike:.0%} of the motion was at nearly one speed"
        return [f"{alike}: what tells k_q from k_l is only how it got there; use the drag-force band"]
    shares = np.sqrt(np.maximum(0.0, np.diag(evidence.covariance))) * np.array([high * high, high]) / force
    if shares.max() <= SPLIT_SHARE:
        return []
    either = f"either is uncertain by {shares.max():.0%} of the drag"
    return [f"speeds of {low:.2g} to {high:.2g} do not separate k_q from k_l ({either}); use the drag-force band"]


def _physics(evidence: Evidence, force: float) -> list[str]:
    out = []
    sigma = math.sqrt(max(0.0, float(evidence.covariance[0, 0])))
    if evidence.k[0] < -3.0 * sigma:
        out.append(f"k_q is negative ({evidence.k[0]:.3g} +- {sigma:.2g}): the record is not drag alone")
    sigma = math.sqrt(max(0.0, float(evidence.covariance[1, 1])))
    if evidence.k[1] < -3.0 * sigma and -evidence.k[1] * evidence.excitation.high > LINEAR_SHARE * force:
        out.append(f"k_l is negative ({evidence.k[1]:.3g} +- {sigma:.2g}): the record is not drag alone")
    if evidence.mass_gap < -3.0:
        below = f"the mass comes out below the body's own by {-evidence.mass_gap:.3g} standard deviations"
        out.append(f"{below}: check the units of force and velocity, and the mass of the vehicle file")
    if evidence.offset > OFFSET_SHARE * force:
        beside = f"a constant force of {evidence.offset:.2g} or more, {evidence.offset / force:.0%} of the largest drag"
        out.append(f"{beside}, acts besides: a current, the tether, or thrust where there is none")
    form = evidence.form
    if form.significant and form.share > FORM_SHARE:
        out.append(f"the force differs from the model's by {form.share:.0%} of the largest drag ({form.words})")
    checked = evidence.validation
    if checked is not None and checked.fit < LEAST_FIT and checked.excess > 1.5:
        out.append(f"it predicts the held-out part of the run with a fit of {checked.fit:.0%} only")
    return out
