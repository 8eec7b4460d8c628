"""Added mass and damping from a free oscillation on a spring. COB-2023-2422.

A model of mass m_b hangs on springs of stiffness k in water, is displaced and released. The frequency of the decay
gives the added mass, its decrement the damping. The record is a displacement, or the raw signal of an accelerometer.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hindrax_core.text.digits import Value
from hindrax_ident.arrays import Array
from hindrax_laboratory.decay import Decay, curve_fit, decay_of, displacement, drag_from_swings
from hindrax_laboratory.experiment_record import Column, evenly
from hindrax_laboratory.least_squares import check_added_mass, propagate

COLUMNS = (
    Column("time_s", "time [s], increasing"),
    Column("displacement_m", "displacement from rest [m]", required=False),
    Column("acceleration_mps2", "acceleration along the motion [m/s^2], offset and gravity may remain", required=False),
)


@dataclass(frozen=True, slots=True)
class Bench:
    """Known quantities: springs, model, water, and the vehicle to which the result is scaled."""

    stiffness_Npm: float
    mass_kg: float
    volume_m3: float
    density_kgpm3: float = 1000.0
    viscosity_m2ps: float = 1.01e-6
    prototype_volume_m3: float | None = None
    stiffness_std_Npm: float = 0.0
    mass_std_kg: float = 0.0

    @property
    def length_m(self) -> float:
        """Characteristic length, the cube root of the displaced volume."""
        return math.cbrt(self.volume_m3)


@dataclass(frozen=True, slots=True)
class FreeDecay:
    """Result of one test. Numbers in brackets are equations of COB-2023-2422."""

    decay: Decay
    added_mass_kg: Value
    """(5), from the damped frequency and the damping ratio; deviation with the spread against the curve fit."""
    added_mass_undamped_kg: Value
    """(7), which takes the damped frequency for the natural one."""
    error_percent: float
    """(11), of (7) against (5)."""
    damping_Nspm: Value
    """(6), equivalent linear damping over the whole record."""
    linear_drag_Nspm: Value
    """k_l: the part of the decrement that does not depend on amplitude."""
    quadratic_drag_Ns2pm2: Value
    """k_q: the part of the decrement that grows with amplitude."""
    added_mass_coefficient: Value
    """C_M (8)."""
    amplitude_m: float
    keulegan_carpenter: float
    """KC (9)."""
    reynolds: float
    """Largest speed times characteristic length over viscosity."""
    prototype_added_mass_kg: Value | None
    """(12)."""
    prototype_amplitude_m: float | None
    """(10)."""
    total_mass_kg: float
    """Dry and added mass together."""
    curve_fit: Decay
    """The same from a fit of the whole curve, for comparison; from an accelerometer it needs no integration."""


def added_mass_damped(stiffness: float, frequency: float, damping_ratio: float, mass: float) -> float:
    """Added mass by the damped frequency: m_a = k (1 - zeta^2) / w_d^2 - m_b. COB-2023-2422 eq. 5.

    Parameters
    ----------
    stiffness : [N/m]
        k of the springs.
    frequency : [rad/s]
        w_d of the decay, in water.
    damping_ratio : [-]
        zeta.
    mass : [kg]
        m_b, dry.

    Returns
    -------
    float
        [kg].
    """
    return stiffness * (1.0 - damping_ratio**2) / frequency**2 - mass


def added_mass_undamped(stiffness: float, frequency: float, mass: float) -> float:
    """Added mass with the damped frequency taken for the natural one: m_a = k / w_d^2 - m_b. COB-2023-2422 eq. 7.

    Parameters
    ----------
    stiffness, frequency, mass
        As in `added_mass_damped`.

    Returns
    -------
    float
        [kg]; too large by zeta^2 / (1 - zeta^2) of the total mass.
    """
    return stiffness / frequency**2 - mass


def linear_damping(stiffness: float, damping_ratio: float, mass: float, added_mass: float) -> float:
    """Equivalent linear damping: 2 zeta sqrt(k (m_b + m_a)). COB-2023-2422 eq. 6.

    Parameters
    ----------
    stiffness, damping_ratio, mass
        As in `added_mass_damped`.
    added_mass : [kg]
        m_a.

    Returns
    -------
    float
        [N s/m].
    """
    return 2.0 * damping_ratio * math.sqrt(stiffness * (mass + added_mass))


def keulegan_carpenter(amplitude_m: float, volume_m3: float) -> float:
    """COB-2023-2422 eq. 9 [-]."""
    return 2.0 * math.pi * amplitude_m / math.cbrt(volume_m3)


def scaled_added_mass(coefficient: float, density_kgpm3: float, volume_m3: float) -> float:
    """Added mass of another size of the same shape. COB-2023-2422 eq. 12.

    Parameters
    ----------
    coefficient : [-]
        C_M of the model, its added mass by the mass of the water that it displaces (eq. 8).
    density_kgpm3 : [kg/m^3]
        Of the water.
    volume_m3 : [m^3]
        Displaced by the other size.

    Returns
    -------
    float
        [kg].
    """
    return coefficient * density_kgpm3 * volume_m3


def analyze(
    time_s: Array,
    signal: Array,
    bench: Bench,
    kind: Literal["displacement", "acceleration"],
    *,
    source: str = "free decay",
    amplitude_m: float | None = None,
) -> FreeDecay:
    """Results of COB-2023-2422 from one record.

    Parameters
    ----------
    time_s : (n,) [s]
        Rising; even within what `evenly` allows.
    signal : (n,) [m] or [m/s^2]
        Displacement or acceleration along the motion; an offset may remain.
    bench
        Springs, model, water.
    kind
        Which of both the signal is.
    source
        Name of the record, for errors.
    amplitude_m : [m]
        Measured release amplitude; by default the largest deviation of the record.

    Returns
    -------
    FreeDecay
        Added mass, damping, drag and the numbers of the paper.

    Raises
    ------
    HindraxError
        Where the record is flat, too short or does not decay, and where the added mass is implausible.
    """
    rate, (even,) = evenly(time_s, [signal], source)
    moved = displacement(even, rate) if kind == "acceleration" else even
    decay = decay_of(moved, rate)
    largest = float(np.max(np.abs(even - np.median(even))))
    if kind == "acceleration":  # at a turning point it is the displacement times the natural frequency squared
        largest *= (1.0 - decay.damping_ratio.value**2) / decay.frequency_radps.value**2
    found = _result(decay, curve_fit(even, rate, decay), bench, amplitude_m or largest)
    check_added_mass(found.added_mass_kg, bench.mass_kg, source, "stiffness, mass and the rate of the record")
    return found


def _with_spread(value: Value, other: float) -> Value:
    """Value whose deviation includes half the difference from the other method: scatter alone is too small."""
    return Value(value.value, math.hypot(value.std, 0.5 * abs(value.value - other)))


def _damped(v: Array) -> float:
    """Return (5) of stiffness, frequency, damping ratio and mass, the order of all three formulas here."""
    return added_mass_damped(*map(float, v))


def _damping(v: Array) -> float:
    return linear_damping(float(v[0]), float(v[2]), float(v[3]), _damped(v))


def _result(decay: Decay, fitted: Decay, bench: Bench, amplitude: float) -> FreeDecay:
    inputs = np.array([bench.stiffness_Npm, decay.frequency_radps.value, decay.damping_ratio.value, bench.mass_kg])
    spread = (bench.stiffness_std_Npm, decay.frequency_radps.std, decay.damping_ratio.std, bench.mass_std_kg)
    covariance = np.diag(np.square(spread))
    other = inputs.copy()
    other[1:3] = fitted.frequency_radps.value, fitted.damping_ratio.value
    damped = _with_spread(propagate(_damped, inputs, covariance), _damped(other))
    damping = _with_spread(propagate(_damping, inputs, covariance), _damping(other))
    undamped = propagate(lambda v: added_mass_undamped(float(v[0]), float(v[1]), float(v[3])), inputs, covariance)
    displaced = bench.density_kgpm3 * bench.volume_m3
    coefficient = Value(damped.value / displaced, damped.std / displaced)
    linear, quadratic = drag_from_swings(decay, bench.mass_kg + damped.value)
    scale = bench.density_kgpm3 * (bench.prototype_volume_m3 or 0.0)
    prototype = Value(coefficient.value * scale, coefficient.std * scale) if bench.prototype_volume_m3 else None
    speed = amplitude * decay.frequency_radps.value
    return FreeDecay(
        decay=decay,
        added_mass_kg=damped,
        added_mass_undamped_kg=undamped,
        error_percent=100.0 * (undamped.value / damped.value - 1.0),
        damping_Nspm=damping,
        linear_drag_Nspm=linear,
        quadratic_drag_Ns2pm2=quadratic,
        added_mass_coefficient=coefficient,
        amplitude_m=amplitude,
        keulegan_carpenter=keulegan_carpenter(amplitude, bench.volume_m3),
        reynolds=speed * bench.length_m / bench.viscosity_m2ps,
        prototype_added_mass_kg=prototype,
        prototype_amplitude_m=amplitude * math.cbrt(bench.prototype_volume_m3) / bench.length_m
        if bench.prototype_volume_m3
        else None,
        total_mass_kg=bench.mass_kg + damped.value,
        curve_fit=fitted,
    )
