"""The holds on an ideal vehicle: uncoupled degrees of freedom without sensors in between."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_control.hold.holds import (
    HoldKnobs,
    Holds,
    HoldsOutput,
    HoldState,
    Setpoint,
    down_rate,
)
from hindrax_control.hold.station_keeping import StationKeeping
from hindrax_control.prior_dynamics import PriorDynamics, guessed, prior_dynamics
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.readings import Vec6
from hindrax_core.rotation import wrapped
from hindrax_core.signals import ZERO6, Navigation
from hindrax_core.text.refusals import Reason
from hindrax_core.vehicle import Drag, Vehicle, load_vehicle

HINDRAX = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup" / "vehicles" / "hindrax.yaml")
DT = 0.02
FLOOR_M = 1.8


VEHICLES = sorted((Path(__file__).parents[2] / "hindrax_bringup" / "vehicles").glob("*.yaml"))


class IdealVehicle:
    """Heave, roll, pitch and yaw, each on its own, with the truth of the vehicle file and a thruster lag."""

    def __init__(self, vehicle: Vehicle = HINDRAX, depth_m: float = 0.9, limit: float = 1e9) -> None:
        self.freedoms = {axis: prior_dynamics(vehicle)[axis] for axis in ("heave", "roll", "pitch", "yaw")}
        self.value = {"heave": depth_m, "roll": 0.0, "pitch": 0.0, "yaw": 0.0}
        self.rate = dict.fromkeys(self.value, 0.0)
        self.thrust = dict.fromkeys(self.value, 0.0)
        self.time_s, self.limit, self.sonar_age_s, self.push = 0.0, limit, 0.0, 0.0

    @property
    def stamp(self) -> Stamp:
        return stamp_from_s(self.time_s)

    def navigation(self) -> Navigation:
        value, rate = self.value, self.rate
        silent = self.sonar_age_s > 5.0
        return Navigation(
            attitude_rad=(value["roll"], value["pitch"], wrapped(value["yaw"])),
            rate_radps=(rate["roll"], rate["pitch"], rate["yaw"]),
            velocity_mps=(0.0, 0.0, rate["heave"]),
            depth_m=value["heave"],
            altitude_m=math.nan if silent else FLOOR_M - value["heave"],
            position_m=(0.0, 0.0),
            dvl_locked=True,
            altitude_age_s=self.sonar_age_s,
        )

    def step(self, wrench: Vec6) -> Vec6:
        """Apply a wrench for one period; returns what was missing of it."""
        shortfall = [0.0] * 6
        self.time_s += DT
        for axis, index in (("heave", 2), ("roll", 3), ("pitch", 4), ("yaw", 5)):
            freedom = self.freedoms[axis]
            given_force = max(-self.limit, min(self.limit, wrench[index]))
            shortfall[index] = wrench[index] - given_force
            self.thrust[axis] += (given_force - self.thrust[axis]) * (1.0 - math.exp(-DT / 0.15))
            push = self.push if axis == "heave" else 0.0
            force = self.thrust[axis] + push - freedom.drag_force(self.rate[axis]) - freedom.bias
            force -= freedom.restoring * math.sin(self.value[axis])
            self.rate[axis] += force / freedom.inertia * DT
            self.value[axis] += self.rate[axis] * DT
        X, Y, Z, K, M, N = shortfall
        return (X, Y, Z, K, M, N)


def fly(
    holds: Holds,
    vehicle: IdealVehicle,
    seconds: float,
    each: Callable[[Any, Any], None] = lambda _vehicle, _output: None,
    shortfall: Vec6 = ZERO6,
) -> HoldsOutput:
    for _ in range(round(seconds / DT)):
        output = holds.step(vehicle.navigation(), vehicle.stamp, shortfall)
        shortfall = vehicle.step(output.wrench)
        each(vehicle, output)
    return output


def state(output: HoldsOutput, axis: str) -> HoldState:
    return next(one for one in output.states if one.axis == axis)


def test_holds_own_only_their_axis() -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle()
    holds.set(Setpoint("heading", value=1.0))
    wrench = fly(holds, vehicle, 0.5).wrench
    assert wrench[5] != 0.0
    assert wrench[:5] == (0.0,) * 5


@pytest.mark.parametrize(
    ("axis", "coordinate", "value", "expected"),
    [
        ("heading", "yaw", 1.2, 1.2),
        ("roll", "roll", 0.3, 0.3),
        ("pitch", "pitch", -0.4, -0.4),
        ("depth", "heave", 1.2, 1.2),
        ("altitude", "heave", 1.1, FLOOR_M - 1.1),
    ],
)
def test_setpoint_is_reached_without_overshoot_and_held(
    axis: str, coordinate: str, value: float, expected: float
) -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle()
    start = vehicle.value[coordinate]
    assert holds.set(Setpoint(axis, value=value)) == ""
    furthest = []
    fly(holds, vehicle, 12.0, lambda one, _: furthest.append((one.value[coordinate] - start) / (expected - start)))
    output = fly(holds, vehicle, 8.0)
    assert vehicle.value[coordinate] == pytest.approx(expected, abs=0.01)
    assert max(furthest) < 1.08
    assert state(output, axis).error == pytest.approx(0.0, abs=0.01)
    assert [one.axis for one in output.states if one.engaged] == [axis]


def test_a_dive_and_a_transit_at_once_stay_below_the_speed_limit_of_a_slow_vehicle() -> None:
    slow = replace(HINDRAX, limits=replace(HINDRAX.limits, speed_mps=0.2))
    holds, vehicle = Holds(slow), IdealVehicle(slow, depth_m=0.2)
    holds.set(Setpoint("depth", value=1.4))
    speeds = []
    fly(holds, vehicle, 15.0, lambda one, _: speeds.append(one.rate["heave"]))
    assert vehicle.value["heave"] == pytest.approx(1.4, abs=0.02)
    assert math.hypot(max(speeds), *(StationKeeping(slow).speed_mps,) * 2) < 0.85 * 0.2, "along and across the pool"


def test_heading_takes_the_short_way_round() -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle()
    vehicle.value["yaw"] = 3.0
    holds.set(Setpoint("heading", value=-3.0))
    fly(holds, vehicle, 15.0)
    assert vehicle.value["yaw"] == pytest.approx(math.tau - 3.0, abs=0.02)


def test_engaging_far_from_the_setpoint_does_not_jump() -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle()
    holds.set(Setpoint("depth", value=1.5))
    first = holds.step(vehicle.navigation(), vehicle.stamp).wrench[2]
    assert first == pytest.approx(HINDRAX.net_buoyancy_N, abs=1e-9)


def test_changing_between_depth_and_altitude_keeps_the_effort() -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle()
    vehicle.push = -6.0  # something the feed-forward does not know
    holds.set(Setpoint("depth", value=0.9))
    before = fly(holds, vehicle, 20.0).wrench[2]
    assert before == pytest.approx(6.0 + HINDRAX.net_buoyancy_N, abs=0.1)
    holds.set(Setpoint("altitude", value=FLOOR_M - 0.9))
    after = fly(holds, vehicle, DT).wrench[2]
    assert after == pytest.approx(before, abs=0.05)
    fly(holds, vehicle, 3.0)
    assert vehicle.value["heave"] == pytest.approx(0.9, abs=0.01)


def test_lost_sonar_falls_back_to_depth_and_comes_back() -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle()
    holds.set(Setpoint("altitude", value=0.7))
    fly(holds, vehicle, 12.0)
    vehicle.sonar_age_s = 2.0
    output = fly(holds, vehicle, 5.0)
    assert "altitude unknown for 2.0 s: holding depth" in state(output, "altitude").note
    assert vehicle.value["heave"] == pytest.approx(FLOOR_M - 0.7, abs=0.01)
    vehicle.sonar_age_s = 9.0  # and the altitude itself is gone
    holds.set(Setpoint("altitude", value=1.0))
    fly(holds, vehicle, 5.0)
    assert vehicle.value["heave"] == pytest.approx(FLOOR_M - 0.7, abs=0.01)
    vehicle.sonar_age_s = 0.0
    output = fly(holds, vehicle, 12.0)
    assert state(output, "altitude").note == ""
    assert vehicle.value["heave"] == pytest.approx(FLOOR_M - 1.0, abs=0.01)


def test_integral_does_not_wind_up_while_the_thrusters_fall_short() -> None:
    """Pushed away with more than the thrusters have, then let go: back without a long overshoot the other way."""
    holds, vehicle = Holds(HINDRAX), IdealVehicle(limit=10.0)
    holds.set(Setpoint("depth", value=0.9))
    fly(holds, vehicle, 5.0)
    vehicle.push = 14.0
    fly(holds, vehicle, 6.0)
    vehicle.push = 0.0
    reached = []
    fly(holds, vehicle, 30.0, lambda one, _: reached.append(one.value["heave"]))
    assert min(reached) > 0.9 - 0.15
    assert reached[-1] == pytest.approx(0.9, abs=0.02)


def test_disarming_releases_and_arming_again_does_not_dive() -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle()
    holds.set(Setpoint("altitude", value=0.6))
    fly(holds, vehicle, 2.0)
    output = holds.step(vehicle.navigation(), vehicle.stamp, armed=False)
    assert output.wrench == ZERO6
    output = fly(holds, vehicle, 1.0)
    assert output.wrench == ZERO6
    assert not any(one.engaged for one in output.states)


def test_released_hold_leaves_the_others_alone() -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle()
    holds.set(Setpoint("depth", value=1.0))
    holds.set(Setpoint("heading", value=0.5))
    fly(holds, vehicle, 3.0)
    holds.set(Setpoint("heading", engaged=False))
    holds.set(Setpoint("altitude", engaged=False))  # not the mode in force: nothing happens
    output = fly(holds, vehicle, 10.0)
    assert output.wrench[5] == 0.0
    assert vehicle.value["heave"] == pytest.approx(1.0, abs=0.01)


def test_setpoint_of_nan_is_where_the_vehicle_is() -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle(depth_m=0.77)
    holds.set(Setpoint("altitude"))
    holds.set(Setpoint("heading"))
    output = fly(holds, vehicle, 10.0)
    assert state(output, "altitude").setpoint == pytest.approx(FLOOR_M - 0.77)
    assert vehicle.value["heave"] == pytest.approx(0.77, abs=0.01)


@pytest.mark.parametrize(
    ("setpoint", "sentence"),
    [
        (Setpoint("surge", value=1.0), "unknown, wanted one of heading"),
        (Setpoint("depth", value=-1.0), "found -1 m, wanted 0 to 1.6 m, by depth_rating_m and pool.depth_m of the"),
        (Setpoint("depth", value=9.0), "found 9 m, wanted 0 to 1.6 m"),
        (Setpoint("depth", value=1.7), "found 1.7 m, wanted 0 to 1.6 m"),
        (Setpoint("roll", value=2.0), "found 114.592 deg, wanted -55 to 55 deg"),
        (Setpoint("heading", value=2e6), "found 1.14592e+08 deg, wanted -5.72958e+07 to 5.72958e+07 deg"),
        (Setpoint("pitch", value=-2.0), "found -114.592 deg, wanted -55 to 55 deg"),
        (Setpoint("altitude", value=0.1), "found 0.1 m, wanted 0.2 to 1.8 m, by depth_rating_m and pool.depth_m"),
        (Setpoint("altitude", value=9.0), "found 9 m, wanted 0.2 to 1.8 m"),
    ],
)
def test_setpoints_out_of_reach_are_refused(setpoint: Setpoint, sentence: str) -> None:
    holds = Holds(HINDRAX)
    reported = holds.set(setpoint)
    assert reported.reason is Reason.SETPOINT
    assert sentence in reported
    ends = {"depth": " of the vehicle file", "altitude": " of the vehicle file", "surge": "station"}
    assert reported.endswith(ends.get(setpoint.axis, " deg"))
    assert not any(one.engaged for one in holds.step(IdealVehicle().navigation(), Stamp(0)).states)


def test_the_hull_may_touch_the_surface_and_the_floor_and_no_vehicle_goes_deeper_than_it_is_rated() -> None:
    holds = Holds(HINDRAX)  # 0.4 m high, in 1.8 m of water
    ends = [("depth", (0.0, 1.6)), ("altitude", (0.2, 1.8)), ("roll", (math.radians(-55.0), math.radians(55.0)))]
    for axis, values in ends:
        assert [holds.set(Setpoint(axis, value=value)) for value in values] == ["", ""]
    lake = Holds(replace(HINDRAX, pool=replace(HINDRAX.pool, depth_m=200.0)))
    assert lake.set(Setpoint("depth", value=60.0)) == ""
    assert lake.set(Setpoint("depth", value=60.1)).reason is Reason.SETPOINT
    assert lake.set(Setpoint("altitude", value=150.0)) == ""


def test_an_altitude_where_it_is_waits_for_the_sonar_and_no_other_hold_does() -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle(depth_m=0.77)
    for axis in ("altitude", "heading"):
        holds.set(Setpoint(axis))
    silent = replace(vehicle.navigation(), altitude_m=math.nan)
    output = holds.step(silent, vehicle.stamp)
    assert math.isnan(state(output, "altitude").setpoint)
    assert state(output, "heading").setpoint == silent.attitude_rad[2]
    output = holds.step(vehicle.navigation(), vehicle.stamp)
    assert state(output, "altitude").setpoint == pytest.approx(FLOOR_M - 0.77)


def test_unmeasured_axis_gets_no_effort_and_reports_it() -> None:
    holds, vehicle = Holds(HINDRAX), IdealVehicle()
    holds.set(Setpoint("depth", value=1.0))
    holds.set(Setpoint("heading", value=1.0))
    blind = replace(vehicle.navigation(), depth_m=math.nan, attitude_rad=(0.0, 0.0, math.nan))
    output = holds.step(blind, vehicle.stamp)
    assert output.wrench == ZERO6
    assert state(output, "depth").note == state(output, "heading").note == "not measured: no effort"
    assert fly(holds, vehicle, 0.5).wrench[2] != 0.0


@settings(max_examples=20, deadline=None)
@given(st.floats(5.0, 200.0), st.floats(0.5, 2.0))
def test_other_vehicles_need_no_tuning(mass_kg: float, size: float) -> None:
    other = replace(
        HINDRAX,
        mass_kg=mass_kg,
        volume_m3=mass_kg * 1.005e-3,
        envelope_m=(0.6 * size, 0.5 * size, 0.4 * size),
        hydrodynamics=None,
    )
    holds, vehicle = Holds(other, HoldKnobs(integral_N=50.0)), IdealVehicle(other)
    holds.set(Setpoint("depth", value=1.2))
    holds.set(Setpoint("heading", value=0.8))
    fly(holds, vehicle, 20.0)
    assert vehicle.value["heave"] == pytest.approx(1.2, abs=0.02)
    assert vehicle.value["yaw"] == pytest.approx(0.8, abs=0.02)


REST = IdealVehicle().navigation()


def efforts(holds: Holds, navigation: Navigation, seconds: float = 0.0, shortfall: Vec6 = ZERO6) -> list[Vec6]:
    """Wrenches of the holds for a vehicle that stays as it is."""
    return [
        holds.step(navigation, stamp_from_s(DT * index), shortfall).wrench for index in range(round(seconds / DT) + 1)
    ]


def held(*setpoints: Setpoint, knobs: HoldKnobs | None = None) -> Holds:
    holds = Holds(HINDRAX, knobs)
    assert [holds.set(one) for one in setpoints] == [""] * len(setpoints)
    return holds


UPRIGHT = (Setpoint("heading"), Setpoint("roll"), Setpoint("pitch"))


def test_a_hull_that_moves_askew_is_kept_from_turning_across_its_way() -> None:
    """Fossen 2011 eq. 6.43 for a diagonal mass matrix: the held axes carry the Munk moments, no other does."""
    freedoms = prior_dynamics(HINDRAX)
    mx, my, mz = (freedoms[axis].inertia for axis in ("surge", "sway", "heave"))
    u, v, w = 0.4, 0.3, -0.2
    askew = replace(REST, velocity_mps=(u, v, w))
    K, M, N = (mz - my) * v * w, (mx - mz) * w * u, (my - mx) * u * v
    assert efforts(held(*UPRIGHT), askew)[0] == pytest.approx((0.0, 0.0, 0.0, K, M, N))
    assert efforts(held(Setpoint("pitch")), askew)[0] == pytest.approx((0.0, 0.0, 0.0, 0.0, M, 0.0))
    blind = replace(askew, velocity_mps=(u, math.nan, w))
    assert efforts(held(*UPRIGHT), blind)[0] == pytest.approx((0.0, 0.0, 0.0, 0.0, M, 0.0))


@pytest.mark.parametrize(
    ("tilt_rad", "share"),
    [((0.5, 0.0), math.cos(0.5)), ((0.3, -0.6), math.cos(0.3) * math.cos(0.6)), ((1.5, 0.0), 0.5)],
)
def test_a_tilted_vehicle_pushes_more_for_the_same_lift_but_never_more_than_twice(
    tilt_rad: tuple[float, float], share: float
) -> None:
    tilted = replace(REST, attitude_rad=(*tilt_rad, 0.0))
    assert efforts(held(Setpoint("depth")), tilted)[0][2] == pytest.approx(HINDRAX.net_buoyancy_N / share)


@pytest.mark.parametrize(
    ("axis", "index", "begin"), [("depth", 2, 0.9), ("heading", 5, 0.0), ("roll", 3, 0.0), ("pitch", 4, 0.0)]
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_only_a_shortfall_of_some_size_stops_the_integral(axis: str, index: int, begin: float, sign: float) -> None:
    knobs = HoldKnobs()
    limit = knobs.shortfall_N if axis == "depth" else knobs.shortfall_Nm
    setpoint = Setpoint(axis, value=begin + 0.1 * sign)
    gained = []
    for share in (0.9, 1.1):
        X, Y, Z, K, M, N = (sign * share * limit if at == index else 0.0 for at in range(6))
        asked = [wrench[index] for wrench in efforts(held(setpoint), REST, 6.0, (X, Y, Z, K, M, N))]
        gained.append(sign * (asked[-1] - asked[-50]))
    assert abs(gained[1]) < 0.05 * gained[0]


def test_other_knobs_act_at_once_and_keep_what_is_held() -> None:
    soft, brisk = HoldKnobs(shortfall_Nm=0.1), HoldKnobs(heading_bandwidth_radps=4.0, shortfall_Nm=4.0)
    off = replace(REST, attitude_rad=(0.0, 0.0, -0.1))
    tuned, fresh = held(Setpoint("heading", value=0.0), knobs=soft), held(Setpoint("heading", value=0.0), knobs=brisk)
    for holds in (tuned, fresh):
        holds.step(REST, Stamp(0))
    tuned.tune(brisk)
    short: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 2.0)
    stamps = [stamp_from_s(DT * index) for index in range(1, 50)]
    assert [tuned.step(off, one, short) for one in stamps] == [fresh.step(off, one, short) for one in stamps]


def test_another_patience_with_the_sonar_acts_at_once() -> None:
    holds, quiet = held(Setpoint("altitude")), replace(REST, altitude_age_s=2.0)
    assert "holding depth" in state(holds.step(quiet, Stamp(0)), "altitude").note
    holds.tune(HoldKnobs(silent_s=5.0))
    assert state(holds.step(quiet, stamp_from_s(DT)), "altitude").note == ""


@pytest.mark.parametrize("lost", ["released", "unmeasured"])
def test_a_hold_that_acts_again_begins_where_the_vehicle_is(lost: str) -> None:
    goal = Setpoint("heading", value=1.0)
    used, fresh = held(goal), held(goal)
    fly(used, IdealVehicle(), 10.0)
    elsewhere = replace(REST, attitude_rad=(0.0, 0.0, -0.5))
    unknown = replace(REST, attitude_rad=(0.0, 0.0, math.nan))
    first, second = (stamp_from_s(10.0 + DT * index) for index in (1, 2))
    if lost == "released":
        used.set(Setpoint("heading", engaged=False))
        used.set(goal)
        fresh.step(unknown, stamp_from_s(10.0 - DT))
    else:
        assert used.step(unknown, first).wrench == fresh.step(unknown, first).wrench == ZERO6
    assert used.step(elsewhere, second).wrench[5] == pytest.approx(fresh.step(elsewhere, second).wrench[5], abs=0.01)


def test_a_heading_is_held_where_it_is_whatever_holds_the_height() -> None:
    turned, holds = replace(REST, attitude_rad=(0.0, 0.0, 0.5)), held(Setpoint("altitude"))
    output = holds.step(turned, Stamp(0))
    assert state(output, "altitude").setpoint == pytest.approx(FLOOR_M - 0.9)
    holds.set(Setpoint("heading"))
    assert state(holds.step(turned, stamp_from_s(DT)), "heading").setpoint == 0.5


@pytest.mark.parametrize(
    ("tilt_rad", "velocity_mps", "down_mps"),
    [
        ((0.0, 0.0), (0.3, 0.2, 0.1), 0.1),
        ((0.0, 0.5), (0.3, 0.2, 0.1), 0.1 * math.cos(0.5) - 0.3 * math.sin(0.5)),
        ((0.4, 0.0), (0.3, 0.2, 0.1), 0.1 * math.cos(0.4) + 0.2 * math.sin(0.4)),
        ((math.pi / 2.0, 0.5), (0.3, 0.2, 0.1), 0.2 * math.cos(0.5) - 0.3 * math.sin(0.5)),
        ((0.4, 0.5), (math.nan, math.nan, 0.1), 0.1 * math.cos(0.4) * math.cos(0.5)),
    ],
)
def test_what_goes_down_is_the_third_row_of_the_rotation(
    tilt_rad: tuple[float, float], velocity_mps: tuple[float, float, float], down_mps: float
) -> None:
    """Fossen 2011 eq. 2.18."""
    moving = replace(REST, attitude_rad=(*tilt_rad, 1.0), velocity_mps=velocity_mps)
    assert down_rate(moving) == pytest.approx(down_mps)


@given(st.floats(-3.0, 3.0), st.sampled_from([Drag(66.0, 1.25), Drag(0.0, 5.0), Drag(93.0, 5.0, 56.0, 11.0)]))
def test_steady_rate_undoes_drag(rate: float, drag: Drag) -> None:
    freedom = PriorDynamics(20.0, drag)
    assert freedom.rate_at(freedom.drag_force(rate)) == pytest.approx(rate, abs=1e-9)


def test_prior_of_a_vehicle_without_hydrodynamics_is_of_the_right_size() -> None:
    ours, crude = HINDRAX.hydrodynamics, guessed(HINDRAX)
    assert ours is not None
    for axis in ("surge", "sway", "heave"):
        assert 0.4 < crude.drag(axis).k_q / ours.drag(axis).k_q < 2.5
    assert 0.3 < crude.added_mass[0] / ours.added_mass[0] < 3.0


@pytest.mark.parametrize("file", VEHICLES, ids=lambda file: file.stem)
def test_depth_and_heading_of_every_vehicle_settle_untuned(file: Path) -> None:
    """Gains, drag and mass are of its file: both settle in 5 s of its time, and do not overshoot."""
    vehicle = load_vehicle(file)
    ideal, holds = IdealVehicle(vehicle), Holds(vehicle)
    for axis, value in (("depth", 1.4), ("heading", math.pi / 2.0), ("roll", 0.0), ("pitch", 0.0)):
        holds.set(Setpoint(axis, value=value))
    seen: list[tuple[float, float, float]] = []
    while ideal.time_s < 15.0:
        ideal.step(holds.step(ideal.navigation(), ideal.stamp).wrench)
        seen.append((ideal.time_s, ideal.value["heave"] - 1.4, ideal.value["yaw"] - math.pi / 2.0))
    assert max(time_s for time_s, off_m, off_rad in seen if abs(off_m) > 0.03 or abs(off_rad) > 0.04) < 5.0
    assert max(off_m for _, off_m, _ in seen) < 0.02
    assert max(off_rad for _, _, off_rad in seen) < 0.03
