"""What each sensor beside the IMU tells the filters: lever, tilt, delay, and what of it is not used."""

import math
from dataclasses import replace
from typing import Any

import pytest

from hindrax_control.navigation.aiding import Aiding
from hindrax_control.navigation.measured_noise import MEMORY
from hindrax_control.navigation.navigator import NavigatorKnobs
from hindrax_control.sensors import SensorMount
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, Magnetic, Pressure, Vec3
from hindrax_core.rotation import Matrix3, matrix, rotate
from hindrax_core.vehicle import Mount, Vehicle

LEVER: Vec3 = (0.2, -0.1, 0.3)
TILT: Vec3 = (0.2, -0.25, 0.0)
HERE = SensorMount(Mount("here"))
THERE = SensorMount(Mount("there", position_m=LEVER))
EARTH_T = 20e-6


def rotate_back(turn: Matrix3, vector: Vec3) -> Vec3:
    a, b, c = zip(*turn, strict=True)
    return rotate((a, b, c), vector)


class Rig:
    """The filters, at rest in one attitude, and what aids them."""

    def __init__(self, vehicle: Vehicle, attitude_rad: Vec3 = (0.0, 0.0, 0.0), **knobs: Any) -> None:
        given = NavigatorKnobs(**knobs)
        self.turn, self.vehicle, self.time_s = matrix(attitude_rad), vehicle, 0.0
        self.aiding = Aiding(replace(vehicle, thrusters=()), given)
        self.attitude, self.vertical = self.aiding.attitude, self.aiding.vertical
        self.horizontal, self.heading = self.aiding.horizontal, self.aiding.heading
        self.attitude.align(rotate_back(self.turn, (0.0, 0.0, -GRAVITY_mps2)), 1.0, attitude_rad[2])

    @property
    def heading_rad(self) -> float:
        return self.attitude.heading_rad

    def wait(self, seconds: float, rate: Vec3 = (0.0, 0.0, 0.0)) -> None:
        p, q, r = rate
        for _ in range(round(seconds / 0.02)):
            self.time_s += 0.02
            self.horizontal.predict((0.0, 0.0), (0.02 * p, 0.02 * q, 0.02 * r), self.time_s, 0.02)
            self.vertical.predict(0.0, 0.02)

    def dvl(
        self,
        velocity: Vec3,
        interval_s: float = 0.1,
        late_s: float = 0.1,
        at: SensorMount = HERE,
        *,
        device_time: bool = True,
    ) -> bool:
        reading = BottomVelocity(velocity, 0.01, 1.0, interval_s, round(1e6 * self.time_s) if device_time else 0)
        return self.aiding.bottom_velocity(reading, at, self.time_s - late_s)

    def pressure(self, depth_m: float, at: SensorMount = HERE) -> bool:
        water = self.vehicle.water
        pressure = water.surface_pressure_Pa + water.density_kgpm3 * GRAVITY_mps2 * depth_m
        return self.aiding.pressure(Pressure(pressure, 20.0), at, 0.0)

    def pressures(self, depth_m: float) -> None:
        """As many as show their noise."""
        for _ in range(MEMORY):
            self.pressure(depth_m)

    def magnetic(self, heading_rad: float, delay_s: float = 0.0) -> bool:
        """A field that says this heading from magnetic north."""
        return self.field((EARTH_T * math.cos(heading_rad), -EARTH_T * math.sin(heading_rad), 0.5 * EARTH_T), delay_s)

    def field(self, field_T: Vec3, delay_s: float = 0.0) -> bool:
        return self.aiding.magnetic(Magnetic(field_T), HERE, delay_s)

    def track(self, *, delay_s: float = 0.0, **changes: Any) -> bool:
        known = BottomTrack(True, 0.0, 0.0, 0.5, None, (0.0, 0.0), (), "3333", 0)
        return self.aiding.dvl_heading(replace(known, **changes), delay_s)


