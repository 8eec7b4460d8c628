"""The equations against the vehicle and the papers: signs, shapes, names."""

from dataclasses import replace

import numpy as np
import pytest

from hindrax_core.vehicle import Vehicle
from hindrax_ident.model.model_parameters import parameters_of
from hindrax_ident.model.motion_model import (
    MOTIONS,
    Model,
    coefficient_units,
    known_force,
    lag_s,
    model_of,
    motions_of,
    offset,
    restoring,
    rigid_mass,
    speed_across,
)


def test_motions_are_the_rows_of_table_3() -> None:
    assert list(MOTIONS) == ["surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw"]
    assert [motion.name for motion in motions_of(2)] == ["heave_down", "heave_up"]


def test_every_parameter_has_a_coefficient_with_a_unit(vehicle: Vehicle) -> None:
    for motion in MOTIONS.values():
        model = model_of(vehicle, motion.axis)
        known = coefficient_units(motion.axis)
        for name in model.names_of(motion.side):
            assert name in model.names
            plain = name.removesuffix("_negative").replace("mass", "added_mass")
            assert known[plain]


def test_drag_is_odd_where_it_is_not_split() -> None:
    theta, v = np.array([66.48, 1.25, 0.0, 27.3]), np.linspace(0.01, 0.6, 20, dtype=np.float64)
    model, still = Model(0, 15.22), np.zeros(20)
    assert model.force(theta, v, still) == pytest.approx(-model.force(theta, -v, still))


def test_split_drag_uses_the_own_coefficients_of_each_direction() -> None:
    model = Model(2, 15.22, split=True)
    theta = np.array([93.52, 5.26, 56.57, 11.84, 0.7845, 37.7])
    v = np.array([0.5, -0.5])
    expected = [93.52 * 0.25 + 5.26 * 0.5 + 0.7845, -56.57 * 0.25 - 11.84 * 0.5 + 0.7845]
    assert model.force(theta, v, np.zeros(2)) == pytest.approx(expected)


@pytest.mark.parametrize("crossed", [False, True])
@pytest.mark.parametrize("split", [False, True])
def test_slope_is_the_derivative_of_the_force(split: bool, crossed: bool) -> None:
    model = Model(0, 15.22, split=split, crossed=crossed)
    rows = [0, 1, *([2, 3] if split else []), 4, *([5] if crossed else []), 6]
    theta = np.array([93.52, 5.26, 56.57, 11.84, 0.5, 80.0, 37.7])[rows]
    v, across, h = np.array([-0.4, -0.1, 0.2, 0.5]), np.array([0.1, 0.3, 0.0, 0.2]), 1e-6
    still = np.zeros(4)
    ahead, behind = (model.force(theta, v + step, still, across) for step in (h, -h))
    assert model.slope(theta, v, across) == pytest.approx((ahead - behind) / (2.0 * h), rel=1e-6)


def test_at_rest_the_drag_by_the_speed_across_has_its_slope_and_no_other_trouble() -> None:
    """F = k_w w v near v = 0; nothing where the water rests too."""
    model, theta = Model(0, 15.22, crossed=True), np.array([60.0, 2.0, 0.0, 80.0, 30.0])
    assert model.slope(theta, np.zeros(2), np.array([0.3, 0.0])) == pytest.approx([2.0 + 80.0 * 0.3, 2.0])


def test_the_speed_across_is_that_of_the_hull_in_the_unit_of_the_axis(vehicle: Vehicle) -> None:
    """0.3 and 0.4 m/s across sway and heave; a hull of 0.59 m turns at 1.2 rad/s and moves at 0.295 m/s: 1 rad/s."""
    nu = [np.array([one]) for one in (0.3, 9.0, 0.4, 0.5, 0.6, 0.7)]
    assert speed_across(vehicle, 1, nu) == pytest.approx([0.5])
    assert max(vehicle.envelope_m) == 0.59
    turning = [np.array([one]) for one in (0.0, 0.295, 0.0, 0.0, 1.2, 9.0)]
    assert speed_across(vehicle, 5, turning) == pytest.approx([np.hypot(1.0, 1.2)])


