"""Every way in which a state can be wrong is named, with its limit and a remedy, and is not forgotten in flight."""

import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hindrax_control.navigation.attitude_filter import AttitudeFilter
from hindrax_control.navigation.estimator_health import EstimatorHealth, EstimatorHealthKnobs, FailedCheck, StateCheck
from hindrax_control.navigation.navigator import NavigatorKnobs
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.signals import Consistency, Navigation
from hindrax_core.vehicle import load_vehicle

VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
WELL = Navigation(
    attitude_rad=(0.1, -0.1, 1.0),
    rate_radps=(0.1, 0.1, 0.5),
    velocity_mps=(0.5, 0.1, -0.1),
    depth_m=0.8,
    altitude_m=0.9,
    position_m=(0.0, 0.0),
    dvl_locked=True,
    consistency=Consistency(stamp_from_s(1.0), math.radians(0.5), math.radians(3.0)),
)


def wrong(**changes: Any) -> Navigation:
    return replace(WELL, consistency=replace(WELL.consistency, **changes))


class Watch:
    """Steps a monitor fifty times a second."""

    def __init__(self) -> None:
        self.health, self.time_s = EstimatorHealth(VEHICLE), 10.0

    def see(self, state: Navigation, seconds: float, *, armed: bool = True) -> tuple[FailedCheck, ...]:
        found: tuple[FailedCheck, ...] = ()
        for _ in range(round(seconds * 50)):
            self.time_s += 0.02
            found = self.health.step(state, stamp_from_s(self.time_s), armed=armed)
        return found