def test_a_velocity_at_a_lever_is_that_of_the_origin_and_of_the_turn(hindrax: Vehicle) -> None:
    rig = Rig(hindrax)
    rig.pressures(1.0)
    rig.wait(1.0, (0.3, -0.4, 0.5))
    # v + w x l = (0.1, 0.2, 0.05) + (0.3, -0.4, 0.5) x (0.2, -0.1, 0.3).
    assert rig.dvl((0.1 - 0.12 + 0.05, 0.2 + 0.1 - 0.09, 0.05 - 0.03 + 0.08), at=THERE)
    assert (rig.horizontal.u_mps, rig.horizontal.v_mps) == pytest.approx((0.1, 0.2), abs=3e-3)
    assert rig.aiding.sunk_off_m == pytest.approx(0.5 * 0.05), "of half a second"


def test_the_turn_at_a_lever_is_that_within_the_interval_of_the_velocity(hindrax: Vehicle) -> None:
    rig = Rig(hindrax)
    for seconds, yaw_radps in ((1.0, 0.0), (0.1, 2.0), (0.2, 0.0)):
        rig.wait(seconds, (0.0, 0.0, yaw_radps))
    # (0, 0, 2) x (0.2, -0.1, 0.3), though nothing turns before 1.0 s and after 1.1 s.
    assert rig.dvl((0.2, 0.4, 0.0), interval_s=0.1, late_s=0.25, at=THERE)
    assert (rig.horizontal.u_mps, rig.horizontal.v_mps) == pytest.approx((0.0, 0.0), abs=0.01)


@pytest.mark.parametrize(("noise_mps", "assumed"), [(0.0, False), (0.001, True)])
def test_a_velocity_that_jumps_is_accepted_in_the_end_unless_it_repeats_itself(
    hindrax: Vehicle, noise_mps: float, assumed: bool
) -> None:
    rig = Rig(hindrax, patience=5, repeated_s=60.0)
    for tick in range(60):
        rig.wait(0.1)
        rig.dvl((0.0 if tick < 30 else 2.0 + noise_mps * (tick % 3), 0.0, 0.0))
    assert (rig.horizontal.u_mps > 1.0) is assumed


def test_an_equal_velocity_counts_again_only_where_the_device_says_that_it_is_another(hindrax: Vehicle) -> None:
    for device_time in (True, False):
        rig = Rig(hindrax)
        rig.wait(1.0)
        assert rig.dvl((0.3, 0.1, 0.0), device_time=device_time)
        rig.wait(0.1)
        assert rig.dvl((0.3, 0.1, 0.0), device_time=device_time) is device_time
        assert rig.dvl((0.3, 0.1001, 0.0), device_time=device_time)


def test_a_dvl_that_hangs_is_back_when_its_velocities_differ_for_a_while_and_not_by_one(hindrax: Vehicle) -> None:
    rig = Rig(hindrax)
    rig.wait(1.0)
    # The same way, by intervals that become shorter, as where the floor comes nearer.
    for interval_s in (0.1,) * 15 + (0.05,) * 15 + (0.1, 0.05) * 5:
        rig.wait(0.1)
        used = rig.dvl((0.03 / interval_s, 0.01 / interval_s, 0.0), interval_s)
    assert not used
    back = []
    for tick in range(15):
        rig.wait(0.1)
        back.append(rig.dvl((0.301 + 0.001 * tick, 0.1, 0.0)))
    assert not any(back[:9])
    assert all(back[11:])


@pytest.mark.parametrize("velocity", [(3.1, 0.0, 0.0), (0.0, -3.1, 0.0), (-4.0, 4.0, 0.0)])
def test_a_velocity_that_is_too_fast_is_not_used(hindrax: Vehicle, velocity: Vec3) -> None:
    rig = Rig(hindrax, fastest_mps=3.0)
    rig.wait(1.0)
    assert not rig.dvl(velocity)
    assert not rig.horizontal.known
    assert rig.dvl((2.9, -2.9, 0.0))


