"""Each stage of a maneuver by itself: what it asks of the holds, what it does at a moment, and when it is over."""

import math
from dataclasses import replace
from typing import Any

import pytest

from hindrax_control.hold.holds import Setpoint
from hindrax_control.hold.station_keeping import StationKeeping
from hindrax_control.maneuver.excitation import Bounds, Excite
from hindrax_control.maneuver.leg import LegController, LegOutput
from hindrax_control.maneuver.plan import Leg, motion_name
from hindrax_control.maneuver.stages import (
    RELEASED,
    BrakeAndHold,
    ExciteMotion,
    Hover,
    Pose,
    SettleAtPose,
    StageInput,
    StageOutput,
    along,
)
from hindrax_control.pool_bounds import PoolPosition
from hindrax_control.prior_dynamics import PriorDynamics
from hindrax_core.events import stamp_from_s
from hindrax_core.signals import Consistency, Navigation
from hindrax_core.vehicle import Drag, Vehicle


def test_what_ends_neutral_lets_go_of_every_hold() -> None:
    assert {(one.axis, one.engaged) for one in RELEASED} == {
        (axis, False) for axis in ("heading", "roll", "pitch", "depth", "altitude")
    }


HERE = PoolPosition(5.0, 3.0, 0.0, 0.0, 0.0)
AT_REST = Navigation((0.0, 0.0, 0.4), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.1, 0.9, (0.0, 0.0), dvl_locked=True)
POSE = Pose(HERE, 0.4, ("altitude", 0.9), floor_m=2.0)
AWAY = replace(HERE, x_m=5.1, y_m=2.9)
BEGIN_S = 100.0


def moment(time_s: float, place: PoolPosition = HERE, *, fresh: bool = True, **changes: Any) -> StageInput:
    """A vehicle at rest at its pose, but for some changes of its navigation, some time after the stage has begun."""
    navigation = replace(AT_REST, **changes)
    return StageInput(navigation, place, BEGIN_S + time_s, 0.05, turned_rad=3.5, altitude_measured=fresh)


@pytest.fixture
def station(hindrax: Vehicle) -> StationKeeping:
    return StationKeeping(hindrax)


@pytest.mark.parametrize(
    ("axis", "coordinate", "rate"),
    [
        ("surge", 5.0, 0.1),
        ("sway", 5.0, 0.2),
        ("heave", 1.1, 0.3),
        ("roll", 0.0, 0.4),
        ("pitch", 0.0, 0.5),
        ("yaw", 3.5, 0.6),
    ],
)
def test_a_motion_goes_along_the_pool_down_or_round(axis: str, coordinate: float, rate: float) -> None:
    moving = moment(0.0, velocity_mps=(0.1, 0.2, 0.3), rate_radps=(0.4, 0.5, 0.6))
    assert along(axis, moving) == pytest.approx((coordinate, rate))


def test_a_pose_is_held_by_depth_as_well_and_knows_how_far_off_it_is() -> None:
    by_depth = POSE.without_altitude()
    axis, depth_m = by_depth.vertical
    assert axis == "depth"
    assert depth_m == pytest.approx(1.1)
    assert by_depth.without_altitude() == by_depth
    high = replace(AT_REST, altitude_m=1.2, depth_m=1.0)
    assert POSE.off_m(high) == pytest.approx(0.3)
    assert by_depth.off_m(high) == pytest.approx(-0.1)
    assert POSE.turned_rad(replace(AT_REST, attitude_rad=(0.0, 0.0, -3.0))) == pytest.approx(math.tau - 3.4)


