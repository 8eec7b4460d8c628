"""A vehicle that another simulator moves is seen by all devices as that simulator says."""

import math

import pytest
from vehicles_beside import vehicle_beside

from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.vehicle import Mount
from hindrax_sim.physics.followed_plant import FollowedPlant, Sample
from hindrax_sim.physics.geometry import quaternion
from hindrax_sim.physics.plant import Plant
from hindrax_sim.simulators import simulator_of
from hindrax_sim.world import World

VEHICLE = vehicle_beside()
LEVEL = (1.0, 0.0, 0.0, 0.0)
REST = (0.0,) * 6
PUSH_us = (1600.0, 1600.0, 1400.0, 1400.0, 1550.0, 1550.0, 1550.0, 1450.0)


def sample_of(plant: Plant, at_s: float) -> Sample:
    velocity = (plant.u, plant.v, plant.w, plant.p, plant.q, plant.r)
    return Sample(at_s, (plant.x, plant.y, plant.z), plant.quaternion, velocity)


def test_devices_see_what_the_other_plant_does() -> None:
    other, world = World(VEHICLE), World(VEHICLE, plant=FollowedPlant)
    plant = world.plant
    assert isinstance(plant, FollowedPlant)
    mount = other.mounting(Mount("dvl75", position_m=(0.1, 0.05, 0.12), rotation_deg=(0.0, 0.0, 90.0)))
    plant.follow(sample_of(other.plant, 500.0))
    other.drive(PUSH_us)
    for index in range(1, 401):
        now = stamp_from_s(0.005 * index)
        other.advance(now)
        plant.follow(sample_of(other.plant, 500.0 + 0.005 * index))
        world.advance(now)
    assert math.hypot(other.plant.u, other.plant.v) > 0.1
    assert abs(other.plant.r) > 0.05
    assert world.velocity_mps(mount) == pytest.approx(other.velocity_mps(mount), abs=1e-6)
    assert world.attitude_rad == pytest.approx(other.attitude_rad, abs=1e-6)
    assert world.depth_m == pytest.approx(other.depth_m, abs=1e-9)
    for ours, theirs in zip(world.travel(mount), other.travel(mount), strict=True):
        assert ours == pytest.approx(theirs, abs=2e-3)  # of 1 m and 1 rad: the sums of other steps
    for ours, theirs in zip(world.inertial(mount), other.inertial(mount), strict=True):
        assert ours == pytest.approx(theirs, abs=5e-3)


def test_between_two_samples_the_state_is_between_them_and_never_beyond_the_last() -> None:
    plant = FollowedPlant(VEHICLE)
    turned = quaternion((0.0, 0.0, 0.2))
    plant.follow(Sample(7.0, (0.0, 0.0, 1.0), LEVEL, REST))
    plant.follow(Sample(7.1, (1.0, 0.0, 1.0), turned, (2.0, 0.0, 0.0, 0.0, 0.0, 0.4)))
    assert plant.reached_s == pytest.approx(0.1)
    plant.step(0.05)
    assert (plant.x, plant.u, plant.r, plant.du) == pytest.approx((0.5, 1.0, 0.2, 20.0))
    assert plant.quaternion == pytest.approx(quaternion((0.0, 0.0, 0.1)), abs=1e-6)
    plant.step(0.2)
    assert (plant.x, plant.u) == pytest.approx((1.0, 2.0))


def test_the_same_attitude_with_the_other_sign_is_no_turn() -> None:
    plant = FollowedPlant(VEHICLE)
    there = quaternion((0.0, 0.0, 3.0))
    plant.follow(Sample(0.0, (0.0, 0.0, 1.0), there, REST))
    plant.follow(Sample(0.1, (0.0, 0.0, 1.0), tuple(-one for one in there), REST))  # type: ignore[arg-type]  # as long
    plant.step(0.05)
    assert plant.quaternion == pytest.approx(there)


def test_without_a_sample_the_vehicle_rests_and_forces_are_those_of_the_pulses() -> None:
    plant = FollowedPlant(VEHICLE)
    plant.drive(PUSH_us)
    before = plant.x, plant.y, plant.z
    plant.step(1.0)
    assert (plant.x, plant.y, plant.z) == before
    assert plant.targets_N[0] != 0.0


def test_forces_are_those_of_our_plant_at_the_same_pulses() -> None:
    ours, followed = Plant(VEHICLE), FollowedPlant(VEHICLE)
    for plant in (ours, followed):
        plant.drive(PUSH_us)
    assert followed.targets_N == ours.targets_N
    assert any(ours.targets_N)


@pytest.mark.parametrize(
    ("sample", "why"),
    [
        (Sample(1.0, (0.0, 0.0, 1.0), LEVEL, REST), r"found the time 1\.000 s after 5\.000 s"),
        (Sample(6.0, (math.nan, 0.0, 1.0), LEVEL, REST), "a number that is none"),
        (Sample(6.0, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0), REST), "wanted a unit quaternion"),
    ],
)
def test_a_state_that_cannot_follow_is_refused(sample: Sample, why: str) -> None:
    plant = FollowedPlant(VEHICLE)
    plant.follow(Sample(5.0, (0.0, 0.0, 1.0), LEVEL, REST))
    with pytest.raises(ValueError, match=why):
        plant.follow(sample)


def test_a_paused_simulator_may_repeat_itself() -> None:
    plant = FollowedPlant(VEHICLE)
    assert not plant.followed
    for _ in range(3):
        plant.follow(Sample(5.0, (1.0, 0.0, 1.0), LEVEL, REST))
    assert plant.followed
    assert plant.reached_s == plant.time_s


def test_walls_of_our_pool_do_not_hold_it() -> None:
    world = World(VEHICLE, plant=FollowedPlant)
    plant = world.plant
    assert isinstance(plant, FollowedPlant)
    plant.follow(Sample(0.0, (99.0, 0.0, 1.0), LEVEL, REST))
    plant.follow(Sample(1.0, (99.0, 0.0, 1.0), LEVEL, REST))
    world.advance(Stamp(stamp_from_s(0.5)))
    assert plant.x == 99.0
    assert world.box.wall_hits == 0


def test_topics_are_those_of_the_kind_with_the_name_or_the_prefix() -> None:
    found = simulator_of("gz", "bluerov2-heavy")
    assert found.odometry == "/model/bluerov2_heavy/odometry"
    assert found.thrust == "/model/bluerov2_heavy/joint/{thruster}_joint/cmd_thrust"
    assert simulator_of("stonefish:/girona500/", "x").thrust == "/girona500/thruster_setpoints"
    assert simulator_of("mujoco", "lbv").odometry == "/lbv/odometry"
    for wrong, wanted in {"gazebo": "mujoco, gz", "": "mujoco, gz", "gz:model": "begins with /, as in gz:/"}.items():
        with pytest.raises(UsageError, match=f"wanted one .*{wanted}"):
            simulator_of(wrong, "lbv")
