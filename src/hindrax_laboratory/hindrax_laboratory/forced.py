"""Added mass from forced oscillation. Xu, Ma, Han 2017 (vertical planar motion mechanism).

The model is driven through a sine of known frequency while it is towed, and a balance measures force and moment. The
part of the force in phase with the acceleration is inertia: the model's own and the added mass. Signs are the paper's:
force = derivative x motion, so an added mass of 90 kg is Z_wdot = -90 kg.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.digits import Value
from hindrax_ident.arrays import Array
from hindrax_laboratory.experiment_record import Column, evenly
from hindrax_laboratory.least_squares import Fit, least_squares

LOADS = ("X_N", "Y_N", "Z_N", "K_Nm", "M_Nm", "N_Nm")

COLUMNS = (
    Column("time_s", "time [s], increasing"),
    Column("displacement_m", "heave or sway of the model [m]", required=False),
    Column("angle_rad", "pitch or yaw of the model [rad]", required=False),
    *(
        Column(name, f"measured load {name[0]} [{name[2:].replace('Nm', 'N m')}], SNAME", required=False)
        for name in LOADS
    ),
)

NOT_A_SINE = 0.5
"""Largest residual of the motion beside its sine, root mean square, relative."""


@dataclass(frozen=True, slots=True)
class ForcedMotion:
    """One kind of oscillation: symbol of its acceleration, loads it excites, load to which the model's inertia adds."""

    name: str
    symbol: str
    loads: tuple[str, ...]
    own: str
    angular: bool


MOTIONS = {
    "heave": ForcedMotion("heave", "wdot", ("X_N", "Z_N", "M_Nm"), "Z_N", angular=False),
    "sway": ForcedMotion("sway", "vdot", ("Y_N", "K_Nm", "N_Nm"), "Y_N", angular=False),
    "pitch": ForcedMotion("pitch", "qdot", ("Z_N", "M_Nm"), "M_Nm", angular=True),
    "yaw": ForcedMotion("yaw", "rdot", ("Y_N", "N_Nm"), "N_Nm", angular=True),
}
"""Equations 20 (heave), 21 (sway), 22 (pitch) and 23 (yaw)."""


@dataclass(frozen=True, slots=True)
class TowedModel:
    """The towed model: mass, inertia by motion, righting moment m g z_B, length for the dimensionless form."""

    mass_kg: float
    length_m: float
    inertia_kgm2: Mapping[str, float] = field(default_factory=dict)
    restoring_Nm: float = 0.0
    density_kgpm3: float = 1000.0

    def own_inertia(self, motion: ForcedMotion) -> float:
        """Inertia of the dry model, which the load of the motion holds besides the added mass.

        Parameters
        ----------
        motion
            One of `MOTIONS`.

        Returns
        -------
        float
            Mass [kg] for a translation, moment of inertia [kg m^2] for a rotation.

        Raises
        ------
        HindraxError
            Where the moment of inertia was not given.
        """
        if not motion.angular:
            return self.mass_kg
        if motion.name not in self.inertia_kgm2:
            raise HindraxError(
                f"forced {motion.name}: the model's moment of inertia is missing; name it with --inertia"
            )
        return self.inertia_kgm2[motion.name]


@dataclass(frozen=True, slots=True)
class Harmonics:
    """Amplitudes of F(t) = F_s sin wt - F_c cos wt - F_0. Xu 2017 eq. 17 and 18."""

    sine: float
    cosine: float
    offset: float


@dataclass(frozen=True, slots=True)
class OscillationRun:
    """One test at one frequency: time from zero and, on an even time base, the motion and the loads."""

    motion: ForcedMotion
    rate_Hz: float
    moved: Array
    loads: Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class Coefficient:
    """One derivative by both methods, and its dimensionless form (Fourier method)."""

    name: str
    unit: str
    fourier: Value
    direct: Value
    dimensionless: float
    difference_percent: float


