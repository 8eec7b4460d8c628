"""The size of a velocity is none: an axis that has it is told so, and a velocity that is never negative is not."""

import numpy as np
import pytest

from hindrax_analysis.records.csv.record import read_records
from hindrax_analysis.records.recording import reason_to_skip
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.objections import Code

T = array(0.1 * np.arange(900))
NOISE_mps = 0.01
LEGS = 20.0 * np.sign(np.sin(0.5 * T)) * (np.sin(0.05 * T) > -0.5)
CHIRP = 20.0 * np.sin(0.1 * T + 0.008 * T**2)
BRAKED = np.where(T % 15.0 < 8.0, 20.0, np.where(T % 15.0 < 10.0, -12.0, 0.0))


def moved(force: Array, mass_kg: float = 20.0) -> Array:
    """Velocities (n,) [m/s] by forces (n,) [N], with noise."""
    v = np.zeros(len(T))
    for i in range(1, len(T)):
        v[i] = v[i - 1] + 0.1 / mass_kg * (force[i - 1] - 30.0 * abs(v[i - 1]) * v[i - 1])
    return array(v + NOISE_mps * np.random.default_rng(5).standard_normal(len(T)))


def code(v: Array, force: Array) -> Code:
    rows = "\n".join(f"{t:.1f},{one:.5f},{push:.4f}" for t, one, push in zip(T, v, force, strict=True))
    (record,) = read_records(f"t,u,X\n{rows}", "x.csv")
    return reason_to_skip(record, 0).code


@pytest.mark.parametrize("force", [LEGS, CHIRP])
@pytest.mark.parametrize("mass_kg", [6.0, 20.0, 60.0])
@pytest.mark.parametrize("across_mps", [0.0, 0.05])
def test_a_speed_without_a_sign_is_named(force: Array, mass_kg: float, across_mps: float) -> None:
    assert code(array(np.hypot(moved(force, mass_kg), across_mps)), force) is Code.UNSIGNED_VELOCITY


@pytest.mark.parametrize(
    ("v", "force"),
    [
        (moved(LEGS), LEGS),
        (moved(CHIRP) + 1.2, CHIRP),
        (np.maximum(0.0, moved(BRAKED)), BRAKED),
        (np.abs(moved(np.abs(LEGS))), np.abs(LEGS)),
    ],
    ids=["both ways", "in a current", "ahead and braked", "pushed one way alone"],
)
def test_a_velocity_is_none(v: Array, force: Array) -> None:
    assert code(array(v), force) is Code.NONE
