"""Plots of the bench experiments and of predictions: units on every axis, one color per meaning, no global state.

Each function returns a matplotlib Figure with the Agg canvas; the caller saves it (`figure.savefig(path)`).
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hindrax_analysis.experiments import towing as drag
from hindrax_analysis.experiments.bollard import BollardCurve, Direction
from hindrax_analysis.experiments.estimate import EmpiricalModel
from hindrax_analysis.experiments.forced import Coefficient
from hindrax_analysis.experiments.free_decay import FreeDecay
from hindrax_analysis.experiments.pendulum import PendulumFit
from hindrax_analysis.experiments.step import StepPlant, StepTest
from hindrax_analysis.experiments.towing import Towing
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.prediction import Prediction

MEASURED = "#33658a"
MODEL = "#d1495b"
SECOND = "#6c9a3b"
BAND_ALPHA = 0.2


def _figure(rows: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(width, height), layout="constrained", dpi=120)
    FigureCanvasAgg(figure)
    axes = [figure.add_subplot(rows, columns, index + 1) for index in range(rows * columns)]
    for axis in axes:
        axis.grid(visible=True, color="0.9")
        axis.set_axisbelow(True)
        axis.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _label(axis: Axes, x: str, y: str, title: str = "") -> None:
    axis.set_xlabel(x)
    axis.set_ylabel(y)
    axis.set_title(title, loc="left", fontsize=10)


def free_decay(result: FreeDecay) -> Figure:
    """Half-swings over time with both decays fitted to them, and the loss per half-swing over amplitude."""
    figure, (left, right) = _figure(1, 2, 10.0, 4.0)
    decay = result.decay
    time, swing = decay.swing_time_s, decay.swing_m
    left.semilogy(time, 1e3 * swing, "o", color=MEASURED, label="half-swings")
    rate = decay.damping_ratio.value * decay.frequency_radps.value / np.sqrt(1.0 - decay.damping_ratio.value**2)
    middle = float(np.average(time, weights=swing))
    level = float(np.exp(np.average(np.log(swing), weights=swing)))
    line = 1e3 * level * np.exp(-rate * (time - middle))
    left.semilogy(time, line, color=SECOND, label=f"linear, zeta = {decay.damping_ratio:.4f}")
    _label(left, "time [s]", "half-swing [mm]", f"m_ad = {result.added_mass_kg:.4f} kg")
    loss, amplitude = -np.diff(np.log(swing)), np.sqrt(swing[1:] * swing[:-1])
    right.plot(1e3 * amplitude, loss, "o", color=MEASURED)
    k_l, k_q = result.linear_drag_Nspm, result.quadratic_drag_Ns2pm2
    if np.isfinite(k_q.value):
        unit = np.pi / (2.0 * result.total_mass_kg * decay.frequency_radps.value)
        steep = unit * 8.0 / (3.0 * np.pi) * decay.frequency_radps.value * k_q.value
        ends = np.array([0.0, float(amplitude.max())])
        right.plot(1e3 * ends, unit * k_l.value + steep * ends, color=MODEL)
        per_swing = unit * k_l.value + steep * amplitude
        modelled = swing[0] * np.exp(-np.concatenate(([0.0], np.cumsum(per_swing))))
        left.semilogy(time, 1e3 * modelled, color=MODEL, label="linear and quadratic")
    left.legend(frameon=False)
    title = f"k_l = {k_l:.2f} N s/m, k_q = {k_q:.1f} N s$^2$/m$^2$"
    _label(right, "amplitude [mm]", "loss per half-swing, ln(x1/x2) [-]", title)
    right.set_ylim(bottom=0.0)
    right.set_xlim(left=0.0)
    return figure


def forced(coefficients: Sequence[Coefficient]) -> Figure:
    """Each derivative by both methods, with one standard deviation."""
    figure, axes = _figure(1, len(coefficients), 3.2 * len(coefficients) + 1.0, 3.6)
    for axis, found in zip(axes, coefficients, strict=True):
        for place, (name, value) in enumerate((("Fourier", found.fourier), ("direct fit", found.direct))):
            spread = value.std if np.isfinite(value.std) else 0.0
            color = (MEASURED, MODEL)[place]
            axis.errorbar(place, value.value, yerr=spread, fmt="o", capsize=4, color=color, label=name)
        axis.set_xticks([0, 1], ["Fourier", "direct fit"])
        axis.set_xlim(-0.5, 1.5)
        axis.ticklabel_format(axis="y", useOffset=False)
        title = f"{found.name}: {found.difference_percent:.2f} % apart"
        _label(axis, "", f"{found.name} [{found.unit}]", title)
    return figure


def pendulum(fit: PendulumFit) -> Figure:
    """Recorded and simulated angle, and the residuals."""
    figure, (above, below) = _figure(2, 1, 8.0, 5.5)
    above.plot(fit.time_s, fit.theta_rad, color=MEASURED, label="recorded")
    above.plot(fit.time_s, fit.model_rad, "--", color=MODEL, label="simulated")
    above.legend(frameon=False)
    found = fit.output_error
    title = f"m_a = {found.added_mass_kg:.3f} kg, K_L = {found.k_l:.2f} N s/m, K_Q = {found.k_q:.2f} N s$^2$/m$^2$"
    _label(above, "", "angle [rad]", title)
    below.plot(fit.time_s, 1e3 * (fit.theta_rad - fit.model_rad), color=MEASURED)
    _label(below, "time [s]", "recorded - simulated [mrad]")
    return figure


def bollard(pulse_us: Array, thrust_N: Array, curve: BollardCurve) -> Figure:
    """The sweep, both cubics with a band of two standard deviations, and the residuals."""
    figure, (above, below) = _figure(2, 1, 8.0, 6.0)
    above.plot(pulse_us, thrust_N, "o", color=MEASURED, markersize=3, label="load cell")
    for direction, color in ((curve.negative, SECOND), (curve.positive, MODEL)):
        pulses = array(np.linspace(direction.from_us, direction.to_us, 100))
        force, spread = _forces(direction, pulses)
        above.plot(pulses, force, color=color)
        above.fill_between(pulses, force - 2.0 * spread, force + 2.0 * spread, color=color, alpha=BAND_ALPHA, lw=0.0)
        inside = (pulse_us >= direction.from_us) & (pulse_us <= direction.to_us)
        residual = thrust_N[inside] - _forces(direction, pulse_us[inside])[0]
        below.plot(pulse_us[inside], residual, "o", color=color, markersize=3)
    stop, dead_band = curve.stop_us, curve.dead_band_us
    above.axvspan(stop - dead_band, stop + dead_band, color="0.93", label="dead band")
    above.legend(frameon=False)
    _label(above, "", "thrust [N]", "thrust curve, band of two standard deviations")
    _label(below, "pulse [us]", "measured - curve [N]")
    return figure


def _forces(direction: Direction, pulse_us: Array) -> tuple[Array, Array]:
    """Thrust and its standard deviation at each pulse: (n,) each [N]."""
    values = [direction.force_N(float(pulse)) for pulse in pulse_us]
    return np.array([value.value for value in values]), np.array([value.std for value in values])


def towing(speed_mps: Array, drag_N: Array, fit: Towing) -> Figure:
    """Towing points, the fitted drag and its two parts."""
    figure, (axis,) = _figure(1, 1, 7.0, 4.5)
    axis.plot(speed_mps, drag_N, "o", color=MEASURED, label="measured")
    speeds = array(np.linspace(min(0.0, speed_mps.min()), max(0.0, speed_mps.max()), 200))
    offset = fit.b.value if fit.b else 0.0
    axis.plot(speeds, drag.drag_N(speeds, fit.k_q.value, fit.k_l.value, offset), color=MODEL, label="fit")
    axis.plot(speeds, drag.drag_N(speeds, fit.k_q.value, 0.0), ":", color=SECOND, label="quadratic part")
    axis.legend(frameon=False)
    _label(axis, "speed [m/s]", "drag [N]", f"k_q = {fit.k_q:.3f} N s$^2$/m$^2$, k_l = {fit.k_l:.3f} N s/m")
    return figure


def step(plant: StepPlant, thrusts_N: Sequence[float], duration_s: float, tests: Sequence[StepTest] = ()) -> Figure:
    """Velocity and acceleration after steps of thrust; recorded velocities as points. Badawy 2012, figures 14 to 17."""
    figure, (left, right) = _figure(1, 2, 10.0, 4.2)
    time = array(np.linspace(0.0, duration_s, 400))
    shades = np.linspace(0.35, 1.0, len(thrusts_N))
    for thrust, shade in zip(thrusts_N, shades, strict=True):
        left.plot(time, plant.velocity_mps(time, thrust), color=MODEL, alpha=float(shade), label=f"{thrust:g} N")
        right.plot(time, plant.acceleration_mps2(time, thrust), color=MODEL, alpha=float(shade))
    for test in tests:
        left.plot(test.time_s, test.velocity_mps, ".", color=MEASURED, markersize=2)
    left.legend(frameon=False, title="thrust", fontsize=8)
    title = f"total mass {plant.mass_kg:.2f} kg, k_l {plant.k_l:.3g}, k_q {plant.k_q:.3g}"
    _label(left, "time [s]", "velocity [m/s]", title)
    _label(right, "time [s]", "acceleration [m/s$^2$]")
    return figure


def estimate(model: EmpiricalModel) -> Figure:
    """Added mass and quadratic drag as bars, translations and rotations apart."""
    figure, axes = _figure(1, 4, 11.0, 3.6)
    panels = (
        (slice(0, 3), model.added_mass, "added mass [kg]"),
        (slice(3, 6), model.added_mass, "added inertia [kg m$^2$]"),
        (slice(0, 3), model.quadratic_drag, "quadratic drag [N s$^2$/m$^2$]"),
        (slice(3, 6), model.quadratic_drag, "quadratic drag [Nm s$^2$]"),
    )
    for axis, (part, values, label) in zip(axes, panels, strict=True):
        axis.bar(AXES[part], values[part], color=MEASURED if "added" in label else MODEL, width=0.6)
        _label(axis, "", label)
    return figure


def prediction(predictions: Sequence[Prediction]) -> Figure:
    """Measured and predicted motion over time, one plot per axis."""
    figure, rows = _figure(len(predictions), 1, 9.0, 2.6 * len(predictions))
    for axis, one in zip(rows, predictions, strict=True):
        edges = np.flatnonzero(np.diff(one.window)) + 1
        axis.plot(one.t, one.measured, ".", markersize=2.0, color=MEASURED, label="measured")
        apart = [np.insert(values, edges, np.nan) for values in (one.t, one.predicted)]
        axis.plot(*apart, color=MODEL, label="predicted from the beginning of each window")
        _label(axis, "time [s]", f"{AXES[one.axis]} [{one.unit}]")
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper right", ncols=2, fontsize=8)
    return figure
