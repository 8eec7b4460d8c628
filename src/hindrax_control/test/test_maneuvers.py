"""Maneuvers and the pilot on an ideal vehicle: to the end, and through cancels, currents and lost sensors."""

import math
import re
from collections.abc import Callable
from dataclasses import replace

import pytest

from hindrax_control.allocation.allocator import Allocator
from hindrax_control.hold.holds import HOLDS, STATION, Setpoint
from hindrax_control.maneuver.goal import HEADING_UNKNOWN, Goal, check_goal
from hindrax_control.maneuver.maneuver import ManeuverOutput, abandoned
from hindrax_control.maneuver.plan import PlanKnobs
from hindrax_control.pilot import Pilot, PilotKnobs, PilotOutput
from hindrax_control.pool_bounds import PoolBounds, PoolPosition
from hindrax_control.testing.ideal_vehicle import IdealVehicle
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import Stamp
from hindrax_core.signals import UNKNOWN6, ZERO6, Allocation, Phase
from hindrax_core.text.refusals import CANCELLED, SENSELESS, Reason
from hindrax_core.vehicle import Vehicle

SHORT = PilotKnobs(plan=PlanKnobs(levels=2, turning_levels=2, repeats=(1,) * 6, plateau_s=5.0, turns=1.0))


class Rig:
    """Ideal vehicle and pilot; exact allocation within the reach of the thrusters."""

    def __init__(self, hindrax: Vehicle, ideal_vehicle: type[IdealVehicle], knobs: PilotKnobs = SHORT) -> None:
        self.ideal, self.pilot = ideal_vehicle(hindrax, step_s=0.05), Pilot(hindrax, knobs)
        self.box, self.limits = PoolBounds(hindrax, 0.0), hindrax.limits.wrench
        self.nearest_m, self.armed, self.unarmed = math.inf, False, ""
        self.flight: PilotOutput | None = None
        self.became = Allocation(ZERO6, ZERO6, ZERO6, (), (), ())

    def step(self) -> PilotOutput:
        ideal = self.ideal
        flight = self.flight = self.pilot.step(
            ideal.navigation(), ideal.stamp, self.became, armed=self.armed, unarmed=self.unarmed
        )
        ideal.step(tuple(max(-top, min(top, f)) for f, top in zip(flight.wrench, self.limits, strict=True)))
        self.nearest_m = min(self.nearest_m, *self.box.walls_m(self.box.place(ideal.navigation())).values())
        return flight

    @property
    def output(self) -> ManeuverOutput:
        assert self.flight is not None
        assert self.flight.maneuver is not None
        return self.flight.maneuver

    @property
    def place(self) -> PoolPosition:
        """Where the pilot takes itself to be."""
        assert self.pilot.pool is not None
        return self.pilot.pool.place(self.ideal.navigation())

    def arm(self) -> None:
        self.step()
        self.armed = True
        self.step()

    def fly(
        self, goal: Goal, each: Callable[["Rig"], None] = lambda _rig: None, most_s: float = 600.0
    ) -> tuple[ManeuverOutput, list[Phase]]:
        """Fly a goal to its end; returns the last output and every phase that was flown."""
        self.arm()
        self.pilot.fly(goal)
        phases: list[Phase] = []
        while self.ideal.time_s < most_s:
            self.step()
            output = self.output
            if not phases or phases[-1] != output.phase:
                phases.append(output.phase)
            each(self)
            if output.done:
                return output, phases
        raise AssertionError(f"not done after {most_s} s: {output}")


