"""The navigator against motions that are known in closed form."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from navigator_ride import CENTERED, FIELD_T, HOVER, MOUNTED, FLOOR_m, Ride, part, rms

from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_control.navigation.estimator_health import EstimatorHealthKnobs
from hindrax_control.navigation.navigator import Navigator, NavigatorKnobs
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_control.sensors import SensorMount
from hindrax_control.testing.motion import vector
from hindrax_core.events import Stamp, Stamped, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import (
    BottomTrack,
    BottomVelocity,
    DeviceText,
    Echo,
    Inertial,
    Magnetic,
    Pressure,
    Reading,
    Vec3,
)
from hindrax_core.rotation import cross, matrix
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import Mount


def surging(t: float) -> Vec3:
    """Half a meter to and fro, once in eight seconds, after two seconds of rest."""
    return (0.25 * (1 - math.cos(0.8 * max(0.0, t - 2.0))), 0.0, 0.9)


def heaving(t: float) -> Vec3:
    return (0.0, 0.0, 0.9 + 0.15 * math.sin(1.2 * max(0.0, t - 2.0)) * min(1.0, max(0.0, (t - 2.0) / 2.0)))


def test_at_rest_everything_is_known_and_still() -> None:
    ride = Ride().run(6.0)
    state = ride.out[-1].reading
    assert state.attitude_rad == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert state.velocity_mps == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert state.depth_m == pytest.approx(0.9, abs=1e-6)
    assert state.altitude_m == pytest.approx(0.9, abs=1e-6)
    assert state.position_m == pytest.approx((0.0, 0.0), abs=1e-6)
    assert state.dvl_locked
    assert ride.navigator.refused <= 1  # the DVL's interval that began before the alignment ended
    assert set(state.ages_s) == {"icm20948", "ms5837", "ping1d", "dvl75"}
    assert state.ages_s["dvl75"] == pytest.approx(0.045, abs=0.06)


def test_it_speaks_fifty_times_a_second_of_imu_time() -> None:
    ride = Ride().run(6.0)
    stamps = [one.stamp for one in ride.out]
    assert len(stamps) == pytest.approx(5.0 * 50, abs=2)
    gaps = [b - a for a, b in pairwise(stamps)]
    assert max(gaps) <= 25_000_000
    assert min(gaps) >= 15_000_000


def test_the_rate_holds_when_samples_do_not_fall_on_the_ticks() -> None:
    navigator, count = Navigator(CENTERED), 0
    for number in range(225 * 11):
        stamp = Stamp(number * 4_444_444)
        count += navigator.step(Stamped(stamp, Inertial((0, 0, -9.81), (0, 0, 0), 20.0)), "icm20948") is not None
    assert count == pytest.approx(500, abs=2)


def test_gravity_that_no_turn_explains_is_reported_at_once_and_followed_slowly() -> None:
    navigator, reported = Navigator(CENTERED), list[Navigation]()
    for number in range(700):
        roll_rad = 0.1 if number > 400 else 0.0
        force = (0.0, -GRAVITY_mps2 * math.sin(roll_rad), -GRAVITY_mps2 * math.cos(roll_rad))
        out = navigator.step(Stamped(stamp_from_s(0.01 * number), Inertial(force, (0.0, 0.0, 0.0), 20.0)), "icm20948")
        reported += [out.reading] if out else []
    off_rad, roll_rad = reported[-1].consistency.gravity_off_rad, reported[-1].attitude_rad[0]
    assert roll_rad > 0.001
    assert off_rad + roll_rad == pytest.approx(0.1, abs=0.01)


def test_tilt_and_gyroscope_bias_are_found_while_it_rests() -> None:
    tilt = (0.1, -0.05, 0.4)
    ride = Ride(attitude=lambda _: tilt, gyro_bias=(0.01, -0.02, 0.005)).run(9.0)
    state = ride.out[-1].reading
    assert state.attitude_rad == pytest.approx(tilt, abs=2e-3)
    assert state.rate_radps == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)


def test_surge_is_followed_between_dvl_samples_without_lag() -> None:
    ride = Ride(position=surging, noise=1.0).run(25.0)
    assert rms(ride.errors(lambda n: n.velocity_mps[0], lambda t: ride.velocity(t)[0])) < 0.006
    assert rms(ride.errors(lambda n: n.position_m[0], lambda t: surging(t)[0])) < 0.03
    sigma = ride.out[-1].reading.velocity_sigma_mps[0]
    assert 0.003 < sigma < 0.012


@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.3])
def test_a_late_dvl_sample_is_fused_at_its_own_time(delay_s: float) -> None:
    # 0.2 m/s^2 at most: a delay of 0.3 s that is not respected would be wrong by up to 0.05 m/s.
    ride = Ride(position=surging, dvl_delay_s=delay_s).run(20.0)
    assert rms(ride.errors(lambda n: n.velocity_mps[0], lambda t: ride.velocity(t)[0])) < 0.007


def test_without_lock_it_goes_on_by_the_accelerometer_and_states_how_sure_it_is() -> None:
    ride = Ride(position=surging, force_bias=(0.02, 0.0, 0.0), dvl_until_s=15.0).run(18.0)
    locked, lost = ride.out[700].reading, ride.out[-1].reading
    assert locked.dvl_locked
    assert not lost.dvl_locked
    error = abs(lost.velocity_mps[0] - ride.velocity(ride.out[-1].stamp * 1e-9)[0])
    assert lost.velocity_sigma_mps[0] > 3 * locked.velocity_sigma_mps[0]
    assert error < 3 * lost.velocity_sigma_mps[0]
    assert error < 0.08
    assert lost.ages_s["dvl75"] == pytest.approx(3.0, abs=0.15)


def test_velocity_is_unknown_before_the_first_lock() -> None:
    ride = Ride(dvl_from_s=3.0).run(5.0)
    before, after = ride.out[50].reading, ride.out[-1].reading
    assert math.isnan(before.velocity_mps[0])
    assert math.isnan(before.velocity_sigma_mps[0])
    assert not before.dvl_locked
    assert before.velocity_mps[2] == pytest.approx(0.0, abs=1e-3)
    assert after.dvl_locked


def test_heave_velocity_is_far_better_than_a_differentiated_altitude() -> None:
    ride = Ride(position=heaving, noise=1.0, force_bias=(0.0, 0.0, 0.03)).run(30.0)
    off = rms(ride.errors(lambda n: n.velocity_mps[2], lambda t: ride.velocity(t)[2]))
    differentiated = 0.005 * math.sqrt(2) / 0.05
    assert off < 0.007
    assert off < differentiated / 15
    assert off < 2.0 * ride.out[-1].reading.velocity_sigma_mps[2]
    assert rms(ride.errors(lambda n: n.depth_m, lambda t: heaving(t)[2])) < 0.002
    assert rms(ride.errors(lambda n: n.altitude_m, lambda t: FLOOR_m - heaving(t)[2])) < 0.004


@pytest.mark.parametrize(("deep", "roll", "known"), [(True, 0.0, True), (False, 0.0, False), (True, 2.8, False)])
def test_heave_is_reported_only_with_a_depth_and_upright(deep: bool, roll: float, known: bool) -> None:
    state = Ride(deep=deep, attitude=lambda _: (roll, 0.0, 0.0), sonar_until_s=0.0).run(3.0).out[-1].reading
    assert math.isfinite(state.velocity_mps[2]) is known
    assert math.isfinite(state.velocity_sigma_mps[2]) is known


def sinking(t: float) -> Vec3:
    """Down at 0.3 m/s, reached between one and two seconds."""
    since = max(0.0, t - 1.0)
    return (0.0, 0.0, 0.3 * (0.5 * since**2 if since < 1.0 else since - 0.5))


class Clogged(Ride):
    """From the third second on the pressure freezes."""

    def tell(self, t: float, reading: Reading, source: str) -> None:
        if isinstance(reading, Pressure):
            self.kept = getattr(self, "kept", reading) if t > 3.0 else reading
            reading = self.kept
        super().tell(t, reading, source)


def test_a_pressure_that_sticks_is_contradicted_by_the_dvl() -> None:
    honest, clogged = (
        made(position=sinking, noise=1.0, sonar_until_s=0.0).run(6.0).out[-1] for made in (Ride, Clogged)
    )
    assert abs(honest.reading.consistency.sunk_off_m) < 0.03
    assert 0.3 < clogged.reading.consistency.sunk_off_m < 0.9


def test_an_inertial_sensor_that_states_the_very_same_is_reported() -> None:
    moving, still = (Ride(position=position).run(4.0).out[-1].reading.consistency for position in (surging, HOVER))
    assert moving.frozen_s == 0.0
    assert still.frozen_s == pytest.approx(3.99, abs=0.05)


@pytest.mark.parametrize(
    ("rate_radps", "seconds", "frozen_s"),
    [
        ((0.0, 0.0, 1.2), 0.9, 0.0),  # as a SITL does in a steady turn
        ((0.0, 0.0, 1.2), 2.0, 0.99),
        ((0.03, 0.0, 0.0), 0.9, 0.70),  # gravity would have moved by 5 of its steps after 0.2 s
    ],
)
def test_samples_of_an_autopilot_repeat_at_rest_and_for_a_while_in_a_turn_that_leaves_gravity_as_it_is(
    rate_radps: Vec3, seconds: float, frozen_s: float
) -> None:
    coarse = replace(CENTERED, sensors={**CENTERED.sensors, "icm20948": Mount("ardusub")})
    ride = Ride(vehicle=coarse, gyro_bias=(0.0, 0.0, 0.005))
    ride.run(4.0)
    assert ride.out[-1].reading.consistency.frozen_s == 0.0, "RAW_IMU has steps of 1 mrad/s and 1 mg"
    stuck = Inertial((0.0, 0.0, -9.81), rate_radps, 20.0)
    for number in range(1, round(250 * seconds)):
        ride.tell(4.0 + 0.004 * number, stuck, "icm20948")
    assert ride.out[-1].reading.consistency.frozen_s == pytest.approx(frozen_s, abs=0.05)


def pitching_up(t: float) -> Vec3:
    return (0.0, 0.4 * math.sin(0.25 * max(0.0, t - 3.0)), 0.0)


@pytest.mark.parametrize("deep", [True, False])
def test_a_turn_without_dvl_makes_no_surge_of_heave(deep: bool) -> None:
    position = sinking if deep else HOVER
    bias = 0.0 if deep else 0.1
    ride = Ride(position=position, attitude=pitching_up, deep=deep, force_bias=(0.0, 0.0, bias), dvl_until_s=3.0)
    ride.sonar_until_s = 0.0
    off = ride.run(9.0).errors(lambda state: state.velocity_mps[0], lambda t: ride.velocity(t)[0], 8.0)
    assert max(map(abs, off)) < 0.08


def test_without_sonar_the_altitude_goes_on_from_depth_and_grows_old() -> None:
    ride = Ride(position=heaving, sonar_until_s=10.0).run(16.0)
    assert rms(ride.errors(lambda n: n.altitude_m, lambda t: FLOOR_m - heaving(t)[2], 12.0)) < 0.01
    assert ride.out[-1].reading.ages_s["ping1d"] == pytest.approx(6.0, abs=0.1)


def rocking(t: float) -> Vec3:
    ease = min(1.0, max(0.0, (t - 2.0) / 3.0))
    return (0.2 * ease * math.sin(1.7 * t), 0.15 * ease * math.sin(1.3 * t), 0.5 * ease * math.sin(0.9 * t))


def test_levers_and_turned_mounts_are_taken_off() -> None:
    ride = Ride(vehicle=MOUNTED, attitude=rocking, knobs=NavigatorKnobs(heading_from="none")).run(20.0)
    for axis in range(3):
        assert rms(ride.errors(part(lambda n: n.velocity_mps, axis), part(ride.velocity, axis))) < 0.012
        assert rms(ride.errors(part(lambda n: n.attitude_rad, axis), part(rocking, axis))) < 0.01
        assert rms(ride.errors(part(lambda n: n.rate_radps, axis), part(ride.rates, axis))) < 0.002
    assert rms(ride.errors(lambda n: n.depth_m, lambda _: 0.9)) < 0.003


def turning(t: float) -> Vec3:
    return (0.0, 0.0, 0.3 * max(0.0, t - 3.0))


def test_heading_goes_round_with_the_gyroscope() -> None:
    ride = Ride(attitude=turning).run(25.0)
    error = [math.remainder(e, math.tau) for e in ride.errors(lambda n: n.attitude_rad[2], lambda t: turning(t)[2])]
    assert max(map(abs, error)) < 0.01


THRUSTERS_T = ((2e-7, -1e-7), (-1e-7, 2.5e-7), (1.5e-7, 1e-7), (-2e-7, -1e-7)) * 2
"""Field of each thruster at the compass per N^1.5, along x and y."""


def pattern(t: float) -> tuple[float, ...]:
    """Forces that change every two seconds, after ten seconds of rest, and never repeat soon."""
    if t < 10.0:
        return (0.0,) * 8
    turn = int((t - 10.0) / 2.0)
    return tuple(float((turn * (3 * k + 1)) % 7 - 2) * 1.5 for k in range(8))


def motors(t: float) -> Vec3:
    x, y = (sum(abs(f) ** 1.5 * k[axis] for f, k in zip(pattern(t), THRUSTERS_T, strict=True)) for axis in (0, 1))
    return (x, y, 0.0)


@pytest.mark.parametrize("reported", [True, False])
def test_the_compass_learns_what_the_thrusters_do_to_it(reported: bool) -> None:
    ride = Ride(motors_T=motors, gyro_bias=(0.0, 0.0, 0.002)).run(10.0)
    worst = 0.0
    for number in range(1000, 6000):
        t = number * 0.01
        if reported and number % 2 == 0:
            ride.navigator.thrust(pattern(t))
        ride.tell(t, Inertial((0.0, 0.0, -GRAVITY_mps2), (0.0, 0.0, 0.002), 20.0), "icm20948")
        if number % 4 == 0:
            ride.tell(t, Magnetic(vector(a + b for a, b in zip(FIELD_T, motors(t), strict=True))), "icm20948")
        worst = max(worst, abs(ride.out[-1].reading.attitude_rad[2]))
    assert (worst < math.radians(1.0)) is reported


def test_a_compass_that_jumps_is_not_followed_at_once() -> None:
    ride = Ride(motors_T=lambda t: (0.0, 9e-6, 0.0) if t > 5.0 else (0.0, 0.0, 0.0)).run(12.0)
    assert max(map(abs, ride.errors(lambda n: n.attitude_rad[2], lambda _: 0.0, 2.0))) < math.radians(1.0)


def track(heading_rad: float, calibration: str = "3333", altitude_m: float | None = None) -> BottomTrack:
    return BottomTrack(altitude_m is not None, 0.0, 0.0, heading_rad, altitude_m, (0.0, 0.0), (), calibration, 0)


@pytest.mark.parametrize(("calibration", "wanted"), [("3333", 1.0), ("", 1.0), ("3331", 0.0)])
def test_the_heading_may_come_from_a_calibrated_dvl(calibration: str, wanted: float) -> None:
    ride = Ride(knobs=NavigatorKnobs(heading_from="dvl"))
    for number in range(400):
        ride.tell(number * 0.005, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        ride.tell(number * 0.005, track(1.0, calibration), "dvl75")
    assert ride.out[-1].reading.attitude_rad[2] == pytest.approx(wanted, abs=0.01)


def test_the_dvl_shows_the_altitude_while_the_sonar_is_silent() -> None:
    ride = Ride()
    for number in range(600):
        ride.tell(number * 0.005, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        ride.tell(number * 0.005, track(0.0, altitude_m=0.7), "dvl75")
    assert ride.out[-1].reading.altitude_m == pytest.approx(0.7, abs=0.01)
    assert ride.out[-1].reading.ages_s.get("ping1d", math.inf) == math.inf
    assert ride.out[-1].reading.altitude_age_s < 0.05, "the age is that of what the altitude comes from"


def test_a_dvl_serves_as_altimeter_only_after_the_sonar_is_silent() -> None:
    ride = Ride(sonar_until_s=5.0).run(4.0)
    for number in range(800, 1400):
        t = number * 0.005
        ride.tell(t, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        if t < 5.0:
            ride.tell(t, Echo(FLOOR_m - 0.9, 0.9), "ping1d")
        ride.tell(t, track(0.0, altitude_m=0.2), "dvl75")
    before = [one.reading for one in ride.out if 4.1 < one.stamp * 1e-9 < 5.4]
    assert all(one.altitude_m > 0.8 for one in before)
    assert ride.out[-1].reading.altitude_m == pytest.approx(0.2, abs=0.02)
    assert ride.out[-1].reading.altitude_age_s < 0.05
    assert ride.out[-1].reading.ages_s["ping1d"] > 1.5


def test_a_sonar_that_looks_ahead_is_no_altimeter() -> None:
    """Two Pings, a usual fit: what the forward one sees of a wall must not move the floor."""
    ahead = Mount("ping1d", port="b", rotation_deg=(0.0, 90.0, 0.0))
    vehicle = replace(CENTERED, sensors={**CENTERED.sensors, "ahead": ahead})
    assert vehicle.measuring("altitude") == ("ping1d", "dvl75")
    assert vehicle.measuring("range_ahead") == ("ahead",)
    ride = Ride(vehicle=vehicle).run(4.0)
    known, refused = ride.out[-1].reading, ride.navigator.refused
    for number in range(800, 1200):
        ride.tell(number * 0.005, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        ride.tell(number * 0.005, Echo(5.0, 0.9), "ahead")
    assert ride.navigator.refused == refused
    assert "ahead" not in ride.out[-1].reading.ages_s
    assert ride.out[-1].reading.altitude_age_s > known.altitude_age_s + 1.9


def test_of_two_inertial_sensors_the_first_of_the_file_paces_the_filters() -> None:
    spare = Mount("icm20948", port="b", rotation_deg=(180.0, 0.0, 0.0))
    ride = Ride(vehicle=replace(CENTERED, sensors={**CENTERED.sensors, "spare": spare}))
    for number in range(1, 1000):
        ride.tell(number * 0.005, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        ride.tell(number * 0.005 + 0.001, Inertial((0, 0, GRAVITY_mps2), (0, 0, 0.5), 20.0), "spare")
    assert "spare" not in ride.out[-1].reading.ages_s
    assert max(map(abs, ride.out[-1].reading.attitude_rad)) < 0.01


def test_a_frozen_dvl_is_found_beside_another_that_measures() -> None:
    other = Mount("dvl75", port="b")
    ride = Ride(vehicle=replace(CENTERED, sensors={**CENTERED.sensors, "other": other})).run(4.0)
    refused = ride.navigator.refused
    for number in range(800, 1400):
        t = number * 0.005
        ride.tell(t, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        if number % 10 == 0:
            ride.tell(t - 0.03, BottomVelocity((0.001, 0.0, 0.0), 0.01, 1.0, 0.05, 0), "dvl75")
            noise = ride.random.gauss(0.0, 0.002)
            ride.tell(t - 0.03, BottomVelocity((noise, 0.0, 0.0), 0.01, 1.0, 0.05, 0), "other")
    found = ride.out[-1].reading
    assert ride.navigator.refused > refused
    assert found.ages_s["dvl75"] > 1.0
    assert found.ages_s["other"] < 0.1


@pytest.mark.parametrize("bad", [
    BottomVelocity((math.nan, 0.0, 0.0), 0.01, 1.0, 0.05, 0),
    BottomVelocity((9.0, 0.0, 0.0), 0.01, 1.0, 0.05, 0),
    Pressure(math.nan, 20.0),
    Pressure(9e9, 20.0),
    Echo(math.nan, 0.9),
    Echo(-1.0, 0.9),
    Echo(50.0, 0.9),
    Inertial((math.inf, 0.0, 0.0), (0.0, 0.0, 0.0), 20.0),
    Inertial((0.0, 0.0, -9.81), (math.nan, 0.0, 0.0), 20.0),
])  # fmt: skip
def test_what_cannot_be_is_refused_and_changes_nothing(bad: BottomVelocity | Pressure | Echo | Inertial) -> None:
    ride = Ride().run(4.0)
    before = ride.navigator.refused
    for number in range(3):
        ride.tell(4.0 + 0.005 * number - 0.001, bad, {Echo: "ping1d", Pressure: "ms5837"}.get(type(bad), "dvl75"))
        ride.tell(4.0 + 0.005 * number, ride.inertial(4.0, CENTERED.sensors["icm20948"]), "icm20948")
    for t in (4.03, 4.06):
        ride.tell(t, ride.inertial(4.0, CENTERED.sensors["icm20948"]), "icm20948")
    state = ride.out[-1].reading
    assert ride.navigator.refused - before == 3
    assert state.velocity_mps == pytest.approx((0.0, 0.0, 0.0), abs=1e-5)
    assert (state.depth_m, state.altitude_m) == pytest.approx((0.9, 0.9), abs=1e-5)


def test_what_was_measured_after_the_newest_imu_sample_waits() -> None:
    # IMU samples come in batches, so a pressure may be younger than they: fused too early, depth would run ahead.
    ride = Ride(position=lambda t: (0.0, 0.0, 0.3 + 0.2 * t)).run(4.0)
    ride.tell(4.5, Pressure(101325.0 + 1000.0 * GRAVITY_mps2 * 1.2, 20.0), "ms5837")
    ride.tell(4.02, ride.inertial(4.0, CENTERED.sensors["icm20948"]), "icm20948")
    assert ride.out[-1].reading.depth_m == pytest.approx(0.3 + 0.2 * 4.02, abs=1e-3)


def test_a_velocity_waits_until_its_interval_is_over() -> None:
    ride = Ride().run(4.0)
    ride.tell(4.001, BottomVelocity((0.02, 0.0, 0.0), 0.01, 1.0, 0.1, 0), "dvl75")
    surge_mps = []
    for t in (4.02, 4.04, 4.06):
        ride.tell(t, ride.inertial(4.0, CENTERED.sensors["icm20948"]), "icm20948")
        surge_mps.append(ride.out[-1].reading.velocity_mps[0])
    assert surge_mps[:2] == pytest.approx([0.0, 0.0], abs=1e-5)
    assert surge_mps[2] > 1e-3


def test_a_weak_echo_and_an_unknown_reading_are_passed_over() -> None:
    ride = Ride().run(4.0)
    ride.tell(4.0, Echo(0.3, 0.1), "ping1d")
    ride.tell(4.0, DeviceText("hello"), "dvl75")
    ride.tell(4.02, ride.inertial(4.0, CENTERED.sensors["icm20948"]), "icm20948")
    assert ride.out[-1].reading.altitude_m == pytest.approx(0.9, abs=1e-5)


def test_a_floor_that_really_changes_is_accepted_in_the_end() -> None:
    ride = Ride().run(4.0)
    for number in range(800, 1400):
        t = number * 0.005
        ride.tell(t, ride.inertial(4.0, CENTERED.sensors["icm20948"]), "icm20948")
        if number % 10 == 0:
            ride.tell(t, Echo(2.4, 0.9), "ping1d")
    assert ride.out[-1].reading.altitude_m == pytest.approx(2.4, abs=0.02)


@pytest.mark.parametrize(("velocity", "locked"), [((0.2, 0.0, 0.0), False), ((0.0, 0.0, 0.0), True)])
def test_a_velocity_that_repeats_itself_is_no_bottom_lock_but_for_rest(velocity: Vec3, locked: bool) -> None:
    ride = Ride()
    for number in range(1, 1600):
        t = number * 0.005
        ride.tell(t, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        if number % 20 == 0 and t > 4.0:
            ride.tell(t, BottomVelocity(velocity, 0.01, 1.0, 0.1, number), "dvl75")
    assert ride.out[-1].reading.dvl_locked is locked
    assert any(one.reading.dvl_locked for one in ride.out)


@pytest.mark.parametrize(
    ("share", "late_s", "hung"), [(0.0, 0.0, True), (1.0, 0.0, False), (1.0, 0.1, False), (0.7, 0.0, False)]
)
def test_a_dvl_that_hangs_with_live_noise_is_contradicted_and_one_that_is_late_or_scaled_is_not(
    share: float, late_s: float, hung: bool
) -> None:
    """Each velocity is within the gate; what they are off by has one sign, and the offset of the filter learned it."""
    ride, noise = Ride(), np.random.default_rng(3).normal(0.0, 0.01, 400)
    most = 0
    for number in range(1, 1500):
        t = number * 0.005
        gathers_s = min(max(t - 6.0, 0.0), 1.2)
        pushed = 0.0 < gathers_s < 1.2
        ride.tell(t, Inertial((0.35 * pushed, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        if number % 10 == 0 and t > 3.0:
            ahead = 0.35 * share * min(max(t - 0.025 - late_s - 6.0, 0.0), 1.2)
            velocity = (ahead + float(noise[number // 10]), 0.0, 0.0)
            ride.tell(t, BottomVelocity(velocity, 0.01, 1.0, 0.05, number), "dvl75")
            most = max(most, ride.out[-1].reading.consistency.refused_velocities)
    assert (most >= EstimatorHealthKnobs().refused_velocities) is hung


@pytest.mark.parametrize(
    ("follows", "force_N", "hung"), [(0.0, 1.0, True), (1.0, 1.0, False), (0.0, 0.0, False), (0.0, -1.0, False)]
)
def test_a_dvl_hangs_too_where_it_misses_a_slow_push_that_the_thrusters_explain(
    follows: float, force_N: float, hung: bool
) -> None:
    """The accelerometer may be off by as much: without thrust, or against it, it proves nothing."""
    ride, noise = Ride(), np.random.default_rng(3).normal(0.0, 0.01, 400)
    pushes_N = 0.15 * prior_dynamics(ride.vehicle)["surge"].inertia * force_N
    forces_N = np.linalg.pinv(effectiveness(ride.vehicle))[:, 0] * pushes_N
    most = 0
    for number in range(1, 1900):
        t = number * 0.005
        pushed = t > 6.0
        if number % 10 == 0:
            ride.navigator.thrust(tuple((forces_N * pushed).tolist()))
        ride.tell(t, Inertial((0.15 * pushed, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        if number % 10 == 0:
            ahead = follows * 0.15 * max(t - 0.025 - 6.0, 0.0)
            velocity = (ahead + float(noise[number // 10]), 0.0, 0.0)
            ride.tell(t, BottomVelocity(velocity, 0.01, 1.0, 0.05, number), "dvl75")
            most = max(most, ride.out[-1].reading.consistency.refused_velocities if ride.out else 0)
    assert (most >= EstimatorHealthKnobs().refused_velocities) is hung


def test_a_vehicle_that_points_exactly_up_has_no_direction_ahead_and_its_dvl_is_heard_all_the_same() -> None:
    ride = Ride()
    ride.run(4.0)
    aiding = ride.navigator._aiding
    aiding.attitude.rotation = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
    assert aiding.attitude.ahead == 0j
    mount = SensorMount(ride.vehicle.sensors["dvl75"])
    reading = BottomVelocity((0.001, 0.0, 0.0), 0.01, 1.0, 0.05, 1)
    assert aiding.bottom_velocity(reading, mount, aiding.horizontal._rows[-1][0] - 0.1, "dvl75")


@pytest.mark.parametrize(("noise_mps", "assumed"), [(0.0, False), (0.001, True)])
def test_a_velocity_against_the_accelerometer_is_accepted_in_the_end_unless_it_repeats_itself(
    noise_mps: float, assumed: bool
) -> None:
    ride = Ride()
    for number in range(1, 1340):
        t = number * 0.005
        ahead = 0.8 if t > 6.0 else 0.0
        ride.tell(t, Inertial((ahead, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        if number % 10 == 0 and t > 4.0:
            velocity = (0.01 + noise_mps * (number % 3), 0.0, 0.0)
            ride.tell(t, BottomVelocity(velocity if t > 5.9 else (0.0, 0.0, 0.0), 0.01, 1.0, 0.05, number), "dvl75")
    state = ride.out[-1].reading
    assert state.dvl_locked is assumed
    assert (state.velocity_mps[0] < 0.2) is assumed


def test_after_a_gap_in_the_imu_it_starts_anew() -> None:
    ride = Ride(position=surging).run(6.0)
    ride.tell(8.0, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
    count = len(ride.out)
    for number in range(1, 300):
        ride.tell(8.0 + number * 0.005, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
    state = ride.out[count].reading
    assert ride.out[count].stamp >= stamp_from_s(9.0)
    assert math.isnan(state.velocity_mps[0])
    assert math.isnan(state.depth_m)


def test_after_a_gap_the_compass_is_still_corrected_by_what_the_thrusters_do() -> None:
    ride = Ride()
    ride.navigator.thrust(pattern(30.0))
    for gap_s in (0.0, 2.0):
        ride.tell(gap_s, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
    assert ride.navigator._aiding.forces_N == pattern(30.0)  # its effect on the compass is tested above


def test_alignment_averages_a_whole_window_after_every_start() -> None:
    ride = Ride()
    for begin in (0.0, 10.0):
        count = len(ride.out)
        for number in range(1, 199):
            ride.tell(begin + number * 0.005, Inertial((0, 0, -GRAVITY_mps2), (0, 0, 0), 20.0), "icm20948")
        assert len(ride.out) == count, "a second is not over"


def test_time_that_runs_back_is_refused() -> None:
    ride = Ride().run(3.0)
    before = ride.navigator.refused
    ride.tell(2.0, Inertial((0, 0, -9.81), (0, 0, 0), 20.0), "icm20948")
    assert ride.navigator.refused == before + 1


@settings(max_examples=15, deadline=None)
@given(st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-3.0, 3.0)))
def test_any_attitude_at_rest_is_found(attitude: Vec3) -> None:
    ride = Ride(attitude=lambda _: attitude).run(1.6)
    found = ride.out[-1].reading.attitude_rad
    assert found[:2] == pytest.approx(attitude[:2], abs=1e-3)
    assert matrix(found)[0] == pytest.approx(matrix((*found[:2], attitude[2]))[0], abs=0.02)


def test_the_same_readings_give_the_same_navigation() -> None:
    first, second = (Ride(position=surging, noise=1.0).run(4.0).out for _ in range(2))
    assert first == second


def test_rates_of_the_test_itself_are_those_of_a_turning_body() -> None:
    ride = Ride(attitude=turning)
    assert ride.rates(5.0) == pytest.approx((0.0, 0.0, 0.3), abs=1e-6)
    lever = (0.2, 0.0, 0.0)
    assert ride.velocity(5.0, lever) == pytest.approx(cross((0.0, 0.0, 0.3), lever), abs=1e-6)


def level_samples(
    begin_s: float, seconds: float, force: Vec3 = (0.0, 0.0, -GRAVITY_mps2)
) -> Iterator[Stamped[Reading]]:
    """A hundred samples a second of a vehicle at rest."""
    for number in range(round(100 * seconds)):
        yield Stamped(stamp_from_s(begin_s + 0.01 * number), Inertial(force, (0.0, 0.0, 0.0), 20.0))


@pytest.mark.parametrize(("at_s", "side"), [(1.7e9, "after"), (3.0, "before")])
def test_a_sensor_with_another_clock_than_the_inertial_one_is_named(at_s: float, side: str) -> None:
    navigator = Navigator(CENTERED)
    for sample in level_samples(1000.0, 3.0):
        navigator.step(sample, "icm20948")
    navigator.step(Stamped(stamp_from_s(at_s), Pressure(110_000.0, 20.0)), "ms5837")
    assert f"s {side} the inertial sensor's, wanted within 10 s" in navigator.refusals.last
    assert navigator.refusals.counts == {"ms5837": 1}


@pytest.mark.parametrize("ahead_s", [-8.0, -1.5, 1.5, 8.0])
def test_a_velocity_of_a_clock_that_is_seconds_off_is_refused_by_name(ahead_s: float) -> None:
    """Late, it can be compared with nothing; early, it would be compared with a motion of seconds later."""
    navigator, found = Navigator(CENTERED), None
    for number, sample in enumerate(level_samples(1000.0, 12.0)):
        found = navigator.step(sample, "icm20948") or found
        if number % 10 == 0:
            velocity = BottomVelocity((0.4, 0.0, 0.0), 0.01, 0.1, 0.0, number)
            navigator.step(Stamped(stamp_from_s(1000.0 + 0.01 * number + ahead_s), velocity), "dvl75")
    assert found is not None
    side = "before" if ahead_s < 0.0 else "after"
    assert f"s {side} the inertial sensor's, wanted within 1 s; another clock" in navigator.refusals.last
    assert "synchronize" in navigator.refusals.last
    assert not found.reading.dvl_locked
    assert math.isnan(found.reading.velocity_mps[0]) or ahead_s > 0.0


def test_messages_that_are_fetched_before_the_inertial_samples_with_them_are_of_no_other_clock() -> None:
    """A busy process, or a fast mock, fetches seconds at once, topic by topic, the inertial samples last."""
    navigator = Navigator(CENTERED)
    samples = list(level_samples(1000.0, 30.0))
    for begin in range(0, len(samples), 500):
        for sample in samples[begin : begin + 500 : 10]:
            still = BottomVelocity((1e-4, 0.0, 0.0), 0.01, 0.1, 0.0, begin + 1)
            navigator.step(Stamped(sample.stamp, still), "dvl75")
            navigator.step(Stamped(sample.stamp, Pressure(110_000.0, 20.0)), "ms5837")
        for sample in samples[begin : begin + 500]:
            navigator.step(sample, "icm20948")
    assert navigator.refusals.counts == {}


def test_a_clock_that_is_set_back_costs_an_alignment_and_one_odd_stamp_nothing() -> None:
    navigator = Navigator(CENTERED)
    for sample in level_samples(5000.0, 3.0):
        navigator.step(sample, "icm20948")
    navigator.step(next(level_samples(10.0, 0.01)), "icm20948")
    assert navigator.step(Stamped(stamp_from_s(5003.02), Inertial((0.0, 0.0, -9.8), (0.0, 0.0, 0.0), 20.0)), "icm20948")
    assert navigator.refusals.last.startswith("icm20948: found a stamp 4.99e+03 s before the last one")
    states = [navigator.step(sample, "icm20948") for sample in level_samples(1000.0, 4.0)]
    assert sum(state is not None for state in states) > 50


@pytest.mark.parametrize("force", [(0.0, 0.0, -1.0), (0.0, 0.0, 0.0)], ids=["in g", "without gravity"])
def test_accelerations_that_are_none_of_gravity_are_named_and_make_no_state(force: Vec3) -> None:
    navigator = Navigator(CENTERED)
    states = [navigator.step(sample, "icm20948") for sample in level_samples(10.0, 10.0, force)]
    assert not any(states)
    found = f"found mean acceleration with gravity [m/s^2] {math.hypot(*force):g}, wanted 8 to 12"
    assert navigator.refusals.last == f"icm20948: {found}"
