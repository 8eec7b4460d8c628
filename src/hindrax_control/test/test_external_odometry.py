"""The state from third-party odometry: which values are used, and which end thrust."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_control.navigation.estimator_health import FASTEST, EstimatorHealth, ExternalOdometry
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.signals import Consistency, Navigation
from hindrax_core.vehicle import load_vehicle

VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
NOW = Stamp(1_700_000_000_000_000_000)
LEVEL = Navigation(
    (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.5, math.nan, (0.0, 0.0), dvl_locked=True
)  # fmt: skip
MINE = "/my/navigator"


class Flight:
    """An odometry at 50 Hz through both, armed."""

    def __init__(self) -> None:
        self.odometry, self._health = ExternalOdometry(VEHICLE), EstimatorHealth(VEHICLE)
        self.now = NOW

    def step(self, state: Navigation, source: str = MINE, *, later_s: float = 0.02) -> tuple[str, ...]:
        self.now = after(self.now, later_s)
        found, refused = self.odometry.step(Stamped(self.now, state), source, self.now)
        assert found is not None, refused
        return self._health.step(found.reading, self.now, armed=True)

    def steps(self, state: Navigation, count: int = 20) -> tuple[str, ...]:
        return [self.step(state) for _ in range(count)][-1]


def test_a_quiet_one_is_accepted_and_stands_for_every_sensor_but_the_altimeter() -> None:
    flight = Flight()
    assert flight.steps(LEVEL) == ()
    found, _ = flight.odometry.step(Stamped(after(flight.now, 0.02), LEVEL), MINE, after(flight.now, 0.02))
    assert found is not None
    ages_s = found.reading.ages_s
    assert ages_s.keys() == VEHICLE.sensors.keys()
    assert {name for name, age_s in ages_s.items() if age_s > 0.0} == {"ping1d"}


@pytest.mark.parametrize(
    ("state", "wanted"),
    [
        (replace(LEVEL, attitude_rad=(math.pi, 0.0, 0.0)), "tilt: 180 deg, wanted at most "),
        (replace(LEVEL, rate_radps=(math.nan, 0.0, 0.0)), "finite: attitude or rates are no numbers"),
        (replace(LEVEL, rate_radps=(0.0, 9.0, 0.0)), "rate: 516 deg/s, wanted at most 450 deg/s"),
        (replace(LEVEL, velocity_mps=(9.0, 0.0, 0.0)), "speed: 9.0 m/s, wanted at most "),
        (replace(LEVEL, consistency=Consistency(tilt_sigma_rad=0.1)), "attitude: tilt known to 5.7 deg, wanted 3.0"),
    ],
)
def test_what_cannot_be_true_ends_thrust(state: Navigation, wanted: str) -> None:
    flight = Flight()
    flight.steps(LEVEL)
    assert flight.steps(state)[0].startswith(wanted)


def test_a_jump_another_source_and_a_step_back_are_another_state() -> None:
    for state, source, later_s in (
        (replace(LEVEL, position_m=(5.0, 0.0)), MINE, 0.02),
        (LEVEL, "/stranger", 0.02),
        (LEVEL, MINE, -0.2),
    ):
        flight = Flight()
        flight.steps(LEVEL)
        assert flight.step(state, source, later_s=later_s)[0].startswith("restart: the state of the vehicle restarted")


def test_moving_on_is_no_jump_not_even_after_a_gap() -> None:
    flight = Flight()
    for metres in range(10):
        assert flight.step(replace(LEVEL, position_m=(0.5 * metres, 0.0)), later_s=0.5) == ()


@pytest.mark.parametrize(("part", "breaks"), [(0.99, 0), (1.01, 1)])
def test_a_jump_is_what_exceeds_a_correction_and_the_way_at_the_highest_speed(part: float, breaks: int) -> None:
    slow = replace(VEHICLE, limits=replace(VEHICLE.limits, speed_mps=0.5))
    flight = Flight()
    flight.odometry = ExternalOdometry(slow)
    flight.step(LEVEL)
    way_m = 0.3 + FASTEST * 0.5 * 0.4
    flight.step(replace(LEVEL, position_m=(0.0, part * way_m)), later_s=0.4)
    assert flight.odometry.breaks == breaks


def test_a_position_that_becomes_known_where_it_began_is_no_jump() -> None:
    flight = Flight()
    flight.step(replace(LEVEL, position_m=(math.nan, math.nan)))
    flight.step(LEVEL)
    assert flight.odometry.breaks == 0
    flight.step(replace(LEVEL, position_m=(math.nan, math.nan)))
    flight.step(replace(LEVEL, position_m=(5.0, 0.0)))
    assert flight.odometry.breaks == 1


def test_a_late_one_is_refused_and_what_comes_too_often_is_left_out() -> None:
    odometry = ExternalOdometry(VEHICLE)
    found, refused = odometry.step(Stamped(after(NOW, -1.0), LEVEL), MINE, NOW)
    assert found is None
    assert refused.startswith("1.00 s old, wanted at most 0.50 s")
    assert odometry.step(Stamped(after(NOW, 1.0), LEVEL), MINE, NOW)[1].startswith("stamped 1.00 s in the future")
    assert odometry.step(Stamped(NOW, LEVEL), MINE, NOW)[0] is not None
    again = bytes(MINE, "utf-8").decode()  # each message brings a string of its own
    assert odometry.step(Stamped(after(NOW, 0.005), LEVEL), again, after(NOW, 0.005)) == (None, "")


def test_the_altimeter_gives_the_height_above_the_bottom_while_it_is_received() -> None:
    odometry = ExternalOdometry(VEHICLE)
    sonar = VEHICLE.sensors["ping1d"]
    odometry.range(NOW, 1.2)
    odometry.range(NOW, math.nan)
    found, _ = odometry.step(Stamped(NOW, LEVEL), MINE, NOW)
    assert found is not None
    assert found.reading.altitude_m == pytest.approx(1.2 + sonar.position_m[2])
    assert found.reading.ages_s["ping1d"] == found.reading.altitude_age_s == 0.0
    for later_s, known in ((1.9, True), (3.0, False)):
        later = after(NOW, later_s)
        found, _ = odometry.step(Stamped(later, LEVEL), MINE, later)
        assert found is not None
        assert math.isfinite(found.reading.altitude_m) is known
    assert found.reading.ages_s["ping1d"] == found.reading.altitude_age_s == pytest.approx(3.0)


def test_a_range_that_is_stamped_after_the_state_is_not_older_than_it() -> None:
    odometry = ExternalOdometry(VEHICLE)
    odometry.range(after(NOW, 0.1), 1.2)
    found, _ = odometry.step(Stamped(NOW, LEVEL), MINE, NOW)
    assert found is not None
    assert found.reading.ages_s["ping1d"] == 0.0


@pytest.mark.parametrize(("range_m", "received"), [(0.2, True), (0.0, False), (-1.0, False), (math.inf, False)])
def test_a_range_is_a_positive_number(range_m: float, received: bool) -> None:
    odometry = ExternalOdometry(VEHICLE)
    odometry.range(NOW, range_m)
    found, _ = odometry.step(Stamped(NOW, LEVEL), MINE, NOW)
    assert found is not None
    assert math.isfinite(found.reading.altitude_m) is received


def test_without_a_sonar_the_altitude_of_the_dvl_is_taken() -> None:
    others = {name: sensor for name, sensor in VEHICLE.sensors.items() if name != "ping1d"}
    odometry = ExternalOdometry(replace(VEHICLE, sensors=others))
    odometry.range(NOW, 1.2)
    found, _ = odometry.step(Stamped(NOW, LEVEL), MINE, NOW)
    assert found is not None
    assert found.reading.altitude_m == pytest.approx(1.2 + VEHICLE.sensors["dvl75"].position_m[2])


def test_without_an_altimeter_there_is_no_height_above_the_bottom() -> None:
    others = {name: sensor for name, sensor in VEHICLE.sensors.items() if name not in ("ping1d", "dvl75")}
    odometry = ExternalOdometry(replace(VEHICLE, sensors=others))
    odometry.range(NOW, 1.2)
    found, _ = odometry.step(Stamped(NOW, LEVEL), MINE, NOW)
    assert found is not None
    assert math.isnan(found.reading.altitude_m)
    assert found.reading.ages_s == dict.fromkeys(others, 0.0)


def test_every_break_is_counted_and_the_beginning_is_none() -> None:
    flight = Flight()
    flight.steps(LEVEL)
    assert flight.odometry.breaks == 0
    flight.step(replace(LEVEL, position_m=(5.0, 0.0)))
    flight.step(replace(LEVEL, position_m=(5.0, 0.0)))
    assert flight.odometry.breaks == 1
    flight.step(replace(LEVEL, position_m=(5.0, 0.0)), "/somebody/else")
    assert flight.odometry.breaks == 2
