"""The reading-level sensors against the truth that they are made from."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hindrax_core.events import Stamp, Stamped, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, Inertial, Magnetic, Pressure, Reading, Vec3
from hindrax_core.vehicle import Mount, load_vehicle
from hindrax_sim.flights.sensor_models import SensorNoise, sensors
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.world import Conditions, World

QUIET = SensorNoise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
"""Sensors without noise and bias: what is left is their rounding."""

VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
CALM = Conditions(thrust_noise=0.0)


def moving(
    noise: SensorNoise = QUIET, attitude: Vec3 = (0.0, 0.0, 0.3), seed: int = 1
) -> tuple[World, list[tuple[str, Stamped[Reading]]]]:
    """A world in motion and its sensors, half a second in, each asked at its period."""
    world = World(VEHICLE, seed, CALM)
    world.plant.place((0.0, 0.0, 0.9), attitude)
    world.plant.u, world.plant.v, world.plant.r = 0.3, -0.1, 0.2
    seen, due = [], {one: one.period_ns for one in sensors(world, noise, seed)}
    while world.stamp < stamp_from_s(0.5):
        sensor = min(due, key=due.__getitem__)
        world.advance(Stamp(due[sensor]))
        due[sensor] += sensor.period_ns
        seen += [(sensor.source, one) for one in sensor.sample()]
    return world, seen


def of(kind: type[Reading], seen: list[tuple[str, Stamped[Reading]]]) -> list[Any]:
    return [one for _, one in seen if isinstance(one.reading, kind)]


def test_every_sensor_of_the_vehicle_speaks_at_its_rate() -> None:
    _, seen = moving()
    counts = {kind: len(of(kind, seen)) for kind in (Inertial, Magnetic, Pressure, Echo, BottomVelocity, BottomTrack)}
    assert counts[Inertial] == pytest.approx(0.5 * 225, abs=6)
    assert counts[Magnetic] == pytest.approx(0.5 * 25, abs=1)
    assert counts[Pressure] == pytest.approx(0.5 * 50, abs=1)
    assert counts[Echo] == pytest.approx(0.5 * 20, abs=1)
    assert counts[BottomVelocity] == pytest.approx(0.5 * 20, abs=1)
    assert counts[BottomTrack] == pytest.approx(0.5 * 10, abs=1)
    assert {source for source, _ in seen} == set(VEHICLE.sensors)


def test_without_noise_they_say_the_truth_to_their_last_digit() -> None:
    world, seen = moving()
    last = of(Inertial, seen)[-1]
    assert last.reading.rate_radps[2] == pytest.approx(world.plant.r, abs=0.01)
    assert last.reading.specific_force_mps2[2] == pytest.approx(-GRAVITY_mps2, abs=0.05)
    pressure = of(Pressure, seen)[-1].reading.pressure_Pa
    assert pressure == pytest.approx(world.pressure_Pa(world.mounting(Mount("x"))), abs=11.0)
    echo = of(Echo, seen)[-1].reading.range_m
    assert echo == pytest.approx(world.height_m(world.mounting(VEHICLE.sensors["ping1d"])), abs=2e-3)
    x, y, _ = of(Magnetic, seen)[-1].reading.field_T
    assert math.atan2(-y, x) == pytest.approx(world.attitude_rad[2], abs=0.02)


def test_the_dvl_shows_the_mean_over_its_interval_stamped_in_the_middle() -> None:
    world, seen = moving()
    velocity = of(BottomVelocity, seen)[-1]
    assert velocity.reading.interval_s == pytest.approx(0.05)
    assert velocity.stamp == pytest.approx(world.stamp - 25_000_000, abs=30_000_000)
    truth = world.velocity_mps(world.mounting(VEHICLE.sensors["dvl75"]))
    assert velocity.reading.velocity_mps[:2] == pytest.approx(truth[:2], abs=0.03)
    assert velocity.reading.velocity_mps[0] / 0.02 == pytest.approx(round(velocity.reading.velocity_mps[0] / 0.02))


def test_lock_is_lost_by_silence_and_by_tilt() -> None:
    world, _ = moving()
    dvl = next(one for one in sensors(world, QUIET, 1) if one.source == "dvl75")
    for tilt, silenced in ((0.0, True), (1.0, False)):
        world.plant.place((0.0, 0.0, 0.9), (tilt, 0.0, 0.0))
        world.dvl_silenced = silenced
        world.advance(Stamp(world.stamp + 50_000_000))
        velocity = dvl.sample()[0].reading
        assert isinstance(velocity, BottomVelocity)
        assert velocity.velocity_mps is None
        assert velocity.velocity_mps is None


def test_beside_the_floor_there_is_no_echo() -> None:
    world, _ = moving()
    sonar = next(one for one in sensors(world, QUIET, 1) if one.source == "ping1d")
    world.plant.place((0.0, 0.0, 0.9), (2.0, 0.0, 0.0))
    assert sonar.sample() == ()


def test_noise_has_the_spread_that_is_asked_for() -> None:
    world = World(VEHICLE, 1, CALM)
    noise = replace(QUIET, pressure_Pa=300.0)
    sensor = next(one for one in sensors(world, noise, 1) if one.source == "ms5837")
    truth = world.pressure_Pa(world.mounting(VEHICLE.sensors["ms5837"]))
    readings = [sensor.sample()[0].reading for _ in range(4000)]
    off = [one.pressure_Pa - truth for one in readings if isinstance(one, Pressure)]
    assert len(off) == len(readings)
    assert math.sqrt(sum(one * one for one in off) / len(off)) == pytest.approx(300.0, rel=0.05)


def test_one_seed_one_story() -> None:
    stories = [[one for _, one in moving(SensorNoise(), seed=seed)[1]] for seed in (3, 3, 4)]
    assert stories[0] == stories[1]
    assert stories[0] != stories[2]


def test_draws_depend_on_name_and_seed_alone() -> None:
    first, again, other = NormalDraws("a", 1), NormalDraws("a", 1), NormalDraws("b", 1)
    values = [first.normal() for _ in range(3000)]
    assert values == [again.normal() for _ in range(3000)]
    assert values != [other.normal() for _ in range(3000)]
    assert sum(values) / 3000 == pytest.approx(0.0, abs=0.07)
    assert sum(one * one for one in values) / 3000 == pytest.approx(1.0, abs=0.1)
