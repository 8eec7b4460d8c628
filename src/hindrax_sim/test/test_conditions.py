"""The table of conditions: each law against a closed form, off is off to the last bit, drawn by seed."""

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import pytest
from vehicles_beside import vehicle_beside

from hindrax_core.errors import UsageError
from hindrax_core.events import stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Vec6
from hindrax_core.thrust.curves import Curve
from hindrax_core.thrust.table import ThrustTable
from hindrax_core.vehicle import AXES, Hydrodynamics, Vehicle
from hindrax_sim.conditions.hull import KnownLoad
from hindrax_sim.conditions.known_coefficients import known_coefficients
from hindrax_sim.conditions.realization import TESTED, Realization
from hindrax_sim.conditions.world_table import CONDITIONS, SIGNED, realize, sizes_of
from hindrax_sim.physics.plant import Plant
from hindrax_sim.physics.thruster import thruster_force, wrench_per_newton
from hindrax_sim.world import Conditions, World

VEHICLE = vehicle_beside()
AHEAD = [1650.0, 1650.0, 1350.0, 1350.0, 1440.0, 1440.0, 1440.0, 1440.0]


def made(vehicle: Vehicle = VEHICLE, /, **sizes: float) -> Realization:
    return realize(vehicle, sizes, seed=3)


def hydrodynamics_of(vehicle: Vehicle) -> Hydrodynamics:
    assert vehicle.hydrodynamics is not None
    return vehicle.hydrodynamics


def plant_of(world: Realization, *, nu: Vec6 = (0.0,) * 6, x_m: float = 0.0) -> Plant:
    plant = Plant(world.vehicle, world.influences, world.thrust_losses)
    plant.place((x_m, 0.0, 0.9), (0.0, 0.0, 0.0))
    plant.u, plant.v, plant.w, plant.p, plant.q, plant.r = nu
    return plant


def wrench(world: Realization, plant: Plant, dt: float = 0.005) -> Vec6:
    (influence,) = world.influences
    return influence(plant, dt)


def flown(sizes: Mapping[str, float], seed: int = 1) -> tuple[float, ...]:
    """Where a short drive ends, and what a DVL says of it."""
    world = World(VEHICLE, seed, Conditions(sizes=sizes))
    world.plant.place((0.0, 0.0, 0.9), (0.0, 0.0, 0.0))
    for number, pulses in enumerate((AHEAD, [3000.0 - pulse for pulse in AHEAD])):
        world.drive(pulses)
        world.advance(stamp_from_s(3.0 * (number + 1)))
    plant = world.plant
    dvl = world.travel(world.mounting(world.vehicle.sensors["dvl75"]))[1]
    imu = world.inertial(world.mounting(world.vehicle.sensors["icm20948"]))[0]
    return (plant.x, plant.y, plant.z, *plant.quaternion, *dvl, *imu)


def test_a_held_vehicle_is_let_go_at_rest() -> None:
    world = World(VEHICLE, 2, Conditions(sizes=sizes_of("pool,tether=2,current=0,seiche=0", 2)))
    world.settle(stamp_from_s(10.0))
    assert math.hypot(world.plant.x, world.plant.y) < 0.001
    assert abs(world.attitude_rad[1]) > math.radians(1.0)  # the tether tilts it
    before = world.attitude_rad
    world.advance(stamp_from_s(12.0))
    assert world.attitude_rad[:2] == pytest.approx(before[:2], abs=math.radians(0.5))


# ---- the table


def test_ideal_is_nothing_and_a_size_of_zero_is_off_to_the_last_bit() -> None:
    assert sizes_of("ideal", 1) == {}
    assert flown(dict.fromkeys(CONDITIONS, 0.0)) == flown({})


@pytest.mark.parametrize("name", CONDITIONS)
def test_every_condition_changes_the_flight_the_same_way_for_the_same_seed(name: str) -> None:
    sizes = {name: 10.0 * CONDITIONS[name].size if name == "false_locks" else CONDITIONS[name].size}
    assert flown(sizes) == flown(sizes)
    assert flown(sizes) != flown({})


def test_every_row_states_how_it_acts_and_why_so_much() -> None:
    assert [row.name for row in CONDITIONS.values() if not (row.meaning and row.source)] == []


