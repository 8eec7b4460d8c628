"""The thrust curve from a bollard-pull sweep. COB-2023-1394 section 2.2.1 and eq. 1.

The thruster pulls on a load cell through a lever: thrust = load x lever ratio. Each direction gets its own cubic
F = c4 P^3 + c3 P^2 + c2 P + c1, F in N and P in us, by least squares with standard deviations (eq. 6 to 8).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import yaml

from hindrax_core.errors import HindraxError
from hindrax_core.text.digits import Value
from hindrax_core.thrust.curves import Branch
from hindrax_ident.arrays import Array
from hindrax_ident.assess.thrust_calibration import powers_from_scaled
from hindrax_laboratory.experiment_record import Column
from hindrax_laboratory.least_squares import least_squares
from hindrax_laboratory.measured_table import BASIC_ESC_us, quiet

COLUMNS = (
    Column("pulse_us", "pulse [us]"),
    Column("load_N", "load cell, positive for forward thrust [N]"),
    Column("supply_V", "supply voltage during the sweep [V]", required=False),
)

COEFFICIENTS = ("c1", "c2", "c3", "c4")
HALF_RANGE_us = 400.0
LOW_N = 2.0
SERVO_us = (500.0, 2500.0)
"""No servo pulse is shorter or longer."""


@dataclass(frozen=True, slots=True)
class Direction:
    """One direction of the sweep: its cubic, where it can be trusted, and how well it fits."""

    c: tuple[Value, Value, Value, Value]
    covariance: Array
    """(4, 4) of c1 to c4: strongly correlated, so their deviations alone do not give that of a force."""
    from_us: float
    to_us: float
    monotone_from_us: float
    monotone_to_us: float
    residual_std_N: float
    samples: int

    def force_N(self, pulse_us: float) -> Value:
        """Thrust with the standard deviation of the fitted curve at one pulse."""
        row = np.array([1.0, pulse_us, pulse_us**2, pulse_us**3])
        value = float(row @ np.array([c.value for c in self.c]))
        return Value(value, float(np.sqrt(max(0.0, row @ self.covariance @ row))))

    @property
    def monotone(self) -> bool:
        """Whether thrust grows with the pulse over the whole range of the sweep."""
        return self.monotone_from_us <= self.from_us and self.to_us <= self.monotone_to_us

    def branch(self) -> Branch:
        """Part of the cubic that is monotone, as the vehicle file has it."""
        c1, c2, c3, c4 = self.c
        return Branch(
            c=(c1.value, c2.value, c3.value, c4.value),
            from_us=max(self.from_us, self.monotone_from_us),
            to_us=min(self.to_us, self.monotone_to_us),
            sigma=(c1.std, c2.std, c3.std, c4.std),
        )


@dataclass(frozen=True, slots=True)
class BollardCurve:
    """Both directions of a sweep."""

    negative: Direction
    positive: Direction
    stop_us: float
    dead_band_us: float
    supply_V: float | None
    missed_at_low: float
    """Largest part of a force below 2 N that its cubic misses; 0 where there is none."""
    gain_sigma: float
    """Relative deviation of the force at full thrust, the larger of both directions and of the load cell's own."""


def fit(
    pulse_us: Array,
    load_N: Array,
    *,
    lever_ratio: float = 1.0,
    stop_us: float = 1500.0,
    dead_band_us: float | None = None,
    supply_V: float | None = None,
    load_cell_sigma: float = 0.0,
) -> BollardCurve:
    """Cubic per direction from a sweep; points inside the dead band belong to neither.

    Parameters
    ----------
    pulse_us : (n,) [us]
        Pulses of the sweep.
    load_N : (n,) [N]
        What the load cell showed, positive forward.
    lever_ratio : [-]
        Thrust per load, where a lever is between both.
    stop_us : [us]
        Pulse at which the thruster stands.
    dead_band_us : [us]
        Half the width of the dead band. By default that of the data: out to the last pulse without thrust, or that of a
        Basic ESC.
    supply_V : [V]
        Voltage of the sweep, for the vehicle file.
    load_cell_sigma : [-]
        Standard deviation of the gain of cell and lever.

    Returns
    -------
    BollardCurve
        Both cubics with covariances.

    Raises
    ------
    HindraxError
        When pulses are not in microseconds, or a direction has too few points or thrust of the wrong sign.
    """
    least_us, most_us = float(pulse_us.min()), float(pulse_us.max())
    if least_us < SERVO_us[0] or most_us > SERVO_us[1]:
        raise HindraxError(
            f"bollard: pulse_us runs from {least_us:g} to {most_us:g}, wanted microseconds "
            f"from {SERVO_us[0]:.0f} to {SERVO_us[1]:.0f}"
        )
    thrust = load_N * lever_ratio
    idle = quiet(thrust)
    if dead_band_us is None:
        about = np.abs(pulse_us[idle] - stop_us)
        dead_band_us = float(about.max()) if np.any(about) else BASIC_ESC_us
    running = ~idle | (np.abs(pulse_us - stop_us) > dead_band_us)
    below = (pulse_us <= stop_us - dead_band_us) & running
    above = (pulse_us >= stop_us + dead_band_us) & running
    negative = _direction(pulse_us[below], thrust[below], "negative")
    positive = _direction(pulse_us[above], thrust[above], "positive")
    ends = (negative.force_N(negative.from_us), positive.force_N(positive.to_us))
    if ends[0].value >= 0.0 or ends[1].value <= 0.0:
        raise HindraxError(
            f"bollard: thrust is {ends[0].value:.3g} N at {negative.from_us:.0f} us and {ends[1].value:.3g} N at "
            f"{positive.to_us:.0f} us, wanted below and above 0; check the sign of the load, and remove outliers"
        )
    relative = max(end.std / abs(end.value) for end in ends)
    missed = max(_missed(one, pulse_us[at], thrust[at]) for one, at in ((negative, below), (positive, above)))
    gain_sigma = float(np.hypot(relative, load_cell_sigma))
    return BollardCurve(negative, positive, stop_us, dead_band_us, supply_V, missed, gain_sigma)


