"""Plots of the bench experiments: each function returns a matplotlib Figure, which the caller saves.

The types of the results are imported for annotations only: a command with one experiment does not load the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hindrax_analysis.plots import BAND_ALPHA, MEASURED, MODEL, SECOND, label, new_figure
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array, array
from hindrax_laboratory import towing as drag

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hindrax_ident.model.empirical_model import EmpiricalModel
    from hindrax_laboratory.bollard import BollardCurve, Direction
    from hindrax_laboratory.forced import Coefficient
    from hindrax_laboratory.free_decay import FreeDecay
    from hindrax_laboratory.measured_table import MeasuredTable
    from hindrax_laboratory.pendulum import PendulumFit
    from hindrax_laboratory.step import StepPlant, StepTest
    from hindrax_laboratory.thruster_sheets import Sheet
    from hindrax_laboratory.towing import Towing


def free_decay(result: FreeDecay) -> Figure:
    """Half-swings over time with both decays fitted to them, and the loss per half-swing over amplitude."""
    figure, (left, right) = new_figure(1, 2, 10.0, 4.0)
    decay = result.decay
    time, swing = decay.swing_time_s, decay.swing_m
    left.semilogy(time, 1e3 * swing, "o", color=MEASURED, label="half-swings")
    rate = decay.damping_ratio.value * decay.frequency_radps.value / np.sqrt(1.0 - decay.damping_ratio.value**2)
    middle = float(np.average(time, weights=swing))
    level = float(np.exp(np.average(np.log(swing), weights=swing)))
    line = 1e3 * level * np.exp(-rate * (time - middle))
    left.semilogy(time, line, color=SECOND, label=f"linear, zeta = {decay.damping_ratio:.4f}")
    label(left, "time [s]", "half-swing [mm]", f"m_ad = {result.added_mass_kg:.4f} kg")
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
    label(right, "amplitude [mm]", "loss per half-swing, ln(x1/x2) [-]", title)
    right.set_ylim(bottom=0.0)
    right.set_xlim(left=0.0)
    return figure


def forced(coefficients: Sequence[Coefficient]) -> Figure:
    """Each derivative by both methods, with one standard deviation."""
    figure, axes = new_figure(1, len(coefficients), 3.2 * len(coefficients) + 1.0, 3.6)
    for axis, found in zip(axes, coefficients, strict=True):
        for place, (name, value) in enumerate((("Fourier", found.fourier), ("direct fit", found.direct))):
            spread = value.std if np.isfinite(value.std) else 0.0
            color = (MEASURED, MODEL)[place]
            axis.errorbar(place, value.value, yerr=spread, fmt="o", capsize=4, color=color, label=name)
        axis.set_xticks([0, 1], ["Fourier", "direct fit"])
        axis.set_xlim(-0.5, 1.5)
        axis.ticklabel_format(axis="y", useOffset=False)
        title = f"{found.name}: {found.difference_percent:.2f} % apart"
        label(axis, "", f"{found.name} [{found.unit}]", title)
    return figure


def pendulum(fit: PendulumFit) -> Figure:
    """Recorded and simulated angle, and the residuals."""
    figure, (above, below) = new_figure(2, 1, 8.0, 5.5)
    above.plot(fit.time_s, fit.theta_rad, color=MEASURED, label="recorded")
    above.plot(fit.time_s, fit.model_rad, "--", color=MODEL, label="simulated")
    above.legend(frameon=False)
    found = fit.output_error
    title = f"m_a = {found.added_mass_kg:.3f} kg, K_L = {found.k_l:.2f} N s/m, K_Q = {found.k_q:.2f} N s$^2$/m$^2$"
    label(above, "", "angle [rad]", title)
    below.plot(fit.time_s, 1e3 * (fit.theta_rad - fit.model_rad), color=MEASURED)
    label(below, "time [s]", "recorded - simulated [mrad]")
    return figure


def thrust_table(sheets: Sequence[Sheet], found: MeasuredTable) -> Figure:
    """Sweeps at several voltages, the table through them, and the residuals."""
    figure, (above, below) = new_figure(2, 1, 8.0, 6.0)
    for sheet, row in zip(sheets, found.table.force_N, strict=True):
        (line,) = above.plot(found.table.pulse_us, row, label=f"{sheet.supply_V:g} V")
        above.plot(sheet.pulse_us, sheet.force_N, "o", color=line.get_color(), markersize=1.5)
        residual = sheet.force_N - np.interp(sheet.pulse_us, found.table.pulse_us, row)
        below.plot(sheet.pulse_us, residual, "o", color=line.get_color(), markersize=1.5)
    above.legend(frameon=False)
    label(above, "", "thrust [N]", "thrust table, and the sweeps it is made of")
    label(below, "pulse [us]", "measured - table [N]")
    return figure


def bollard(pulse_us: Array, thrust_N: Array, curve: BollardCurve) -> Figure:
    """The sweep, both cubics with a band of two standard deviations, and the residuals.

    Parameters
    ----------
    pulse_us, thrust_N : (n,) [us], (n,) [N]
        Of the sweep.
    curve
        Fitted.

    Returns
    -------
    Figure
        Two plots.
    """
    figure, (above, below) = new_figure(2, 1, 8.0, 6.0)
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
    label(above, "", "thrust [N]", "thrust curve, two standard deviations")
    label(below, "pulse [us]", "measured - curve [N]")
    return figure


def _forces(direction: Direction, pulse_us: Array) -> tuple[Array, Array]:
    """Thrust and its standard deviation at each pulse: (n,) each [N]."""
    values = [direction.force_N(float(pulse)) for pulse in pulse_us]
    return np.array([value.value for value in values]), np.array([value.std for value in values])


def towing(speed_mps: Array, drag_N: Array, fit: Towing) -> Figure:
    """Towing points, the fitted drag and its two parts.

    Parameters
    ----------
    speed_mps, drag_N : (n,) [m/s], (n,) [N]
        Points.
    fit
        Quadratic and linear part.

    Returns
    -------
    Figure
        One plot.
    """
    figure, (axis,) = new_figure(1, 1, 7.0, 4.5)
    axis.plot(speed_mps, drag_N, "o", color=MEASURED, label="measured")
    speeds = array(np.linspace(min(0.0, speed_mps.min()), max(0.0, speed_mps.max()), 200))
    offset = fit.b.value if fit.b else 0.0
    axis.plot(speeds, drag.drag_N(speeds, fit.k_q.value, fit.k_l.value, offset), color=MODEL, label="fit")
    axis.plot(speeds, drag.drag_N(speeds, fit.k_q.value, 0.0), ":", color=SECOND, label="quadratic part")
    axis.legend(frameon=False)
    label(axis, "speed [m/s]", "drag [N]", f"k_q = {fit.k_q:.3f} N s$^2$/m$^2$, k_l = {fit.k_l:.3f} N s/m")
    return figure


def step(plant: StepPlant, thrusts_N: Sequence[float], duration_s: float, tests: Sequence[StepTest] = ()) -> Figure:
    """Velocity and acceleration after steps of thrust; recorded velocities as points. Badawy 2012, figures 14 to 17.

    Parameters
    ----------
    plant
        Simulated.
    thrusts_N : [N]
        Of the steps.
    duration_s : [s]
        Of each.
    tests
        Recorded ones.

    Returns
    -------
    Figure
        Two plots.
    """
    figure, (left, right) = new_figure(1, 2, 10.0, 4.2)
    time = array(np.linspace(0.0, duration_s, 400))
    shades = np.linspace(0.35, 1.0, len(thrusts_N))
    for thrust, shade in zip(thrusts_N, shades, strict=True):
        left.plot(time, plant.velocity_mps(time, thrust), color=MODEL, alpha=float(shade), label=f"{thrust:g} N")
        right.plot(time, plant.acceleration_mps2(time, thrust), color=MODEL, alpha=float(shade))
    for test in tests:
        left.plot(test.time_s, test.velocity_mps, ".", color=MEASURED, markersize=2)
    left.legend(frameon=False, title="thrust", fontsize=8)
    title = f"total mass {plant.mass_kg:.2f} kg, k_l {plant.k_l:.3g}, k_q {plant.k_q:.3g}"
    label(left, "time [s]", "velocity [m/s]", title)
    label(right, "time [s]", "acceleration [m/s$^2$]")
    return figure


def estimate(model: EmpiricalModel) -> Figure:
    """Added mass and quadratic drag as bars, translations and rotations apart."""
    figure, axes = new_figure(1, 4, 11.0, 3.6)
    panels = (
        (slice(0, 3), model.added_mass, "added mass [kg]"),
        (slice(3, 6), model.added_mass, "added inertia [kg m$^2$]"),
        (slice(0, 3), model.quadratic_drag, "quadratic drag [N s$^2$/m$^2$]"),
        (slice(3, 6), model.quadratic_drag, "quadratic drag [N m s$^2$]"),
    )
    for axis, (part, values, quantity) in zip(axes, panels, strict=True):
        axis.bar(AXES[part], values[part], color=MEASURED if "added" in quantity else MODEL, width=0.6)
        label(axis, "", quantity)
    return figure