def test_pool_draws_every_size_by_its_seed_within_its_limits() -> None:
    drawn = [sizes_of("pool", seed) for seed in range(400)]
    assert drawn[7] == sizes_of("pool", 7)
    assert drawn[7] != drawn[8]
    for name, row in CONDITIONS.items():
        if row.pool == 0.0:
            assert not any(name in one for one in drawn), "a known load hangs only where it is asked for"
            continue
        sizes = [one[name] for one in drawn]
        deviation = abs(row.pool) / (1.0 if row.distribution == SIGNED else math.sqrt(3.0))
        assert all(row.least <= size <= row.most for size in sizes)
        assert math.sqrt(sum(size * size for size in sizes) / len(sizes)) == pytest.approx(deviation, rel=0.1)


def test_rows_are_named_alone_with_a_size_and_behind_pool() -> None:
    assert sizes_of("tether", 1) == {"tether": CONDITIONS["tether"].size}
    assert sizes_of("tether=0.5,dvl_yaw=-2", 1) == {"tether": 0.5, "dvl_yaw": -2.0}
    assert sizes_of("pool,tether=0", 4) == {k: v for k, v in sizes_of("pool", 4).items() if k != "tether"}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("sea", "found 'sea', wanted one of thrust_gain, "),
        ("tether=much", r"tether=much, wanted 0 to 100 N"),
        ("tether=-1", r"tether=-1, wanted 0 to 100 N"),
        ("tether=nan", "tether=nan, wanted 0"),
        ("tethr=1", r"found 'tethr' \(did you mean tether\?\); the form is"),
        ("pool,ideal", "found 'ideal' behind another name, wanted it first"),
        ("", "found ''"),
    ],
)
def test_a_world_that_does_not_exist_is_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        sizes_of(text, 1)


# ---- thrust


def force(world: Realization, index: int, pulse_us: float) -> float:
    return thruster_force(world.vehicle, world.vehicle.thrusters[index], pulse_us, world.vehicle.supply_V)


def assumed(index: int, pulse_us: float) -> float:
    return force(Realization(VEHICLE), index, pulse_us)


def test_a_gain_scales_all_thrusters_and_a_weak_one_is_one() -> None:
    for pulse in (1200.0, 1700.0):
        gained = [force(made(thrust_gain=0.05), index, pulse) / assumed(index, pulse) for index in range(8)]
        assert gained == pytest.approx([1.05] * 8)
        weak = sorted(force(made(weak_thruster=0.3), index, pulse) / assumed(index, pulse) for index in range(8))
        assert weak == pytest.approx([0.7] + [1.0] * 7)


def test_a_wider_dead_band_moves_the_whole_curve_outward() -> None:
    world = made(dead_bands=5.0)
    for index, thruster in enumerate(world.vehicle.thrusters):
        wider = world.vehicle.curves[thruster.curve].dead_band_us - VEHICLE.curves["main"].dead_band_us
        assert wider != 0.0
        for pulse, outward in ((1600.0, wider), (1350.0, -wider)):
            assert force(world, index, pulse) == pytest.approx(assumed(index, pulse - outward))
        assert force(world, index, 1500.0 + 24.9 + wider) == 0.0


TABLE = ThrustTable(
    (1100.0, 1470.0, 1480.0, 1500.0, 1520.0, 1530.0, 1900.0), (14.8,), ((-30.0, -1.0, 0, 0, 0, 1.0, 40.0),)
)


def test_gain_and_dead_band_change_a_table_as_they_change_cubics() -> None:
    tabulated = replace(VEHICLE, curves={"main": Curve(table=TABLE)})
    gained = force(made(tabulated, thrust_gain=0.05), 0, 1900.0)
    assert gained == pytest.approx(42.0)
    world = made(tabulated, dead_bands=5.0)
    for index, thruster in enumerate(world.vehicle.thrusters):
        table = world.vehicle.curves[thruster.curve].table
        assert table is not None
        wider = table.pulse_us[4] - 1520.0
        assert wider != 0.0
        assert table.pulse_us == pytest.approx(
            [p + wider * math.copysign(p != 1500.0, p - 1500.0) for p in TABLE.pulse_us]
        )
        assert force(world, index, 1620.0 + wider) == pytest.approx(1.0 + 39.0 * 90.0 / 370.0)