def test_a_velocity_without_an_interval_is_used_and_one_without_lock_or_from_long_ago_is_not(hindrax: Vehicle) -> None:
    rig = Rig(hindrax)
    rig.wait(2.0)
    assert rig.dvl((0.1, 0.0, 0.0), interval_s=0.0)
    assert not rig.dvl((0.1, 0.0, 0.01), late_s=1.5)
    assert not rig.aiding.bottom_velocity(BottomVelocity(None, 0.01, 0.0, 0.1, 0), HERE, rig.time_s)


def test_the_way_down_by_dvl_is_compared_with_that_by_pressure(hindrax: Vehicle) -> None:
    rig = Rig(hindrax, TILT)
    measured_mps: Vec3 = (0.08, -0.06, 0.08)
    sinking_mps = rotate(rig.turn, measured_mps)[2] - 0.03
    for _ in range(50):
        rig.wait(0.1)
        rig.pressure(1.0 + 0.03 * rig.time_s)
    for tick in range(400):
        rig.wait(0.1)
        rig.pressure(1.0 + 0.03 * rig.time_s)
        x, y, z = measured_mps
        rig.dvl((x, y, z + 1e-6 * (tick % 2)))
        if tick == 9:
            # Nine tenths of a second, and half a second before the first.
            assert rig.aiding.sunk_off_m == pytest.approx(5.0 * sinking_mps * -math.expm1(-1.4 / 5.0), rel=0.05)
    assert rig.aiding.sunk_off_m == pytest.approx(5.0 * sinking_mps, rel=0.01), "what is older than 5 s fades"


def test_a_silence_of_the_dvl_or_no_depth_is_no_way_down(hindrax: Vehicle) -> None:
    rig = Rig(hindrax)
    rig.wait(1.0)
    rig.dvl((0.0, 0.0, 0.1))
    assert rig.aiding.sunk_off_m == 0.0, "no depth to compare with"
    rig.pressure(1.0)
    rig.dvl((0.0, 0.0, 0.105))
    assert rig.aiding.sunk_off_m == 0.0, "two pressures make a rate, but not one that means anything"
    rig.pressures(1.0)
    rig.wait(10.0)
    rig.dvl((0.0, 0.0, 0.11))
    assert 0.0 < rig.aiding.sunk_off_m < 0.1


@pytest.mark.parametrize("attitude_rad", [(0.0, 0.0, 0.0), TILT, (0.1, 0.3, 2.0)])
def test_pressure_and_sonar_are_taken_at_their_lever(hindrax: Vehicle, attitude_rad: Vec3) -> None:
    rig = Rig(hindrax, attitude_rad, sonar_beam_deg=60.0)
    below_m = rotate(rig.turn, LEVER)[2]
    assert rig.pressure(1.0 + below_m, THERE)
    assert rig.vertical.depth_m == pytest.approx(1.0, abs=1e-4)
    assert rig.aiding.echo(Echo(0.8 - below_m, 1.0), THERE, 0.0)
    assert rig.vertical.altitude_m == pytest.approx(0.8, abs=1e-3)


def test_no_pressure_is_deeper_than_twice_the_rating(hindrax: Vehicle) -> None:
    rig = Rig(hindrax)
    assert not rig.pressure(2.01 * hindrax.depth_rating_m)
    assert not rig.vertical.has_depth
    assert rig.pressure(1.99 * hindrax.depth_rating_m)


@pytest.mark.parametrize(("beam_deg", "tilt_deg"), [(10.0, 20.0), (10.0, 4.0), (30.0, 24.0)])
def test_the_nearest_point_of_the_floor_in_its_beam_answers_a_sonar(
    hindrax: Vehicle, beam_deg: float, tilt_deg: float
) -> None:
    rig = Rig(hindrax, (math.radians(tilt_deg), 0.0, 0.0), sonar_beam_deg=beam_deg)
    rig.pressure(0.5)
    slant = math.cos(math.radians(max(0.0, tilt_deg - 0.5 * beam_deg)))
    assert rig.aiding.echo(Echo(2.0 / slant, 1.0), HERE, 0.0)
    assert rig.vertical.altitude_m == pytest.approx(2.0, abs=1e-4)


