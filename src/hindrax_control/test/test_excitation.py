"""Excitation: bounded, seeded, rich, and kept in its room."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_control.maneuver.excitation import EXCITATIONS, Bounds, Excite, signal
from hindrax_control.prior_dynamics import PriorDynamics
from hindrax_core.vehicle import Drag

SURGE = PriorDynamics(27.3, Drag(66.48, 1.25))
BOUNDS = Bounds(force=16.0, rate=0.45, middle=5.0, room=3.9, inertia=27.3)
kinds = st.sampled_from(EXCITATIONS)
seeds = st.integers(0, 2**32 - 1)


@given(kinds, seeds, st.floats(-10.0, 100.0))
def test_signals_are_bounded(kind: str, seed: int, t: float) -> None:
    assert -1.0 <= signal(kind, seed, 60.0, 0.05)(t) <= 1.0


@given(kinds, seeds)
def test_same_seed_same_signal_other_seed_other_signal(kind: str, seed: int) -> None:
    times = np.linspace(0.0, 59.9, 300)
    one, again, other = (signal(kind, value, 60.0, 0.05) for value in (seed, seed, seed + 1))
    values = [one(t) for t in times]
    assert values == [again(t) for t in times]
    assert kind == "steps" or values != [other(t) for t in times]


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_signals_push_both_ways_and_hold_several_frequencies(kind: str) -> None:
    wave = signal(kind, 3, 60.0, 0.05)
    values = np.array([wave(t) for t in np.arange(0.0, 60.0, 0.05)])
    assert values.max() > 0.5
    assert values.min() < -0.5
    assert abs(values.mean()) < 0.1
    power = np.abs(np.fft.rfft(values)) ** 2
    # At least five lines hold a hundredth of the power or more: enough to tell inertia from drag.
    assert np.sum(power > 0.01 * power.sum()) >= 5


def test_frequencies_of_a_chirp_rise() -> None:
    wave = signal("chirp", 1, 60.0, 0.05)
    crossings = [t for t in np.arange(0.0, 60.0, 0.01) if wave(t) * wave(t + 0.01) < 0.0]
    assert np.diff(crossings)[:3].mean() > 3.0 * np.diff(crossings)[-3:].mean()


@pytest.mark.parametrize("kind", EXCITATIONS)
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("drift", [0.0, 0.15])
def test_vehicle_stays_in_its_room(kind: str, seed: int, drift: float) -> None:
    """Surge of the Hindrax, with a current that carries it away."""
    driver = Excite(signal(kind, seed, 60.0, BOUNDS.slowest_Hz), BOUNDS, 60.0)
    x, u, thrust, dt = 5.0, 0.0, 0.0, 0.02
    furthest = fastest = 0.0
    for index in range(3001):
        drive = driver.step(x, u + drift, index * dt)
        thrust += (drive.force - thrust) * (1.0 - math.exp(-dt / 0.15))
        u += (thrust - SURGE.drag_force(u)) / SURGE.inertia * dt
        x += (u + drift) * dt
        furthest, fastest = max(furthest, abs(x - 5.0)), max(fastest, abs(u))
    assert furthest < BOUNDS.room
    assert fastest > 0.6 * BOUNDS.rate
    assert drive.finished
