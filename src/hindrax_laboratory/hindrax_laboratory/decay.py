"""A decaying oscillation: its turning points, its decrement and its frequency. COB-2023-2422 eq. 2 and 3.

The record is a displacement, or the raw signal of an accelerometer that is integrated twice.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, detrend, find_peaks, sosfiltfilt

from hindrax_core.errors import HindraxError
from hindrax_core.text.digits import Value
from hindrax_ident.arrays import Array
from hindrax_laboratory.least_squares import fit_curve, least_squares, propagate

HIGH_PASS = 0.25
"""Corner frequency of the drift filter, relative to the oscillation: far below it, far above the drift."""

SMALLEST_SWING = 0.05
"""Swings below this share of the first are omitted: noise and friction dominate there."""

FEWEST_SWINGS = 4


@dataclass(frozen=True, slots=True)
class Decay:
    """Shape of a decay: half-swings (peak to trough, halved) over their number, and the frequency."""

    frequency_radps: Value
    damping_ratio: Value
    decrement: Value
    swing_time_s: Array
    swing_m: Array


def damping_ratio(decrement: float) -> float:
    """COB-2023-2422 eq. 3 solved for zeta; decrement per full period."""
    return decrement / math.hypot(2.0 * math.pi, decrement)


def displacement(acceleration_mps2: Array, rate_Hz: float) -> Array:
    """Displacement from the release on: acceleration of a decaying oscillation, integrated twice.

    Offset, gravity and sensor drift grow without bound when integrated, so a zero-phase high-pass far below the
    oscillation removes them before, between and after the two integrations. The record is cut at its first large
    turning point: there acceleration and displacement continue as even functions and velocity as an odd one, so the
    filter has no edge effect.

    Parameters
    ----------
    acceleration_mps2 : (n,) [m/s^2]
        Along the motion, evenly sampled.
    rate_Hz : [Hz]
        Sampling rate.

    Returns
    -------
    Array
        (m,) [m], m <= n, about its mean.
    """
    frequency = dominant_frequency(acceleration_mps2, rate_Hz)
    high_pass = butter(2, HIGH_PASS * frequency, "highpass", fs=rate_Hz, output="sos")
    signal = acceleration_mps2[release(acceleration_mps2) :]
    signal = signal - np.mean(signal)
    pad = min(signal.size - 1, int(3.0 * rate_Hz / (HIGH_PASS * frequency)))
    for parity in ("even", "odd"):
        smooth = np.asarray(sosfiltfilt(high_pass, signal, padtype=parity, padlen=pad))
        signal = np.concatenate(([0.0], np.cumsum(0.5 * (smooth[1:] + smooth[:-1])))) / rate_Hz
    signal = signal - np.mean(signal)
    return np.asarray(sosfiltfilt(high_pass, signal, padtype="even", padlen=pad))


def release(signal: Array) -> int:
    """Index of the turning point with the largest deviation from rest: the first one of a decay, or its very start."""
    return int(np.argmax(np.abs(signal - np.median(signal))))


def dominant_frequency(signal: Array, rate_Hz: float) -> float:
    """Frequency of the largest line of the spectrum above two periods per record.

    The window is one at the start, where the oscillation is large, and falls to zero at the end. The record is filled
    with zeros to eight times its length, so that lines lie close enough.

    Parameters
    ----------
    signal : (n,)
        In any unit, evenly sampled.
    rate_Hz : [Hz]
        Sampling rate.

    Returns
    -------
    float
        [Hz].

    Raises
    ------
    HindraxError
        When the record is flat.
    """
    window = 0.5 * (1.0 + np.cos(np.linspace(0.0, np.pi, signal.size)))
    spectrum = np.abs(np.fft.rfft(detrend(signal) * window, 8 * signal.size))
    frequencies = np.fft.rfftfreq(8 * signal.size, 1.0 / rate_Hz)
    spectrum[frequencies < 2.0 * rate_Hz / signal.size] = 0.0
    if not 0.0 < float(spectrum.max()) < math.inf:
        raise HindraxError("free decay: the record is flat, wanted an oscillation; check the column and its unit")
    return float(frequencies[int(np.argmax(spectrum))])


def swings(signal: Array, rate_Hz: float) -> tuple[Array, Array]:
    """Turning points of a decay from the largest on, each refined by the parabola through three samples.

    Parameters
    ----------
    signal : (n,)
        In any unit, evenly sampled.
    rate_Hz : [Hz]
        Sampling rate.

    Returns
    -------
    tuple[Array, Array]
        Times (k,) [s] from the start of the record, and the signal there, (k,).

    Raises
    ------
    HindraxError
        When there are fewer than `FEWEST_SWINGS` + 1.
    """
    apart = max(1, int(0.7 * rate_Hz / dominant_frequency(signal, rate_Hz)))
    start = release(signal)
    part = signal[start:]
    floor = 2.0 * SMALLEST_SWING * float(np.max(np.abs(part - np.median(part))))
    tops, _ = find_peaks(part, distance=apart, prominence=floor)
    bottoms, _ = find_peaks(-part, distance=apart, prominence=floor)
    # Tops and bottoms in turn, up to the first two of one kind in a row: noise begins there.
    indices = np.concatenate((tops, bottoms))
    order = np.argsort(indices)
    repeats = np.flatnonzero(np.diff(order < tops.size) == 0)
    times, values = _parabola(part, indices[order][: int(repeats[0]) + 1 if repeats.size else None], rate_Hz)
    if times.size < FEWEST_SWINGS + 1:
        raise HindraxError(
            f"free decay: found {times.size} turning points, wanted at least {FEWEST_SWINGS + 1}; "
            "pull further aside, use a stiffer spring or record longer"
        )
    return times + start / rate_Hz, values


def _parabola(signal: Array, at: NDArray[np.intp], rate_Hz: float) -> tuple[Array, Array]:
    """Times [s] and values of the extremes near given samples: (n,) each."""
    before, here, after = signal[at - 1], signal[at], signal[at + 1]
    bend = before - 2.0 * here + after
    offset = np.where(bend == 0.0, 0.0, 0.5 * (before - after) / np.where(bend == 0.0, 1.0, bend))
    return (at + offset) / rate_Hz, here - 0.25 * (before - after) * offset


def decay_of(signal: Array, rate_Hz: float) -> Decay:
    """Frequency and decrement from the turning points.

    Half the distance between neighboring turning points decays like the oscillation, independent of its offset. The
    logarithms of these half-swings lie on a line whose slope is half the decrement; the times of the turning points lie
    on a line whose slope is half the period. Both slopes come with standard deviations. Noise moves the logarithm of a
    swing, and its time, by noise over swing: so each row counts with the size of its swing.

    Parameters
    ----------
    signal : (n,)
        Displacement, or anything proportional to it, evenly sampled.
    rate_Hz : [Hz]
        Sampling rate.

    Returns
    -------
    Decay
        Decrement per full period; damping ratio by COB-2023-2422 eq. 3.

    Raises
    ------
    HindraxError
        When too few half-swings are large enough, or they do not decay.
    """
    times, values = swings(signal, rate_Hz)
    half = 0.5 * np.abs(np.diff(values))
    weak = np.flatnonzero(half < SMALLEST_SWING * half[0])
    count = int(weak[0]) if weak.size else half.size
    if count < FEWEST_SWINGS:
        raise HindraxError(
            f"free decay: found {count} usable half-swings, wanted at least {FEWEST_SWINGS}; use a stiffer spring"
        )
    half, times = half[:count], times[: count + 1]
    number = np.arange(count, dtype=np.float64)
    # The noise of a half-swing's logarithm, and of its time, decreases with the swing: weights.
    line = least_squares(np.column_stack((half, half * number)), half * np.log(half), ("start", "slope"))
    middle = 0.5 * (times[:-1] + times[1:])
    clock = least_squares(np.column_stack((half, half * number)), half * middle, ("start", "half period"))
    if not line["slope"].value < -2.0 * line["slope"].std:
        raise HindraxError(f"free decay: the {count} half-swings do not decay; record from the release on")
    delta = Value(-2.0 * line["slope"].value, 2.0 * line["slope"].std)
    period = clock["half period"]
    frequency = math.pi / period.value
    return Decay(
        frequency_radps=Value(frequency, frequency * period.std / period.value),
        damping_ratio=propagate(
            lambda d: damping_ratio(float(d[0])), np.array([delta.value]), np.array([[delta.std**2]])
        ),
        decrement=delta,
        swing_time_s=middle,
        swing_m=half,
    )


def curve_fit(signal: Array, rate_Hz: float, start: Decay) -> Decay:
    """Fit exp(-s t) (C cos w t + S sin w t) + offset + slope t to the record from the first turning point on.

    Variable projection: for given s and w the rest is linear and solved at once, so only two unknowns are searched.

    Parameters
    ----------
    signal : (n,)
        As of `decay_of`.
    rate_Hz : [Hz]
        Sampling rate.
    start
        What `decay_of` found: where the search begins.

    Returns
    -------
    Decay
        With the swings of `start`.
    """
    begin = int(start.swing_time_s[0] * rate_Hz)
    end = min(signal.size, int(start.swing_time_s[-1] * rate_Hz) + 1)
    part = signal[begin:end]
    time = np.arange(part.size) / rate_Hz

    def basis(shape: Array) -> Array:
        """Basis functions: (n, 4) [-, -, -, s]."""
        envelope = np.exp(-shape[0] * time)
        swing = (envelope * np.cos(shape[1] * time), envelope * np.sin(shape[1] * time))
        return np.column_stack((*swing, np.ones(time.size), time))

    def residual(shape: Array) -> Array:
        """Residuals of the best combination: (n,), in the unit of the signal."""
        columns = basis(shape)
        return np.asarray(part - columns @ np.linalg.lstsq(columns, part, rcond=None)[0])

    frequency, zeta = start.frequency_radps.value, start.damping_ratio.value
    first = np.array([zeta * frequency / math.sqrt(1.0 - zeta**2), frequency])
    # The residual of a real decay is not white (drag is partly quadratic), so these deviations are a rough scale.
    found = fit_curve(residual, first, np.abs(first) + 1e-6, ("decay rate", "frequency"))
    shape, covariance = found.values, found.covariance
    return Decay(
        frequency_radps=found["frequency"],
        damping_ratio=propagate(lambda s: float(s[0] / math.hypot(s[0], s[1])), shape, covariance),
        decrement=propagate(lambda s: float(2.0 * math.pi * s[0] / s[1]), shape, covariance),
        swing_time_s=start.swing_time_s,
        swing_m=start.swing_m,
    )


def drag_from_swings(decay: Decay, total_mass_kg: float) -> tuple[Value, Value]:
    """Linear and quadratic drag from how the decrement depends on the amplitude.

    Energy balance over one half-swing of amplitude A: the loss of logarithmic amplitude is
    pi / (2 m w) * (k_l + 8 / (3 pi) k_q w A), so the losses lie on a line over A.

    Parameters
    ----------
    decay
        Half-swings (k,) [m] and frequency w.
    total_mass_kg : [kg]
        m, with the added mass.

    Returns
    -------
    tuple[Value, Value]
        k_l [N s/m] and k_q [N s^2/m^2]; NaN for fewer than three losses.
    """
    frequency = decay.frequency_radps.value
    loss = -np.diff(np.log(decay.swing_m))
    amplitude = np.sqrt(decay.swing_m[1:] * decay.swing_m[:-1])
    if loss.size < 3:
        return Value(math.nan, math.nan), Value(math.nan, math.nan)
    unit = math.pi / (2.0 * total_mass_kg * frequency)
    regressor = unit * np.column_stack((np.ones(loss.size), 8.0 / (3.0 * math.pi) * frequency * amplitude))
    fit = least_squares(regressor, loss, ("k_l", "k_q"))
    return fit["k_l"], fit["k_q"]
