import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Vec3, Vec6
from hindrax_core.vehicle import Mount, load_vehicle
from hindrax_sim.physics.geometry import quaternion, rotate
from hindrax_sim.world import Conditions, World

VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
CALM = Conditions(thrust_noise=0.0)
STOP = [1500.0] * 8
angle = st.floats(-0.6, 0.6)


def under_water(world: World, attitude: Vec3 = (0.0, 0.0, 0.0), nu: Vec6 = (0.0,) * 6) -> World:
    world.plant.place((0.0, 0.0, 0.9), attitude)
    world.plant.u, world.plant.v, world.plant.w, world.plant.p, world.plant.q, world.plant.r = nu
    return world


def mount(position_m: Vec3 = (0.0, 0.0, 0.0), rotation_deg: Vec3 = (0.0, 0.0, 0.0)) -> Mount:
    return Mount("x", position_m=position_m, rotation_deg=rotation_deg)


def test_it_starts_afloat_in_the_middle_and_stays() -> None:
    world = World(VEHICLE, conditions=CALM)
    world.advance(stamp_from_s(20.0))
    assert world.depth_m == pytest.approx(0.4 * VEHICLE.weight_N / VEHICLE.buoyancy_N - 0.2, abs=1e-3)
    assert (world.plant.x, world.plant.y) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert world.attitude_rad == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert (world.box.wall_hits, world.box.floor_hits) == (0, 0)


@pytest.mark.parametrize(("pulse_us", "sinks"), [(1500.0, False), (1600.0, True)])
def test_one_that_sinks_is_held_afloat_until_a_thruster_turns(pulse_us: float, *, sinks: bool) -> None:
    heavy = replace(VEHICLE, mass_kg=VEHICLE.mass_kg + 0.3)
    world = World(heavy, conditions=Conditions(sizes={"current": 0.02}))
    world.settle(stamp_from_s(10.0))
    assert world.depth_m == pytest.approx(0.2, abs=0.01)
    world.drive([pulse_us, *STOP[1:]])
    world.advance(stamp_from_s(11.0))
    world.drive(STOP)
    world.advance(stamp_from_s(41.0))
    assert (world.depth_m > 0.5) is sinks


def test_time_is_met_exactly_and_never_runs_back() -> None:
    world = World(VEHICLE, conditions=CALM)
    world.advance(Stamp(1_234_567_891))
    assert world.stamp == 1_234_567_891
    world.advance(Stamp(5))
    assert world.stamp == 1_234_567_891


def test_the_same_seed_is_the_same_world() -> None:
    ends = []
    for seed in (1, 1, 2):
        world = World(VEHICLE, seed)
        world.drive([1650, 1600, 1500, 1500, 1400, 1400, 1400, 1400])
        world.advance(stamp_from_s(5.0))
        ends.append((world.plant.x, world.plant.y, world.plant.z))
    assert ends[0] == ends[1]
    assert ends[0] != ends[2]


@pytest.mark.parametrize(("pulses", "coordinate", "limit"), [
    ([1800, 1800, 1500, 1500], "x", 5.0 - 0.295),
    ([1200, 1200, 1500, 1500], "x", -5.0 + 0.295),
    ([1800, 1500, 1800, 1500], "y", 3.0 - 0.235),
])  # fmt: skip
def test_walls_stop_it_and_are_counted_once(pulses: list[int], coordinate: str, limit: float) -> None:
    world = under_water(World(VEHICLE, conditions=CALM))
    vertical = [1500.0] * 4
    world.drive([*pulses, *vertical])
    world.advance(stamp_from_s(25.0))
    assert getattr(world.plant, coordinate) == pytest.approx(limit, abs=0.08)
    assert world.box.wall_hits >= 1


