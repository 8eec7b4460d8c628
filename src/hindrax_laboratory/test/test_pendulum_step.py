"""Pendulum and step response: what was simulated comes back. Badawy, Omer 2012."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hindrax_core.errors import HindraxError
from hindrax_ident.arrays import Array, array
from hindrax_laboratory import pendulum, step

PENDULUM = pendulum.Pendulum(mass_kg=3.739, buoyancy_N=2.24 * 9.80665, arm_m=0.40)
REPEATS = [(1.73977, 59.44488, 0.348868), (1.660689, 62.27559, 0.282417), (1.344367, 48.12204, 0.365481)]


def coefficients(added: float, k_l: float, k_q: float) -> Array:
    total = PENDULUM.mass_kg + added
    return np.array([-PENDULUM.net_weight_N / (total * PENDULUM.arm_m), k_l / total, k_q * PENDULUM.arm_m / total])


@pytest.mark.parametrize("repeat", REPEATS)
def test_the_published_repeats_come_back_from_their_simulation(repeat: tuple[float, float, float]) -> None:
    time = array(np.arange(0.0, 8.0, 0.01))
    theta = pendulum.simulate(time, coefficients(*repeat), 1.0)
    found = pendulum.analyze(time, theta, PENDULUM).output_error
    assert found.added_mass_kg.value == pytest.approx(repeat[0], rel=0.005)
    assert found.k_l.value == pytest.approx(repeat[1], rel=0.005)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_swinging_pendulum_shows_all_three_under_noise(seed: int) -> None:
    time = array(np.arange(0.0, 12.0, 0.02))
    truth = (1.74, 2.2, 6.9)
    noise = np.random.default_rng(seed).normal(0.0, 1e-3, time.size)
    fit = pendulum.analyze(time, pendulum.simulate(time, coefficients(*truth), 1.0) + noise, PENDULUM)
    found = (fit.output_error.added_mass_kg, fit.output_error.k_l, fit.output_error.k_q)
    for value, true in zip(found, truth, strict=True):
        assert abs(value.value - true) < 4.0 * value.std
        assert value.std < 0.02 * true
    paper = (fit.regression.added_mass_kg, fit.regression.k_l, fit.regression.k_q)
    assert [v.value for v in paper] == pytest.approx(truth, rel=0.05)


def test_a_pendulum_that_floats_is_refused() -> None:
    time = array(np.arange(0.0, 5.0, 0.01))
    with pytest.raises(HindraxError, match="weight minus buoyancy"):
        pendulum.analyze(time, np.cos(time), pendulum.Pendulum(2.0, 30.0, 0.4))


@pytest.mark.parametrize(
    ("signal", "message"),
    [
        ("degrees", "use radians"),
        ("noise", "pendulum"),
        ("flat", "does not excite|separate them"),
        ("growing", "the swing grows|no pendulum motion fits"),
    ],
)
def test_what_is_no_pendulum_is_refused(signal: str, message: str) -> None:
    time = array(np.arange(0.0, 6.0, 0.01))
    signals = {
        "degrees": 57.3 * np.cos(time),
        "noise": np.random.default_rng(0).normal(0.0, 0.3, time.size),
        "flat": np.zeros(time.size),
        "growing": 0.1 * np.sin(9.0 * time) * np.exp(0.3 * time),
    }
    with pytest.raises(HindraxError, match=message):
        pendulum.analyze(time, signals[signal], PENDULUM)


def test_a_record_without_a_step_is_refused() -> None:
    time = array(np.arange(0.0, 6.0, 0.01))
    with pytest.raises(HindraxError, match=r"step|separate them"):
        step.fit([step.StepTest(5.0, time, np.random.default_rng(0).normal(0.0, 1.0, time.size))], 3.0)


@pytest.mark.parametrize("top_mps", [0.0, 1e-200])
def test_a_step_without_motion_is_refused(top_mps: float) -> None:
    time = np.arange(100) / 10.0
    with pytest.raises(HindraxError, match="no velocity or no thrust in the strongest step"):
        step.fit([step.StepTest(5.0, time, top_mps * time)], 3.0)


@settings(max_examples=25, deadline=None)
@given(st.floats(1.0, 50.0), st.floats(0.01, 80.0), st.floats(0.01, 90.0), st.floats(-30.0, 30.0))
def test_the_exact_step_is_the_solution_of_the_equation_of_motion(
    mass: float, k_l: float, k_q: float, thrust: float
) -> None:
    plant = step.StepPlant(mass, k_l, k_q)
    time = array(np.linspace(0.0, 5.0, 21))
    solved = solve_ivp(
        lambda _, v: (thrust - k_l * v - k_q * v * np.abs(v)) / mass,
        (0.0, 5.0),
        [0.0],
        t_eval=time,
        rtol=1e-9,
        atol=1e-11,
        method="LSODA",
    )
    assert plant.velocity_mps(time, thrust) == pytest.approx(solved.y[0], abs=1e-6)


@given(st.floats(0.1, 80.0), st.floats(0.1, 90.0), st.floats(0.1, 30.0))
def test_velocity_rises_to_where_drag_holds_the_thrust_and_acceleration_falls(
    k_l: float, k_q: float, thrust: float
) -> None:
    plant = step.StepPlant(5.0, k_l, k_q)
    top = plant.terminal_mps(thrust)
    assert k_l * top + k_q * top**2 == pytest.approx(thrust)
    time = array(np.linspace(0.0, 10.0, 50))
    assert np.all(np.diff(plant.velocity_mps(time, thrust)) >= -1e-12)
    assert np.all(np.diff(plant.acceleration_mps2(time, thrust)) <= 1e-9)
    assert plant.acceleration_mps2(time, thrust)[0] == pytest.approx(thrust / 5.0)


def test_purely_quadratic_drag_is_a_hyperbolic_tangent() -> None:
    plant = step.StepPlant(27.3, 0.0, 66.48)
    time = array(np.linspace(0.0, 5.0, 30))
    assert plant.velocity_mps(time, 20.0) == pytest.approx(
        np.sqrt(20 / 66.48) * np.tanh(np.sqrt(20 * 66.48) / 27.3 * time)
    )


def test_mass_and_drag_come_back_from_steps_in_both_directions() -> None:
    plant, generator = step.StepPlant(27.3, 1.25, 66.48), np.random.default_rng(0)
    time = array(np.arange(0.0, 10.0, 0.05))
    tests = [
        step.StepTest(t, time, plant.velocity_mps(time, t) + generator.normal(0.0, 0.01, time.size))
        for t in (5.0, 10.0, -20.0, 30.0)
    ]
    found = step.fit(tests, 15.22)
    assert abs(found.added_mass_kg.value - 12.08) < 4.0 * found.added_mass_kg.std
    assert abs(found.k_q.value - 66.48) < 4.0 * found.k_q.std
    assert abs(found.k_l.value - 1.25) < 4.0 * found.k_l.std


def test_a_record_is_cut_where_the_thrust_changes_or_time_starts_again() -> None:
    time = np.array([0.0, 1.0, 2.0, 0.0, 1.0, 2.0, 3.0])
    thrust = np.array([5.0, 5.0, 5.0, 5.0, 5.0, 10.0, 10.0])
    parts = step.tests_from_columns(time, array(np.arange(7.0)), thrust)
    assert [(p.thrust_N, p.time_s.tolist()) for p in parts] == [(5.0, [0, 1, 2]), (5.0, [0, 1]), (10.0, [0, 1])]


def test_an_arm_that_makes_the_added_mass_negative_is_refused() -> None:
    time = array(np.arange(0.0, 8.0, 0.01))
    theta = pendulum.simulate(time, coefficients(1.74, 2.2, 6.9), 1.0)
    with pytest.raises(HindraxError, match="check mass, arm"):
        pendulum.analyze(time, theta, pendulum.Pendulum(PENDULUM.mass_kg, PENDULUM.buoyancy_N, 2.0 * PENDULUM.arm_m))


def test_a_mass_above_the_total_is_refused() -> None:
    time = array(np.arange(0.0, 5.0, 0.05))
    moved = [step.StepTest(T, time, step.StepPlant(17.0, 10.0, 20.0).velocity_mps(time, T)) for T in (5.0, 20.0)]
    with pytest.raises(HindraxError, match="check mass"):
        step.fit(moved, 40.0)
