"""Forced oscillation: known derivatives come back by both ways. Xu, Ma, Han 2017."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.errors import HindraxError
from hindrax_ident.arrays import array
from hindrax_laboratory.forced import (
    MOTIONS,
    OscillationRun,
    TowedModel,
    derivatives,
    frequency_of,
    harmonics,
    run_from_columns,
)

MODEL = TowedModel(78.0, 0.875, {"pitch": 6.0, "yaw": 5.5}, restoring_Nm=25.0)
PUBLISHED = {
    "heave": {"Z_N": -86.7, "M_Nm": -7.98},
    "sway": {"Y_N": -41.9, "K_Nm": -6.08, "N_Nm": -6.69},
    "pitch": {"Z_N": -17.9, "M_Nm": -4.49},
    "yaw": {"Y_N": -9.63, "N_Nm": -5.88},
}
"""At U = 0.532 m/s."""


def oscillate(name: str, frequency_Hz: float, *, phase: float = 0.7, noise: float = 0.0) -> OscillationRun:
    motion = MOTIONS[name]
    time = np.arange(3000) / 100.0
    w = 2.0 * math.pi * frequency_Hz
    amplitude = 0.05 if motion.angular else 0.02
    moved = amplitude * np.sin(w * time + phase)
    velocity, acceleration = amplitude * w * np.cos(w * time + phase), -(w**2) * moved
    columns = {"time_s": time, ("angle_rad" if motion.angular else "displacement_m"): moved}
    generator = np.random.default_rng(3)
    for load, derivative in PUBLISHED[name].items():
        own = MODEL.own_inertia(motion) if load == motion.own else 0.0
        righting = MODEL.restoring_Nm * moved if load == "M_Nm" and name == "pitch" else 0.0
        force = (derivative - own) * acceleration - 30.0 * velocity - 3.0 - righting
        columns[load] = force + generator.normal(0.0, noise, time.size) if noise else force
    return run_from_columns(columns, motion, "test")


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-50, 50), st.integers(1, 7))
def test_the_projection_needs_one_over_pi(sine: float, cosine: float, offset: float, periods: int) -> None:
    phase = 2.0 * math.pi * periods * (np.arange(256 * periods) + 0.5) / (256 * periods)
    found = harmonics(sine * np.sin(phase) - cosine * np.cos(phase) - offset, periods)
    assert (found.sine, found.cosine, found.offset) == pytest.approx((sine, cosine, offset), abs=1e-9)


@pytest.mark.parametrize("name", list(MOTIONS))
def test_nine_derivatives_come_back_by_both_ways(name: str) -> None:
    runs = [oscillate(name, f, noise=0.2) for f in (0.1, 0.2, 0.3, 0.4, 0.5)]
    found = {c.name[0]: c for c in derivatives(runs, MODEL)}
    for load, truth in PUBLISHED[name].items():
        coefficient = found[load[0]]
        assert coefficient.fourier.value == pytest.approx(truth, rel=0.02)
        assert coefficient.direct.value == pytest.approx(truth, rel=0.02)
        assert coefficient.difference_percent < 6.3


def test_names_units_and_dimensionless_forms() -> None:
    found = {c.name: c for name in MOTIONS for c in derivatives([oscillate(name, 0.3), oscillate(name, 0.4)], MODEL)}
    assert set(found) == {"Z_wdot", "M_wdot", "Y_vdot", "K_vdot", "N_vdot", "Z_qdot", "M_qdot", "Y_rdot", "N_rdot"}
    for name, power in (("Z_wdot", 3), ("M_wdot", 4), ("Z_qdot", 4), ("M_qdot", 5)):
        assert found[name].dimensionless == pytest.approx(found[name].fourier.value / (500.0 * 0.875**power))
    assert [found[name].unit for name in ("Z_wdot", "M_wdot", "Z_qdot", "M_qdot")] == ["kg", "kg m", "kg m", "kg m^2"]


@settings(max_examples=8, deadline=None)
@given(st.floats(0.1, 0.5), st.floats(0.0, 6.2))
def test_frequency_and_phase_of_the_drive_are_found(frequency_Hz: float, phase: float) -> None:
    run = oscillate("heave", frequency_Hz, phase=phase)
    assert frequency_of(run) == pytest.approx(2.0 * math.pi * frequency_Hz, rel=1e-4)
    found = {c.name: c for c in derivatives([run], MODEL)}
    assert found["Z_wdot"].fourier.value == pytest.approx(-86.7, rel=5e-3)


def test_a_missing_column_is_named() -> None:
    with pytest.raises(HindraxError, match="no column Z_N, which heave needs"):
        run_from_columns({"time_s": array(np.arange(20.0)), "displacement_m": np.zeros(20)}, MOTIONS["heave"], "a.csv")


def test_a_motion_of_two_frequencies_is_refused() -> None:
    time = np.arange(3000) / 100.0
    moved = np.sin(1.0 * time) + np.sin(2.3 * time)
    with pytest.raises(HindraxError, match="not a sine of one frequency"):
        derivatives(
            [run_from_columns({"time_s": time, "displacement_m": moved, "Z_N": moved}, MOTIONS["heave"], "a")], MODEL
        )


def test_less_than_a_period_is_refused() -> None:
    time = np.arange(100) / 100.0
    columns = {"time_s": time, "displacement_m": np.sin(2.0 * time), "Z_N": np.cos(2.0 * time)}
    with pytest.raises(HindraxError, match="no whole period"):
        derivatives([run_from_columns(columns, MOTIONS["heave"], "a.csv")], MODEL)