@pytest.mark.parametrize(("fresh", "vertical"), [(True, ("altitude", 0.9)), (False, ("depth", 1.1))])
def test_settling_holds_the_pose_upright_by_depth_where_the_sonar_is_silent(
    station: StationKeeping, fresh: bool, vertical: tuple[str, float]
) -> None:
    stage = SettleAtPose("surge", station, POSE, seconds=3.0)
    *upright, up = stage.begin(moment(0.0, AWAY, fresh=fresh))
    assert upright == [
        Setpoint("heading", value=0.4),
        Setpoint("roll", value=0.0),
        Setpoint("pitch", value=0.0),
    ]
    assert up == Setpoint(vertical[0], value=up.value)
    assert up.value == pytest.approx(vertical[1])
    assert stage.ends == (HERE,)
    X, Y, *others = stage.step(moment(1.0, AWAY)).wrench
    assert X < 0.0 < Y
    assert others == [0.0] * 4


def test_what_has_come_to_rest_is_settled_a_little_later(station: StationKeeping) -> None:
    stage = SettleAtPose("surge", station, POSE, seconds=3.0)
    stage.begin(moment(0.0))
    output = [stage.step(moment(0.1 * index - 0.05)) for index in range(20)]
    assert [one.finished for one in output] == [False] * 9 + [True] * 11, "after 0.8 s"
    assert (output[0].force, output[0].velocity, output[0].trouble) == (0.0, 0.0, "")
    assert StageInput(AT_REST, HERE, 0.0, 0.05, 0.0).altitude_measured
    assert output[-1] == StageOutput(output[-1].wrench, "settle", finished=True)
    assert output[-1].wrench == pytest.approx((0.0,) * 6)


def test_a_vehicle_without_a_dvl_settles_by_gyroscope_and_depth(station: StationKeeping) -> None:
    nowhere = replace(FAR, vx_mps=math.nan, vy_mps=math.nan)

    def settled(w_mps: float, *, velocity_measured: bool, **changes: Any) -> StageOutput:
        stage = SettleAtPose("yaw", station, POSE, seconds=3.0)
        stage.begin(moment(0.0))
        changes = {"velocity_mps": (math.nan, math.nan, w_mps), **changes}
        moments = [
            replace(moment(time_s, nowhere, **changes), velocity_measured=velocity_measured)
            for time_s in (0.0, 1.0, 100.0)
        ]
        return [stage.step(one) for one in moments][-1]

    assert settled(0.03, velocity_measured=False).finished
    assert "0.50 m from its place" in str(settled(0.03, velocity_measured=True).trouble)
    for w_mps, changes, words in (
        (0.05, {}, "+0.05 m/s down"),
        (math.nan, {}, "+nan m/s down"),
        (0.0, {"rate_radps": (0.0, -0.2, 0.1)}, "turning at 11 deg/s"),
        (0.0, {"altitude_m": 0.7}, "altitude off by -0.20 m"),
    ):
        output = settled(w_mps, velocity_measured=False, **changes)
        assert not output.finished
        assert words in str(output.trouble)


FAR = replace(HERE, x_m=4.7, y_m=3.4)


@pytest.mark.parametrize(
    ("place", "changes", "words"),
    [
        (FAR, {}, "0.50 m from its place"),
        (HERE, {"altitude_m": 0.7}, "altitude off by -0.20 m"),
        (HERE, {"attitude_rad": (0.0, 0.0, 0.3)}, "heading off by -5.7 deg"),
        (HERE, {"velocity_mps": (0.3, 0.0, -0.4)}, "moving at 0.50 m/s"),
        (HERE, {"rate_radps": (0.0, -0.2, 0.1)}, "turning at 11 deg/s"),
        (HERE, {"velocity_mps": (math.nan,) * 3}, "moving at nan m/s"),
        (HERE, {"attitude_rad": (0.0, 0.0, math.nan)}, "heading off by nan deg"),
    ],
)
def test_what_does_not_come_to_rest_is_given_up_with_the_reason(
    station: StationKeeping, place: PoolPosition, changes: dict[str, Any], words: str
) -> None:
    stage = SettleAtPose("surge", station, POSE, seconds=3.0)
    stage.begin(moment(0.0, place, **changes))
    for time_s in (0.0, 5.0, 60.0, 75.0):
        output = stage.step(moment(time_s, place, **changes))
        assert (output.finished, output.trouble) == (False, "")
    assert stage.step(moment(75.1, place, **changes)).trouble
    output = stage.step(moment(120.0, place, **changes))
    assert output.trouble.startswith(f"settle: {words} after 120 s; look for a current")
    assert not stage.step(moment(120.1)).finished
    late = stage.step(moment(125.0))
    assert (late.finished, late.trouble) == (True, "")