def test_the_floor_stops_it_too() -> None:
    world = under_water(World(replace(VEHICLE, mass_kg=16.0), conditions=CALM))
    world.drive([1600.0] * 8)
    world.advance(stamp_from_s(0.01))
    world.drive(STOP)
    world.advance(stamp_from_s(20.0))
    assert world.vehicle.pool.depth_m - world.depth_m == pytest.approx(0.2, abs=1e-3)
    assert world.box.floor_hits == 1
    assert world.box.wall_hits == 0


def test_at_rest_the_specific_force_points_up_with_one_g() -> None:
    world = World(VEHICLE, conditions=CALM)
    world.advance(stamp_from_s(1.0))
    force, rate = world.inertial(world.mounting(mount()))
    assert force == pytest.approx((0.0, 0.0, -GRAVITY_mps2), abs=1e-6)
    assert rate == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    upside_down, _ = world.inertial(world.mounting(mount(rotation_deg=(180.0, 0.0, 0.0))))
    assert upside_down == pytest.approx((0.0, 0.0, GRAVITY_mps2), abs=1e-6)


@settings(max_examples=10, deadline=None)
@given(st.tuples(angle, angle, angle), st.tuples(angle, angle, angle, angle, angle, angle))
def test_inertial_truth_is_the_second_derivative_of_where_the_sensor_is(attitude: Vec3, nu: Vec6) -> None:
    world = under_water(World(VEHICLE, conditions=CALM), attitude, nu)
    world.plant.current_mps = (0.1, 0.05, 0.0)
    at = world.mounting(mount(position_m=(0.2, -0.1, 0.15), rotation_deg=(10.0, 20.0, 30.0)))
    where, step = [], 1_000_000
    for number in range(1, 4):
        world.advance(Stamp(number * step))
        where.append(world.point_m(at.lever_m))
        if number == 2:
            force, turned = world.inertial(at)[0], world.plant.quaternion
    acceleration = [(a - 2 * b + c) / (step * 1e-9) ** 2 for a, b, c in zip(*where, strict=True)]
    felt = rotate(turned, at.into_body(force))
    wanted = (acceleration[0], acceleration[1], acceleration[2] - GRAVITY_mps2)
    assert felt == pytest.approx(wanted, abs=0.02)


@settings(max_examples=10, deadline=None)
@given(st.tuples(angle, angle, angle), st.tuples(angle, angle, angle, angle, angle, angle))
def test_dvl_truths_agree_with_each_other(attitude: Vec3, nu: Vec6) -> None:
    world = under_water(World(VEHICLE, conditions=CALM), attitude, nu)
    at = world.mounting(mount(position_m=(0.1, 0.05, 0.15), rotation_deg=(0.0, 0.0, 45.0)))
    world.advance(stamp_from_s(0.5))
    (_, before), velocity = world.travel(at), world.velocity_mps(at)
    world.advance(stamp_from_s(0.502))
    _, after = world.travel(at)
    assert [(b - a) / 0.002 for a, b in zip(before, after, strict=True)] == pytest.approx(velocity, abs=0.01)


def test_pressure_and_ranges_see_the_position_of_the_sensor() -> None:
    world = under_water(World(VEHICLE, conditions=CALM), (0.0, 0.3, 0.0))
    ahead = world.mounting(mount(position_m=(0.2, 0.0, 0.1)))
    deeper = -0.2 * math.sin(0.3) + 0.1 * math.cos(0.3)
    water = VEHICLE.water
    assert world.pressure_Pa(ahead) == pytest.approx(
        water.surface_pressure_Pa + water.density_kgpm3 * GRAVITY_mps2 * (0.9 + deeper)
    )
    assert world.height_m(ahead) == pytest.approx(0.9 - deeper)
    assert world.range_m(ahead) == pytest.approx((0.9 - deeper) / math.cos(0.3))
    assert world.range_m(ahead, math.radians(12.5)) == pytest.approx(
        (0.9 - deeper) / math.cos(0.3 - math.radians(12.5))
    )


