"""Results of a run: coefficients as fitted and as corrected, their uncertainties, their method, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple

import numpy as np

from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.objections import CAUSES, OF_FITS, Objection, to_json
from hindrax_ident.model.motion_model import MOTIONS, offset, restoring
from hindrax_ident.remedies import Remedy

Z95 = 1.959964
"""Half of the 95 % interval of a normal distribution [standard deviations]."""


class Interval(NamedTuple):
    """Posterior of k quantities: its mean, and the ends of its equal-tailed 68 and 95 % intervals, (k,) each."""

    center: Array
    low68: Array
    high68: Array
    low95: Array
    high95: Array

    def widened(self, std: Array) -> Interval:
        """With an independent normal error of this deviation (k,) besides."""
        ends = [
            self.center + side * np.hypot(end - self.center, z * std)
            for end, side, z in zip(self[1:], (-1.0, 1.0, -1.0, 1.0), (1.0, 1.0, Z95, Z95), strict=True)
        ]
        return Interval(self.center, *map(array, ends))

    def at(self, index: int) -> Corrected:
        """One of the quantities."""
        center, low68, high68, low95, high95 = (float(one[index]) for one in self)
        return Corrected(center, (low68, high68), (low95, high95))

    def to_json(self) -> dict[str, object]:
        """Plain lists."""
        pairs = {"interval68": (self.low68, self.high68), "interval95": (self.low95, self.high95)}
        return {"value": self.center.tolist(), **{name: [one.tolist() for one in ends] for name, ends in pairs.items()}}


@dataclass(frozen=True, slots=True)
class Corrected:
    """A quantity corrected by what is probable of each influence, and its 68 and 95 % intervals."""

    value: float
    interval68: tuple[float, float]
    interval95: tuple[float, float]

    @property
    def std(self) -> float:
        """Half of the 68 % interval: the standard deviation where it is symmetric. What stands behind +-."""
        return 0.5 * (self.interval68[1] - self.interval68[0])

    def widened(self, std: float) -> Corrected:
        """With an independent normal error of this deviation besides."""
        one = Interval(*(array([x]) for x in (self.value, *self.interval68, *self.interval95)))
        return one.widened(array([std])).at(0)

    def to_json(self) -> dict[str, object]:
        """Plain data."""
        return {"value": self.value, "interval68": list(self.interval68), "interval95": list(self.interval95)}


@dataclass(frozen=True, slots=True)
class Number:
    """A coefficient: value of the fit, standard deviation from the noise of this run, and with all influences.

    `corrected`: the value that it probably has, with its intervals; None where only the record is known.
    """

    value: float
    std: float
    std_calibrated: float = math.nan
    truth: float | None = None
    unit: str = ""
    corrected: Corrected | None = None

    @property
    def quoted(self) -> tuple[float, float]:
        """What to say of the vehicle: the corrected value and half of its 68 % interval, else that of the fit."""
        if self.corrected is not None:
            return self.corrected.value, self.corrected.std
        return self.value, self.std_calibrated if math.isfinite(self.std_calibrated) else self.std

    def to_json(self) -> dict[str, object]:
        """Plain data; `truth` is null where unknown."""
        out: dict[str, object] = {"value": self.value, "std": self.std, "truth": self.truth, "unit": self.unit}
        if math.isfinite(self.std_calibrated):
            out["std_calibrated"] = self.std_calibrated
        if self.corrected is not None:
            out["corrected"] = self.corrected.to_json()
        return out


@dataclass(frozen=True, slots=True)
class Contribution:
    """One row of an uncertainty budget: standard deviation that a quantity would lose if the influence were known."""

    influence: str
    std: float
    remedy: str


@dataclass(frozen=True, slots=True)
class NextStep:
    """Next experiment: the remedy that narrows the interval of a quantity most, and its deviation then."""

    remedy: Remedy
    std: float
    """Standard deviation of the quantity after it."""

    def to_json(self) -> dict[str, object]:
        """As a mapping of plain values: YAML knows no other kind of text."""
        return {"remedy": str(self.remedy), "std": self.std}


@dataclass(frozen=True, slots=True)
class DragBand:
    """Drag force over the excited speeds, as fitted, with both standard deviations, and as corrected: (n,) each."""

    speed: Array
    force: Array
    std: Array
    std_calibrated: Array
    corrected: Interval | None = None

    def quoted(self, index: int) -> tuple[float, float]:
        """What to say of the vehicle at one of the speeds: force and deviation, as `Number.quoted`."""
        if self.corrected is not None:
            one = self.corrected.at(index)
            return one.value, one.std
        return float(self.force[index]), float(self.std_calibrated[index])

    @property
    def correction(self) -> float | None:
        """Change of the force at the highest speed by what is probable of each influence, as a share of it [-].

        None where there is no such share: the 95 % interval of the force reaches zero, or the change is as large as the
        force that was fitted.
        """
        if self.corrected is None:
            return 0.0
        fitted, one = float(self.force[-1]), self.corrected.at(-1)
        low, high = one.interval95
        known = abs(one.value - fitted) < abs(fitted) and (low > 0.0 or high < 0.0)
        return one.value / fitted - 1.0 if known else None

    def to_json(self) -> dict[str, object]:
        """Plain lists."""
        out: dict[str, object] = {
            one.name: getattr(self, one.name).tolist() for one in fields(self) if one.name != "corrected"
        }
        return out | ({"corrected": self.corrected.to_json()} if self.corrected is not None else {})


@dataclass(frozen=True, slots=True)
class MotionResult:
    """One row of the result: the coefficients of one motion."""

    motion: str
    method: str
    coefficients: Mapping[str, Number]
    identifiable: bool
    reasons: tuple[Objection, ...] = ()
    speeds: tuple[float, float] = (0.0, 0.0)
    names: tuple[str, ...] = ()
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    covariance_calibrated: Array = field(default_factory=lambda: np.zeros((0, 0)), compare=False)
    """With all influences of the budget; `covariance` has the noise of this run alone. Rows and columns as `names`."""
    covariance_corrected: Array = field(default_factory=lambda: np.zeros((0, 0)), compare=False)
    """Of the posterior, about the corrected values; rows and columns as `names`."""
    samples: int = 0
    effective_samples: float = 0.0
    drag: DragBand | None = None
    methods: Mapping[str, Mapping[str, Number]] = field(default_factory=dict)
    quality: Mapping[str, float] = field(default_factory=dict)
    budget: Mapping[str, Sequence[Contribution]] = field(default_factory=dict)
    """Per coefficient, and for the `drag` at the highest speed: contributions to the calibrated band, largest first."""
    next_step: NextStep | None = None
    """For the drag at the highest speed."""
    warnings: tuple[Objection, ...] = ()
    """Influences that the record shows, and what else must be known before the result is used."""

    def refused_for(self, *reasons: Objection) -> MotionResult:
        """Not identifiable for these reasons beside its own; what the residuals of such a fit resemble is no cause."""
        warnings = tuple(one for one in self.warnings if one.code not in (*CAUSES, *OF_FITS))
        return replace(self, identifiable=False, reasons=(*self.reasons, *reasons), warnings=warnings)

    def value(self, name: str) -> float:
        """Value of a coefficient; NaN where missing."""
        return self.coefficients[name].value if name in self.coefficients else math.nan

    def quoted(self, name: str) -> float:
        """Value of a coefficient as it is quoted, corrected where that is known; NaN where missing."""
        return self.coefficients[name].quoted[0] if name in self.coefficients else math.nan

    def drag_force(self, speed: float) -> tuple[float, float]:
        """Drag and its standard deviation at a speed of this motion's direction [N, N m]."""
        gradient = np.array([speed * abs(speed), speed])
        rows = [self.names.index("k_q"), self.names.index("k_l")]
        block = self.covariance[np.ix_(rows, rows)]
        k = np.array([self.coefficients["k_q"].value, self.coefficients["k_l"].value])
        return float(k @ gradient), math.sqrt(max(0.0, float(gradient @ block @ gradient)))

    def to_json(self) -> dict[str, object]:
        """Shape of `pool-test` and `identify`: coefficients by name, and their quality."""
        return {
            **{name: number.to_json() for name, number in self.coefficients.items()},
            "samples": self.samples,
            "effective_samples": self.effective_samples,
            "identifiable": self.identifiable,
            **to_json("reason", self.reasons),
            "method": self.method,
            "names": list(self.names),
            "covariance": self.covariance.tolist(),
            "covariance_calibrated": self.covariance_calibrated.tolist(),
            "covariance_corrected": self.covariance_corrected.tolist(),
            "speeds": list(self.speeds),
            "drag_force": self.drag.to_json() if self.drag else None,
            "methods": {
                method: {name: number.to_json() for name, number in numbers.items()}
                for method, numbers in self.methods.items()
            },
            "quality": dict(self.quality),
            "budget": {name: {row.influence: row.std for row in rows} for name, rows in self.budget.items()},
            "next_step": self.next_step.to_json() if self.next_step else None,
            **to_json("warning", self.warnings),
        }


