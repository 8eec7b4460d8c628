"""Lagged thrust against a fine integration, and its limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from hindrax_ident.arrays import Array
from hindrax_ident.model.thrust_lag import LaggedInput, LaggedThrust, SumOfThrusts


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.05, 0.15, 1.0]))
def test_force_and_impulse_are_those_of_a_fine_integration(seed: int, lag: float) -> None:
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.05, 0.6, 6))
    commands = rng.uniform(-10.0, 10.0, 6)
    thrust = LaggedThrust(times, commands, lag)
    h = 5e-4
    at = np.arange(times[0], times[-1] + 0.5, h)
    reported = commands[np.searchsorted(times, at, side="right") - 1]
    force = reported.copy()
    if lag:
        keep = 1.0 - h / lag
        force = lfilter([0.0, h / lag], [1.0, -keep], reported - commands[0]) + commands[0]
    size = np.abs(commands).max()
    assert np.abs(thrust.force(at) - force).max() < 0.03 * size
    impulse = np.concatenate([[0.0], np.cumsum(0.5 * h * (force[1:] + force[:-1]))])
    assert np.abs(thrust.impulse(at) - impulse).max() < 0.01 * size


def followed(times: Array, commands: Array, lags_s: tuple[float, float, float], at: Array) -> Array:
    """Thrust at times `at` (n,), evenly apart: it comes, goes toward zero and turns round by these lags."""
    comes_s, goes_s, turns_s = lags_s
    out, now, step_s = [], float(commands[0]), float(at[1] - at[0])
    for command in commands[np.searchsorted(times, at, side="right") - 1].tolist():
        out.append(now)
        lag_s = turns_s if command * now < 0.0 else goes_s if abs(command) < abs(now) else comes_s
        now += (command - now) * step_s / lag_s
    return np.array(out)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 2**32 - 1), st.sampled_from([(0.1, 0.3, 0.3), (0.2, 0.05, 0.4), (0.05, 0.6, 0.05), (0.3, 0.3, 0.1)])
)
def test_lags_that_differ_are_those_of_a_fine_integration(seed: int, lags_s: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(seed)
    times = np.cumsum(rng.uniform(0.02, 0.6, 12))
    commands = rng.uniform(-10.0, 10.0, 12)
    commands[rng.random(12) < 0.2] = 0.0
    at = np.arange(times[0], times[-1] + 0.5, 2e-4)
    force = followed(times, commands, lags_s, at)
    thrust = LaggedThrust(times, commands, lags_s[0], (lags_s[1] - lags_s[0], lags_s[2] - lags_s[0]))
    assert np.abs(thrust.force(at) - force).max() < 0.1
    impulse = np.concatenate([[0.0], np.cumsum(1e-4 * (force[1:] + force[:-1]))])
    assert np.abs(thrust.impulse(at) - impulse).max() < 0.02


def test_a_lag_that_is_longer_than_another_by_nothing_is_the_same() -> None:
    rng = np.random.default_rng(4)
    times, commands = np.cumsum(rng.uniform(0.02, 0.1, 2000)), rng.normal(0.0, 10.0, 2000)
    at = np.arange(0.0, times[-1] + 1.0, 0.013)
    one, by_nothing = LaggedThrust(times, commands, 0.15), LaggedThrust(times, commands, 0.15, (1e-12, 1e-12))
    assert by_nothing.impulse(at) == pytest.approx(one.impulse(at), abs=1e-8)
    assert by_nothing.force(at) == pytest.approx(one.force(at), abs=1e-8)


@pytest.mark.parametrize("lags_s", [(0.0, 0.3, 0.2), (0.15, -0.15, 0.0), (0.02, 1.0, 1.0)])
def test_thrust_of_any_lags_is_finite_and_never_beyond_its_commands(lags_s: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(5)
    times, commands = np.cumsum(rng.uniform(0.01, 0.1, 3000)), rng.uniform(-10.0, 10.0, 3000)
    force = LaggedThrust(times, commands, lags_s[0], lags_s[1:]).force(np.arange(0.0, times[-1], 0.003))
    assert np.abs(force).max() <= 10.0 + 1e-6


def test_a_sum_of_thrusts_is_that_of_its_parts() -> None:
    times, commands, at = np.array([1.0, 2.0]), np.array([4.0, 0.0]), np.linspace(0.0, 4.0, 50, dtype=np.float64)
    one, other = LaggedThrust(times, commands, 0.15), LaggedThrust(times, commands, 0.3)
    both = SumOfThrusts([(2.0, one), (-0.5, other)])
    assert both.force(at) == pytest.approx(2.0 * one.force(at) - 0.5 * other.force(at))
    assert both.impulse(at) == pytest.approx(2.0 * one.impulse(at) - 0.5 * other.impulse(at))


def test_thrust_is_steady_before_the_first_command() -> None:
    thrust = LaggedThrust(np.array([1.0, 2.0]), np.array([4.0, 0.0]), 0.15)
    assert thrust.force(np.array([0.0, 1.0, 1.99])) == pytest.approx([4.0, 4.0, 4.0])
    assert thrust.impulse(np.array([0.0])) == pytest.approx([-4.0])


def test_impulse_does_not_depend_on_how_a_constant_command_is_repeated() -> None:
    often = LaggedThrust(np.linspace(0.0, 1.0, 51, dtype=np.float64), np.where(np.arange(51) < 20, 3.0, -2.0), 0.15)
    once = LaggedThrust(np.array([0.0, 0.4]), np.array([3.0, -2.0]), 0.15)
    at = np.linspace(0.0, 2.0, 37, dtype=np.float64)
    assert often.impulse(at) == pytest.approx(once.impulse(at), abs=1e-12)


def test_no_thrust_at_all_is_refused() -> None:
    with pytest.raises(ValueError, match="no thrust"):
        LaggedThrust(np.zeros(0), np.zeros(0), 0.1)


@pytest.mark.parametrize("lag_s", [0.0, 0.2])
def test_an_input_that_is_not_over_has_the_integrals_of_a_record(lag_s: float) -> None:
    commands, running, taken = [(1.0, 4.0), (1.3, -2.0), (2.5, 7.0)], LaggedInput(lag_s), 0.0
    assert running.taken(0.5) == 0.0
    times, forces = np.array(commands).T
    record = LaggedThrust(times, forces, lag_s)
    for at_s in (1.0, 1.2, 1.3, 1.31, 2.0, 2.5, 4.0):
        for t_s, value in commands:
            if t_s == at_s:
                running.set(t_s, value)
        taken += running.taken(at_s)
        assert taken == pytest.approx(float(record.impulse(np.array([at_s]))[0]))
    assert running.taken(4.0) == running.taken(3.0) == 0.0
