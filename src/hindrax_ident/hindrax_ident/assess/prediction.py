"""Validation by prediction of the motion for thrust that the coefficients were not fitted to.

The model runs freely over windows, from the velocity that fits the first second of each, with the measured thrust
alone. Its errors stand beside those of two trivial predictors: the vehicle stays still, and it keeps its speed.
Ljung 1999 section 16.4 (simulation over fresh data).
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, Index, array
from hindrax_ident.assess.results import Number
from hindrax_ident.fit.output_error_problem import OutputErrorProblem, build_problem
from hindrax_ident.model.model_parameters import parameters_of
from hindrax_ident.model.motion_model import Model, model_of, motions_of
from hindrax_ident.model.simulation import Trajectory, sensitivities, trajectory
from hindrax_ident.records.axis_record import LATER, Record, Stretch

WINDOW_S = 10.0
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
    def of_position(self) -> bool:
        """Whether positions are predicted, not velocities."""
        return not self.unit.endswith("/s")

    @property
    def windows(self) -> int:
        """Number of windows."""
        return len(np.unique(self.window))

    def rmse(self, predictor: Array) -> float:
        """Root mean square error of a predictor (n,)."""
        return float(np.sqrt(np.mean((predictor - self.measured) ** 2)))

    @property
    def errors(self) -> dict[str, float]:
        """Errors of the model and of both predictors that know nothing, in `unit`."""
        predictors = {"rmse": self.predicted, "rmse_stays_still": self.still, "rmse_keeps_speed": self.steady}
        return {name: self.rmse(one) for name, one in predictors.items()}


def windows_of(stretches: Iterable[Stretch], window_s: float) -> tuple[Stretch, ...]:
    """Windows of one length, one after the other; the rest of a stretch is left out."""
    return tuple(
        # The sample at the end is the first of the next window.
        replace(one, start_s=one.start_s + index * window_s, end_s=one.start_s + (index + 1) * window_s - 1e-6)
        for one in stretches
        for index in range(math.floor((one.end_s - one.start_s) / window_s + 1e-9))
    )


def predict(model: Model, theta: Array, record: Record) -> Prediction:
    """Motion of each stretch of a record separately, from the velocity and position that fit its first second.

    Parameters
    ----------
    model
        Of one axis.
    theta : (p,)
        Its parameters.
    record
        Stretches, inputs, and what was measured.

    Returns
    -------
    Prediction
        Measured and predicted, side by side.

    Raises
    ------
    ValueError
        Where a stretch holds too few samples, or where no motion follows from the parameters.
    """
    problem = build_problem(model, record)
    path = _moved(model, theta, problem, problem.guess)
    for _ in range(GAUSS_NEWTON_STEPS):
        path = _moved(model, theta, problem, _beginnings(model, theta, problem, path))
    counts = problem.channel == problem.main
    at, t = problem.index[counts], problem.t[counts]
    predicted = problem.predicted(np.stack([path.v, path.s], axis=1))[counts]
    window = np.cumsum(problem.grid.starts)[at] - 1
    first = np.flatnonzero(problem.grid.starts)[window]
    v0, unit = path.v[first], ("rad" if model.axis >= 3 else "m")
    if problem.main:
        still = path.s[first]
        steady = still + v0 * (t - problem.grid.times_s[first])
    else:
        still, steady, unit = np.zeros(len(t)), v0, f"{unit}/s"
    return Prediction(model.axis, unit, t, problem.y[counts], predicted, still, steady, window)


def predictions_joined(parts: Sequence[Prediction]) -> Prediction:
    """Predictions of one axis over several records, one after the other.

    Parameters
    ----------
    parts
        Of the same axis, one of each record.

    Returns
    -------
    Prediction
        Of the velocities, where some records measured velocities and others positions.
    """
    parts = [one for one in parts if not one.of_position] or parts
    begin_s, first, times, windows = 0.0, 0, [], []
    for one in parts:
        times.append(one.t + begin_s)
        windows.append(one.window + first)
        begin_s, first = float(times[-1][-1]), int(windows[-1][-1]) + 1

    def whole(name: str) -> Array:
        """An array over all of them: (n,)."""
        return array(np.concatenate([getattr(one, name) for one in parts]))

    return Prediction(
        parts[0].axis,
        parts[0].unit,
        array(np.concatenate(times)),
        whole("measured"),
        whole("predicted"),
        whole("still"),
        whole("steady"),
        np.concatenate(windows),
    )


def predict_record(
    motions: Mapping[str, Mapping[str, Number]], vehicle: Vehicle, axis: int, record: Record, window_s: float
) -> Prediction:
    """Prediction over windows of the record of one axis.

    Parameters
    ----------
    motions
        Coefficients by motion, then by name.
    vehicle
        Mass and geometry.
    axis
        Index, 0 to 5.
    record
        Of that axis.
    window_s : [s]
        Length of a window; each begins anew from what was measured.

    Returns
    -------
    Prediction
        As of `predict`.

    Raises
    ------
    HindraxError
        Where there is no window to predict.
    """
    own = [motions[motion.name] for motion in motions_of(axis) if motion.name in motions]
    model = replace(model_of(vehicle, axis), crossed=any("k_w" in numbers for numbers in own))
    values = {motion: {name: one.value for name, one in numbers.items()} for motion, numbers in motions.items()}
    theta = parameters_of(model, values)
    windows = windows_of(record.stretches, window_s)
    if not windows:
        longest = max((stretch.end_s - stretch.start_s for stretch in record.stretches), default=0.0)
        raise HindraxError(
            f"{AXES[axis]}: no stretch of the record lasts {window_s:g} s, the longest {longest:.3g} s; "
            "choose a shorter --window"
        )
    try:
        return predict(model, theta, record.with_stretches(windows))
    except ValueError as error:
        raise HindraxError(f"{AXES[axis]}: {error}, in windows of {window_s:g} s") from None


def with_delays_of(record: Record, qualities: Iterable[Mapping[str, float]]) -> Record:
    """The record with the delays that a fit found (`quality` of its motions); as it is where there are none."""
    for one in qualities:
        if "lag_s" in one and "latency_s" in one:
            goes_s, turns_s = (one.get(name, 0.0) for name in LATER)
            return replace(record, lag_s=one["lag_s"], latency_s=one["latency_s"], later_s=(goes_s, turns_s))
    return record


def _moved(model: Model, theta: Array, problem: OutputErrorProblem, start: Trajectory) -> Trajectory:
    path = trajectory(model, theta, problem.grid, start)
    if path is None:
        raise ValueError("no motion follows from these coefficients and this thrust; are both of this vehicle?")
    return path


def _beginnings(model: Model, theta: Array, problem: OutputErrorProblem, path: Trajectory) -> Trajectory:
    """The path with the initial velocity and position of each window that fit its first second best."""
    by_start = problem.predicted(sensitivities(model, theta, problem.grid, path)[:, :, -2:])
    left = problem.y - problem.predicted(np.stack([path.v, path.s], axis=1))
    v, s = path.v.copy(), path.s.copy()
    for first, span in zip(np.flatnonzero(problem.grid.starts).tolist(), problem.spans, strict=True):
        early = problem.t[span] <= problem.t[span][0] + START_S
        change, *_ = np.linalg.lstsq(by_start[span][early], left[span][early])
        v[first], s[first] = v[first] + change[0], s[first] + change[1]
    return Trajectory(v, s)
