"""Results of a run: coefficients with two standard deviations each, their method, and the verdict."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

import numpy as np

from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array
from hindrax_ident.model.motion_model import MOTIONS, offset, restoring


@dataclass(frozen=True, slots=True)
class Number:
    """A coefficient: value, standard deviation from the noise of this run, and with thruster calibration."""

    value: float
    std: float
    std_calibrated: float = math.nan
    truth: float | None = None
    unit: str = ""

    def to_json(self) -> dict[str, object]:
        """Plain data; `truth` is null where unknown."""
        out: dict[str, object] = {"value": self.value, "std": self.std, "truth": self.truth, "unit": self.unit}
        if math.isfinite(self.std_calibrated):
            out["std_calibrated"] = self.std_calibrated
        return out


@dataclass(frozen=True, slots=True)
class Contribution:
    """One row of an uncertainty budget: standard deviation that a quantity would lose if the influence were known."""

    influence: str
    std: float
    remedy: str


@dataclass(frozen=True, slots=True)
class NextStep:
    """Next experiment: the remedy that would shrink the band of a quantity most, and to what."""

    remedy: str
    std: float
    """Standard deviation of the quantity after it."""


@dataclass(frozen=True, slots=True)
class DragBand:
    """Drag force over the excited speeds, with both standard deviations: (n,) each, SI units."""

    speed: Array
    force: Array
    std: Array
    std_calibrated: Array

    def to_json(self) -> dict[str, list[float]]:
        """Plain lists."""
        return {one.name: getattr(self, one.name).tolist() for one in fields(self)}


@dataclass(frozen=True, slots=True)
class MotionResult:
    """One row of the result: the coefficients of one motion."""

    motion: str
    method: str
    coefficients: Mapping[str, Number]
    identifiable: bool
    reasons: tuple[str, ...] = ()
    speeds: tuple[float, float] = (0.0, 0.0)
    names: tuple[str, ...] = ()
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    covariance_calibrated: Array = field(default_factory=lambda: np.zeros((0, 0)), compare=False)
    """With all influences of the budget; `covariance` has the noise of this run alone. Rows and columns as `names`."""
    samples: int = 0
    effective_samples: float = 0.0
    drag: DragBand | None = None
    methods: Mapping[str, Mapping[str, Number]] = field(default_factory=dict)
    quality: Mapping[str, float] = field(default_factory=dict)
    budget: Mapping[str, Sequence[Contribution]] = field(default_factory=dict)
    """Per coefficient, and for the `drag` at the highest speed: contributions to the calibrated band, largest first."""
    next_step: NextStep | None = None
    """For the drag at the highest speed."""
    warnings: tuple[str, ...] = ()
    """Influences that the record shows, one sentence each."""

    def value(self, name: str) -> float:
        """Value of a coefficient; NaN where missing."""
        return self.coefficients[name].value if name in self.coefficients else math.nan

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
            "reasons": list(self.reasons),
            "method": self.method,
            "names": list(self.names),
            "covariance": self.covariance.tolist(),
            "covariance_calibrated": self.covariance_calibrated.tolist(),
            "speeds": list(self.speeds),
            "drag_force": self.drag.to_json() if self.drag else None,
            "methods": {
                method: {name: number.to_json() for name, number in numbers.items()}
                for method, numbers in self.methods.items()
            },
            "quality": dict(self.quality),
            "budget": {name: {row.influence: row.std for row in rows} for name, rows in self.budget.items()},
            "next_step": asdict(self.next_step) if self.next_step else None,
            "warnings": list(self.warnings),
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