@pytest.fixture
def rig(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> Rig:
    return Rig(hindrax, ideal_vehicle)


@pytest.mark.parametrize(
    ("motion", "names"),
    [
        ("surge", {"surge"}),
        ("sway", {"sway"}),
        ("heave", {"heave_down", "heave_up", "heave"}),
        ("roll", {"roll"}),
        ("pitch", {"pitch"}),
        ("yaw", {"yaw"}),
    ],
)
def test_motion_is_flown_to_its_end_with_plateaus_both_ways(rig: Rig, motion: str, names: set[str]) -> None:
    rates = []

    def note(rig: Rig) -> None:
        output = rig.output
        if output.phase.phase == "plateau":
            rates.append(output.velocity)

    output, phases = rig.fly(Goal((motion,)), note)
    assert output.aborted == ""
    assert output.phase.phase == "done"
    assert output.progress == 1.0
    assert {phase.motion for phase in phases} - {""} == names
    assert {"settle", "transient", "plateau", "transit"} <= {phase.phase for phase in phases}
    # Where a swing ends, and with it whether a plateau fits into the leg that follows, depends on the damping.
    assert min(rates) < 0.0 < max(rates) or motion in ("roll", "pitch")
    assert motion not in ("roll", "pitch") or min(rates) < 0.0
    assert rig.nearest_m > 0.6


def test_heave_begins_with_hovering_as_long_as_planned(rig: Rig) -> None:
    hovered = []

    def note(rig: Rig) -> None:
        output = rig.output
        if output.phase.phase == "hover":
            hovered.append((rig.ideal.time_s, output.phase.motion, rig.ideal.rate["heave"]))

    _, phases = rig.fly(Goal(("heave",)), note)
    order = [phase.phase for phase in phases]
    assert order.index("settle") < order.index("hover") < order.index("transient")
    assert hovered[-1][0] - hovered[0][0] == pytest.approx(PlanKnobs().hover_s, abs=0.1)
    assert {motion for _, motion, _ in hovered} == {"heave_down"}
    assert max(abs(rate) for *_, rate in hovered) < 0.02


def test_plateau_speed_is_that_of_the_plan(rig: Rig) -> None:
    seen: dict[float, list[float]] = {}

    def note(rig: Rig) -> None:
        output = rig.output
        if output.phase.phase == "plateau":
            seen.setdefault(round(output.force, 3), []).append(output.velocity)

    rig.fly(Goal(("surge",)), note)
    means = sorted(sum(rates) / len(rates) for rates in seen.values())
    assert means == pytest.approx([-0.45, -0.1, 0.1, 0.45], abs=0.01)


def test_altitude_and_heading_are_held_while_surging(rig: Rig) -> None:
    worst = [0.0, 0.0]

    def note(rig: Rig) -> None:
        if rig.output.phase.phase == "plateau":
            worst[0] = max(worst[0], abs(rig.ideal.navigation().altitude_m - 0.9))
            worst[1] = max(worst[1], abs(rig.ideal.heading))

    rig.fly(Goal(("surge",)), note)
    assert worst[0] < 0.05
    assert worst[1] < math.radians(2.0)


@pytest.mark.parametrize(
    "goal", [Goal(("surge", "yaw")), Goal(("sway", "heave")), Goal(("roll",)), Goal(("surge",), "chirp")]
)
def test_feedback_counts_down_the_time_that_it_takes(rig: Rig, goal: Goal) -> None:
    shown: list[tuple[float, ManeuverOutput]] = []
    rig.fly(goal, lambda one: shown.append((one.ideal.time_s, one.output)))
    (begin_s, first), (end_s, last), planned_s = shown[0], shown[-1], shown[0][1].remaining_s
    assert end_s - begin_s == pytest.approx(planned_s, rel=0.06)
    progress = [one.progress for _, one in shown]
    assert progress == sorted(progress)
    assert (first.progress, last.progress, last.remaining_s) == (0.0, 1.0, 0.0)
    for time_s, one in shown[:-1]:
        assert one.remaining_s == pytest.approx(end_s - time_s, abs=max(2.5, 0.08 * planned_s))
        assert one.remaining_s == pytest.approx((1.0 - one.progress) * planned_s)
        assert 0.0 < one.wall_distance_m < 10.0
        assert not one.aborted


def test_what_is_flown_to_its_end_is_held_there(rig: Rig) -> None:
    output, _ = rig.fly(Goal(("surge",)))
    assert {state.axis for state in rig.step().holds if state.engaged} == {"heading", "roll", "pitch", "depth"}
    assert math.hypot(*rig.ideal.ground_velocity()) < 0.06
    assert not output.neutral


def test_a_maneuver_that_ends_without_a_state_releases_every_hold() -> None:
    output = abandoned(CANCELLED)
    assert (output.done, output.neutral, output.aborted) == (True, True, CANCELLED)
    assert (output.wrench, output.progress, output.remaining_s) == (ZERO6, 0.0, 0.0)
    assert {(one.axis, one.engaged) for one in output.setpoints} == {(axis, False) for axis in HOLDS if axis != STATION}


@pytest.mark.parametrize("current", [(0.15, 0.0), (-0.15, 0.0), (0.0, 0.15), (0.1, -0.1)])
@pytest.mark.parametrize("motion", ["surge", "heave"])
def test_current_neither_stops_it_nor_drives_it_into_a_wall(
    rig: Rig, motion: str, current: tuple[float, float]
) -> None:
    def switch_on(rig: Rig) -> None:
        rig.ideal.current = current if rig.ideal.time_s > 15.0 else (0.0, 0.0)

    output, _ = rig.fly(Goal((motion,)), switch_on)
    assert rig.nearest_m > 0.3
    assert output.aborted == ""


def test_lock_lost_for_three_seconds_is_no_plateau_and_no_abort(rig: Rig) -> None:
    blind_phases = set()

    def blind(rig: Rig) -> None:
        rig.ideal.locked = not 20.0 <= rig.ideal.time_s < 23.0
        if 20.1 <= rig.ideal.time_s < 23.0:
            blind_phases.add(rig.output.phase.phase)

    output, _ = rig.fly(Goal(("surge",)), blind)
    assert output.aborted == ""
    assert "plateau" not in blind_phases


@pytest.mark.parametrize("silent_from_s", [0.0, 4.0, 15.0])
def test_silent_sonar_is_replaced_by_depth(rig: Rig, silent_from_s: float) -> None:
    depths = []

    def silence(rig: Rig) -> None:
        rig.ideal.altitude_age_s = max(0.05, rig.ideal.time_s - silent_from_s)
        if rig.output.phase.phase == "plateau":
            depths.append(rig.ideal.depth)

    if silent_from_s == 0.0:
        rig.ideal.altitude_age_s = math.inf
    output, _ = rig.fly(Goal(("surge", "yaw")), silence)
    assert output.aborted == ""
    assert depths == pytest.approx([0.9] * len(depths), abs=0.05)


def test_plateau_counts_only_while_heading_and_altitude_are_held(rig: Rig) -> None:
    """Someone turns the vehicle in mid-plateau: no plateau until it is back."""
    shown = []

    def push(rig: Rig) -> None:
        if 20.0 <= rig.ideal.time_s < 20.1:
            rig.ideal.heading += math.radians(6.0)
        heading_deg = abs(math.degrees(rig.ideal.heading))
        shown.append((rig.ideal.time_s, heading_deg, rig.output.phase.phase))

    output, _ = rig.fly(Goal(("surge",)), push)
    assert output.aborted == ""
    assert not any(phase == "plateau" for time_s, turned_deg, phase in shown if turned_deg > 4.5 and time_s > 20.2)
    assert any(phase == "plateau" for time_s, _, phase in shown if time_s > 25.0)


def test_lock_lost_for_good_aborts_by_name_and_stops(rig: Rig) -> None:
    def blind(rig: Rig) -> None:
        rig.ideal.locked = rig.ideal.time_s < 20.0

    output, _ = rig.fly(Goal(("surge",)), blind)
    assert output.aborted.startswith("dvl_lock: no bottom lock for 5.0")
    assert output.phase.phase == "aborted"
    assert math.hypot(*rig.ideal.ground_velocity()) < 0.06


def test_lying_dead_reckoning_is_caught_before_the_wall(rig: Rig) -> None:
    """Someone set the current so high that the vehicle cannot hold against it."""

    def torrent(rig: Rig) -> None:
        rig.ideal.current = (0.0, 0.95) if rig.ideal.time_s > 20.0 else (0.0, 0.0)

    output, _ = rig.fly(Goal(("surge",)), torrent)
    assert output.aborted.reason is Reason.POOL_BOX
    assert "east wall" in output.aborted


LONG = PilotKnobs(plan=PlanKnobs(levels=1, plateau_s=14.0))


def test_a_leg_that_might_end_at_a_wall_is_shortened(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> None:
    """The longer it flies, the further it keeps off the walls, and goes on."""
    rig, reach_m = Rig(hindrax, ideal_vehicle, LONG), []
    half_m = 0.5 * hindrax.envelope_m[0]

    def doubt(rig: Rig) -> None:
        rig.ideal.sigma_m = 0.1 + 0.005 * rig.ideal.time_s
        margin_m = 0.3 + 2.0 * math.hypot(0.1, rig.ideal.sigma_m)
        reach_m.append(min(rig.place.x_m, hindrax.pool.length_m - rig.place.x_m) - half_m - margin_m)

    output, phases = rig.fly(Goal(("surge", "sway")), doubt)
    assert output.aborted == ""
    assert {"surge", "sway"} == {one.motion for one in phases if one.phase == "plateau"}
    assert rig.ideal.sigma_m > 0.5
    assert 0.1 < min(reach_m) < 0.3


def test_a_leg_of_which_little_would_be_left_is_not_flown(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> None:
    rig = Rig(hindrax, ideal_vehicle, LONG)
    rig.ideal.sigma_m = 1.2
    output, phases = rig.fly(Goal(("surge",)))
    assert {one.phase for one in phases} == {"settle", "aborted"}
    why = r"pool_box: surge would end [01]\.\d+ m from the \w+ wall, wanted 0\.30 m and 2\.41 m uncertainty; bring it"
    assert re.match(why, output.aborted)
    assert "./hindrax recentre" in output.aborted


def test_a_leg_ends_before_it_might_touch_a_wall(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> None:
    """The doubt grows in the middle of a leg: the guard ends it that much earlier."""
    rig = Rig(hindrax, ideal_vehicle, LONG)

    def doubt(rig: Rig) -> None:
        rig.ideal.sigma_m = 0.0 if rig.nearest_m > 1.5 or rig.ideal.north < 0.0 else 0.9

    output, phases = rig.fly(Goal(("surge",)), doubt)
    assert "plateau" in {one.phase for one in phases}
    assert re.match(r"pool_box: \d\.\d\d m to the north wall after braking, wanted 0\.30 m and 1\.81 m", output.aborted)
    assert rig.box.walls_m(rig.box.place(rig.ideal.navigation()))["north"] > 1.8


def test_pushing_a_wall_that_is_elsewhere_is_reported_and_ended(rig: Rig) -> None:
    """The vehicle does not move from its first plateau on, and its dead reckoning sees nothing near."""
    touched: list[bool] = []

    def wall(rig: Rig) -> None:
        if touched or rig.output.phase.phase == "plateau":
            touched.append(True)
            rig.ideal.rate["surge"] = 0.0

    output, phases = rig.fly(Goal(("surge",)), wall)
    assert output.aborted.reason is Reason.BLOCKED
    assert [one.phase for one in phases].count("blocked") == 1
    assert "blocked" not in {one.phase for one in rig_without_wall(rig)}


def rig_without_wall(rig: Rig) -> list[Phase]:
    rig.armed = False
    rig.step()
    return Rig(rig.ideal.vehicle, type(rig.ideal)).fly(Goal(("surge", "heave", "yaw")))[1]


def test_a_recentred_position_is_used_and_its_sigma_begins_anew(rig: Rig) -> None:
    rig.arm()
    rig.ideal.north, rig.ideal.sigma_m = 1.0, 1.6
    assert rig.step().guards[0].startswith("pool_box: 2.77 m to the west wall after braking, wanted 0.30 m and 3.21 m")
    assert rig.pilot.recentre(2.0, 1.0) == ""
    assert rig.step().guards == ()
    rig.ideal.north, rig.ideal.sigma_m = 1.4, 2.0  # a navigator that goes on counting from its own start
    found = rig.step().guards
    assert found[0].startswith("pool_box: 0.77 m to the west wall after braking, wanted 0.30 m and 2.41 m uncertainty")
    rig.ideal.sigma_m = 0.1  # one that counts from here
    assert rig.step().guards == ()
    assert rig.pilot.recentre() == ""
    assert rig.place.x_m == pytest.approx(5.0)


def test_a_given_place_holds_before_arming_too_and_turns_the_pool_when_asked(rig: Rig) -> None:
    assert rig.pilot.recentre() == HEADING_UNKNOWN
    rig.step()
    assert rig.pilot.recentre(3.0, 2.0, math.pi / 2.0) == ""
    rig.ideal.north = 0.5
    rig.arm()
    place = rig.place
    assert (place.x_m, place.y_m, place.heading_rad) == pytest.approx((3.0, 2.5, math.pi / 2.0))


@pytest.mark.parametrize(
    ("reported", "reason"),
    [
        ((math.nan, 2.0), "x: found nan m, wanted 0.29 to"),
        ((math.inf, 2.0), "x: found inf m, wanted 0.29 to 9.71 m, the hull within the pool"),
        ((-1e300, 2.0), "x: found -1e+300 m"),
        ((2.0, 5.9), "y: found 5.9 m, wanted 0.23 to 5.76 m"),
        ((2.0, 2.0, math.inf), "heading: found inf deg, wanted -360 to 360 deg from the pool's length"),
        ((2.0, 2.0, 7.0), "heading: found 401 deg"),
    ],
)
def test_an_impossible_place_is_refused_and_changes_nothing(rig: Rig, reported: tuple[float, ...], reason: str) -> None:
    rig.arm()
    assert reason in rig.pilot.recentre(*reported)
    assert rig.place.x_m == 5.0


def test_no_new_place_while_a_maneuver_flies_or_the_position_is_unknown(rig: Rig) -> None:
    rig.arm()
    rig.pilot.fly(Goal(("yaw",)))
    assert "`./hindrax stop` ends it" in rig.pilot.recentre()
    rig.pilot.cancel()
    while rig.pilot.flying:
        rig.step()
    rig.ideal.north = math.nan
    rig.step()
    assert rig.pilot.recentre() == f"the position is unknown; {SENSELESS}"


@pytest.mark.parametrize("ending", ["hold", "neutral"])
@pytest.mark.parametrize("at_s", [3.0, 17.0, 31.0])
@pytest.mark.parametrize("motion", ["surge", "heave", "yaw"])
def test_cancel_at_any_moment_ends_as_asked(rig: Rig, motion: str, ending: str, at_s: float) -> None:
    def cancel(rig: Rig) -> None:
        if rig.ideal.time_s >= at_s:
            rig.pilot.cancel()

    output, phases = rig.fly(Goal((motion,), on_cancel=ending), cancel)
    assert output.aborted.reason is Reason.CANCELLED
    assert rig.ideal.time_s < at_s + 9.0
    held = rig.step()
    engaged = {state.axis for state in held.holds if state.engaged}
    if ending == "neutral":
        assert held.wrench == ZERO6
        assert engaged == set()
    else:
        assert engaged == {"heading", "roll", "pitch", "depth"}
        before = rig.box.place(rig.ideal.navigation())
        rig.ideal.current = (0.1, 0.0)
        for _ in range(600):
            rig.step()
        after = rig.box.place(rig.ideal.navigation())
        assert math.hypot(after.x_m - before.x_m, after.y_m - before.y_m) < 0.7
    assert phases[-1].phase == "aborted"


@pytest.mark.parametrize(
    ("end", "reason"),
    [
        (lambda rig: rig.pilot.cancel(), CANCELLED),
        (lambda rig: setattr(rig, "armed", False), "disarmed: the thrusters give no reason; arm and fly again"),
    ],
)
@pytest.mark.parametrize("ending", ["hold", "neutral"])
def test_what_ends_before_its_first_step_is_reported_so_and_flies_nothing(
    rig: Rig, end: Callable[[Rig], object], reason: str, ending: str
) -> None:
    rig.arm()
    maneuver = rig.pilot.fly(Goal(("surge",), on_cancel=ending))
    assert (maneuver.last, maneuver.done) == (None, False)
    end(rig)
    rig.step()
    reported = [rig.output]
    while not reported[-1].done:
        rig.step()
        reported.append(rig.output)
        assert len(reported) < 500
    assert maneuver.last is reported[-1]
    assert (reported[-1].aborted, reported[-1].phase.phase) == (reason, "aborted")
    assert {(one.phase.motion, one.progress) for one in reported} == {("", 0.0)}
    assert {one.phase.phase for one in reported[:-1]} == {"settle"}
    assert reported[-1].neutral is (ending == "neutral" or not rig.armed)


def test_disarming_in_flight_aborts_and_asks_for_nothing(rig: Rig) -> None:
    rig.arm()
    rig.pilot.fly(Goal(("surge",)))
    for _ in range(100):
        rig.step()
    rig.armed, rig.unarmed = False, "no command for 5 s"
    assert rig.step().wrench == ZERO6
    for _ in range(200):
        rig.step()
    aborted = "disarmed: no command for 5 s; arm and fly again"
    assert rig.output.aborted == aborted
    rig.armed = True
    assert rig.step().wrench == ZERO6


def test_nothing_flies_before_it_is_armed_or_while_a_guard_objects(rig: Rig) -> None:
    rig.step()
    with pytest.raises(HindraxError, match="not armed"):
        rig.pilot.fly(Goal(("surge",)))
    assert rig.pilot.set(Setpoint("depth", value=1.0)).reason is Reason.NOT_ARMED
    rig.ideal.north = 4.6
    rig.arm()
    with pytest.raises(HindraxError, match=r"pool_box: .* wanted 0\.30 m; bring it to the middle"):
        rig.pilot.fly(Goal(("surge",)))


def test_one_maneuver_at_a_time_and_no_hand_meanwhile(rig: Rig) -> None:
    rig.arm()
    rig.pilot.fly(Goal(("surge",)))
    rig.step()
    with pytest.raises(HindraxError, match=r"`\./hindrax stop` ends it"):
        rig.pilot.fly(Goal(("yaw",)))
    assert rig.pilot.set(Setpoint("depth", value=1.0)).reason is Reason.BUSY
    stamp = rig.ideal.stamp
    (refusal,) = rig.pilot.set_operator_wrench((5.0, 0.0, 0.0, 0.0, 0.0, 0.0), "base_link_fsd", stamp, stamp)
    assert refusal.reason is Reason.BUSY


def test_wrench_by_hand_is_added_to_the_holds_until_it_is_stale(rig: Rig) -> None:
    rig.arm()
    assert rig.pilot.set(Setpoint("depth", value=0.9)) == ""
    stamp = rig.ideal.stamp
    assert rig.pilot.set_operator_wrench((5.0, 0.0, 0.0, 0.0, 0.0, 0.0), "base_link_fsd", stamp, stamp) == ()
    flight = rig.step()
    assert flight.wrench[0] == 5.0
    assert flight.wrench[2] != 0.0
    for _ in range(12):
        flight = rig.step()
    assert flight.wrench[0] == 0.0
    refused = rig.pilot.set_operator_wrench((5.0,) * 6, "map", stamp, stamp)
    assert refused[0].reason is Reason.FRAME


def test_failed_thrusters_that_cost_the_axis_abort_by_name(rig: Rig) -> None:
    def fail(rig: Rig) -> None:
        lost = ("surge",) if rig.ideal.time_s > 15.0 else ()
        rig.became = Allocation(ZERO6, ZERO6, ZERO6, (), (), (), lost_axes=lost)

    output, _ = rig.fly(Goal(("surge",)), fail)
    assert output.aborted.startswith("thrusters: surge cannot be served")


def test_unknown_navigation_aborts_instead_of_guessing(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> None:
    rig = Rig(hindrax, ideal_vehicle)
    rig.arm()
    maneuver = rig.pilot.fly(Goal(("surge",)))
    for _ in range(300):
        rig.step()
    blind = replace(rig.ideal.navigation(), velocity_mps=UNKNOWN6[:3])
    output = maneuver.step(blind, Stamp(rig.ideal.stamp + 1))
    assert output.phase.phase == "settle"
    assert {one.axis for one in output.setpoints if one.engaged} == {"heading", "roll", "pitch", "depth"}
    for index in range(400):
        output = maneuver.step(blind, Stamp(rig.ideal.stamp + 1 + index * 50_000_000))
    assert output.done
    assert output.aborted.startswith("navigation: surge unknown; see which sensor is silent (`./hindrax doctor`)")


@pytest.mark.parametrize("excitation", ["steps", "doublets", "chirp", "multisine"])
@pytest.mark.parametrize("motion", ["surge", "roll"])
def test_excitations_stay_clear_of_walls_and_limits(rig: Rig, motion: str, excitation: str) -> None:
    tilts = []
    output, phases = rig.fly(Goal((motion,), excitation, seed=5), lambda one: tilts.append(abs(one.ideal.roll)))
    assert output.aborted == ""
    assert {phase.phase for phase in phases} == {"settle", "excite", "done"}
    assert rig.nearest_m > 0.4
    assert max(tilts) < math.radians(45.0)


def test_an_excitation_of_heave_states_which_way_it_goes(rig: Rig) -> None:
    """Down and up are identified as two motions; nobody learns of one that is called otherwise."""
    named = set()

    def note(one: Rig) -> None:
        reported, down_mps = one.output.phase, one.ideal.navigation().velocity_mps[2]
        if reported.phase == "excite" and abs(down_mps) > 0.02:
            named.add((reported.motion, down_mps > 0.0))

    output, _ = rig.fly(Goal(("heave",), "multisine", seed=5), note)
    assert output.aborted == ""
    assert named == {("heave_down", True), ("heave_up", False)}


@pytest.mark.parametrize(
    ("goal", "reason"),
    [
        (Goal(()), "no motion"),
        (Goal(("surge", "loop")), "motion 'loop' unknown"),
        (Goal(("surge",), "noise"), "excitation 'noise' unknown"),
        (Goal(("surge",), on_cancel="drift"), "ending 'drift' unknown"),
        (Goal(("surge", "yaw"), levels=(1.0,)), "levels of surge, yaw by plateaus, wanted the levels of one motion"),
        (Goal(("yaw",), "chirp", levels=(1.0,)), "levels of yaw by chirp, wanted the levels of one motion by plateaus"),
        (Goal(("yaw",), levels=(0.5,) * 21), "21 levels, wanted at most 20"),
        (Goal(("yaw",) * 13), "13 motions, wanted at most 12"),
        (Goal(("yaw",), levels=(0.5, 1.1)), "level 1.1, wanted 0 .* to 1"),
        (Goal(("yaw",), levels=(float("nan"),)), "level nan, wanted 0 .* to 1"),
    ],
)
def test_goals_that_nobody_can_fly_are_refused(rig: Rig, goal: Goal, reason: str) -> None:
    with pytest.raises(UsageError, match=reason):
        check_goal(goal)
    rig.arm()
    with pytest.raises(UsageError, match=reason):
        rig.pilot.fly(goal)
    assert not rig.pilot.flying


def test_plans_are_for_the_thrusters_that_work(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> None:
    rig = Rig(hindrax, ideal_vehicle)
    rig.pilot.disable(frozenset({"T3", "T4"}))
    rig.pilot.check(Goal(("surge", "yaw")))
    with pytest.raises(UsageError, match="sway: without T3, T4 no thruster serves it"):
        rig.pilot.check(Goal(("surge", "sway")))
    rig.arm()
    with pytest.raises(UsageError, match="sway: without T3, T4 no thruster serves it"):
        rig.pilot.fly(Goal(("sway",)))
    assert Allocator(hindrax).lost_axes(frozenset({"T3", "T4"})) == ("sway",)
