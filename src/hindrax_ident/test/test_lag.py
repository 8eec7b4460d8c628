"""Lagged thrust against a fine integration, and its limits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from hindrax_ident.model.thrust_lag import LaggedInput, LaggedThrust


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