def test_a_sonar_that_looks_aside_shows_no_altitude_and_one_that_is_mounted_aslant_may(hindrax: Vehicle) -> None:
    aslant = SensorMount(Mount("aslant", rotation_deg=(20.0, 0.0, 0.0)))
    for roll_deg, used in ((0.0, True), (-20.0, True), (4.0, True), (6.0, False), (-46.0, False)):
        rig = Rig(hindrax, (math.radians(roll_deg), 0.0, 0.0), sonar_tilt_deg=25.0)
        assert rig.aiding.echo(Echo(2.0, 1.0), aslant, 0.0) is used
        assert rig.vertical.has_floor is used


@pytest.mark.parametrize("looks_deg", [0.0, 180.0])
def test_a_sonar_that_looks_straight_down_or_up_is_at_no_impossible_angle(hindrax: Vehicle, looks_deg: float) -> None:
    for roll_deg in range(-90, 90):
        at = SensorMount(Mount("at", rotation_deg=(looks_deg - roll_deg, 0.0, 0.0)))
        rig = Rig(hindrax, (math.radians(roll_deg), 0.0, 0.0))
        assert rig.aiding.echo(Echo(2.0, 1.0), at, 0.0) is (looks_deg == 0.0)


@pytest.mark.parametrize("reading", [Echo(2.0, 0.49), Echo(0.0, 1.0), Echo(-1.0, 1.0), Echo(math.inf, 1.0)])
def test_an_echo_that_is_weak_or_no_distance_is_not_used(hindrax: Vehicle, reading: Echo) -> None:
    rig = Rig(hindrax, sonar_confidence=0.5)
    assert not rig.aiding.echo(reading, HERE, 0.0)
    assert rig.aiding.echo(Echo(2.0, 0.5), HERE, 0.0)


def test_a_sonar_is_trusted_less_far_away(hindrax: Vehicle) -> None:
    # Near: 0.01 m. Far: hypot(0.01, 0.1) m, ten times as much, so what is refused near is believed there.
    for range_m, used in ((0.1, False), (10.0, True)):
        rig = Rig(hindrax, sonar_sigma_m=0.01, sonar_sigma=0.01, gate=5.0)
        rig.pressure(1.0)
        rig.aiding.echo(Echo(range_m, 1.0), HERE, 0.0)
        assert rig.aiding.echo(Echo(range_m + 0.2, 1.0), HERE, 0.0) is used


@pytest.mark.parametrize("heading_from", ["magnetometer", "both", "dvl", "none"])
def test_the_heading_follows_what_it_is_ordered_to(hindrax: Vehicle, heading_from: str) -> None:
    compass, dvl = (Rig(hindrax, heading_from=heading_from) for _ in range(2))
    assert compass.magnetic(0.5) is (heading_from in ("magnetometer", "both"))
    assert dvl.track() is (heading_from in ("dvl", "both"))
    assert (compass.heading_rad, dvl.heading_rad) == pytest.approx(
        (
            0.5 if heading_from in ("magnetometer", "both") else 0.0,
            0.5 if heading_from in ("dvl", "both") else 0.0,
        ),
        abs=1e-3,
    )


@pytest.mark.parametrize("assumed_rad", [0.0, 0.9, -2.5])
def test_true_north_is_magnetic_north_and_the_declination(hindrax: Vehicle, assumed_rad: float) -> None:
    rig = Rig(hindrax, (0.0, 0.0, assumed_rad), declination_deg=-20.0)
    assert rig.magnetic(1.0)
    assert rig.heading_rad == pytest.approx(1.0 - math.radians(20.0), abs=1e-3)