def harmonics(force: Array, periods: int) -> Harmonics:
    """Fourier amplitudes of a load over whole periods. Xu 2017 eq. 17 and 18.

    Projecting sin on itself over one period gives pi, so the factor in front of the integral is 1/pi per period
    (the 1/2pi of the mean value belongs to the offset alone).

    Parameters
    ----------
    force : (n,) [N, N m]
        Samples at the middle of even steps in phase.
    periods
        Whole number of periods that they span.

    Returns
    -------
    Harmonics
        In the unit of `force`.
    """
    step = 2.0 * math.pi * periods / force.size
    phase = step * (np.arange(force.size) + 0.5)
    sine = float(np.sum(force * np.sin(phase))) * step / (math.pi * periods)
    cosine = -float(np.sum(force * np.cos(phase))) * step / (math.pi * periods)
    return Harmonics(sine, cosine, -float(np.mean(force)))


def run_from_columns(columns: Mapping[str, Array], motion: ForcedMotion, source: str) -> OscillationRun:
    """Columns of a record needed for the motion, on an even time base.

    Parameters
    ----------
    columns : (n,) each
        As `COLUMNS` names them.
    motion
        One of `MOTIONS`.
    source
        Name of the record, for the error.

    Returns
    -------
    OscillationRun
        The motion, and those of its loads that the record has.

    Raises
    ------
    UsageError
        Names a missing column.
    """
    moved = "angle_rad" if motion.angular else "displacement_m"
    present = [name for name in motion.loads if name in columns]
    for wanted in (moved, motion.own):
        if wanted not in columns:
            raise UsageError(f"{source}: no column {wanted}, which {motion.name} needs; found {', '.join(columns)}")
    rate, signals = evenly(columns["time_s"], [columns[moved], *(columns[name] for name in present)], source)
    return OscillationRun(motion, rate, signals[0], dict(zip(present, signals[1:], strict=True)))


def frequency_of(run: OscillationRun) -> float:
    """Angular frequency [rad/s] of the driven motion, refined from the spectrum's largest line by least squares."""
    signal = run.moved - np.mean(run.moved)
    spectrum = np.abs(np.fft.rfft(signal * np.hanning(signal.size), 4 * signal.size))
    line = int(np.argmax(spectrum[1:])) + 1
    width = 2.0 * math.pi * run.rate_Hz / (4 * signal.size)
    center = line * width
    for _ in range(4):
        grid = np.linspace(center - width, center + width, 41)
        center = float(grid[int(np.argmin([_misfit(run, w) for w in grid]))])
        width /= 15.0
    return center


def _sine_columns(run: OscillationRun, frequency: float) -> Array:
    """Sine, cosine and constant over the samples of a run: (n, 3) [-]."""
    angle = frequency * np.arange(run.moved.size) / run.rate_Hz
    return np.column_stack((np.sin(angle), np.cos(angle), np.ones(angle.size)))


def _misfit(run: OscillationRun, frequency: float) -> float:
    columns = _sine_columns(run, frequency)
    residual = run.moved - columns @ np.linalg.lstsq(columns, run.moved, rcond=None)[0]
    return float(residual @ residual)


Analyzed: TypeAlias = tuple[float, float, dict[str, Harmonics]]


def amplitudes(run: OscillationRun) -> Analyzed:
    """Frequency, acceleration, and harmonics of each load in phase with the acceleration.

    The phase is zero where the acceleration rises through zero: motion = -(amplitude / w^2) sin. Every period that the
    record holds in full counts; the load is interpolated on 256 phases of each.

    Parameters
    ----------
    run
        One test at one frequency.

    Returns
    -------
    Analyzed
        w [rad/s]; amplitude of the acceleration [m/s^2, rad/s^2]; harmonics by load [N, N m].

    Raises
    ------
    HindraxError
        Where the motion is not a sine of one frequency, or the record holds no whole period.
    """
    frequency = frequency_of(run)
    if _misfit(run, frequency) > NOT_A_SINE**2 * float(np.sum((run.moved - np.mean(run.moved)) ** 2)):
        raise HindraxError(
            f"forced {run.motion.name}: the motion is not a sine of one frequency; give one file per frequency"
        )
    sine, cosine, _ = np.linalg.lstsq(_sine_columns(run, frequency), run.moved, rcond=None)[0]
    motion = math.hypot(sine, cosine)
    start = -math.atan2(-cosine, -sine) / frequency
    period = 2.0 * math.pi / frequency
    length = (run.moved.size - 1) / run.rate_Hz
    start -= period * math.floor(start / period)
    count = int((length - start) / period)
    if count < 1:
        raise HindraxError(f"forced {run.motion.name}: no whole period of {period:.3g} s in the record; record longer")
    phase = 2.0 * math.pi * count * (np.arange(256 * count) + 0.5) / (256 * count)
    time = np.arange(run.moved.size) / run.rate_Hz
    even = {name: np.interp(start + phase / frequency, time, load) for name, load in run.loads.items()}
    return frequency, motion * frequency**2, {name: harmonics(load, count) for name, load in even.items()}