def test_a_bluff_body_has_the_drag_of_its_whole_speed() -> None:
    """k_w = k_q: F = k_q sqrt(v^2 + w^2) v, by 0.3 along and 0.4 m/s across 60 * 0.5 * 0.3 N."""
    model = Model(0, 15.22, crossed=True)
    assert model.names == ("k_q", "k_l", "b", "k_w", "mass")
    theta = np.array([60.0, 0.0, 0.0, 60.0, 30.0])
    force = model.force(theta, np.array([0.3, -0.3]), np.zeros(2), np.array([0.4, 0.4]))
    assert force == pytest.approx([9.0, -9.0])
    assert model.names_of(1) == ("k_q", "k_l", "b", "mass", "k_w")


def test_rigid_part_is_mass_and_inertia_of_a_prism(vehicle: Vehicle) -> None:
    # Eidsvik 2015 eq. 3.1 with the envelope of COB-2023-1394.
    assert rigid_mass(vehicle, 0) == 15.22
    assert rigid_mass(vehicle, 5) == pytest.approx(15.22 / 12.0 * (0.59**2 + 0.47**2))


def test_restoring_rights_the_vehicle(vehicle: Vehicle) -> None:
    # 20 mm between the centers and 150.04 N of buoyancy.
    assert restoring(vehicle) == pytest.approx(0.0153 * 1000.0 * 9.80665 * 0.02)
    assert restoring(vehicle) > 0.0


def test_a_hull_out_of_trim_rests_with_its_heavy_side_down(vehicle: Vehicle) -> None:
    """At rest b + k_r sin(angle) = 0: the center of mass hangs below that of buoyancy."""
    x, y, z = vehicle.center_of_buoyancy_m
    heavy = replace(vehicle, center_of_mass_m=(x + 0.002, y + 0.003, z + 0.02))
    roll, pitch = (-offset(heavy, axis) / restoring(heavy) for axis in (3, 4))
    assert (roll, pitch) == pytest.approx((0.003 / 0.02, -0.002 / 0.02))
    assert [offset(heavy, axis) for axis in (0, 1, 2, 5)] == [0.0, 0.0, heavy.net_buoyancy_N, 0.0]


def test_a_floating_vehicle_is_pushed_towards_the_high_end(vehicle: Vehicle) -> None:
    # Bow up: buoyancy, which wins by 0.78 N, has a component towards the bow; starboard down: towards port.
    assert known_force(vehicle, 0, (0.0, 0.2, 0.0)) == pytest.approx(0.7845 * np.sin(0.2), rel=1e-3)
    assert known_force(vehicle, 1, (0.2, 0.0, 0.0)) == pytest.approx(-0.7845 * np.sin(0.2), rel=1e-3)
    assert known_force(vehicle, 2, (0.2, 0.2, 0.0)) == 0.0


def test_lag_of_an_axis_is_that_of_its_thrusters(vehicle: Vehicle) -> None:
    assert [lag_s(vehicle, axis) for axis in range(6)] == pytest.approx([0.15] * 6)
    at_once = replace(vehicle, thrusters=tuple(replace(one, lag_s=0.0) for one in vehicle.thrusters))
    assert lag_s(at_once, 0) == 0.0
    assert lag_s(replace(vehicle, thrusters=()), 0) is None


def test_coefficients_of_a_motion_are_those_without_speed_across() -> None:
    given = {"surge": {"k_q": 60.0, "k_l": 2.0, "b": 0.1, "added_mass": 10.0}}
    assert parameters_of(Model(0, 15.0, crossed=True), given).tolist() == [60.0, 2.0, 0.1, 0.0, 25.0]