@pytest.mark.parametrize("yaw_rate_radps", [None, 0.4])
def test_compass_and_heading_of_the_dvl_are_those_of_their_time(hindrax: Vehicle, yaw_rate_radps: float | None) -> None:
    compass, dvl = Rig(hindrax), Rig(hindrax, heading_from="dvl")
    if yaw_rate_radps is not None:
        compass.aiding.yaw_rate_radps = dvl.aiding.yaw_rate_radps = yaw_rate_radps
    assert compass.magnetic(0.5, delay_s=0.25)
    assert dvl.track(delay_s=0.25)
    wanted_rad = 0.5 + (yaw_rate_radps or 0.0) * 0.25
    assert (compass.heading_rad, dvl.heading_rad) == pytest.approx((wanted_rad, wanted_rad), abs=1e-3)


def test_a_leaning_compass_is_leveled_and_not_used_when_it_leans_far(hindrax: Vehicle) -> None:
    for roll_deg, used in ((10.0, True), (-14.0, True), (16.0, False)):
        rig = Rig(hindrax, (math.radians(roll_deg), 0.0, 0.8), compass_tilt_deg=15.0)
        field = rotate_back(rig.turn, (EARTH_T, 0.0, 2.0 * EARTH_T))
        assert rig.field(field), "the first one is better than none"
        assert rig.heading_rad == pytest.approx(0.8, abs=1e-3)
        assert rig.field(field) is used


@pytest.mark.parametrize("field_T", [(0.0, 0.0, 4e-5), (math.nan, 0.0, 0.0), (math.inf, 0.0, 0.0)])
def test_a_field_that_points_nowhere_is_not_used(hindrax: Vehicle, field_T: Vec3) -> None:
    assert not Rig(hindrax).field(field_T)


def test_a_compass_that_jumps_is_not_used(hindrax: Vehicle) -> None:
    rig = Rig(hindrax)
    for _ in range(20):
        assert rig.magnetic(0.2)
    assert not rig.magnetic(2.0)
    assert rig.heading_rad == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize(
    ("changes", "used"),
    [
        ({"imu_calibration": "0003"}, True),
        ({"imu_calibration": "0002"}, True),
        ({"imu_calibration": "3331"}, False),
        ({"imu_calibration": "333"}, True),
        ({"heading_rad": math.nan}, False),
        ({"locked": False}, True),
    ],
)
def test_the_dvl_shows_its_heading_when_its_compass_is_calibrated(
    hindrax: Vehicle, changes: dict[str, Any], used: bool
) -> None:
    rig = Rig(hindrax, heading_from="dvl")
    assert rig.track(**changes) is used
    assert rig.heading_rad == pytest.approx(0.5 if used else 0.0, abs=1e-3)


def test_a_heading_of_the_dvl_beyond_the_turn_is_near(hindrax: Vehicle) -> None:
    rig = Rig(hindrax, (0.0, 0.0, 3.0), heading_from="dvl")
    for _ in range(3):
        assert rig.track(heading_rad=3.1)
    assert rig.track(heading_rad=-3.1)
    assert 3.1 < rig.heading_rad < math.pi


def test_the_altitude_of_the_dvl_is_along_its_axis(hindrax: Vehicle) -> None:
    rig = Rig(hindrax, TILT)
    assert rig.aiding.dvl_altitude(1.5, THERE, 0.0)
    altitude_m = 1.5 * rig.turn[2][2] + rotate(rig.turn, LEVER)[2]
    assert rig.vertical.altitude_m == pytest.approx(altitude_m, abs=1e-3)


@pytest.mark.parametrize("echoes", [True, False])
def test_a_depth_that_drifts_is_told_where_dvl_and_echo_both_contradict_it(hindrax: Vehicle, echoes: bool) -> None:
    rig = Rig(hindrax)
    for tick in range(500):
        rig.wait(0.1)
        rig.pressure(1.0 + 0.01 * max(0.0, rig.time_s - 5.0))
        rig.dvl((0.0, 0.0, 1e-6 * (tick % 2)))
        if echoes:
            rig.aiding.echo(Echo(0.8, 1.0), HERE, 0.0)
        rig.aiding.compare_floor(Pressure(1e5 + tick, 20.0), rig.time_s)
    assert rig.aiding.drift.off_m == pytest.approx(0.45 - 45.0 * 0.003 if echoes else 0.0, abs=0.04)