def derivatives(runs: Sequence[OscillationRun], model: TowedModel) -> list[Coefficient]:
    """Acceleration derivatives of one motion, by both methods of the paper.

    Parameters
    ----------
    runs
        Of one motion, at several frequencies.
    model
        Its own mass or inertia is subtracted.

    Returns
    -------
    list[Coefficient]
        One per load that every run has.

    Raises
    ------
    HindraxError
        Where motions are mixed, and as `amplitudes` and `TowedModel.own_inertia` do.
    """
    motion = runs[0].motion
    if any(run.motion != motion for run in runs):
        raise HindraxError("forced: runs of different motions were mixed; give one motion at a time")
    analyzed = [amplitudes(run) for run in runs]
    names = [name for name in motion.loads if all(name in run.loads for run in runs)]
    return [_coefficient(name, runs, analyzed, model) for name in names]


def _coefficient(
    load: str, runs: Sequence[OscillationRun], analyzed: Sequence[Analyzed], model: TowedModel
) -> Coefficient:
    motion = runs[0].motion
    own = model.own_inertia(motion) if load == motion.own else 0.0
    restoring = model.restoring_Nm if load == motion.own == "M_Nm" else 0.0
    fourier = _by_amplitudes(load, analyzed, own, restoring)
    fit = _by_time_series(load, runs, analyzed, restoring)
    direct = Value(fit["acceleration"].value + own, fit["acceleration"].std)
    power = 3 + (load.endswith("Nm")) + motion.angular
    scale = 0.5 * model.density_kgpm3 * model.length_m**power
    return Coefficient(
        name=f"{load[0]}_{motion.symbol}",
        unit={3: "kg", 4: "kg m", 5: "kg m^2"}[power],
        fourier=fourier,
        direct=direct,
        dimensionless=fourier.value / scale,
        difference_percent=100.0 * abs(direct.value / fourier.value - 1.0) if fourier.value else math.nan,
    )


def _by_amplitudes(load: str, analyzed: Sequence[Analyzed], own: float, restoring: float) -> Value:
    """Slope of F_s over the acceleration amplitude, through the origin (20-23); its spread needs two frequencies."""
    acceleration = np.array([item[1] for item in analyzed])
    # The righting moment opposes the angle, and the angle opposes its own acceleration: it appears with a plus.
    righting = np.array([restoring * item[1] / item[0] ** 2 for item in analyzed])
    sine = np.array([item[2][load].sine for item in analyzed]) - righting
    if acceleration.size == 1:
        return Value(float(sine[0] / acceleration[0]) + own, math.nan)
    fit = least_squares(acceleration[:, None], sine, (load,))
    return Value(float(fit.values[0]) + own, fit[load].std)


def _by_time_series(load: str, runs: Sequence[OscillationRun], analyzed: Sequence[Analyzed], restoring: float) -> Fit:
    """Least squares of the load itself on acceleration, velocity and a constant (11-14), all runs together."""
    blocks, measured = [], []
    for run, (frequency, _, _) in zip(runs, analyzed, strict=True):
        columns = _sine_columns(run, frequency)
        sine, cosine, offset = np.linalg.lstsq(columns, run.moved, rcond=None)[0]
        moved = columns[:, :2] @ np.array([sine, cosine])
        velocity = frequency * columns[:, :2] @ np.array([-cosine, sine])
        blocks.append(np.column_stack((-(frequency**2) * moved, velocity, np.ones(moved.size))))
        measured.append(run.loads[load] + restoring * (moved + offset))
    names = ("acceleration", "velocity", "constant")
    return least_squares(np.vstack(blocks), np.concatenate(measured), names)
