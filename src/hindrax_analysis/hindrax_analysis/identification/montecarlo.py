"""Accuracy of the identification: many runs with known truth, each compared with the bound of its record."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import chdtri

from hindrax_analysis.plain import plain
from hindrax_ident.arrays import Array
from hindrax_ident.assess.assessment import METHOD, Assessment
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.fit.cramer_rao import bound_of
from hindrax_ident.model.model_parameters import parameters_of, reported_parameters
from hindrax_ident.model.motion_model import MOTIONS
from hindrax_ident.online.session import Outcome
from hindrax_ident.records.axis_record import Record

LIVE = "rls"
SHARES = (0.25, 0.5, 1.0)
Z95 = 1.959964


@dataclass(frozen=True, slots=True)
class CoefficientError:
    """One coefficient of one run by one method: error, reported standard deviation, bound of the record.

    The bound of the live estimate is that of one that does not know the delays of the thrust.
    """

    motion: str
    coefficient: str
    method: str
    error: float
    std: float
    bound: float
    truth: float
    std_calibrated: float = math.nan
    corrected: CorrectedError | None = None


@dataclass(frozen=True, slots=True)
class CorrectedError:
    """Errors of a corrected quantity and of the ends of its 95 % interval."""

    error: float
    low: float
    high: float

    @property
    def held(self) -> bool:
        """Whether the interval holds the truth."""
        return self.low <= 0.0 <= self.high


@dataclass(frozen=True, slots=True)
class DragError:
    """Drag force of one run at a share of its highest speed, one way: relative error and calibrated deviation [-].

    `corrected`: relative as well.
    """

    motion: str
    share: float
    error: float
    std_calibrated: float = math.nan
    corrected: CorrectedError | None = None


@dataclass(frozen=True, slots=True)
class Trial:
    """One run: errors of its coefficients, and the reason for missing ones (empty: none)."""

    seed: int
    found: tuple[CoefficientError, ...]
    drag: tuple[DragError, ...]
    trouble: str = ""


def trial_of(
    seed: int,
    outcome: Outcome,
    truth: dict[str, dict[str, float]],
    drag_force: Callable[[str, float], float],
    *,
    trouble: str = "",
    thrust_s: float | None = None,
) -> Trial:
    """Compare the outcome of a run with what is true of the hull that flew.

    Parameters
    ----------
    seed
        Of the run.
    outcome
        Of its session.
    truth
        Coefficients by motion.
    drag_force : [m/s, rad/s] to [N, N m]
        True drag of a motion at a signed speed.
    trouble
        Why there is no result; empty where there is one.
    thrust_s : [s]
        True density of the thrust noise, as in `bound_of`; None: not known.

    Returns
    -------
    Trial
        Errors of coefficients and of the drag.
    """
    found: list[CoefficientError] = []
    drag: list[DragError] = []
    for result in outcome.results.motions.values():
        assessment = outcome.assessments.get(MOTIONS[result.motion].axis)
        if assessment is not None and result.coefficients:
            found += _found(result, assessment, truth, thrust_s)
            drag += _drag(result, drag_force)
    return Trial(seed, tuple(found), tuple(drag), trouble)


def _found(
    result: MotionResult,
    assessment: Assessment,
    truth: dict[str, dict[str, float]],
    thrust_s: float | None,
) -> Iterator[CoefficientError]:
    fit, motion = assessment.fit, MOTIONS[result.motion]
    face = reported_parameters(fit.model, motion)
    # A constant error of the measured angle cannot be separated from an offset of the moment.
    tilt = assessment.budget.prior_band("tilt of the accelerometer")
    theta, record = parameters_of(fit.model, truth), assessment.budget.case.record

    def limits(delayed: Record | None) -> dict[str, float]:
        bound = bound_of(fit, theta, thrust_s, delayed=delayed) + tilt
        return dict(zip(face.names, np.sqrt(np.diag(bound[face.square])).tolist(), strict=True))

    methods = {METHOD: result.coefficients, **result.methods}
    known = limits(None)
    # While it flies nobody knows the delays of the thrust: the live estimate finds them.
    not_known = limits(record) if LIVE in methods else known
    for method, numbers in methods.items():
        for name, number in numbers.items():
            true, stds = truth[result.motion][name], (number.std, (not_known if method == LIVE else known)[name])
            error = number.value - true
            one = number.corrected
            off = None if one is None else CorrectedError(*(x - true for x in (one.value, *one.interval95)))
            yield CoefficientError(result.motion, name, method, error, *stds, true, number.std_calibrated, off)


def _drag(result: MotionResult, drag_force: Callable[[str, float], float]) -> Iterator[DragError]:
    """At every share, in every direction that the coefficients hold for."""
    side, band = MOTIONS[result.motion].side, result.drag
    for v in (sign * share * result.speeds[1] for share in SHARES for sign in ((side,) if side else (1.0, -1.0))):
        true, std, off = drag_force(result.motion, v), math.nan, None
        if band is not None and band.corrected is not None:
            ends = (band.corrected.center, band.corrected.low95, band.corrected.high95)
            off = CorrectedError(*(float(np.interp(abs(v), band.speed, x)) / abs(true) - 1.0 for x in ends))
        if band is not None:
            # The variance is speed squared times a parabola of the speed.
            parabola = np.polyfit(band.speed, (band.std_calibrated / band.speed) ** 2, 2)
            std = abs(v) * math.sqrt(max(0.0, float(np.polyval(parabola, abs(v)))))
        error = result.drag_force(v)[0] / true - 1.0
        yield DragError(result.motion, abs(v) / result.speeds[1], error, std / abs(true), off)


def tabulate(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """One row per motion, coefficient and method over all runs, in the order of their first appearance.

    Parameters
    ----------
    trials
        Of one world.

    Returns
    -------
    list[dict[str, Any]]
        Bias, root mean square error, Cramer-Rao bound, their ratio (1 is the limit), and coverages of the intervals.
    """
    groups: dict[tuple[str, str, str], list[CoefficientError]] = {}
    for trial in trials:
        for one in trial.found:
            groups.setdefault((one.motion, one.coefficient, one.method), []).append(one)
    rows = []
    for (motion, coefficient, method), group in groups.items():
        errors, bounds, stds, calibrated, truths = np.array(
            [(one.error, one.bound, one.std, one.std_calibrated, one.truth) for one in group]
        ).T
        row = {"motion": motion, "coefficient": coefficient, "method": method, "runs": len(group)}
        row |= {"truth": float(truths.mean()), "bias": float(errors.mean())}
        row |= {"rmse": _rms(errors), "crlb": _rms(bounds), "ratio": _rms(errors / bounds)}
        row["coverage95"] = float(np.mean(np.abs(errors) <= Z95 * stds))
        row["coverage95_calibrated"] = float(np.mean(np.abs(errors) <= Z95 * calibrated))
        rows.append(row | _after_correction([one.corrected for one in group]))
    return rows


def _after_correction(found: Sequence[CorrectedError | None]) -> dict[str, float]:
    """Bias, error, coverage and median width of the 95 % interval of corrected quantities; none for other methods."""
    known = [one for one in found if one is not None]
    if not known:
        return {}
    errors = np.array([one.error for one in known])
    return {
        "bias_corrected": float(errors.mean()),
        "rmse_corrected": _rms(errors),
        "coverage95_corrected": float(np.mean([one.held for one in known])),
        "width95_corrected": float(np.median([one.high - one.low for one in known])),
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def by_chance(runs: int) -> tuple[float, float]:
    """95 % interval of the ratio over this many runs, for an estimator exactly at its bound."""
    low, high = np.sqrt(chdtri(runs, [0.975, 0.025]) / runs)
    return float(low), float(high)


def drag_bias(trials: Sequence[Trial]) -> list[dict[str, object]]:
    """Relative error of the drag force at shares of the tested speed, per motion.

    Parameters
    ----------
    trials
        Of one world.

    Returns
    -------
    list[dict[str, object]]
        Mean, scatter and coverage; `rmse_per_band` is the root mean square error over the median calibrated deviation.
    """
    groups: dict[tuple[str, float], list[DragError]] = {}
    for trial in trials:
        for one in trial.drag:
            groups.setdefault((one.motion, round(one.share, 6)), []).append(one)
    out = []
    for (motion, share), group in groups.items():
        errors, stds = np.array([(one.error, one.std_calibrated) for one in group]).T
        rmse = _rms(errors)
        coverage = float(np.mean(np.abs(errors) <= Z95 * stds))
        row = {"bias": float(np.mean(errors)), "rmse": rmse, "coverage95_calibrated": coverage}
        row |= {"rmse_per_band": rmse / float(np.median(stds)), "cases": len(group)}
        row |= _after_correction([one.corrected for one in group])
        out.append({"motion": motion, "share_of_speed": share, **row})
    return out


def summary(trials: Sequence[Trial]) -> dict[str, Any]:
    """Document of `montecarlo`: cells of the refined result, the other methods, and the drag force.

    Parameters
    ----------
    trials
        Of one world.

    Returns
    -------
    dict[str, Any]
        Plain data; `ratio_by_chance` is the interval of an estimator at its bound (`by_chance`).
    """
    cells = tabulate(trials)
    others: dict[str, list[object]] = {}
    for cell in cells:
        if cell["method"] != METHOD:
            others.setdefault(cell["method"], []).append(plain(cell))
    return {
        "runs": len(trials),
        "ratio_by_chance": list(by_chance(len(trials))),
        "cells": [plain(cell) for cell in cells if cell["method"] == METHOD],
        "methods": others,
        "drag": plain(drag_bias(trials)),
        "troubles": {str(trial.seed): trial.trouble for trial in trials if trial.trouble},
    }
