"""Charts of one motion: measurement, fit, convergence, and residuals."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hindrax_analysis.coefficients_file import TABULATED
from hindrax_analysis.published import PAPER, published_of
from hindrax_analysis.report.chart import Band, Bars, Chart, Layer, Line, Points, Role, Stems, data_range
from hindrax_core.text.digits import TWO_SIDED_95
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.assessment import Assessment
from hindrax_ident.assess.prediction import Prediction
from hindrax_ident.assess.results import MotionResult, Number
from hindrax_ident.model.model_parameters import reported_parameters
from hindrax_ident.model.motion_model import MOTIONS, Motion, axis_units

CURVE_POINTS = 81
BINS = 24
PREDICTORS = ("model", "stays still", "keeps its speed")
GAP_S = 1.0
PAUSE_S, SHORTENED_S = 300.0, 5.0
"""Pauses longer than the first are drawn with the length of the second."""


@dataclass(frozen=True, slots=True)
class Trace:
    """The online estimate of one motion: times (n,) [s], values and deviations (n, k) of the coefficients `names`."""

    names: Sequence[str]
    t_s: Array
    values: Array
    stds: Array


@dataclass(frozen=True, slots=True)
class MotionFigures:
    """Data of the charts of one motion."""

    vehicle: Vehicle
    result: MotionResult
    assessment: Assessment
    trace: Trace | None = None

    @property
    def motion(self) -> Motion:
        """Axis and direction."""
        return MOTIONS[self.result.motion]

    @property
    def units(self) -> tuple[str, str]:
        """Units of speed and of force."""
        return axis_units(self.motion.axis)

    @property
    def words(self) -> tuple[str, str]:
        """Names of speed and of force on this axis."""
        return ("angular rate", "moment") if self.motion.axis >= 3 else ("velocity", "force")


def charts_of(figures: MotionFigures) -> list[Chart]:
    """All charts of a motion, in the order of reading."""
    checked, trace = figures.assessment.validation, figures.trace
    held_out = [_held_out(figures, checked.prediction)] if checked else []
    names = [name for name in TABULATED if trace and len(trace.t_s) >= 3 and name in trace.names]
    online = [_convergence(figures, trace, name) for name in names if trace]
    first = [_force_velocity(figures), _distance_from_fit(figures), _motion_over_time(figures)]
    last = [_residuals(figures), _whiteness(figures), _excitation(figures)]
    return [*first, _force_over_time(figures), *held_out, *online, *last]


# ---- force against velocity


def _force_velocity(figures: MotionFigures) -> Chart:
    result, (speed_unit, force_unit), (speed, force) = figures.result, figures.units, figures.words
    plateaus = figures.assessment.plateaus.on_side(figures.motion.side)
    high = max(result.speeds[1], 1e-6)
    v = array(np.linspace(0.0 if figures.motion.side else -high, high, CURVE_POINTS) * (figures.motion.side or 1))
    layers: list[Layer] = [*_bands(figures, v), Line(v, _steady(result.coefficients, v), "model", "fitted")]
    truth = {name: number.truth for name, number in result.coefficients.items() if number.truth is not None}
    if {"k_q", "k_l", "b"} <= set(truth):
        layers.append(
            Line(v, _curve(truth["k_q"], truth["k_l"], truth["b"], v), "truth", "truth of the mock", "dashed")
        )
    if paper := published_of(figures.vehicle.name, result.motion):
        k = {name: pair[0] for name, pair in paper.in_our_axes.items()}
        layers.append(Line(v, _curve(k["k_q"], k["k_l"], k["b"], v), "paper", PAPER, "dashed"))
    if len(plateaus.v) and not has_restoring_moment(result):
        layers.append(Points(plateaus.v, plateaus.force, "plateau", "plateaus (means)"))
    return Chart(
        title=f"{force.capitalize()} against {speed}",
        x_label=f"{speed} [{speed_unit}]",
        y_label=f"steady {force} [{force_unit}]",
        caption=f"The fitted drag curve k_q|x|x + k_l x + b over the tested range of {speed}, with its 95 % intervals.",
        layers=tuple(layers),
        y_range=data_range([layer.y for layer in layers if not isinstance(layer, Band)]),
    )


def _distance_from_fit(figures: MotionFigures) -> Chart:
    """The first chart minus the fitted curve: shows the bands of a good fit."""
    whole, numbers = _force_velocity(figures), figures.result.coefficients
    layers = [replace(layer, y=array(layer.y - _steady(numbers, layer.x))) for layer in whole.layers]
    close = [layer.y for layer in layers if layer.role != "paper"]
    return replace(
        whole,
        title="Distance from the fitted curve",
        y_label=f"{figures.words[1]} \u2212 fitted [{figures.units[1]}]",
        caption="The same minus the fitted curve, which makes the intervals visible.",
        layers=tuple(layers),
        y_range=data_range(close, margin=0.15),
    )


def _curve(k_q: float, k_l: float, b: float, v: Array) -> Array:
    """Drag curve including b: (n,) [N, N m]."""
    return array(k_q * np.abs(v) * v + k_l * v + b)


def _steady(numbers: Mapping[str, Number], v: Array) -> Array:
    """Fitted drag curve including b: (n,) [N, N m]."""
    return _curve(numbers["k_q"].value, numbers["k_l"].value, numbers["b"].value, v)


def _bands(figures: MotionFigures, v: Array) -> list[Band]:
    """Outer interval with the calibration, inner one of the noise."""
    result, assessment = figures.result, figures.assessment
    square = reported_parameters(assessment.fit.model, figures.motion).square
    rows = [result.names.index(name) for name in ("k_q", "k_l", "b")]
    gradient = np.stack([np.abs(v) * v, v, np.ones_like(v)], axis=1)
    middle = _steady(result.coefficients, v)
    # A result over several runs may be wider than its fit; what the calibration adds is the same.
    calibrated = result.covariance + assessment.calibrated[square] - assessment.fit.covariance[square]
    out = []
    for covariance, label, variant in (
        (calibrated, "95 %, with calibration", "faint"),
        (result.covariance, "95 %, noise of this run", ""),
    ):
        block = covariance[np.ix_(rows, rows)]
        half_width = TWO_SIDED_95 * np.sqrt(np.maximum(0.0, np.sum(gradient @ block * gradient, axis=1)))
        out.append(Band(v, np.stack([middle - half_width, middle + half_width]), "model", label, variant))
    return out


# ---- over time


def _clock(figures: MotionFigures, t_s: Array) -> Array:
    """Times from the first sample, (n,) [s]; long pauses, as between pooled records, are shortened."""
    known = figures.assessment.fit.problem.grid.times_s
    steps = np.diff(known)
    shown = np.concatenate([[0.0], np.cumsum(np.where(steps > PAUSE_S, SHORTENED_S, steps))])
    inside = np.interp(t_s, known, shown)
    return array(inside + np.minimum(0.0, t_s - known[0]) + np.maximum(0.0, t_s - known[-1]))


def _main(figures: MotionFigures) -> tuple[Array, Array, Array]:
    """Times [s], measurements and residuals [m/s, rad/s or m, rad] of the main channel: (n,) each."""
    problem, linear = figures.assessment.fit.problem, figures.assessment.fit.linear
    own = problem.channel == problem.main
    return problem.t[own], problem.y[own], linear.raw[own]


def _quantity(figures: MotionFigures) -> tuple[str, str]:
    """Name and unit of the main channel: velocity, or depth or angle without one."""
    if figures.assessment.fit.problem.main == 0:
        return figures.words[0], figures.units[0]
    return ("angle", "rad") if figures.motion.axis >= 3 else ("depth", "m")


def _broken(t: Array, y: Array) -> Array:
    """Values with NaN after each jump in time, (n,): a line is interrupted at a pause."""
    out = y.astype(float).copy()
    out[1:][np.diff(t) > GAP_S] = math.nan
    return array(out)


def _motion_over_time(figures: MotionFigures) -> Chart:
    problem, path = figures.assessment.fit.problem, figures.assessment.fit.linear.path
    t, y, _ = _main(figures)
    what, unit = _quantity(figures)
    times, fitted = problem.grid.times_s, path.v if problem.main == 0 else path.s
    smooth = np.where(problem.grid.starts, math.nan, fitted)
    return Chart(
        title=f"{what.capitalize()} over time",
        x_label="time [s]",
        y_label=f"{what} [{unit}]",
        caption=f"Measured {what}, and simulation of the fitted model with the recorded thrust.",
        layers=(
            Points(_clock(figures, t), y, "measured", "measured", small=True),
            Line(_clock(figures, times), array(smooth), "model", "fitted model"),
        ),
    )


def _force_over_time(figures: MotionFigures) -> Chart:
    record, times = figures.assessment.record, figures.assessment.fit.problem.grid.times_s
    force, unit = figures.words[1], figures.units[1]
    return Chart(
        title=f"{force.capitalize()} over time",
        x_label="time [s]",
        y_label=f"achieved {force} [{unit}]",
        caption=f"The {force} achieved by the thrusters, after their lag: the input of the model.",
        layers=(Line(_clock(figures, times), _broken(times, record.force(times)), "measured"),),
    )


def _held_out(figures: MotionFigures, found: Prediction) -> Chart:
    what, unit = _quantity(figures)
    times = _clock(figures, found.t)
    errors = ", ".join(f"{name} {error:.2g}" for name, error in zip(PREDICTORS, found.errors.values(), strict=True))
    begins = np.diff(found.window, prepend=found.window[:1]) != 0
    return Chart(
        title="Prediction of a held-out part",
        x_label="time [s]",
        y_label=f"{what} [{unit}]",
        caption=(
            "The last quarter of the run (of several the last run), predicted over each window by a model that "
            f"was not fitted to it; RMS errors: {errors} {unit}."
        ),
        layers=(
            Points(times, found.measured, "measured", "measured", small=True),
            Line(times, np.where(begins, math.nan, found.predicted), "model", "predicted"),
        ),
    )


# ---- convergence


def _convergence(figures: MotionFigures, trace: Trace, name: str) -> Chart:
    column = trace.names.index(name)
    value, half_width = trace.values[:, column], TWO_SIDED_95 * trace.stds[:, column]
    t = _clock(figures, trace.t_s)
    number = figures.result.coefficients.get(name)
    layers: list[Layer] = [
        Band(t, np.stack([value - half_width, value + half_width]), "online", "95 % interval"),
        Line(t, _broken(t, value), "online", "online estimate"),
    ]
    ends = array(np.array([t[0], t[-1]]))
    if number is not None:
        layers.append(Line(ends, np.full(2, number.value), "model", "refined after the run"))
    if number is not None and number.truth is not None:
        layers.append(Line(ends, np.full(2, number.truth), "truth", "truth of the mock", "dashed"))
    unit = number.unit if number else ("kg m^2" if figures.motion.axis >= 3 else "kg")
    # The later half is shown in full; the first estimates may leave the frame.
    late = slice(len(value) // 2, None)
    levels = [layer.y for layer in layers if isinstance(layer, Line)][1:]
    return Chart(
        title=f"Online estimate of {LABELS[name]}",
        x_label="time [s]",
        y_label=f"{LABELS[name]} [{pretty_unit(unit)}]",
        caption=f"Online estimate of {LABELS[name]} during the run.",
        layers=tuple(layers),
        y_range=data_range([(value - half_width)[late], (value + half_width)[late], *levels], margin=0.15),
        zero=False,
    )


# ---- residuals


def _residuals(figures: MotionFigures) -> Chart:
    t, _, residual = _main(figures)
    what, unit = _quantity(figures)
    return Chart(
        title="Residuals",
        x_label="time [s]",
        y_label=f"measured \u2212 fitted [{unit}]",
        caption=f"Measured minus fitted {what}; it should be noise without a pattern.",
        layers=(Points(_clock(figures, t), residual, "measured", small=True),),
    )


def _whiteness(figures: MotionFigures) -> Chart:
    white = figures.assessment.whiteness
    rho = white.autocorrelation[1:]
    lags = array(np.arange(1, len(rho) + 1, dtype=float))
    limit = TWO_SIDED_95 / math.sqrt(max(1, figures.result.samples))
    ends = array(np.array([0.5, len(rho) + 0.5]))
    outside = float(np.mean(np.abs(rho) > limit)) if len(rho) else 0.0
    return Chart(
        title="Whiteness of the innovations",
        x_label="lag [samples]",
        y_label="autocorrelation [-]",
        caption=(
            f"Autocorrelation of the whitened residuals; {outside:.0%} lies outside the 95 % limits, "
            "5 % would by chance."
        ),
        layers=(
            Stems(lags, rho, "measured"),
            Line(ends, np.full(2, limit), "limit", variant="dashed"),
            Line(ends, np.full(2, -limit), "limit", variant="dashed"),
        ),
        y_range=data_range([rho, np.array([-2.0 * limit, 2.0 * limit])]),
    )


def _excitation(figures: MotionFigures) -> Chart:
    fit, (speed, _), (unit, _) = figures.assessment.fit, figures.words, figures.units
    heights, edges = np.histogram(fit.linear.path.v, bins=BINS, weights=fit.problem.grid.steps_s)
    low, high = figures.result.speeds
    return Chart(
        title="Excitation",
        x_label=f"{speed} [{unit}]",
        y_label="time spent [s]",
        caption=f"Time spent at each {speed}; results hold from {low:.2g} to {high:.2g} {unit}.",
        layers=(Bars(array(edges), array(heights), "measured"),),
    )


# ---- labels


LABELS = {"k_q": "k_q", "k_l": "k_l", "b": "b", "added_mass": "added mass", "k_r": "k_r", "k_w": "k_w"}

ROLES: Mapping[str, Role] = {"output-error": "model", "rls": "online", "ekf": "online", "plateaus": "plateau"}
METHODS = {
    "output-error": "refined (output error)",
    "rls": "online (least squares)",
    "ekf": "online (joint filter)",
    "plateaus": "plateaus (paper's way)",
}


def has_restoring_moment(result: MotionResult) -> bool:
    """Whether the motion has a restoring moment: then a plateau's mean moment is not its drag."""
    return "k_r" in result.coefficients


def comparable_methods(result: MotionResult) -> dict[str, Mapping[str, Number]]:
    """The other methods over the same record, except those that do not model all of the motion's moments."""
    left_out = {"plateaus"} if has_restoring_moment(result) else set()
    return {name: found for name, found in result.methods.items() if name not in left_out}


def pretty_unit(unit: str) -> str:
    """A unit with superscript digits and centered dots."""
    return re.sub("(?<=[Ngm]) (?=[ms])", "\u00b7", unit).replace("^2", "\u00b2").replace("^3", "\u00b3")