@dataclass(frozen=True, slots=True)
class Results:
    """All motions of a run."""

    motions: Mapping[str, MotionResult]
    vehicle: Vehicle

    def to_json(self) -> dict[str, Any]:
        """Plain data with the key `motions`."""
        return {"motions": {name: result.to_json() for name, result in self.motions.items()}}


def truth_of(vehicle: Vehicle) -> dict[str, dict[str, float]]:
    """True coefficients of the mock vehicle, by motion; empty when the vehicle file has none."""
    if vehicle.hydrodynamics is None:
        return {}
    out = {}
    for motion in MOTIONS.values():
        k_q, k_l = vehicle.hydrodynamics.drag(AXES[motion.axis]).of(backward=motion.side < 0)
        out[motion.name] = {
            "k_q": k_q,
            "k_l": k_l,
            "b": offset(vehicle, motion.axis),
            "added_mass": vehicle.hydrodynamics.added_mass[motion.axis],
        }
        if motion.axis in (3, 4):
            out[motion.name]["k_r"] = restoring(vehicle)
    return out


def with_truth(results: Results, truth: Mapping[str, Mapping[str, float]]) -> Results:
    """Results with the true values of the mock vehicle: for display only, not used in the estimation."""
    motions = {}
    for motion, result in results.motions.items():
        true = truth.get(motion, {})
        numbers = {name: replace(number, truth=true.get(name)) for name, number in result.coefficients.items()}
        motions[motion] = replace(result, coefficients=numbers)
    return replace(results, motions=motions)