def _missed(direction: Direction, pulse_us: Array, thrust_N: Array) -> float:
    """Largest part of a small force that the cubic misses."""
    low = np.abs(thrust_N) < LOW_N
    c1, c2, c3, c4 = (c.value for c in direction.c)
    cubic = np.polynomial.Polynomial([c1, c2, c3, c4])(pulse_us[low])
    return float(np.max(np.abs(cubic / thrust_N[low] - 1.0), initial=0.0))


def _direction(pulse_us: Array, thrust_N: Array, name: str) -> Direction:
    different = np.unique(pulse_us).size
    if different < 5:
        raise HindraxError(f"bollard, {name} direction: found {different} different pulses, wanted at least 5")
    middle = float(np.mean(pulse_us))
    x = (pulse_us - middle) / HALF_RANGE_us
    found = least_squares(np.column_stack((np.ones(x.size), x, x**2, x**3)), thrust_N, COEFFICIENTS)
    back = powers_from_scaled(middle, HALF_RANGE_us)
    values = back @ found.values
    covariance = back @ found.covariance @ back.T
    spread = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    c1, c2, c3, c4 = (Value(float(v), float(s)) for v, s in zip(values, spread, strict=True))
    low, high = float(pulse_us.min()), float(pulse_us.max())
    rising = monotone_range((c1.value, c2.value, c3.value, c4.value), low, high)
    return Direction((c1, c2, c3, c4), covariance, low, high, *rising, found.residual_std, found.samples)


def monotone_range(c: tuple[float, float, float, float], low_us: float, high_us: float) -> tuple[float, float]:
    """Largest part of an interval in which a cubic rises with the pulse: between its turning points, or beyond them.

    Parameters
    ----------
    c
        Coefficients of 1, x, x^2 and x^3 in pulses.
    low_us, high_us : [us]
        Ends of the interval.

    Returns
    -------
    tuple[float, float]
        Ends of that part [us].

    Raises
    ------
    HindraxError
        Where it rises nowhere: the load has the wrong sign, or outliers decide.
    """
    _, c2, c3, c4 = c
    slope = np.polynomial.Polynomial([c2, 2.0 * c3, 3.0 * c4])
    turns = sorted(float(root.real) for root in slope.roots() if abs(root.imag) < 1e-9)
    edges = [low_us, *(turn for turn in turns if low_us < turn < high_us), high_us]
    rising = [(a, b) for a, b in pairwise(edges) if float(slope(0.5 * (a + b))) > 0.0]
    if not rising:
        raise HindraxError(
            f"bollard: thrust does not grow with the pulse from {low_us:.0f} to {high_us:.0f} us; "
            "change the sign of the load (positive is forward), and remove outliers"
        )
    return max(rising, key=lambda part: part[1] - part[0])


def vehicle_block(curve: BollardCurve, name: str = "main", source: str = "bollard pull") -> str:
    """YAML of a curve for the vehicle file, under `curves:`.

    Parameters
    ----------
    curve
        As `fit` gives it.
    name
        Of the curve; thrusters name it by `curve`.
    source
        Where it is from, for readers of the file.

    Returns
    -------
    str
        A block to paste.
    """
    block: dict[str, object] = {
        "negative": _branch_block(curve.negative.branch()),
        "positive": _branch_block(curve.positive.branch()),
        "stop_us": curve.stop_us,
        "dead_band_us": curve.dead_band_us,
        "gain_sigma": round(curve.gain_sigma, 5),
        "source": source,
    }
    if curve.supply_V is not None:
        block["supply_V"] = round(curve.supply_V, 3)
    text: str = yaml.safe_dump({"curves": {name: block}}, sort_keys=False, width=120, default_flow_style=None)
    return text


def _branch_block(branch: Branch) -> dict[str, object]:
    # Pulses are rounded inwards, so that the range stays within the rising part.
    return {
        "c": [float(f"{c:.9g}") for c in branch.c],
        "from_us": float(np.ceil(branch.from_us)),
        "to_us": float(np.floor(branch.to_us)),
        "sigma": [float(f"{s:.4g}") for s in (() if branch.sigma is None else branch.sigma)],
    }
