"""A maneuver step by step, on a vehicle that stays where it is put: what each step is given decides what it does."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from hindrax_control.allocation.allocator import Allocator
from hindrax_control.hold.holds import Setpoint
from hindrax_control.maneuver.goal import Goal, check_goal
from hindrax_control.maneuver.maneuver import Maneuver, ManeuverKnobs, ManeuverOutput, abandoned
from hindrax_control.maneuver.plan import CHARACTERS, PlanKnobs, Planner
from hindrax_control.maneuver.stages import RELEASED
from hindrax_control.pool_bounds import PoolBounds
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.events import stamp_from_s
from hindrax_core.readings import Vec6
from hindrax_core.signals import ZERO6, Navigation
from hindrax_core.text.refusals import CANCELLED, STOPPED, Reason, found
from hindrax_core.vehicle import Vehicle

AT_START = Navigation(
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0),
    1.1,
    0.9,
    (0.0, 0.0),
    dvl_locked=True,
    ages_s={"icm20948": 0.01, "ms5837": 0.02, "ping1d": 0.05, "dvl75": 0.05},
    depth_age_s=0.02,
    altitude_age_s=0.05,
)
TOO_LOW = replace(AT_START, depth_m=1.4, altitude_m=0.6)
"""Never at rest at its pose, whatever surge and sway do."""
STEP_S = 0.05
Make = Callable[..., Maneuver]


@pytest.fixture
def make(hindrax: Vehicle) -> Make:
    def maneuver(*motions: str, knobs: ManeuverKnobs | None = None, **goal: Any) -> Maneuver:
        planner = Planner(hindrax, Allocator(hindrax), PlanKnobs())
        return Maneuver(planner, Goal(motions, **goal), PoolBounds(hindrax, 0.0), knobs=knobs)

    return maneuver


def stepped(
    maneuver: Maneuver, seconds: float, navigation: Navigation = AT_START, begin_s: float = 0.0, **given: Any
) -> list[ManeuverOutput]:
    """Outputs from a time on, to its end at most."""
    out = []
    for index in range(round(seconds / STEP_S)):
        out.append(maneuver.step(navigation, stamp_from_s(begin_s + STEP_S * (index + 1)), **given))
        if out[-1].done:
            break
    return out


def test_only_the_first_reason_ends_it_and_its_ending_may_be_another(make: Make) -> None:
    maneuver = make("yaw", on_cancel="hold")
    stepped(maneuver, 1.0)
    maneuver.cancel(STOPPED, "neutral")
    maneuver.cancel(CANCELLED)
    *_, last = stepped(maneuver, 20.0, begin_s=1.0)
    assert (last.aborted, last.neutral, last.wrench) == (STOPPED, True, ZERO6)
    assert maneuver.done
    maneuver.cancel(found(Reason.LEAK, "too late"))
    assert maneuver.step(AT_START, stamp_from_s(60.0)) is last


def test_a_maneuver_without_a_state_is_abandoned_at_once() -> None:
    lost = found(Reason.NAVIGATION, "lost")
    reported = abandoned(lost)
    assert (reported.wrench, reported.force, reported.velocity, reported.setpoints) == (ZERO6, 0.0, 0.0, RELEASED)
    assert (reported.done, reported.neutral, reported.aborted) == (True, True, lost)


BRAKED = (Setpoint("heading"), Setpoint("roll", value=0.0), Setpoint("pitch", value=0.0), Setpoint("depth"))


def test_what_is_in_trouble_brakes_at_once_and_ends_when_it_is_slow(make: Make) -> None:
    maneuver = make("yaw")
    reported = stepped(maneuver, 100.0, TOO_LOW)
    (braked,) = (index for index, one in enumerate(reported) if one.setpoints == BRAKED)
    assert STEP_S * braked == pytest.approx(75.0, abs=0.2)
    assert reported[-1].aborted.startswith("settle: altitude off by -0.30 m")
    assert STEP_S * (len(reported) - braked) == pytest.approx(1.0, abs=0.2), "it is at rest"


def test_who_cancels_it_waits_for_one_stop(make: Make) -> None:
    maneuver = make("yaw")
    stepped(maneuver, 1.0)
    maneuver.cancel()
    reported = stepped(maneuver, 20.0, begin_s=1.0)
    assert [bool(one.setpoints) for one in reported] == [True] + [False] * (len(reported) - 1)
    assert {one.phase.motion for one in reported[:-1]} == {"yaw"}
    assert STEP_S * len(reported) == pytest.approx(1.0, abs=0.2)


def test_what_is_stopping_counts_down_and_makes_no_more_progress(make: Make) -> None:
    maneuver = make("yaw")
    *_, flown = stepped(maneuver, 6.0)
    assert flown.progress > 0.0
    maneuver.cancel()
    reported = stepped(maneuver, 20.0, replace(AT_START, velocity_mps=(0.3, 0.0, 0.0)), begin_s=6.0)
    remaining_s = [one.remaining_s for one in reported]
    assert 1.0 < remaining_s[0] < 5.0
    assert remaining_s == sorted(remaining_s, reverse=True)
    assert min(remaining_s[:-1]) == 0.0, "it takes longer than it should"
    assert {one.progress for one in reported} == {flown.progress}
    assert not any(one.aborted for one in reported[:-1])


@pytest.mark.parametrize("motions", [("yaw",), ("surge", "sway"), ("heave", "surge")])
def test_it_takes_as_long_as_its_ways_its_rests_its_legs_and_its_stop(make: Make, motions: tuple[str, ...]) -> None:
    maneuver, place_m, way_m = make(*motions), (5.0, 3.0), 0.0
    for plan in maneuver.plans:
        way_m += math.dist(place_m, plan.start_m)
        place_m = plan.end_m
    rests_s = 2.5 * len(motions) + 2.0
    wanted_s = way_m / maneuver.station.speed_mps + rests_s + sum(plan.seconds for plan in maneuver.plans)
    assert maneuver.seconds == pytest.approx(wanted_s)


def test_progress_is_the_share_of_the_planned_time_and_what_takes_longer_counts_no_more(make: Make) -> None:
    maneuver = make("yaw")
    reported = stepped(maneuver, 10.0, TOO_LOW)
    for passed_s, counted_s in ((0.0, 0.0), (1.0, 1.0), (2.5, 2.5), (9.0, 2.5)):
        one = reported[round(passed_s / STEP_S)]
        assert one.progress == pytest.approx(counted_s / maneuver.seconds)
        assert one.remaining_s == pytest.approx(maneuver.seconds - counted_s)
        assert one.wall_distance_m == pytest.approx(3.0 - 0.235), "the nearest one"


def test_what_is_cancelled_before_its_first_step_has_made_no_progress(make: Make) -> None:
    maneuver = make("yaw")
    maneuver.cancel()
    reported = stepped(maneuver, 20.0)
    assert {(one.progress, one.phase.motion) for one in reported} == {(0.0, "")}
    assert reported[-1].aborted.reason is Reason.CANCELLED


def test_it_is_given_up_some_time_after_it_should_be_over(make: Make) -> None:
    maneuver = make("roll", knobs=ManeuverKnobs(overtime=1.5, overtime_s=10.0))
    reported = stepped(maneuver, 70.0, TOO_LOW)
    ended = next(index for index, one in enumerate(reported) if one.remaining_s < 3.0)
    assert reported[-1].aborted.reason is Reason.TIME_OUT
    assert STEP_S * ended == pytest.approx(1.5 * maneuver.seconds + 10.0, abs=0.2)


@pytest.mark.parametrize(
    ("motion", "lost", "ends"),
    [
        ("surge", ("surge",), True),
        ("surge", ("heave",), True),
        ("surge", ("sway", "yaw"), False),
        ("heave", ("heave",), True),
        ("heave", ("surge",), False),
    ],
)
def test_it_ends_when_its_own_axis_or_heave_is_lost(make: Make, motion: str, lost: tuple[str, ...], ends: bool) -> None:
    *_, last = stepped(make(motion), 10.0, lost_axes=lost)
    assert last.aborted.startswith(f"thrusters: {lost[0]} cannot be served") is ends


@pytest.mark.parametrize(("silent_s", "axis"), [(0.99, "altitude"), (1.01, "depth")])
def test_an_echo_older_than_a_second_is_none(make: Make, silent_s: float, axis: str) -> None:
    first = make("surge").step(replace(AT_START, altitude_age_s=silent_s), stamp_from_s(1.0))
    assert first.setpoints[-1].axis == axis


def test_a_weak_battery_ends_it(make: Make) -> None:
    *_, last = stepped(make("surge"), 10.0, battery_V=11.0)
    assert last.aborted.startswith("battery: 11.0 V")


def pushed_for(make: Make, seconds: float, shortfall: Callable[[Vec6], Vec6]) -> list[ManeuverOutput]:
    """Steps of a surge that does not move, with a shortfall that follows from the last wrench."""
    maneuver, missing, out = make("surge"), ZERO6, []
    # It settles where it starts, then nothing moves it.
    place = replace(AT_START, position_m=(maneuver.plans[0].start_m[0] - 5.0, 0.0))
    for index in range(round(seconds / STEP_S)):
        out.append(maneuver.step(place, stamp_from_s(STEP_S * (index + 1)), shortfall=missing))
        missing = shortfall(out[-1].wrench)
    return out


def test_only_thrust_that_is_there_can_be_blocked(make: Make) -> None:
    blocked = pushed_for(make, 20.0, lambda _wrench: ZERO6)
    assert any(one.phase.phase == "blocked" for one in blocked)
    assert blocked[-1].aborted.reason is Reason.BLOCKED
    without = pushed_for(make, 20.0, lambda wrench: wrench)
    assert not any(one.phase.phase == "blocked" or one.aborted for one in without)


@pytest.mark.parametrize(
    ("shortfall", "learns"),
    [
        (ZERO6, True),
        ((1.0, -1.0, 9.0, 0.0, 0.0, 0.0), True),
        ((3.1, 0.0, 0.0, 0.0, 0.0, 0.0), False),
        ((0.0, 3.1, 0.0, 0.0, 0.0, 0.0), False),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_station_learns_nothing_while_surge_or_sway_falls_short(
    make: Make, shortfall: Vec6, learns: bool, sign: float
) -> None:
    X, Y, *others = shortfall
    state = replace(TOO_LOW, position_m=(-0.1 * sign, -0.1 * sign))
    reported = stepped(make("yaw"), 12.0, state, shortfall=(sign * X, sign * Y, *others))
    assert reported[-1].phase.phase == "settle"
    for axis in (0, 1):
        assert (sign * (reported[-1].wrench[axis] - reported[-60].wrench[axis]) > 0.05) is learns


def test_after_its_end_it_keeps_the_place_and_nothing_else(make: Make) -> None:
    maneuver = make("yaw")
    stepped(maneuver, 2.0)
    maneuver.cancel()
    stepped(maneuver, 20.0, begin_s=2.0)
    carried = replace(AT_START, position_m=(-0.3, 0.2))
    pushes = [maneuver.keep(carried, stamp_from_s(30.0 + STEP_S * index)) for index in range(20)]
    X, Y, *others = pushes[-1]
    assert Y < 0.0 < pushes[0][0] < X
    assert others == [0.0] * 4


def test_turns_are_counted_on_beyond_half_a_turn(make: Make) -> None:
    """A vehicle that turns on and on while it is to fly a leg of half a turn: the leg ends by its angle."""
    maneuver, begin_s = make("yaw"), 0.0
    while maneuver.step(AT_START, stamp_from_s(begin_s)).phase.phase == "settle":
        begin_s += STEP_S
    phases = []
    for index in range(80):
        heading_rad = 1.2 * STEP_S * index
        turning = replace(
            AT_START, attitude_rad=(0.0, 0.0, math.remainder(heading_rad, math.tau)), rate_radps=(0.0, 0.0, 1.2)
        )
        phases.append((heading_rad, maneuver.step(turning, stamp_from_s(begin_s + STEP_S * (index + 1))).phase.phase))
    over_rad = next(heading_rad for heading_rad, phase in phases if phase in ("coast", "transit"))
    assert 0.4 * math.pi < over_rad < math.pi


def test_goals_at_their_limits_are_flown() -> None:
    check_goal(Goal(("yaw",) * 12))
    check_goal(Goal(("yaw",), levels=(0.0,) * 19 + (1.0,)))


def test_an_excitation_is_as_strong_as_the_fastest_leg_but_no_stronger_than_its_boost(
    make: Make, hindrax: Vehicle
) -> None:
    maneuver, time_s, forces = make("surge", excitation="steps"), 0.0, [0.0]
    start = replace(AT_START, position_m=(maneuver.plans[0].start_m[0] - 5.0, 0.0))
    while maneuver.step(start, stamp_from_s(time_s)).phase.phase == "settle":
        time_s += STEP_S
    for index in range(round(50.0 / STEP_S)):
        moving = replace(AT_START, velocity_mps=(math.copysign(0.4, forces[-1]), 0.0, 0.0))
        forces.append(maneuver.step(moving, stamp_from_s(time_s + STEP_S * (index + 1))).force)
    legs = maneuver.plans[0].legs
    fastest = max(legs, key=lambda leg: abs(leg.rate))
    assert max(map(abs, forces)) < max(leg.boost for leg in legs)
    # what holds its rate, and what reaches it in four times of its boost
    quicker = prior_dynamics(hindrax)["surge"].inertia * fastest.rate / (4.0 * CHARACTERS["surge"].boost_s)
    assert max(map(abs, forces)) == pytest.approx(abs(fastest.level) + abs(quicker))
