"""Validation by prediction: the motion that coefficients predict for thrust that they were not fitted to.

The model runs free over windows of a chosen length, from the velocity that fits the first second of each, with the
measured thrust alone. Its errors stand beside those of two predictors that know nothing: the vehicle stays still, and
it keeps its speed. Ljung 1999 section 16.4 (simulation over fresh data).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, Index, array
from hindrax_ident.assess.results import Number
from hindrax_ident.fit.output_error_problem import OutputErrorProblem, build_problem
from hindrax_ident.model.motion_model import Model, model_of, motions_of
from hindrax_ident.model.simulation import Trajectory, sensitivities, trajectory
from hindrax_ident.records.axis_record import Record, Stretch

START_S = 1.0
"""The beginning of a window, whose measurements give its initial velocity and position."""
GAUSS_NEWTON_STEPS = 3


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predicted and measured motion on one axis: arrays (n,) over all windows.

    Velocities [m/s, rad/s]; where only positions were measured (heave by depth) those [m].
    """

    axis: int
    unit: str
    t: Array
    measured: Array
    predicted: Array
    still: Array
    steady: Array
    window: Index
    """Number of the window of each sample: (n,)."""

    @property
    def windows(self) -> int:
        """Number of windows."""
        return len(np.unique(self.window))

    def rmse(self, predictor: Array) -> float:
        """Root mean square error of a predictor (n,)."""
        return float(np.sqrt(np.mean((predictor - self.measured) ** 2)))

    def to_json(self) -> dict[str, object]:
        """Errors of the model and of both predictors that know nothing, in `unit`."""
        errors = {"rmse": self.predicted, "rmse_stays_still": self.still, "rmse_keeps_speed": self.steady}
        return {"unit": self.unit, "windows": self.windows} | {name: self.rmse(one) for name, one in errors.items()}


def parameters(model: Model, motions: Mapping[str, Mapping[str, Number]]) -> Array:
    """Parameters of a model (p,), in the order of its names, from the coefficients of each motion.

    UsageError names what is missing.
    """
    found: dict[str, float] = {}
    for motion in motions_of(model.axis):
        numbers = motions.get(motion.name, {})
        names = dict(zip(("k_q", "k_l", "b", "added_mass", "k_r"), model.names_of(motion.side), strict=False))
        found |= {names[name]: one.value for name, one in numbers.items() if name in names}
    lacking = [name for name in model.names if name not in found]
    if lacking:
        raise UsageError(
            f"{AXES[model.axis]}: found no {' and no '.join(lacking)} (mass: added_mass) in the coefficients"
        )
    found["mass"] += model.rigid
    return array([found[name] for name in model.names])


def predict_record(
    motions: Mapping[str, Mapping[str, Number]], vehicle: Vehicle, axis: int, record: Record, window_s: float
) -> Prediction:
    """Free-running prediction over windows of the record of one axis. HindraxError where there is none to predict."""
    model = model_of(vehicle, axis)
    theta = parameters(model, motions)
    windows = tuple(window for stretch in record.stretches for window in _windows(stretch, window_s))
    if not windows:
        longest = max((stretch.end_s - stretch.start_s for stretch in record.stretches), default=0.0)
        raise HindraxError(
            f"{AXES[axis]}: no stretch of the record lasts {window_s:g} s, the longest {longest:.3g} s; "
            "choose a shorter --window"
        )
    try:
        problem = build_problem(model, record.with_stretches(windows))
    except ValueError as error:
        raise HindraxError(f"{AXES[axis]}: {error} in {window_s:g} s; choose a longer --window") from None
    path = _moved(model, theta, problem, problem.guess)
    for _ in range(GAUSS_NEWTON_STEPS):
        path = _moved(model, theta, problem, _beginnings(model, theta, problem, path))
    counts = problem.channel == problem.main
    at, t = problem.index[counts], problem.t[counts]
    window = np.cumsum(problem.grid.starts)[at] - 1
    first = np.flatnonzero(problem.grid.starts)[window]
    v0, unit = path.v[first], ("rad" if axis >= 3 else "m")
    if problem.main:
        still = path.s[first]
        steady, predicted = still + v0 * (t - problem.grid.times_s[first]), path.s[at]
    else:
        still, steady, predicted, unit = np.zeros(len(t)), v0, path.v[at], f"{unit}/s"
    return Prediction(axis, unit, t, problem.y[counts], predicted, array(still), array(steady), window)


def _windows(stretch: Stretch, window_s: float) -> Iterator[Stretch]:
    """Windows of one length, one after the other; the rest of a stretch is left out."""
    for index in range(math.floor((stretch.end_s - stretch.start_s) / window_s + 1e-9)):
        start_s = stretch.start_s + index * window_s
        # The sample at the end is the first of the next window.
        yield replace(stretch, start_s=start_s, end_s=start_s + window_s - 1e-6)


def _moved(model: Model, theta: Array, problem: OutputErrorProblem, start: Trajectory) -> Trajectory:
    path = trajectory(model, theta, problem.grid, start)
    if path is None:
        raise HindraxError(
            f"{AXES[model.axis]}: no motion follows from these coefficients and this thrust; are both of this vehicle?"
        )
    return path


def _beginnings(model: Model, theta: Array, problem: OutputErrorProblem, path: Trajectory) -> Trajectory:
    """The path with the initial velocity and position of each window that fit its first second best."""
    by_start = sensitivities(model, theta, problem.grid, path)[:, :, -2:]
    simulated = np.stack([path.v, path.s], axis=1)
    v, s = path.v.copy(), path.s.copy()
    for first, span in zip(np.flatnonzero(problem.grid.starts).tolist(), problem.spans, strict=True):
        early = problem.t[span] <= problem.t[span][0] + START_S
        at, channel = problem.index[span][early], problem.channel[span][early]
        change, *_ = np.linalg.lstsq(by_start[at, channel], problem.y[span][early] - simulated[at, channel])
        v[first], s[first] = v[first] + change[0], s[first] + change[1]
    return Trajectory(v, s)