def test_inflow_takes_its_share_of_ten_newtons_and_goes_with_the_root_of_thrust() -> None:
    world = made(inflow_loss=0.2)
    plant = plant_of(world, nu=(0.5, 0.0, 0.0, 0.0, 0.0, 0.0))
    plant.drive([*AHEAD[:4], 1500.0, 1500.0, 1500.0, 1500.0])
    for _ in range(400):  # until the thrusters' lag is over
        lost = wrench(world, plant)
    along = [wrench_per_newton(VEHICLE, one)[0] for one in VEHICLE.thrusters[:4]]
    closed = -sum(
        0.2 * math.sqrt(10.0 * abs(thrust)) * (0.5 * share / 0.5) * share
        for share, thrust in zip(along, plant.targets_N, strict=False)
    )
    assert lost[0] == pytest.approx(closed, rel=1e-3)
    assert (lost[1], lost[2], lost[5]) == pytest.approx((0.0,) * 3, abs=1e-9)


def test_thrust_that_goes_later_keeps_what_it_takes_longer() -> None:
    """All of a force that goes to nothing for the longer lag, of one that turns round as well; none of what comes."""
    world = made(late_stops=0.1)
    plant, dt = plant_of(world), 0.005
    for pulses, wanted in ((AHEAD, 0.0), ([1500.0] * 8, 1.0), (AHEAD, 0.0), ([3000.0 - one for one in AHEAD], 1.0)):
        before = [
            plant.targets_N[index] * wrench_per_newton(VEHICLE, one)[0] for index, one in enumerate(VEHICLE.thrusters)
        ]
        plant.drive(pulses)
        kept = sum(dt * wrench(world, plant, dt)[0] for _ in range(600))
        assert kept == pytest.approx(0.1 * wanted * sum(before), abs=0.01)
        assert wrench(world, plant, dt) == pytest.approx((0.0,) * 6, abs=1e-3)


def test_thrust_of_thrusters_without_a_lag_goes_by_its_own() -> None:
    at_once = replace(VEHICLE, thrusters=tuple(replace(one, lag_s=0.0) for one in VEHICLE.thrusters))
    world = made(at_once, late_stops=0.2)
    plant = plant_of(world)
    plant.drive(AHEAD)
    force = sum(
        plant.targets_N[index] * wrench_per_newton(VEHICLE, one)[0] for index, one in enumerate(VEHICLE.thrusters)
    )
    assert wrench(world, plant)[0] == pytest.approx(0.0)
    plant.drive([1500.0] * 8)
    found = [wrench(world, plant)[0] for _ in range(40)]
    assert found[-1] == pytest.approx(force * math.exp(-0.2 / 0.2), rel=0.02)


def test_washes_take_their_share_of_equal_thrusters() -> None:
    alone = plant_of(made())
    both = plant_of(made(thruster_wash=0.05))
    for plant in (alone, both):
        plant.drive([1650.0] * 8)
    ratios = [a / b for a, b in zip(both.targets_N, alone.targets_N, strict=True)]
    assert ratios == pytest.approx([0.9] * 8)  # two neighbors, 5 % each
    hull = made(hull_wash=0.05)
    (loss,) = hull.thrust_losses
    for sign in (1.0, -1.0):
        for got, one in zip(loss([sign * 10.0] * 8), VEHICLE.thrusters, strict=True):
            # The jet runs against the force: towards the middle where the force points away from it.
            outward = sign * sum(a * b for a, b in zip(one.direction, one.position_m, strict=True)) > 0.0
            assert got == pytest.approx(sign * (9.5 if outward else 10.0))


def test_the_battery_sags_evenly() -> None:
    world = World(VEHICLE, conditions=Conditions(thrust_noise=0.0, sizes={"battery_sag": 0.1}))
    world.advance(stamp_from_s(90.0))
    assert world.plant.supply_V == pytest.approx(0.99 * VEHICLE.supply_V, rel=1e-4)


# ---- water


def test_what_a_file_declares_of_its_supply_is_the_truth_of_its_mock_in_every_pool() -> None:
    for sizes in ({}, {"supply_resistance": 0.03}):
        world = World(replace(VEHICLE, supply_ohm=0.2), 1, Conditions(sizes=sizes))
        world.drive([1600.0] * len(VEHICLE.thrusters))
        world.advance(stamp_from_s(3.0))
        assert VEHICLE.supply_V - world.supply_V == pytest.approx(0.2 * world.supply_A, rel=0.02)
        assert world.supply_A > 1.0


