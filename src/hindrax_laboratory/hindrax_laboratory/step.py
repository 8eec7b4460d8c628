"""Velocity after a step of thrust: simulated exactly, and fitted. Badawy, Omer 2012, figures 14 to 17.

(m + m_a) v' + K_L v + K_Q v|v| = T from rest: the velocity rises to a constant, the acceleration falls to zero.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_core.errors import HindraxError
from hindrax_core.text.digits import Value
from hindrax_ident.arrays import Array
from hindrax_laboratory.experiment_record import Column
from hindrax_laboratory.least_squares import check_added_mass, fit_curve

COLUMNS = (
    Column("time_s", "time since the step [s]"),
    Column("velocity_mps", "velocity [m/s]"),
    Column("thrust_N", "thrust of the step [N]; each value is one test, time starts again", required=False),
)

REST_mps = 1e-6
"""No instrument measures less."""
NOT_A_STEP = 0.5
"""Largest residual of the velocity after the fit, root mean square, relative."""

PAPER_THRUSTS_N = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0)


@dataclass(frozen=True, slots=True)
class StepPlant:
    """One degree of freedom: total mass (with added mass) [kg], linear [N s/m] and quadratic [N s^2/m^2] drag."""

    mass_kg: float
    k_l: float
    k_q: float

    def terminal_mps(self, thrust_N: float) -> float:
        """Velocity at which drag equals the thrust [m/s]."""
        force = abs(thrust_N)
        root = math.sqrt(self.k_l**2 + 4.0 * self.k_q * force)
        # This form of the root does not cancel when the quadratic drag is small.
        return math.copysign(2.0 * force / (self.k_l + root), thrust_N) if force > 0.0 else 0.0

    def velocity_mps(self, time_s: Array, thrust_N: float) -> Array:
        """Exact velocity from rest [m/s], (n,), for K_L, K_Q >= 0, not both zero (Riccati equation)."""
        top = abs(self.terminal_mps(thrust_N))
        rate = math.sqrt(self.k_l**2 + 4.0 * self.k_q * abs(thrust_N)) / self.mass_kg
        # v_inf over the other root's distance, K_Q v_inf / (K_Q v_inf + K_L), is 0 for linear and 1 for quadratic drag.
        shape = self.k_q * top / (self.k_q * top + self.k_l) if top > 0.0 else 0.0
        decay = np.exp(-rate * np.clip(time_s, 0.0, None))
        return np.asarray(math.copysign(1.0, thrust_N) * top * (1.0 - decay) / (1.0 + shape * decay))

    def acceleration_mps2(self, time_s: Array, thrust_N: float) -> Array:
        """Acceleration [m/s^2], (n,), at velocity_mps, from the equation of motion."""
        velocity = self.velocity_mps(time_s, thrust_N)
        return np.asarray((thrust_N - self.k_l * velocity - self.k_q * velocity * np.abs(velocity)) / self.mass_kg)


@dataclass(frozen=True, slots=True)
class StepTest:
    """One recorded step."""

    thrust_N: float
    time_s: Array
    velocity_mps: Array


@dataclass(frozen=True, slots=True)
class StepFit:
    """Result of the fit of all steps together."""

    total_mass_kg: Value
    added_mass_kg: Value
    k_l: Value
    k_q: Value
    residual_std_mps: float
    samples: int


def tests_from_columns(time_s: Array, velocity_mps: Array, thrust_N: Array) -> list[StepTest]:
    """Cut a record where the thrust changes or time starts again.

    Parameters
    ----------
    time_s : (n,) [s]
        Time of each row.
    velocity_mps : (n,) [m/s]
        Velocity at that time.
    thrust_N : (n,) [N]
        Thrust of the step that the row belongs to.

    Returns
    -------
    list[StepTest]
        One per thrust, each with its time from zero.
    """
    cuts = np.flatnonzero((np.diff(thrust_N) != 0.0) | (np.diff(time_s) <= 0.0)) + 1
    parts = zip(np.split(time_s, cuts), np.split(velocity_mps, cuts), np.split(thrust_N, cuts), strict=True)
    return [StepTest(float(thrust[0]), time - time[0], velocity) for time, velocity, thrust in parts]


def fit(tests: Sequence[StepTest], mass_kg: float) -> StepFit:
    """Output-error fit of total mass, K_L and K_Q to recorded velocities; nothing is differentiated.

    One step alone hardly separates K_L from K_Q: its terminal speed gives one equation for both.

    Parameters
    ----------
    tests
        Velocities after each step.
    mass_kg : [kg]
        The vehicle's own mass, which is subtracted to give the added mass.

    Returns
    -------
    StepFit
        With standard deviations from the residuals.

    Raises
    ------
    HindraxError
        When the record has no step from rest or too few samples, and when it cannot separate K_L from K_Q at all.
    """
    measured = np.concatenate([test.velocity_mps for test in tests])
    if measured.size <= 3:
        raise HindraxError(f"step: found {measured.size} samples, wanted more than 3; record longer")

    def residual(shape: Array) -> Array:
        """Model minus measurement of all tests: (n,) [m/s]."""
        plant = StepPlant(*map(float, np.exp(shape)))
        model = [plant.velocity_mps(test.time_s, test.thrust_N) for test in tests]
        return np.asarray(np.concatenate(model) - measured)

    # Logarithms keep the three positive; their relative deviations are the deviations of the logarithms.
    found = fit_curve(residual, np.log(_start(tests)), np.ones(3), ("mass", "K_L", "K_Q"))
    if found.residual_std > NOT_A_STEP * float(np.sqrt(np.mean(measured**2))):
        raise HindraxError(
            f"step: {found.residual_std:.3g} m/s residual after the fit; the record has no step from rest, "
            "or its thrust is wrong"
        )
    pairs = zip(np.exp(found.values), np.sqrt(np.diag(found.covariance)), strict=True)
    mass, k_l, k_q = (Value(float(value), float(value * part)) for value, part in pairs)
    added = Value(mass.value - mass_kg, mass.std)
    check_added_mass(added, mass_kg, "step", "mass and the unit of the thrust")
    return StepFit(mass, added, k_l, k_q, found.residual_std, found.samples)


def _start(tests: Sequence[StepTest]) -> Array:
    """Initial mass [kg], K_L and K_Q, (3,): equal linear and quadratic drag at the end; mass from the rise time."""
    strongest = max(tests, key=lambda test: abs(test.thrust_N))
    top = float(np.mean(np.abs(strongest.velocity_mps[-max(1, strongest.velocity_mps.size // 10) :])))
    if not (top > REST_mps and strongest.thrust_N != 0.0):
        raise HindraxError("step: found no velocity or no thrust in the strongest step, wanted both; check the columns")
    k_l, k_q = 0.5 * abs(strongest.thrust_N) / top, 0.5 * abs(strongest.thrust_N) / top**2
    risen = int(np.argmax(np.abs(strongest.velocity_mps) >= 0.6 * top))
    return np.array([max(float(strongest.time_s[risen]), 1e-3) * (k_l + 2.0 * k_q * top), k_l, k_q])
