"""The charts of one motion: what was measured, what was fitted, how it came to be known, and what is left over."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.conclude import Conclusion
from hindrax_ident.faces import face_of
from hindrax_ident.models import MOTIONS, Motion
from hindrax_ident.quality import Validation
from hindrax_ident.report.chart import Band, Bars, Chart, Layer, Line, Points, Role, Stems
from hindrax_ident.report.published import published_of
from hindrax_ident.report.scale import spread
from hindrax_ident.results import MotionResult, Number, truth_of

TWO_SIDED_95 = 1.96
CURVE_POINTS = 81
BINS = 24
GAP_S = 1.0
PAUSE_S, SHORTENED_S = 300.0, 5.0
"""A pause that is longer than the first is drawn as long as the second."""


@dataclass(frozen=True, slots=True)
class Trace:
    """The online estimate of one motion, sample by sample: times (n,) [s], and per coefficient value and deviation."""

    t_s: Array
    values: Mapping[str, Array]
    stds: Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class Flown:
    """Everything the charts of one motion are made of; `clock_s` is what is taken off the times of the record."""

    vehicle: Vehicle
    result: MotionResult
    conclusion: Conclusion
    trace: Trace | None = None
    mock: bool = False

    @property
    def motion(self) -> Motion:
        """Axis and direction."""
        return MOTIONS[self.result.motion]

    @property
    def units(self) -> tuple[str, str]:
        """Units of speed and of force."""
        return ("rad/s", "N m") if self.motion.axis >= 3 else ("m/s", "N")

    @property
    def words(self) -> tuple[str, str]:
        """Names of speed and of force on this axis."""
        return ("angular rate", "moment") if self.motion.axis >= 3 else ("velocity", "force")


def charts_of(flown: Flown) -> list[Chart]:
    """All charts of a motion, in the order of reading."""
    found = [_force_velocity(flown), _close_up(flown), _motion_over_time(flown), _force_over_time(flown)]
    found += [_held_out(flown, checked) for checked in [flown.conclusion.validation] if checked is not None]
    found += convergence(flown)
    found += [_residuals(flown), _whiteness(flown), _excitation(flown)]
    return found


# ---- force against velocity


def _force_velocity(flown: Flown) -> Chart:
    result, (speed_unit, force_unit), (speed, force) = flown.result, flown.units, flown.words
    plateaus = flown.conclusion.plateaus.on_side(flown.motion.side)
    v = _speeds(flown)
    layers: list[Layer] = list(_bands(flown, v))
    layers.append(Line(v, _steady(result.coefficients, v), "model", "fitted"))
    truth = {name: number.truth for name, number in result.coefficients.items() if number.truth is not None}
    if {"k_q", "k_l", "b"} <= set(truth):
        layers.append(
            Line(v, _curve(truth["k_q"], truth["k_l"], truth["b"], v), "truth", "truth of the mock", dashed=True)
        )
    layers += _paper_curve(flown, v)
    if len(plateaus.v) and not rights_itself(result):
        layers.append(Points(plateaus.v, plateaus.force, "plateau", "plateaus (means)"))
    seen = np.concatenate([_ys(layer) for layer in layers if not isinstance(layer, Band)])
    low, high = spread([seen])
    return Chart(
        title=f"{force.capitalize()} against {speed}",
        x_label=f"{speed} [{speed_unit}]",
        y_label=f"{force} at constant {speed} [{force_unit}]",
        caption=f"The fitted drag curve k_q|x|x + k_l x + b over the tested range of {speed}, with its 95 % bands.",
        layers=tuple(layers),
        y_range=(low, high),
    )


def _close_up(flown: Flown) -> Chart:
    """What the first chart cannot show when the fit is good: everything less the fitted curve."""
    whole, numbers = _force_velocity(flown), flown.result.coefficients
    layers = tuple(_less(layer, _steady(numbers, _xs(layer))) for layer in whole.layers)
    close = [part for layer in layers if not _is_paper(layer) for part in _extent(layer)]
    return replace(
        whole,
        title="Distance from the fitted curve",
        y_label=f"{flown.words[1]} \u2212 fitted [{flown.units[1]}]",
        caption="The same with the fitted curve taken off, so that the bands can be told apart.",
        layers=layers,
        y_range=spread(close, margin=0.15),
    )


def _is_paper(layer: Layer) -> bool:
    return isinstance(layer, Line) and layer.role == "paper"


def _less(layer: Layer, fitted: Array) -> Layer:
    if isinstance(layer, Band):
        return replace(layer, low=array(layer.low - fitted), high=array(layer.high - fitted))
    return replace(layer, y=array(layer.y - fitted)) if isinstance(layer, Line | Points) else layer


def _xs(layer: Layer) -> Array:
    return layer.edges if isinstance(layer, Bars) else layer.x


def _extent(layer: Layer) -> tuple[Array, ...]:
    return (layer.low, layer.high) if isinstance(layer, Band) else (_ys(layer),)


def _ys(layer: Layer) -> Array:
    return layer.y if isinstance(layer, Line | Points) else np.zeros(0)


def _speeds(flown: Flown) -> Array:
    high = max(flown.result.speeds[1], 1e-6)
    low = 0.0 if flown.motion.side else -high
    v = np.linspace(low, high, CURVE_POINTS)
    return array(v * (flown.motion.side or 1))


def _curve(k_q: float, k_l: float, b: float, v: Array) -> Array:
    return array(k_q * np.abs(v) * v + k_l * v + b)


def _steady(numbers: Mapping[str, Number], v: Array) -> Array:
    return _curve(numbers["k_q"].value, numbers["k_l"].value, numbers["b"].value, v)


def _bands(flown: Flown, v: Array) -> list[Band]:
    """Outer band with the calibration, inner band of the noise."""
    result, conclusion = flown.result, flown.conclusion
    square = face_of(conclusion.fit.model, flown.motion).square
    rows = [result.names.index(name) for name in ("k_q", "k_l", "b")]
    gradient = np.stack([np.abs(v) * v, v, np.ones_like(v)], axis=1)
    middle = _steady(result.coefficients, v)
    # A result over several runs may be wider than its fit; what the calibration adds is the same.
    calibrated = result.covariance + conclusion.calibrated[square] - conclusion.fit.covariance[square]
    out = []
    for covariance, label, faint in (
        (calibrated, "95 %, with calibration", True),
        (result.covariance, "95 %, noise of this run", False),
    ):
        block = covariance[np.ix_(rows, rows)]
        wide = TWO_SIDED_95 * np.sqrt(np.maximum(0.0, np.sum(gradient @ block * gradient, axis=1)))
        out.append(Band(v, array(middle - wide), array(middle + wide), "model", label, faint=faint))
    return out


def _paper_curve(flown: Flown, v: Array) -> list[Line]:
    paper = published_of(flown.vehicle.name, flown.result.motion)
    if paper is None:
        return []
    k = {name: pair[0] for name, pair in paper.in_our_axes.items()}
    return [Line(v, _curve(k["k_q"], k["k_l"], k["b"], v), "paper", "COB-2023-1394", dashed=True)]


# ---- over time


def _clock(flown: Flown, t_s: Array) -> Array:
    """Times from the first sample on; long pauses, as between records that were pooled, are shortened."""
    known = flown.conclusion.fit.problem.grid.times_s
    steps = np.diff(known)
    shown = np.concatenate([[0.0], np.cumsum(np.where(steps > PAUSE_S, SHORTENED_S, steps))])
    inside = np.interp(t_s, known, shown)
    return array(inside + np.minimum(0.0, t_s - known[0]) + np.maximum(0.0, t_s - known[-1]))


def _main(flown: Flown) -> tuple[Array, Array, Array]:
    """Times [s], measurements and residuals of the channel that the motion is judged by."""
    problem, linear = flown.conclusion.fit.problem, flown.conclusion.fit.linear
    own = problem.channel == problem.main
    return problem.t[own], problem.y[own], linear.raw[own]


def _quantity(flown: Flown) -> tuple[str, str]:
    """Name and unit of what was measured: velocity, or the depth or angle where there is none."""
    if flown.conclusion.fit.problem.main == 0:
        return flown.words[0], flown.units[0]
    return ("angle", "rad") if flown.motion.axis >= 3 else ("depth", "m")


def _broken(t: Array, y: Array) -> Array:
    """Values with a hole wherever time jumps, so that no line is drawn across a pause."""
    out = y.astype(float).copy()
    out[1:][np.diff(t) > GAP_S] = math.nan
    return array(out)


def _motion_over_time(flown: Flown) -> Chart:
    problem, path = flown.conclusion.fit.problem, flown.conclusion.fit.linear.path
    t, y, _ = _main(flown)
    what, unit = _quantity(flown)
    fitted = path.v if problem.main == 0 else path.s
    times = problem.grid.times_s
    smooth = np.where(problem.grid.starts, math.nan, fitted)
    return Chart(
        title=f"{what.capitalize()} over time",
        x_label="time [s]",
        y_label=f"{what} [{unit}]",
        caption=f"Measured {what} and the motion that the fitted model makes of the recorded thrust.",
        layers=(
            Points(_clock(flown, t), y, "measured", "measured", small=True),
            Line(_clock(flown, times), array(smooth), "model", "fitted model"),
        ),
    )


def _force_over_time(flown: Flown) -> Chart:
    record, times = flown.conclusion.record, flown.conclusion.fit.problem.grid.times_s
    force, unit = flown.words[1], flown.units[1]
    return Chart(
        title=f"{force.capitalize()} over time",
        x_label="time [s]",
        y_label=f"achieved {force} [{unit}]",
        caption=f"The {force} that the thrusters achieved, behind their lag: what the model is driven by.",
        layers=(Line(_clock(flown, times), _broken(times, record.force(times)), "measured"),),
    )


def _held_out(flown: Flown, checked: Validation) -> Chart:
    what, unit = _quantity(flown)
    times = _clock(flown, checked.t_s)
    return Chart(
        title="Prediction of a held-out part",
        x_label="time [s]",
        y_label=f"{what} [{unit}]",
        caption=(
            f"The last quarter of the run, predicted by a model fitted to the first three: "
            f"it explains {max(0.0, checked.fit):.0%} of the motion (100 % is perfect)."
        ),
        layers=(
            Points(times, checked.measured, "measured", "measured", small=True),
            Line(times, _broken(times, checked.predicted), "model", "predicted"),
        ),
    )


# ---- convergence


def convergence(flown: Flown) -> list[Chart]:
    """One chart per coefficient of the online estimate; none where nobody listened."""
    trace = flown.trace
    if trace is None or len(trace.t_s) < 3:
        return []
    names = [name for name in ("k_q", "k_l", "b", "added_mass") if name in trace.values]
    return [_converging(flown, trace, name) for name in names]


def _converging(flown: Flown, trace: Trace, name: str) -> Chart:
    value, wide = trace.values[name], TWO_SIDED_95 * trace.stds[name]
    t = _clock(flown, trace.t_s)
    number = flown.result.coefficients.get(name)
    layers: list[Layer] = [
        Band(t, array(value - wide), array(value + wide), "online", "95 % band"),
        Line(t, _broken(t, value), "online", "online estimate"),
    ]
    ends = array(np.array([t[0], t[-1]]))
    if number is not None:
        layers.append(Line(ends, np.full(2, number.value), "model", "refined after the run"))
    truth = truth_of(flown.vehicle).get(flown.result.motion, {}).get(name) if flown.mock else None
    if truth is not None:
        layers.append(Line(ends, np.full(2, truth), "truth", "truth of the mock", dashed=True))
    unit = number.unit if number else ("kg m^2" if flown.motion.axis >= 3 else "kg")
    return Chart(
        title=f"Online estimate of {LABELS[name]}",
        x_label="time [s]",
        y_label=f"{LABELS[name]} [{pretty(unit)}]",
        caption=f"What the vehicle knew of {LABELS[name]} while it was still flying.",
        layers=tuple(layers),
        y_range=_settling(value, wide, [layer.y for layer in layers if isinstance(layer, Line)][1:]),
        zero=False,
    )


def _settling(value: Array, wide: Array, levels: Sequence[Array]) -> tuple[float, float]:
    """Range that shows the later part in full; the first guesses may leave the frame."""
    late = slice(len(value) // 4, None)
    return spread([value[late] - wide[late], value[late] + wide[late], *levels], margin=0.15)


# ---- what is left over


def _residuals(flown: Flown) -> Chart:
    t, _, residual = _main(flown)
    what, unit = _quantity(flown)
    return Chart(
        title="Residuals",
        x_label="time [s]",
        y_label=f"measured \u2212 fitted {what} [{unit}]",
        caption="What the fitted model leaves unexplained; it should be noise without a pattern.",
        layers=(Points(_clock(flown, t), residual, "measured", small=True),),
    )


def _whiteness(flown: Flown) -> Chart:
    white = flown.conclusion.whiteness
    rho = white.autocorrelation[1:]
    lags = array(np.arange(1, len(rho) + 1, dtype=float))
    limit = TWO_SIDED_95 / math.sqrt(max(1, flown.result.samples))
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
            Line(ends, np.full(2, limit), "limit", dashed=True),
            Line(ends, np.full(2, -limit), "limit", dashed=True),
        ),
        y_range=spread([rho, np.array([-2.0 * limit, 2.0 * limit])]),
    )


def _excitation(flown: Flown) -> Chart:
    fit, (speed, _), (unit, _) = flown.conclusion.fit, flown.words, flown.units
    heights, edges = np.histogram(fit.linear.path.v, bins=BINS, weights=fit.problem.grid.steps_s)
    low, high = flown.result.speeds
    return Chart(
        title="Excitation",
        x_label=f"{speed} [{unit}]",
        y_label="time spent [s]",
        caption=f"How long each {speed} was flown; results hold from {low:.2g} to {high:.2g} {unit}.",
        layers=(Bars(array(edges), array(heights), "measured"),),
    )


# ---- words


LABELS = {"k_q": "k_q", "k_l": "k_l", "b": "b", "added_mass": "added mass", "k_r": "k_r"}

ROLES: Mapping[str, Role] = {"output-error": "model", "rls": "online", "ekf": "online", "plateaus": "plateau"}
METHODS = {
    "output-error": "refined (output error)",
    "rls": "online (least squares)",
    "ekf": "online (joint filter)",
    "plateaus": "plateaus (paper's way)",
}


def rights_itself(result: MotionResult) -> bool:
    """Whether a moment of the attitude is part of the motion: then a plateau's mean moment is not its drag."""
    return "k_r" in result.coefficients


def comparable(result: MotionResult) -> dict[str, Mapping[str, Number]]:
    """The other methods over the same record, but for those that do not know all of the motion's moments."""
    return {name: found for name, found in result.methods.items() if not (name == "plateaus" and rights_itself(result))}


def pretty(unit: str) -> str:
    """A unit with raised digits."""
    return (
        unit.replace("^2", "\u00b2")
        .replace("^3", "\u00b3")
        .replace("N m", "N\u00b7m")
        .replace("N s", "N\u00b7s")
        .replace("m s", "m\u00b7s")
        .replace("kg m", "kg\u00b7m")
    )