@pytest.mark.parametrize("part", [0.99, -0.99, 1.01, -1.01])
@pytest.mark.parametrize("what", ["place", "altitude", "heading", "speed", "turn"])
def test_where_rest_ends(station: StationKeeping, what: str, part: float) -> None:
    turned, speed, turning = math.radians(2.0 * part), 0.04 * part, math.radians(3.0 * part)
    place = replace(HERE, x_m=5.0 + 0.15 * part) if what == "place" else HERE
    changes: dict[str, dict[str, Any]] = {
        "altitude": {"altitude_m": 0.9 + 0.05 * part},
        "heading": {"attitude_rad": (0.0, 0.0, 0.4 + turned)},
        "speed": {"velocity_mps": (0.0, speed, 0.0)},
        "turn": {"rate_radps": (0.0, turning, 0.0)},
    }
    stage = SettleAtPose("surge", station, POSE, seconds=3.0)
    stage.begin(moment(0.0))
    output = [stage.step(moment(0.1 * index, place, **changes.get(what, {}))) for index in range(20)]
    assert output[-1].finished is (abs(part) < 1.0)


def test_a_sonar_that_falls_silent_does_not_keep_it_from_settling(station: StationKeeping) -> None:
    stage = SettleAtPose("surge", station, POSE, seconds=3.0)
    stage.begin(moment(0.0))
    assert stage.step(moment(5.0, altitude_m=math.nan)).finished


@pytest.mark.parametrize("held_back", [False, True])
def test_hovering_lasts_its_time_on_the_setpoints_as_they_are(station: StationKeeping, held_back: bool) -> None:
    stage = Hover("heave_down", station, 8.0)
    assert stage.begin(moment(0.0)) == ()
    station.start(HERE)
    assert not StageOutput((0.0,) * 6, "hover").finished
    assert [stage.step(moment(time_s)).finished for time_s in (0.0, 7.9, 8.0)] == [False, False, True]
    assert not moment(1.0).held_back
    pushed = [stage.step(replace(moment(1.0, AWAY), held_back=held_back)).wrench for _ in range(20)]
    X, Y, *others = pushed[-1]
    assert X < 0.0 < Y
    assert others == [0.0] * 4
    # Against a current: more and more, unless the thrusters fall short.
    assert (pushed[0][0] > X) is not held_back


SURGE = PriorDynamics(27.0, Drag(66.0, 1.25))
HEAVE = PriorDynamics(38.0, Drag(146.0, 4.0), bias=2.0)
ROLL = PriorDynamics(0.4, Drag(0.4, 0.2), restoring=5.0)


def excited(axis: str, freedom: PriorDynamics, station: StationKeeping) -> ExciteMotion:
    """A stage that excites an axis with a constant half of 4 N or N m, within wide bounds."""
    bounds = Bounds(force=4.0, rate=0.4, middle=1.1, room=8.0, inertia=freedom.inertia)
    return ExciteMotion(axis, Excite(lambda _t: 0.5, bounds, 60.0), freedom, station, POSE)


