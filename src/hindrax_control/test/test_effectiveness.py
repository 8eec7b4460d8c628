"""The effectiveness matrix of the Hindrax against the paper's equation 9 and its account of who drives what."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hindrax_control.allocation.effectiveness import (
    checked_effectiveness,
    condition,
    effectiveness,
    served_axes,
)
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES, load_vehicle

HINDRAX = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup" / "vehicles" / "hindrax.yaml")
B = effectiveness(HINDRAX)
PAPER_SIGNS = {"surge": "++--", "sway": "+-+-"}
"""COB-2023-1394: surge is driven by T1 and T2, sway by T1 and T3, the others steer; T1 to T4 in this order."""


def signs(row: int, count: int) -> str:
    """Signs with which the first thrusters act on an axis: a string of +, - and 0."""
    return "".join("0" if value == 0.0 else "+" if value > 0.0 else "-" for value in B[row, :count])


def test_first_thruster_as_the_paper_writes_it() -> None:
    # COB-2023-1394 eq. 9: F_1x = cos(55 deg) F_1, F_1y = sin(55 deg) F_1, F_1z = 0.
    assert B[:3, 0] == pytest.approx([math.cos(math.radians(55)), math.sin(math.radians(55)), 0.0])


def test_layout_has_full_rank_and_the_signs_of_the_paper() -> None:
    assert len(served_axes(B)) == 6
    assert condition(B) < 10.0
    for axis, pattern in PAPER_SIGNS.items():
        assert signs(AXES.index(axis), 4) == pattern
    assert signs(AXES.index("heave"), 8) == "0000----"  # positive vertical thrust is up


@pytest.mark.parametrize("pair", [(0, 1), (0, 2)])
def test_surge_and_sway_pairs_do_not_turn_the_vehicle(pair: tuple[int, int]) -> None:
    forces = np.zeros(8)
    forces[list(pair)] = 1.0
    assert B[5] @ forces == pytest.approx(0.0, abs=1e-12)


def test_yaw_arm_of_the_vectored_thrusters() -> None:
    # 0.295 sin 55 + 0.235 cos 55, at the corners of the envelope.
    assert np.abs(B[5, :4]) == pytest.approx([0.3764] * 4, abs=5e-5)


def test_moments_are_about_the_center_of_mass() -> None:
    shifted = replace(HINDRAX, center_of_mass_m=(0.1, 0.0, 0.0))
    # A vertical thruster 0.1 m nearer to the center of mass pitches less by 0.1 m per newton.
    assert effectiveness(shifted)[4, 4] - B[4, 4] == pytest.approx(-0.1)


def test_lost_axes_are_those_that_are_needed_least() -> None:
    def without(*columns: int) -> tuple[int, ...]:
        left = B.copy()
        left[:, list(columns)] = 0.0
        return served_axes(left)

    assert without(2) == (0, 1, 2, 3, 4, 5)
    # T1 and T2 make sway and yaw together: yaw is kept. Without vertical thrusters sway is not given up to roll.
    assert without(2, 3) == (0, 2, 3, 4, 5)
    assert without(4, 5, 6, 7) == (0, 1, 5)
    assert served_axes(B[:, :2], (1, 5)) == (1,)


def test_vehicle_without_thrusters_or_with_useless_ones_is_refused() -> None:
    with pytest.raises(UsageError, match="found none"):
        checked_effectiveness(replace(HINDRAX, thrusters=()))
    assert served_axes(np.zeros((6, 3))) == ()


def test_two_nearly_parallel_thrusters_are_refused() -> None:
    twins = (
        HINDRAX.thrusters[0],
        replace(HINDRAX.thrusters[0], name="T1b", azimuth_deg=55.4),
    )
    good = checked_effectiveness(replace(HINDRAX, thrusters=HINDRAX.thrusters[:4]))
    assert len(served_axes(good)) == 3
    assert condition(effectiveness(replace(HINDRAX, thrusters=twins))) > 100.0


def test_thrusters_with_next_to_no_arm_are_refused() -> None:
    narrow = [replace(one, position_m=(one.position_m[0], 1e-6 * one.position_m[1], 0.0)) for one in HINDRAX.thrusters]
    with pytest.raises(UsageError, match="condition of the effectiveness matrix"):
        checked_effectiveness(replace(HINDRAX, thrusters=tuple(narrow[4:]), center_of_mass_m=(0.0, 0.0, 0.0)))


def test_one_thruster_alone_serves_one_axis() -> None:
    assert len(served_axes(checked_effectiveness(replace(HINDRAX, thrusters=HINDRAX.thrusters[:1])))) == 1


def test_thrusters_that_can_do_nothing_are_as_bad_as_can_be() -> None:
    assert condition(np.zeros((6, 3))) == math.inf


@pytest.mark.parametrize("arm_m", [0.05, 1.0, 20.0])
def test_condition_does_not_depend_on_the_size_of_a_vehicle(arm_m: float) -> None:
    assert condition(np.diag([1.0, 1.0, 1.0, arm_m, arm_m, arm_m])) == pytest.approx(1.0)
    assert condition(np.diag([1.0, 1.0, 1.0, arm_m, 0.0, 0.0])) == pytest.approx(1.0)
    assert condition(np.diag([4.0, 2.0, 1.0, arm_m, arm_m, arm_m])) == pytest.approx(4.0)
    assert condition(np.diag([1.0, 1.0, 1.0, arm_m, arm_m, arm_m / 3.0])) == pytest.approx(3.0)


def test_weak_thrusters_serve_the_same_axes() -> None:
    assert served_axes(1e-5 * B) == (0, 1, 2, 3, 4, 5)