WRONG = {
    "finite": replace(WELL, attitude_rad=(math.inf, 0.0, 0.0)),
    "attitude": wrong(tilt_sigma_rad=math.radians(4.0)),
    "gravity": wrong(gravity_off_rad=math.radians(26.0)),
    "depth": wrong(refused_depths=20),
    "velocity": wrong(refused_velocities=20),
    "gain": wrong(velocity_gain=1j, velocity_gain_sigma=0.2),
    "sinking": wrong(sunk_off_m=-0.3),
    "drift": wrong(drifted_off_m=-0.3),
    "floor": replace(WELL, altitude_m=-0.4, depth_age_s=1.5),
    "frozen": wrong(frozen_s=0.3),
    "rate": replace(WELL, rate_radps=(9.0, 0.0, 0.0)),
    "speed": replace(WELL, velocity_mps=(0.0, 0.0, 60.0)),
    "tilt": replace(WELL, attitude_rad=(math.radians(175.0), 0.0, 0.0)),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named_with_limit_and_remedy(name: str) -> None:
    (failed,) = Watch().see(WRONG[name], 0.2)
    assert failed.code == name
    assert "wanted" in failed
    assert "; " in failed


@pytest.mark.parametrize(("gain", "sigma"), [(1.3 + 0j, 0.01), (0.7 + 0j, 0.01), (-1.0 + 0j, 1.0)])
def test_a_gain_of_velocity_within_its_limit_or_its_noise_is_not_wrong(gain: complex, sigma: float) -> None:
    assert not Watch().see(wrong(velocity_gain=gain, velocity_gain_sigma=sigma), 1.0)


@pytest.mark.parametrize("name", sorted(WRONG.keys() - {"gravity"}))
def test_one_bad_state_alone_is_no_reason(name: str) -> None:
    watch = Watch()
    assert not watch.see(WRONG[name], 0.02)
    assert not watch.see(WELL, 1.0)
    assert not watch.see(WRONG[name], 0.02), "nor is another one, a second later"


def test_gravity_is_smoothed_by_the_filter_and_waits_no_longer() -> None:
    assert Watch().see(WRONG["gravity"], 0.02)


def test_all_is_well_in_any_state_of_a_flight_and_before_velocity_and_depth_are_known() -> None:
    unknown = replace(WELL, velocity_mps=(math.nan,) * 3, depth_m=math.nan, altitude_m=math.nan)
    assert not Watch().see(WELL, 1.0)
    assert not Watch().see(unknown, 1.0)


def test_not_a_number_in_the_attitude_is_found() -> None:
    assert Watch().see(replace(WELL, attitude_rad=(math.nan, 0.0, 0.0)), 0.2)


def test_what_failed_in_flight_holds_until_it_is_disarmed() -> None:
    watch = Watch()
    assert watch.see(WRONG["gravity"], 0.2)
    assert watch.see(WELL, 10.0), "still armed"
    assert not watch.see(WELL, 0.1, armed=False), "all was well for long"


def test_nobody_arms_before_all_has_been_well_for_a_while() -> None:
    watch = Watch()
    assert watch.see(WRONG["attitude"], 5.0, armed=False)
    assert watch.see(WELL, 0.5, armed=False)
    assert not watch.see(WELL, 2.0 * EstimatorHealthKnobs().recovery_s, armed=False)


def test_a_state_that_began_anew_in_flight_is_not_trusted_and_one_that_began_on_the_ground_is() -> None:
    anew = wrong(began=Stamp(WELL.consistency.began + 1))
    watch = Watch()
    assert not watch.see(WELL, 1.0)
    (failed,) = watch.see(anew, 0.02)
    assert failed.code is StateCheck.RESTART
    assert watch.see(anew, 5.0)
    grounded = Watch()
    assert not grounded.see(WELL, 1.0, armed=False)
    assert not grounded.see(anew, 1.0, armed=False)
    assert not grounded.see(anew, 1.0)


def test_where_the_lines_are_drawn() -> None:
    fast = replace(VEHICLE, limits=replace(VEHICLE.limits, speed_mps=2.0))
    lines: dict[str, tuple[Navigation, Navigation]] = {
        "gravity": (wrong(gravity_off_rad=math.radians(19.9)), wrong(gravity_off_rad=math.radians(20.1))),
        "attitude": (wrong(tilt_sigma_rad=math.radians(2.9)), wrong(tilt_sigma_rad=math.radians(3.1))),
        "depth": (wrong(refused_depths=19), wrong(refused_depths=20)),
        "velocity": (wrong(refused_velocities=7), wrong(refused_velocities=8)),
        "sinking": (wrong(sunk_off_m=0.2), wrong(sunk_off_m=0.201)),
        "drift": (wrong(drifted_off_m=0.2), wrong(drifted_off_m=0.201)),
        "floor": (replace(WRONG["floor"], altitude_m=-0.3), replace(WRONG["floor"], altitude_m=-0.301)),
        "frozen": (wrong(frozen_s=0.2), wrong(frozen_s=0.201)),
        "rate": (replace(WELL, rate_radps=(0.0, 7.8, 0.0)), replace(WELL, rate_radps=(0.0, 7.9, 0.0))),
        "speed": (replace(WELL, velocity_mps=(0.0, 5.9, math.nan)), replace(WELL, velocity_mps=(0.0, 6.1, math.nan))),
        "tilt": (
            replace(WELL, attitude_rad=(math.radians(65.0), math.radians(-65.0), 0.0)),
            replace(WELL, attitude_rad=(math.radians(65.5), math.radians(-65.5), 0.0)),
        ),
    }
    for name, (inside, beyond) in lines.items():
        watch = Watch()
        watch.health = EstimatorHealth(fast)
        assert watch.see(inside, 0.2) == ()
        (failed,) = watch.see(beyond, 0.2)
        assert failed.code == name


def test_a_gyroscope_that_jumps_is_reported_within_half_a_second_of_a_tilt_that_is_wrong() -> None:
    attitude, watch, wrong_s = AttitudeFilter(NavigatorKnobs()), Watch(), 0.0
    attitude.align((0.0, 0.0, -GRAVITY_mps2), 1.0)
    while not watch.see(wrong(gravity_off_rad=attitude.gravity_off_rad), 0.02):
        attitude.turn((math.radians(40.0) * 0.02, 0.0, 0.0), 0.02)
        attitude.level((0.0, 0.0, -GRAVITY_mps2), 0.02)
        wrong_s += 0.02 * (abs(attitude.euler_rad[0]) > math.radians(15.0))
        assert wrong_s < 0.45


def test_a_floor_that_is_deeper_than_thought_is_no_reason_while_there_is_pressure() -> None:
    assert not Watch().see(replace(WRONG["floor"], depth_age_s=1.0), 1.0)


def test_thrust_back_and_forth_is_no_gyroscope_that_jumps() -> None:
    attitude, watch = AttitudeFilter(NavigatorKnobs()), Watch()
    attitude.align((0.0, 0.0, -GRAVITY_mps2), 1.0)
    for number in range(500):
        push_mps2 = 3.0 if number // 40 % 2 else -3.0
        attitude.turn((0.0, 0.0, 0.0), 0.02)
        attitude.level((push_mps2, 0.0, -GRAVITY_mps2), 0.02)
        assert not watch.see(wrong(gravity_off_rad=attitude.gravity_off_rad), 0.02)


def test_a_failed_check_keeps_its_code_in_a_copy() -> None:
    (failed,) = Watch().see(WRONG["tilt"], 0.2)
    again = pickle.loads(pickle.dumps(failed))
    assert (again, again.code) == (failed, StateCheck.TILT)