def test_the_tether_pulls_home_and_brakes_more_the_farther_it_is_out() -> None:
    pulling, dragged = made(tether=1.0), made(tether_drag=2.0)
    for x_m, share in ((0.0, 1.0), (2.5, 1.5)):
        pull = wrench(pulling, plant_of(pulling, x_m=x_m))
        assert pull == pytest.approx((-share, 0.0, 0.0, 0.0, share * 0.2, 0.0))  # at the top of the stern, 0.2 m up
        brake = wrench(dragged, plant_of(dragged, x_m=x_m, nu=(0.0, -0.25, 0.0, 0.0, 0.0, 0.0)))
        assert brake[:3] == pytest.approx((0.0, 0.25 * 2.0 * share, 0.0))


def test_the_memory_resists_a_jump_and_forgets_it_in_a_second() -> None:
    world = made(fluid_memory=0.2)
    plant = plant_of(world, nu=(0.3, 0.0, 0.0, 0.0, 0.0, 0.1))
    jumped = wrench(world, plant)
    mass = hydrodynamics_of(VEHICLE).added_mass
    assert (jumped[0], jumped[5]) == pytest.approx((-0.2 * mass[0] * 0.3, -0.2 * mass[5] * 0.1))
    for _ in range(200):
        forgot = wrench(world, plant)
    assert forgot[0] == pytest.approx(jumped[0] * math.exp(-1.0), rel=0.01)


def test_the_wake_is_met_after_a_reversal_only() -> None:
    world = made(wake=0.2)
    plant = plant_of(world, nu=(0.4, 0.0, 0.0, 0.0, 0.0, 0.0))
    for _ in range(20000):
        assert wrench(world, plant)[0] == 0.0
    plant.u = -0.4
    drag = hydrodynamics_of(VEHICLE).surge
    met = 0.4 * 1.2
    closed = drag.k_q * (met**2 - 0.4**2) + drag.k_l * (met - 0.4)
    assert wrench(world, plant)[0] == pytest.approx(closed, rel=1e-3)


def test_the_seiche_has_merians_period_and_carries_a_vehicle_that_floats_in_it() -> None:
    world = World(VEHICLE, 3, Conditions(thrust_noise=0.0, sizes={"seiche": 0.02}))
    pool = VEHICLE.pool
    period_s = 2.0 * pool.length_m / math.sqrt(GRAVITY_mps2 * pool.depth_m)
    speeds, ground = [], []
    for number in range(1, 201):
        world.advance(stamp_from_s(number * period_s / 100.0))
        speeds.append(world.plant.current_mps[0])
        ground.append(world.plant.velocity_over_ground[0])
    assert max(speeds) == pytest.approx(0.02, rel=0.01)
    assert speeds[:100] == pytest.approx(speeds[100:], abs=2e-4)
    # Water takes a body of its own density along; this one starts at rest and is nearly neutral.
    swing = max(ground) - min(ground)
    assert swing == pytest.approx(0.04, rel=0.05)


# ---- hull


def test_another_exponent_agrees_at_the_tested_speed_and_is_the_truth_that_is_reported() -> None:
    world = made(drag_exponent=-0.3)
    for axis, name in enumerate(AXES):
        drag = hydrodynamics_of(VEHICLE).drag(name)
        for speed in (TESTED[axis], 0.5 * TESTED[axis], 0.1 * TESTED[axis]):
            share = (speed / TESTED[axis]) ** 1.7
            closed = drag.k_q * TESTED[axis] ** 2 * share + drag.k_l * speed
            assert world.resistance(axis, speed) == pytest.approx(closed)
            velocities = [0.0] * 6
            velocities[axis] = speed
            a, b, c, d, e, f = velocities
            extra = wrench(world, plant_of(world, nu=(a, b, c, d, e, f)))[axis]
            assert extra == pytest.approx(-(closed - (drag.k_q * speed + drag.k_l) * speed))
        reported = hydrodynamics_of(world.described()).drag(name)
        for speed in (TESTED[axis], 0.5 * TESTED[axis]):
            assert (reported.k_q * speed + reported.k_l) * speed == pytest.approx(world.resistance(axis, speed))


def test_the_hull_can_be_harder_to_push_ahead_than_astern() -> None:
    world = made(fore_aft=0.1)
    mean = made().resistance(0, 0.4)
    assert (world.resistance(0, 0.4), world.resistance(0, -0.4)) == pytest.approx((1.1 * mean, -0.9 * mean))


