"""Whose axes velocities are in, by the positions beside them; and velocities from poses alone."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hindrax_analysis.records.bag_track import (
    FrameErrors,
    compare_frames,
    compare_rates,
    to_body,
    to_world,
    velocities_from_poses,
)
from hindrax_ident.arrays import Array, array

T = array(np.arange(0.0, 60.0, 0.05))
YAW = 1.2 + 0.6 * np.sin(0.3 * T)
SURGE = 0.5 * np.sin(0.8 * T)
BODY = np.column_stack([SURGE, np.zeros_like(T), np.zeros_like(T)])
Q = np.column_stack([np.zeros((len(T), 2)), np.sin(0.5 * YAW), np.cos(0.5 * YAW)])
P = np.cumsum(to_world(BODY, Q), axis=0) * 0.05


def compared(positions: Array, quaternions: Array, velocities: Array) -> FrameErrors:
    found = compare_frames(T, positions, quaternions, velocities)
    assert found is not None
    return found


def test_turning_there_and_back() -> None:
    assert to_world(np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]])) == pytest.approx(
        np.array([[0.0, 1.0, 0.0]]), abs=1e-12
    )
    assert to_body(to_world(BODY, Q), Q) == pytest.approx(BODY)


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_positions_show_the_axes_of_the_velocities(noise: float) -> None:
    stray = noise * np.random.default_rng(1).standard_normal(BODY.shape)
    assert compared(P, Q, to_world(BODY, Q) + stray).is_world
    ours = compared(P, Q, BODY + stray)
    assert not ours.is_world
    assert not ours.is_neither


@pytest.mark.parametrize("wrong", [-1.0, 1000.0])
def test_velocities_that_contradict_the_positions(wrong: float) -> None:
    assert compared(P, Q, wrong * BODY).is_neither


def test_a_vehicle_that_keeps_its_heading_north_is_in_both_axes() -> None:
    north = np.tile([0.0, 0.0, 0.0, 1.0], (len(T), 1))
    assert not compared(np.cumsum(BODY, axis=0) * 0.05, north, BODY).is_world


def test_positions_that_never_change_show_nothing() -> None:
    assert compare_frames(T, np.zeros_like(P), Q, BODY) is None


TILTS = np.column_stack([YAW, 0.2 * np.sin(0.7 * T), 0.3 * np.sin(0.5 * T)])
ATTITUDES = Rotation.from_euler("ZYX", TILTS)
RATES = array(np.gradient(TILTS, T, axis=0))
OF_BODY = np.column_stack([  # Fossen 2011 eq. 2.28
    RATES[:, 2] - np.sin(TILTS[:, 1]) * RATES[:, 0],
    np.cos(TILTS[:, 2]) * RATES[:, 1] + np.sin(TILTS[:, 2]) * np.cos(TILTS[:, 1]) * RATES[:, 0],
    np.cos(TILTS[:, 2]) * np.cos(TILTS[:, 1]) * RATES[:, 0] - np.sin(TILTS[:, 2]) * RATES[:, 1],
])  # fmt: skip


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_attitudes_show_the_axes_of_the_rates(noise: float) -> None:
    """Gazebo has them in the axes of the world; roll and pitch of a vehicle that had turned were those of neither."""
    q, stray = array(ATTITUDES.as_quat()), noise * np.random.default_rng(1).standard_normal(OF_BODY.shape)
    of_world, of_body = (compare_rates(T, q, array(one + stray)) for one in (to_world(array(OF_BODY), q), OF_BODY))
    assert of_world is not None
    assert of_world.is_world
    assert of_body is not None
    assert not of_body.is_world
    assert of_body.body < 0.25 * of_body.world


def test_rates_of_a_level_vehicle_are_in_both_axes() -> None:
    yawing = array(np.column_stack([np.zeros((len(T), 2)), np.gradient(YAW, T)]))
    found = compare_rates(T, array(Q), yawing)
    assert found is not None
    assert not found.is_world


def test_poses_alone_make_velocities_and_rates() -> None:
    t, nu = velocities_from_poses(T, P, Q * np.where(np.arange(len(T)) % 7, 1.0, -1.0)[:, None])
    assert nu[:, 0] == pytest.approx(np.interp(t + 0.025, T, SURGE), abs=0.01)
    assert nu[:, 1] == pytest.approx(0.0, abs=0.01)
    assert nu[:, 5] == pytest.approx(np.interp(t, T, 0.18 * np.cos(0.3 * T)), abs=0.002)


def test_a_vehicle_that_turns_right_round_has_its_velocity_in_its_own_axes_all_the_way() -> None:
    """Half a turn from the start, a quaternion is as near to its first one as to the opposite of that."""
    yaw = 0.4 * T
    turning = np.column_stack([np.zeros((len(T), 2)), np.sin(0.5 * yaw), np.cos(0.5 * yaw)])
    ahead = np.tile([0.5, 0.0, 0.0], (len(T), 1))
    _, nu = velocities_from_poses(T, np.cumsum(to_world(ahead, turning), axis=0) * 0.05, turning)
    assert nu[:, 0] == pytest.approx(0.5, abs=0.01)
    assert nu[:, 1] == pytest.approx(0.0, abs=0.01)
    assert nu[:, 5] == pytest.approx(0.4, abs=0.002)
