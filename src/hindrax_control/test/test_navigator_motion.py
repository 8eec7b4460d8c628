"""The navigator while everything moves at once, while a sensor is missing, and after a start that is no rest."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise

import pytest
from navigator_ride import CENTERED, HOVER, MOUNTED, Ride, part, rms

from hindrax_control.navigation.navigator import NavigatorKnobs
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import BottomTrack, Echo, Inertial, Pressure, Vec3
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import Mount

NO_COMPASS = NavigatorKnobs(heading_from="none")


def sliding(t: float) -> Vec3:
    """Always on with 0.3 m/s north, 0.2 m/s east and 0.15 m/s down: to an accelerometer that is rest."""
    return (0.3 * t, 0.2 * t, 0.3 + 0.15 * t)


def tumbling(t: float) -> Vec3:
    since = max(0.0, t - 4.5)
    return (0.5 * math.sin(0.7 * since), 0.4 * math.sin(0.9 * since), 0.5 * since)


@pytest.mark.parametrize("lost_s", [1e9, 5.0])
def test_whoever_tumbles_on_a_straight_way_is_on_a_straight_way(lost_s: float) -> None:
    """Velocity turns in body axes: the accelerometer alone must follow, and the position adds up in those of earth."""
    ride = Ride(position=sliding, attitude=tumbling, knobs=NO_COMPASS, dvl_until_s=lost_s, sonar_until_s=0.0)
    ride.dvl_delay_s = 0.0
    ride.run(10.0)
    for axis in range(3):
        off = ride.errors(part(lambda n: n.velocity_mps, axis), part(ride.velocity, axis), 5.0)
        assert max(map(abs, off)) < 0.05
    for axis in range(2):
        off = ride.errors(part(lambda n: n.position_m, axis), part(sliding, axis), 5.0)
        assert max(off) - min(off) < 0.1


def spinning(t: float) -> Vec3:
    """Two turns in three seconds, reached in two."""
    since = max(0.0, t - 2.0)
    return (0.0, 0.0, 4.0 * (0.25 * since**2 if since < 2.0 else since - 1.0))


def nodding(t: float) -> Vec3:
    return (0.0, 0.25 * (1.0 - math.cos(3.0 * max(0.0, t - 3.0))), 0.0)


def rolling(t: float) -> Vec3:
    return (0.25 * (1.0 - math.cos(3.0 * max(0.0, t - 3.0))), 0.0, 0.0)


@pytest.mark.parametrize("attitude", [spinning, nodding, rolling])
def test_an_inertial_sensor_far_out_feels_no_acceleration_of_the_vehicle_when_it_turns(
    attitude: Callable[[float], Vec3],
) -> None:
    sensors = dict(CENTERED.sensors) | {"icm20948": Mount("icm20948", position_m=(0.3, -0.3, 0.2))}
    vehicle = replace(CENTERED, sensors=sensors)
    ride = Ride(vehicle=vehicle, attitude=attitude, knobs=NO_COMPASS, dvl_until_s=3.0, sonar_until_s=0.0)
    ride.run(7.0)
    for axis in range(3):
        assert max(map(abs, ride.errors(part(lambda n: n.velocity_mps, axis), lambda _: 0.0, 2.0))) < 0.05


def test_at_rest_nothing_moves_from_the_first_state_on() -> None:
    ride = Ride(vehicle=MOUNTED).run(2.0)
    heave = [one.reading.velocity_mps[2] for one in ride.out if not math.isnan(one.reading.velocity_mps[2])]
    assert len(heave) > 40
    assert max(map(abs, heave)) < 0.01


def test_how_sure_heave_is_follows_from_surge_as_far_as_it_leans() -> None:
    def last(tilt: float) -> Navigation:
        return Ride(attitude=lambda _: (0.0, tilt, 0.0), dvl_until_s=4.0).run(12.0).out[-1].reading

    pitch = 0.5
    level, leaning = last(0.0), last(pitch)
    assert level.velocity_sigma_mps[2] < 0.05
    surge_mps = math.sin(pitch) * leaning.velocity_sigma_mps[0]
    wanted = math.hypot(level.velocity_sigma_mps[2], surge_mps) / math.cos(pitch)
    assert surge_mps > 2.0 * level.velocity_sigma_mps[2]
    assert leaning.velocity_sigma_mps[2] == pytest.approx(wanted, rel=0.05)


class Walled(Ride):
    """In the place of the DVL, a sonar that looks at a wall five meters north."""

    def acoustics(self, t: float, _sensors: Mapping[str, Mount], _gauss: Callable[[float], float]) -> None:
        slant = max(0.0, abs(self.attitude(t)[1]) - math.radians(12.5))
        self.tell(t, Echo((5.0 - self.position(t)[0]) / math.cos(slant), 0.9), "ahead")


@pytest.mark.parametrize("pushes_N", [0.0, 1.0])
def test_the_wall_is_that_ahead_when_the_thrusters_first_push(pushes_N: float) -> None:
    """A heading that settles after the first echo would leave the wall askew, and its ranges out."""
    look = {"ahead": Mount("ping1d", rotation_deg=(0.0, 90.0, 0.0))}
    turned = math.radians(12.0)
    ride = Walled(
        vehicle=replace(CENTERED, sensors={n: m for n, m in CENTERED.sensors.items() if n != "dvl75"} | look),
        attitude=lambda t: (0.0, 0.0, turned * min(1.0, max(0.0, 0.5 * (t - 2.0)))),
        knobs=NO_COMPASS,
    )
    ride.navigator.thrust([pushes_N] * 8)
    found = ride.run(6.0).out[-1].reading
    assert math.isnan(found.velocity_mps[0]) == (pushes_N > 0.0)


@pytest.mark.parametrize("walled", [False, True])
def test_heave_of_a_leaning_vehicle_needs_no_dvl(walled: bool) -> None:
    """The accelerometer alone makes meters per second of its offset, which would lean into heave."""
    pitch_rad, speed_mps = 0.2, 0.3 if walled else 0.0
    look = {"ahead": Mount("ping1d", rotation_deg=(0.0, 90.0, 0.0))}
    ride = (Walled if walled else Ride)(
        vehicle=replace(CENTERED, sensors={n: m for n, m in CENTERED.sensors.items() if n != "dvl75"} | look)
        if walled
        else CENTERED,
        position=lambda t: (speed_mps * t, 0.0, 0.9),
        attitude=lambda _: (0.0, pitch_rad, 0.0),
        force_bias=(0.2, 0.2, 0.0),
        dvl_from_s=1e9,
    )
    found = ride.run(10.0).out[-1].reading
    assert found.velocity_mps[2] == pytest.approx(speed_mps * math.sin(pitch_rad), abs=0.02)
    if walled:
        assert max(found.velocity_sigma_mps[0], found.velocity_sigma_mps[2]) < 0.05
    else:  # it may be as fast as its limit
        wanted_mps = math.tan(pitch_rad) * CENTERED.limits.speed_mps
        assert found.velocity_sigma_mps[2] == pytest.approx(wanted_mps, rel=0.2)


def test_after_a_short_pause_of_the_inertial_sensor_ticks_do_not_crowd() -> None:
    ride = Ride().run(2.0)
    for number in range(425, 500):
        t = number * 0.005
        ride.tell(t, ride.inertial(t, ride.vehicle.sensors["icm20948"]), "icm20948")
    gaps_ns = [b.stamp - a.stamp for a, b in pairwise(ride.out)]
    assert max(gaps_ns) > 100_000_000
    assert min(gaps_ns) >= 10_000_000


def test_while_the_sonar_is_received_the_dvl_does_not_show_the_altitude() -> None:
    ride = Ride().run(4.0)
    for number in range(800, 1600):
        t = number * 0.005
        ride.tell(t, ride.inertial(t, ride.vehicle.sensors["icm20948"]), "icm20948")
        ride.slow_sensors(t, number)
        if number % 20 == 0:
            ride.tell(t, BottomTrack(True, 0.0, 0.0, 0.0, 0.8, (0.0, 0.0), (), "3333", 0), "dvl75")
    assert max(map(abs, ride.errors(lambda n: n.altitude_m, lambda _: 0.9, 4.0))) < 0.001


def test_a_heading_that_drifts_after_a_long_rest_is_led_back_by_the_compass() -> None:
    ride = Ride()
    for number in range(1, 8000):
        t = number * 0.01
        drift = 0.002 if t > 20.0 else 0.0
        ride.tell(t, Inertial((1e-6 * number, 0.0, -GRAVITY_mps2), (0.0, 0.0, drift), 20.0), "icm20948")
        if number % 5 == 0:
            ride.slow_sensors(t, number // 5 * 9)
    assert abs(ride.out[-1].reading.attitude_rad[2]) < math.radians(1.5)


def turned_away(t: float) -> Vec3:
    """To a heading of 0.7 rad, and from the sixth second on never at rest."""
    rock = min(1.0, max(0.0, t - 6.0))
    return (0.3 * rock * math.sin(1.9 * t), 0.0, 0.35 * (1.0 - math.cos(min(3.0, max(0.0, t - 2.0)) / 3.0 * math.pi)))


def test_after_a_gap_it_knows_gyroscope_and_heading_from_before_and_needs_no_rest() -> None:
    offset = (0.03, -0.02, 0.025)
    ride = Ride(attitude=turned_away, gyro_bias=offset, knobs=NO_COMPASS).run(6.0)
    for number in range(1600, 2200):
        t = number * 0.005
        ride.tell(t, ride.inertial(t, ride.vehicle.sensors["icm20948"]), "icm20948")
    resumed = [one for one in ride.out if one.stamp > 8e9]
    assert resumed[0].stamp < 9.1e9, "one window, not the whole patience"
    assert resumed[-1].reading.attitude_rad[2] == pytest.approx(0.7, abs=0.05)
    off = ride.errors(lambda n: math.dist(n.rate_radps, (0.0, 0.0, 0.0)), lambda t: math.hypot(*ride.rates(t)), 8.5)
    assert rms(off) < 0.01


def test_a_navigator_that_is_reported_the_gyroscope_of_the_one_before_needs_no_rest() -> None:
    """Control was killed in flight: nothing but the offset of the gyroscope has outlived it."""
    offset = (0.03, -0.02, 0.025)
    before = Ride(attitude=turned_away, gyro_bias=offset, knobs=NO_COMPASS).run(8.0)
    known = before.navigator.gyroscope_offset
    assert known is not None
    assert known.rate_radps == pytest.approx(offset, abs=0.005)
    began_s = {}
    for reported in (None, known):
        ride = Ride(attitude=turned_away, gyro_bias=offset, knobs=NO_COMPASS)
        assert ride.navigator.gyroscope_offset is None
        if reported:
            ride.navigator.set_gyroscope_offset(reported)
        for number in range(1600, 3200):
            t = number * 0.005
            ride.tell(t, ride.inertial(t, ride.vehicle.sensors["icm20948"]), "icm20948")
        began_s[reported] = ride.out[0].stamp / 1e9 - 8.0
    assert began_s[known] == pytest.approx(1.0, abs=0.1), "one window"
    assert began_s[None] == pytest.approx(NavigatorKnobs().align_patience_s, abs=0.3), "the whole patience"


def test_swinging_at_the_start_it_begins_with_the_tilt_of_the_last_moment() -> None:
    def swing(t: float) -> Vec3:
        return (0.3 * math.sin(2.5 * t), 0.0, 0.0)

    ride = Ride(attitude=swing, deep=False).run(7.5)
    knobs = NavigatorKnobs()
    first = ride.out[0]
    assert first.stamp * 1e-9 > knobs.align_patience_s, "it waits for rest as long as its patience allows"
    # The last fifth of a second is what it averages; it swings by 0.15 rad meanwhile at most.
    assert first.reading.attitude_rad[0] == pytest.approx(swing(first.stamp * 1e-9 - 0.1)[0], abs=0.03)


def test_a_steady_turn_that_no_gyroscope_is_off_by_is_a_turn() -> None:
    ride = Ride(attitude=lambda t: (0.0, 0.0, 0.7 * t), position=HOVER, knobs=NO_COMPASS).run(3.0)
    assert ride.out[-1].reading.rate_radps[2] == pytest.approx(0.7, abs=0.01)


def test_a_start_that_is_no_rest_leaves_a_doubt_of_the_gyroscope_that_the_compass_settles() -> None:
    offset = (0.0, 0.0, 0.1)
    ride = Ride(attitude=lambda t: (0.2 * math.sin(2.5 * t), 0.0, 0.0), gyro_bias=offset).run(20.0)
    late = ride.errors(lambda n: n.rate_radps[2], lambda t: ride.rates(t)[2], 15.0)
    assert abs(sum(late) / len(late)) < 0.005


def test_a_reading_that_cannot_be_is_reported_with_its_sensor() -> None:
    ride = Ride().run(1.5)
    before = ride.navigator.refused
    ride.tell(1.5, Pressure(math.nan, 20.0), "ms5837")
    assert ride.navigator.refused == before + 1
    assert ride.navigator.refusals.values()["refused: ms5837"] == "1"
