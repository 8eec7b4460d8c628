"""Times in which something holds the vehicle are left out and told; rests, coasts, hovering and delays are none."""

import math
from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis import api
from hindrax_analysis.records.contact import without_contact
from hindrax_analysis.records.recording import Recording
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, Flags, array

STEP_S = 0.02
MASS_kg, K_Q, K_L = 19.5, 60.0, 5.0
T = array(np.arange(0.0, 160.0, STEP_S))
NEVER: Flags = np.zeros(len(T), dtype=bool)


def legs(levels_N: tuple[float, ...] = (9.0, 18.0, 30.0), rest_N: float = 0.0) -> Array:
    """Thrust (n,) [N]: 5 s ahead, 3 s at rest, 5 s astern, 3 s at rest, at one level after the other."""
    leg = (T / 8.0).astype(int)
    level = np.asarray(levels_N)[leg // 2 % len(levels_N)] * np.where(leg % 2, -1.0, 1.0)
    return array(rest_N + np.where(T % 8.0 < 5.0, level, 0.0))


def flown(thrust: Array, constant_N: float = 0.0, lag_s: float = 0.1, held: Flags = NEVER) -> Array:
    """Velocity (n,) [m/s] under a thrust behind its lag; where it is held, it is stopped."""
    v, force = np.zeros(len(T)), 0.0
    for i in range(1, len(T)):
        force += (thrust[i - 1] - force) * STEP_S / max(lag_s, STEP_S)
        drag = K_Q * abs(v[i - 1]) * v[i - 1] + K_L * v[i - 1]
        v[i] = 0.0 if held[i] else v[i - 1] + STEP_S * (force - constant_N - drag) / MASS_kg
    return array(v)


def noisy(v: Array, noise_mps: float = 0.01) -> Array:
    return array(v + noise_mps * np.random.default_rng(3).standard_normal(len(v)))


def recorded(v: Array, thrust: Array, axis: int = 0, *, late_s: float = 0.0, every: int = 1, t: Array = T) -> Recording:
    velocity, wrench = np.full((len(v[::every]), 6), np.nan), np.full((len(T), 6), np.nan)
    velocity[:, axis], wrench[:, axis] = v[::every], thrust
    none = np.zeros(0), np.zeros((0, 3))
    return Recording("x.csv", array(t[::every] + late_s), velocity, t, wrench, *none)


def during(*spans: tuple[float, float]) -> Flags:
    found: Flags = np.any([(begin_s <= T) & (end_s >= T) for begin_s, end_s in spans], axis=0)
    return found


OFF = during((60.0, 100.0))


def disarmed() -> tuple[Array, Array]:
    """Velocity of a vehicle whose thrusters were off for 40 s, and the commands meanwhile."""
    return noisy(flown(array(np.where(OFF, 0.0, legs())))), legs()


@pytest.mark.parametrize("axis", [0, 1, 2, 5])
@pytest.mark.parametrize("every", [1, 10])
def test_thrusters_that_are_off_move_nothing(axis: int, every: int) -> None:
    found = without_contact(recorded(*disarmed(), axis, every=every))
    gone = np.isnan(found.velocity[:, axis])
    assert gone[OFF[::every]].mean() > 0.9
    assert not gone[during((0.0, 55.0), (105.0, 160.0))[::every]].any()
    assert "at rest under a thrust that moved it at other times: held, or thrusters off" in found.assumptions[0]


def test_their_record_is_identified(tmp_path: Path) -> None:
    """Its drag was 87 % too large, known to 80 %, and the remedy was to fly longer."""
    v, thrust = disarmed()
    record = tmp_path / "off.csv"
    np.savetxt(record, np.column_stack([T, v, thrust]), "%.5f", ",", header="t,u,X", comments="")
    found = api.identify(record, vehicle=Vehicle("other", 11.5, 0.01152, (0.5, 0.4, 0.25))).motions["surge"]
    assert found.identifiable, found.reasons
    assert found.drag is not None
    speed = float(found.drag.speed[-1])
    assert float(found.drag.force[-1]) == pytest.approx(K_Q * speed**2 + K_L * speed, rel=0.05)
    assert found.coefficients["added_mass"].value == pytest.approx(MASS_kg - 11.5, abs=2.0)


def test_what_stopped_it_is_left_out_with_the_rest() -> None:
    """A wall, or a hand: at once, and until the thrust turns."""
    held = during((34.0, 37.0), (130.0, 133.0))
    found = without_contact(recorded(noisy(flown(legs(), held=held)), legs()))
    gone = np.isnan(found.velocity[:, 0])
    assert gone[held].mean() > 0.9
    assert gone.sum() < 1.3 * held.sum()
    assert "2 stretches" in found.assumptions[0]


def test_a_vehicle_on_the_bottom_is_held_by_its_depth_alone() -> None:
    held = during((64.5, 69.0), (112.0, 117.0))
    w = flown(legs(), held=held)
    depth = 2.0 + np.cumsum(STEP_S * w) + 0.002 * np.random.default_rng(4).standard_normal(len(T))
    record = recorded(array(np.full(len(T), np.nan)), legs(), 2)
    attitude = np.column_stack([np.zeros((len(T), 2)), depth])
    found = without_contact(
        Recording("x.csv", T, record.velocity, T, record.wrench, T[::5].copy(), array(attitude[::5]))
    )
    gone = np.isnan(found.attitude[:, 2])
    assert gone[held[::5]].mean() > 0.8
    assert gone.sum() < 1.7 * held[::5].sum()


@pytest.mark.parametrize("lag_s", [0.0, 0.2, 0.6])
@pytest.mark.parametrize("late_s", [0.0, 0.4])
@pytest.mark.parametrize("every", [1, 10])
def test_free_motion_is_kept_whatever_its_delay(lag_s: float, late_s: float, every: int) -> None:
    thrust = legs()
    dead = array(np.where(np.abs(thrust) < 10.0, 0.0, thrust))
    for pushed in (thrust, dead):
        record = recorded(noisy(flown(array(pushed), lag_s=lag_s), 0.02), thrust, late_s=late_s, every=every)
        assert without_contact(record).assumptions == ()


@pytest.mark.parametrize("late_s", [0.0, 0.4])
def test_hovering_at_a_thrust_is_free(late_s: float) -> None:
    """It holds a weight, and passes that thrust, moving, after each leg: a window of 1.5 s without a delay took it."""
    thrust = legs((20.0, 30.0), rest_N=10.0)
    record = recorded(noisy(flown(thrust, constant_N=10.0, lag_s=0.2)), thrust, 2, late_s=late_s, every=10)
    assert without_contact(record).assumptions == ()


def test_a_swing_under_the_moment_that_holds_it_is_free() -> None:
    angle = 0.3 * np.sin(T) * (T % 40.0 < 20.0)
    moment = array(np.where(T % 40.0 < 20.0, 30.0 * np.sin(T), 30.0))
    assert without_contact(recorded(array(np.gradient(angle, STEP_S)), moment, 3)).assumptions == ()


def test_a_pause_of_a_year_costs_no_memory() -> None:
    v, thrust = disarmed()
    later = array(np.where(T > 120.0, T + 3e7, T))
    found = without_contact(recorded(v, thrust, t=later))
    assert np.isnan(found.velocity[OFF, 0]).mean() > 0.9
    assert math.isfinite(found.velocity[-1, 0])


@pytest.mark.parametrize("turns", [True, False])
def test_a_vehicle_that_circles_is_not_held_to_its_side(turns: bool) -> None:
    """Sway of a simulated BlueROV2 in a helix was left out for 26 of 115 s: its thrust bends the path."""
    circles = during((80.0, 120.0))
    thrust = array(np.where(circles, MASS_kg * 0.5 * 1.5, legs()))
    v = noisy(flown(array(np.where(circles, 0.0, thrust))))
    record = recorded(v, thrust, 1)
    record.velocity[:, 0], record.velocity[:, 5] = np.where(circles, 0.5, 0.0), np.where(circles & turns, 1.5, 0.0)
    gone = np.isnan(without_contact(record).velocity[:, 1])
    assert gone[circles].mean() < 0.1 if turns else gone[circles].mean() > 0.8