def test_cross_added_mass_is_symmetric_and_a_share_of_the_axes_it_couples() -> None:
    world = made(added_mass_cross=0.1)
    cross, mass = world.hydrodynamics.added_mass_cross, hydrodynamics_of(VEHICLE).added_mass
    assert abs(cross[0][4]) == pytest.approx(0.1 * math.sqrt(mass[0] * mass[4]))
    assert all(cross[a][b] == cross[b][a] for a in range(6) for b in range(6))


def test_the_center_of_mass_is_as_far_away_as_asked() -> None:
    world = made(center_of_mass=0.01)
    assert math.dist(world.vehicle.center_of_mass_m, VEHICLE.center_of_mass_m) == pytest.approx(0.01)


# ---- sensors


def moving(**sizes: float) -> World:
    """At a steady 0.5 m/s ahead, for two seconds."""
    world = World(VEHICLE, 3, Conditions(thrust_noise=0.0, sizes=sizes))
    world.plant.place((-2.0, 0.0, 0.9), (0.0, 0.0, 0.0))
    for number in range(400):
        plant = world.plant
        plant.u, plant.v, plant.w, plant.p, plant.q, plant.r = 0.5, 0.0, 0.0, 0.0, 0.0, 0.0
        world.advance(stamp_from_s(0.005 * (number + 1)))
    return world


def covered(world: World) -> tuple[float, float, float]:
    return world.travel(world.mounting(world.vehicle.sensors["dvl75"]))[1]


def test_a_weight_hangs_below_and_a_float_on_top_so_that_both_right_the_vehicle(vehicle: Vehicle) -> None:
    """A float that is tied below the hull turned the mock over, and the weighing of heave was lost."""
    level, rolled = Plant(vehicle), Plant(vehicle)
    rolled.place((0.0, 0.0, 1.0), (0.3, 0.0, 0.0))
    (load,) = realize(vehicle, {"weight": 18.0}, 1).influences
    assert isinstance(load, KnownLoad)
    for share in (1.0, -1.0):
        load.share = share
        assert load(level, 0.0)[2] == pytest.approx(18.0 * share)
        assert load(rolled, 0.0)[3] < -0.5, "a moment against the roll"


def test_the_dvl_is_late_by_its_latency_and_long_by_its_scale() -> None:
    true = covered(moving())
    assert covered(moving(dvl_latency=0.15))[0] == pytest.approx(true[0] - 0.15 * 0.5, abs=1e-3)
    assert covered(moving(dvl_scale=0.01)) == pytest.approx([1.01 * one for one in true])
    assert covered(moving(dvl_latency=0.15, dvl_scale=0.01))[0] == pytest.approx(
        1.01 * covered(moving(dvl_latency=0.15))[0]
    )


def test_a_biased_dvl_covers_ground_at_rest() -> None:
    world = made(dvl_bias=0.01)
    plant, (error,) = plant_of(world), world.travel_errors
    for _ in range(1000):  # 5 s
        plant.step(0.005)
    _, (x, y, z) = error(plant, ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    assert math.hypot(x, y) == pytest.approx(0.05)
    assert z == 0.0


def test_a_turned_dvl_sees_a_part_of_surge_as_sway() -> None:
    x, y, _ = covered(moving(dvl_yaw=2.0))
    assert math.degrees(math.atan2(-y, x)) == pytest.approx(2.0, abs=0.05)


def test_a_misaligned_imu_is_turned_by_its_size() -> None:
    rotation = made(imu_misalignment=2.0).vehicle.sensors["icm20948"].rotation_deg
    assert math.hypot(*rotation) == pytest.approx(2.0)


def test_false_locks_come_as_often_as_reported_and_each_is_one_step() -> None:
    world = made(false_locks=2.0)
    plant, (error,) = plant_of(world), world.travel_errors
    observed = []
    for _ in range(100_000):  # 500 s
        wrench(world, plant)
        observed.append(error(plant, ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))[1])
    steps = sum(a != b for a, b in pairwise(observed))
    assert steps == pytest.approx(1000, rel=0.1)


def test_where_a_tether_pulls_no_number_is_the_truth_of_a_constant_force() -> None:
    free, braked, pulled = (known_coefficients(made(**one)) for one in ({}, {"tether_drag": 2.0}, {"tether": 1.0}))
    assert free["surge"]["b"] == braked["surge"]["b"] == 0.0
    assert {motion for motion, true in pulled.items() if "b" in true} == {"heave_up", "heave_down"}
    assert pulled["heave_down"] == free["heave_down"]
    assert pulled["surge"] == {name: value for name, value in free["surge"].items() if name != "b"}