@pytest.mark.parametrize(
    ("axis", "freedom", "released", "rate"),
    [
        ("surge", SURGE, (), 0.3),
        ("heave", HEAVE, ("depth", "altitude"), 0.2),
        ("roll", ROLL, ("roll",), 0.0),
        ("yaw", ROLL, ("heading",), 0.1),
    ],
)
def test_driving_an_axis_releases_its_holds_and_no_others(
    station: StationKeeping, axis: str, freedom: PriorDynamics, released: tuple[str, ...], rate: float
) -> None:
    stage = excited(axis, freedom, station)
    assert stage.motion == motion_name(axis, 0.0)
    assert stage.begin(moment(0.0)) == tuple(Setpoint(name, engaged=False) for name in released)
    moving = moment(0.0, velocity_mps=(0.3, 0.0, 0.2), rate_radps=(0.0, 0.0, 0.1))
    output = stage.step(moving)
    assert (output.phase, output.force, output.trouble) == ("excite", 2.0, "")
    assert output.velocity == pytest.approx(rate)
    assert stage.motion == motion_name(axis, rate)
    assert not output.finished
    assert stage.step(replace(moving, time_s=BEGIN_S + 60.0)).finished
    ends_m = [end.x_m for end in stage.ends]
    assert ends_m == (pytest.approx([-6.9, 9.1]) if axis == "surge" else [])


def test_what_drives_an_axis_carries_its_buoyancy_and_righting_moment_too(station: StationKeeping) -> None:
    down = excited("heave", HEAVE, station).step(moment(0.0)).wrench
    assert down == pytest.approx((0.0, 0.0, 4.0, 0.0, 0.0, 0.0))
    rolled = replace(moment(0.0), navigation=replace(AT_REST, attitude_rad=(0.3, 0.0, 0.4)))
    roll_Nm = 2.0 + 5.0 * math.sin(0.3)
    assert excited("roll", ROLL, station).step(rolled).wrench == pytest.approx((0.0, 0.0, 0.0, roll_Nm, 0.0, 0.0))


def test_the_righting_moment_is_that_of_the_angle_at_which_the_thrust_arrives(station: StationKeeping) -> None:
    angles_rad = (0.3, 0.3 + 0.5 * 0.1, 0.3 + 0.5 * 0.2)
    turning = moment(0.0, attitude_rad=(0.3, 0.0, 0.4), rate_radps=(0.5, 0.0, 0.0))
    now, early, late = (2.0 + 5.0 * math.sin(angle_rad) for angle_rad in angles_rad)
    assert now < early < excited("roll", ROLL, station).step(turning).wrench[3] < late


def test_station_is_kept_across_the_pool_but_not_along_it_while_that_is_driven(station: StationKeeping) -> None:
    for axis, freedom, left_free in (("surge", SURGE, True), ("heave", HEAVE, False)):
        station.start(HERE)
        X, Y, *_ = excited(axis, freedom, station).step(moment(0.0, AWAY)).wrench
        assert Y > 0.0
        assert X == 2.0 if left_free else X < 0.0
        assert station.goal_m == (AWAY.x_m if left_free else HERE.x_m, HERE.y_m)


def test_an_axis_that_is_not_measured_is_not_driven(station: StationKeeping) -> None:
    for changes in ({"velocity_mps": (0.0, 0.0, math.nan)}, {"depth_m": math.nan}):
        output = excited("heave", HEAVE, station).step(moment(0.0, **changes))
        assert output.wrench == (0.0,) * 6
        assert output.trouble.startswith("navigation: heave unknown; see which sensor is silent")


def test_an_axis_that_a_state_begun_anew_does_not_know_sends_nobody_to_a_silent_sensor(station: StationKeeping) -> None:
    stage = excited("surge", SURGE, station)
    stage.begin(moment(0.0))
    anew = Consistency(began=stamp_from_s(3.0))
    output = stage.step(moment(1.0, velocity_mps=(math.nan, math.nan, 0.0), consistency=anew))
    assert output.trouble.startswith("navigation: surge unknown, since the state began anew in flight, as after a gap")
    assert "silent" not in output.trouble


