"""Free oscillation: a simulated bench gives back the added mass and drag it was simulated with. COB-2023-2422."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hindrax_core.errors import HindraxError
from hindrax_ident.arrays import Array
from hindrax_laboratory.free_decay import Bench, analyze, keulegan_carpenter, scaled_added_mass

BENCH = Bench(1127.7, 0.39, 0.00056, prototype_volume_m3=0.0153)
RATE_Hz = 330.0


def bench_record(added: float, linear: float, quadratic: float, amplitude: float) -> tuple[Array, Array, Array]:
    """Time, displacement and acceleration after release."""
    total = BENCH.mass_kg + added

    def motion(_: float, y: Array) -> tuple[float, float]:
        return y[1], -(BENCH.stiffness_Npm * y[0] + linear * y[1] + quadratic * y[1] * abs(y[1])) / total

    time = np.arange(int(10.0 * RATE_Hz)) / RATE_Hz
    x, v = solve_ivp(motion, (0.0, 10.0), (amplitude, 0.0), t_eval=time, rtol=1e-8, atol=1e-11).y
    return time, x, -(BENCH.stiffness_Npm * x + linear * v + quadratic * v * np.abs(v)) / total


@settings(max_examples=6, deadline=None)
@given(st.floats(0.3, 1.5), st.floats(2.0, 8.0), st.floats(0.005, 0.04), st.integers(0, 1000))
def test_known_added_mass_and_damping_are_recovered_from_displacement(
    added: float, linear: float, amplitude: float, seed: int
) -> None:
    time, x, _ = bench_record(added, linear, 0.0, amplitude)
    noise = np.random.default_rng(seed).normal(0.0, 1e-3 * amplitude, x.size)
    result = analyze(time, x + noise + 0.003, BENCH, "displacement")
    assert result.added_mass_kg.value == pytest.approx(added, abs=max(0.01 * added, 5.0 * result.added_mass_kg.std))
    assert result.damping_Nspm.value == pytest.approx(linear, rel=0.03)
    assert result.curve_fit.damping_ratio.value == pytest.approx(result.decay.damping_ratio.value, rel=0.03)


@pytest.mark.parametrize(("linear", "quadratic"), [(4.4, 0.0), (2.0, 10.0), (8.0, 0.0)])
def test_a_drifting_accelerometer_gives_the_same_added_mass(linear: float, quadratic: float) -> None:
    time, _, a = bench_record(0.8289, linear, quadratic, 0.02)
    drift = 9.81 + 0.3 + 0.02 * time + 0.05 * np.sin(0.7 * time)
    noise = np.random.default_rng(1).normal(0.0, 0.05, a.size)
    result = analyze(time, a + drift + noise, BENCH, "acceleration")
    assert result.added_mass_kg.value == pytest.approx(0.8289, rel=0.005)
    assert result.amplitude_m == pytest.approx(0.02, rel=0.03)
    if quadratic:
        assert result.quadratic_drag_Ns2pm2.value == pytest.approx(
            quadratic, abs=3.0 * result.quadratic_drag_Ns2pm2.std
        )
        assert result.linear_drag_Nspm.value == pytest.approx(linear, rel=0.15)


def test_rest_before_the_release_does_not_matter() -> None:
    _, _, a = bench_record(0.8289, 4.4, 0.0, 0.02)
    rest = np.zeros(int(1.3 * RATE_Hz))
    longer = np.arange(rest.size + a.size) / RATE_Hz
    result = analyze(longer, np.concatenate((rest, a)), BENCH, "acceleration")
    assert result.added_mass_kg.value == pytest.approx(0.8289, rel=0.005)


def test_linear_and_quadratic_drag_are_distinguished_by_amplitude() -> None:
    time, x, _ = bench_record(0.8289, 2.0, 10.0, 0.02)
    result = analyze(time, x, BENCH, "displacement")
    assert result.linear_drag_Nspm.value == pytest.approx(2.0, rel=0.03)
    assert result.quadratic_drag_Ns2pm2.value == pytest.approx(10.0, rel=0.04)


def test_scaling_to_the_prototype() -> None:
    time, x, _ = bench_record(0.8227, 4.4, 0.0, 0.02)
    result = analyze(time, x, BENCH, "displacement", amplitude_m=0.02)
    assert result.keulegan_carpenter == pytest.approx(1.52, abs=0.01)
    assert result.prototype_added_mass_kg is not None
    assert result.prototype_added_mass_kg.value == pytest.approx(22.48, rel=0.005)
    assert result.prototype_amplitude_m == pytest.approx(0.02 * math.cbrt(0.0153 / 0.00056))


@given(st.floats(1e-4, 1e-1), st.floats(1e-5, 1e-1), st.floats(0.1, 10.0))
def test_same_relative_amplitude_same_keulegan_carpenter_number(amplitude: float, volume: float, scale: float) -> None:
    larger = keulegan_carpenter(amplitude * scale, volume * scale**3)
    assert larger == pytest.approx(keulegan_carpenter(amplitude, volume), rel=1e-9)
    assert scaled_added_mass(1.4, 1000.0, volume * scale**3) == pytest.approx(
        scale**3 * scaled_added_mass(1.4, 1000.0, volume)
    )


TIME = np.arange(3300) / RATE_Hz


@pytest.mark.parametrize("kind", ["displacement", "acceleration"])
@pytest.mark.parametrize(
    ("signal", "message"),
    [
        (np.exp(-TIME), r"turning points.*stiffer spring"),
        (np.full(TIME.size, 9.81), "the record is flat|turning points"),
        (np.random.default_rng(0).normal(0.0, 1.0, TIME.size), "free decay"),
        (np.sin(30.0 * TIME) * np.exp(0.3 * TIME), "free decay"),
    ],
)
def test_what_is_no_decay_is_refused(
    signal: Array, message: str, kind: Literal["displacement", "acceleration"]
) -> None:
    with pytest.raises(HindraxError, match=message):
        analyze(TIME, signal, BENCH, kind)


def test_a_stiffness_that_makes_the_added_mass_negative_is_refused() -> None:
    time, x, _ = bench_record(0.8, 4.0, 0.0, 0.02)
    with pytest.raises(HindraxError, match="check stiffness"):
        analyze(time, x, replace(BENCH, stiffness_Npm=0.2 * BENCH.stiffness_Npm), "displacement")