def test_there_is_no_range_beside_the_floor() -> None:
    world = under_water(World(VEHICLE, conditions=CALM), (1.5, 0.0, 0.0))
    assert world.range_m(world.mounting(mount())) is None


@pytest.mark.parametrize(
    ("yaw_rad", "pitch_deg", "wanted_m"),
    [
        (0.0, 90.0, 4.8),  # half of 10 m less the lever
        (0.2, 90.0, 5.0 - 0.2 * math.cos(0.2)),  # 11 deg off, within the beam
        (math.pi / 2.0, 90.0, 2.8),  # half of 6 m
        (0.0, -90.0, 5.2),
        (0.0, 180.0, 0.9),  # the surface
        (0.0, 0.0, 0.9),
    ],
)
def test_a_sonar_that_does_not_look_down_finds_walls(yaw_rad: float, pitch_deg: float, wanted_m: float) -> None:
    world = under_water(World(VEHICLE, conditions=CALM), (0.0, 0.0, yaw_rad))
    at = world.mounting(mount(position_m=(0.2, 0.0, 0.0), rotation_deg=(0.0, pitch_deg, 0.0)))
    assert world.echo_m(at, math.radians(12.5)) == pytest.approx(wanted_m, abs=1e-6)


def test_the_compass_shows_the_heading_until_the_motors_run() -> None:
    world = under_water(World(VEHICLE, conditions=replace(CALM, heading_rad=0.7)), (0.0, 0.0, 0.5))
    at = world.mounting(mount())
    x, y, _ = world.magnetic_T(at)
    assert math.atan2(-y, x) == pytest.approx(1.2)
    assert world.attitude_rad[2] == pytest.approx(1.2)
    world.drive([1900, 1900, 1100, 1100, 1500, 1500, 1500, 1500])
    disturbed_x, disturbed_y, _ = world.magnetic_T(at)
    assert math.hypot(disturbed_x - x, disturbed_y - y) > 1e-6


def test_thrust_sags_with_the_supply() -> None:
    stiff, soft = (
        World(VEHICLE, conditions=CALM),
        World(VEHICLE, conditions=replace(CALM, sizes={"supply_resistance": 0.1})),
    )
    for world in (stiff, soft):
        world.drive([1900] * 8)
        world.advance(stamp_from_s(1.0))
    assert soft.plant.supply_V < VEHICLE.supply_V - 3.0
    assert abs(soft.plant.targets_N[0]) < 0.9 * abs(stiff.plant.targets_N[0])


def test_thrusters_fail_by_name() -> None:
    world = World(VEHICLE, conditions=CALM)
    world.drive([1700.0] * 8)
    world.fail_thruster("T3")
    world.advance(stamp_from_s(0.5))
    assert [force == 0.0 for force in world.plant.targets_N] == [False, False, True] + [False] * 5
    with pytest.raises(ValueError, match=r"thruster 'T9': unknown, wanted one of T1"):
        world.fail_thruster("T9")


def test_gusts_are_a_share_of_the_thrust() -> None:
    world = under_water(World(VEHICLE, 3))
    world.drive([1700.0] * 8)
    seen = []
    for number in range(1, 400):
        world.advance(stamp_from_s(0.1 * number))
        seen.append(world.plant.targets_N[0] / 8.1543)
    mean = sum(seen) / len(seen)
    spread = math.sqrt(sum((one - mean) ** 2 for one in seen) / len(seen))
    assert mean == pytest.approx(1.0, abs=0.005)
    assert spread == pytest.approx(0.02, rel=0.2)


def test_mountings_turn_there_and_back() -> None:
    world = World(VEHICLE)
    at = world.mounting(mount(rotation_deg=(10.0, -20.0, 30.0)))
    assert at.into_body(at.into_sensor((1.0, 2.0, 3.0))) == pytest.approx((1.0, 2.0, 3.0))
    assert at.turn == pytest.approx(quaternion((math.radians(10), math.radians(-20), math.radians(30))))