def leg_of(axis: str) -> Leg:
    """A leg at 0.4 m/s or rad/s, from 1 to 9."""
    return Leg(
        axis=axis, name=motion_name(axis, 0.4), sign=1.0, level=10.0, rate=0.4, start=1.0, end=9.0, back=1.0,
        boost=20.0, pace=0.4, inertia=27.0, coast_s=0.0, seconds=20.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("axis", "rests"),
    [("surge", False), ("sway", False), ("heave", True), ("roll", True), ("pitch", True), ("yaw", False)],
)
def test_all_thrusters_rest_while_those_that_hold_it_down_would_lose_thrust_to_the_inflow(
    station: StationKeeping, axis: str, rests: bool
) -> None:
    class Driven(LegController):
        phase = "plateau"

        def step(self, *_: Any, **__: Any) -> LegOutput:
            return LegOutput(0.0, self.phase)

    driver = Driven(leg_of(axis))
    stage = ExciteMotion(axis, driver, SURGE, station, POSE)
    assert not stage.step(moment(0.0)).resting
    driver.phase = "coast"
    assert stage.step(moment(0.1)).resting is rests


@pytest.mark.parametrize(
    ("axis", "changes", "counts"),
    [
        ("surge", {}, True),
        ("surge", {"altitude_m": math.nan}, True),
        ("surge", {"dvl_locked": False}, False),
        ("surge", {"altitude_m": 1.05}, False),
        ("surge", {"altitude_m": 0.75}, False),
        ("surge", {"attitude_rad": (0.0, 0.0, 0.55)}, False),
        ("surge", {"attitude_rad": (0.0, 0.0, 0.25)}, False),
        ("sway", {"dvl_locked": False}, False),
        ("yaw", {"dvl_locked": False, "altitude_m": 1.5}, True),
        ("heave", {"dvl_locked": False, "velocity_mps": (0.0, 0.0, 0.4)}, True),
    ],
)
def test_a_plateau_counts_where_it_is_measured_and_flown_as_it_should_be(
    station: StationKeeping, axis: str, changes: dict[str, Any], counts: bool
) -> None:
    stage = ExciteMotion(axis, LegController(leg_of(axis)), SURGE, station, POSE)
    assert (stage.motion, stage.seconds) == (leg_of(axis).name, 20.0)
    moving = {"velocity_mps": (0.4, 0.4, 0.0), "rate_radps": (0.0, 0.0, 0.4)}
    phases = [stage.step(moment(0.1 * index, **(moving | changes))).phase for index in range(60)]
    assert ("plateau" in phases) is counts


@pytest.mark.parametrize("neutral", [False, True])
def test_braking_holds_where_it_is_and_ends_when_it_is_slow(station: StationKeeping, neutral: bool) -> None:
    stage = BrakeAndHold("surge", station, neutral=neutral)
    assert stage.seconds == 2.0
    assert stage.begin(moment(0.0)) == (
        Setpoint("heading"),
        Setpoint("roll", value=0.0),
        Setpoint("pitch", value=0.0),
        Setpoint("depth"),
    )
    assert station.goal_m == (HERE.x_m, HERE.y_m)
    assert not stage.step(moment(0.1, AWAY)).finished
    fast = stage.step(moment(3.0, AWAY, velocity_mps=(0.3, math.nan, 0.0)))
    assert (fast.phase, fast.finished) == ("settle", False)
    X, Y, *others = fast.wrench
    assert X < 0.0 < Y
    assert others == [0.0] * 4
    slow = stage.step(moment(3.0, AWAY, velocity_mps=(0.01, math.nan, -0.01)))
    assert slow.finished
    assert (slow.wrench == (0.0,) * 6) is neutral
    at_rest, fast_s = [stage.step(moment(time_s)).finished for time_s in (0.9, 1.1)], (7.9, 8.1)
    assert at_rest == [False, True]
    assert [stage.step(moment(time_s, velocity_mps=(0.3, 0.0, 0.0))).finished for time_s in fast_s] == [False, True]
