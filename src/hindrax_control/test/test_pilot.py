"""What the pilot tells of what it was told: a setpoint that is refused is seen in the state of its hold."""

import math
from dataclasses import replace
from typing import Any

import pytest

from hindrax_control.allocation.allocator import AllocationKnobs
from hindrax_control.allocation.thruster_fault_detector import (
    EVERY,
    FaultDetectorKnobs,
    SuspectedFault,
    ThrusterFaultDetector,
)
from hindrax_control.allocation.wrench_guard import WrenchGuardKnobs
from hindrax_control.hold.holds import HoldKnobs, Setpoint
from hindrax_control.maneuver.goal import Goal
from hindrax_control.maneuver.maneuver import ManeuverOutput
from hindrax_control.pilot import REFUSAL_S, Pilot, PilotKnobs, PilotOutput
from hindrax_control.testing.ideal_vehicle import IdealVehicle
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.readings import Vec6
from hindrax_core.signals import ZERO6, Allocation
from hindrax_core.text.refusals import STILL_ARMED, Reason, Refusal
from hindrax_core.vehicle import Vehicle


class Hovering:
    """A vehicle that hangs still; `notes` are those of the holds after a step."""

    def __init__(self, vehicle: Vehicle, ideal: IdealVehicle) -> None:
        self.pilot, self.ideal = Pilot(vehicle), ideal

    def fly(self, *, armed: bool = True, seconds: float = 0.02, **why: str) -> PilotOutput:
        self.ideal.time_s += seconds
        return self.pilot.step(self.ideal.navigation(), self.ideal.stamp, armed=armed, **why)  # type: ignore[arg-type]  # only `unarmed` and `unobeyed`

    def step(self, *, armed: bool = True, seconds: float = 0.02, **why: str) -> dict[str, Any]:
        flight = self.fly(armed=armed, seconds=seconds, **why)
        return {state.axis: state.note for state in flight.holds if state.note}


@pytest.fixture
def hovering(hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]) -> Hovering:
    return Hovering(hindrax, ideal_vehicle(hindrax))


def test_a_refused_setpoint_is_shown_for_a_while(hovering: Hovering) -> None:
    hovering.step()
    assert hovering.pilot.set(Setpoint("roll", value=1.5))
    assert hovering.step() == {"roll": "refused: hold roll: found 85.9437 deg, wanted -55 to 55 deg"}
    assert hovering.step(seconds=REFUSAL_S) == {}


def test_it_is_shown_disarmed_too(hovering: Hovering) -> None:
    hovering.step(armed=False)
    hovering.pilot.set(Setpoint("depth", value=0.5))
    assert hovering.step(armed=False) == {
        "depth": "refused: hold depth: the vehicle is not armed; `./hindrax arm` first"
    }


def test_while_it_is_being_armed_the_refusal_reports_it(hovering: Hovering) -> None:
    hovering.step(armed=False, unarmed="waiting for the ESCs")
    why = hovering.pilot.set(Setpoint("depth", value=0.5))
    assert why == "hold depth: the vehicle is not armed (waiting for the ESCs); `./hindrax arm` first"
    with pytest.raises(HindraxError, match=r"not armed \(waiting for the ESCs\)"):
        hovering.pilot.fly(Goal(("surge",)))


def test_nothing_is_said_to_be_held_or_begins_while_armed_thrusters_obey_no_command(hovering: Hovering) -> None:
    hovering.step()
    assert hovering.pilot.set(Setpoint("depth", value=0.5)) == ""
    assert hovering.step() == {}
    why = "no command is obeyed: found 2 publishers, wanted one"
    sentence = f"the thrusters are armed, but {why}; disarm, find the cause (`./hindrax health`) and arm again"
    assert hovering.step(disobeying=why) == {"depth": sentence}
    assert hovering.pilot.set(Setpoint("roll", value=0.0)) == f"hold roll: {sentence}"
    assert hovering.step(disobeying=why) == {"depth": sentence, "roll": f"refused: hold roll: {sentence}"}
    with pytest.raises(HindraxError, match="no command is obeyed"):
        hovering.pilot.fly(Goal(("surge",)))
    assert hovering.pilot.set(Setpoint("depth", engaged=False)) == "", "letting go is always possible"
    hovering.step()
    assert hovering.pilot.set(Setpoint("roll", value=0.0)) == ""


def test_letting_go_disarmed_is_no_news(hovering: Hovering) -> None:
    hovering.step(armed=False)
    assert hovering.pilot.set(Setpoint("depth", engaged=False)) == ""
    assert hovering.step(armed=False) == {}


def test_a_good_setpoint_takes_its_place(hovering: Hovering) -> None:
    hovering.step()
    hovering.pilot.set(Setpoint("depth", value=-1.0))
    assert "depth" in hovering.step()
    assert hovering.pilot.set(Setpoint("depth", value=0.5)) == ""
    assert hovering.step() == {}


def test_what_others_refuse_is_shown_too(hovering: Hovering) -> None:
    hovering.step()
    hovering.pilot.refuse("heading", Refusal(Reason.LATE, "hold heading: 3.0 s old"))
    assert hovering.step() == {"heading": "refused: hold heading: 3.0 s old"}


def test_a_wrench_by_hand_that_is_refused_is_shown_for_a_while(hovering: Hovering) -> None:
    hovering.step()
    stamp = hovering.ideal.stamp
    assert hovering.fly().refused == ""
    hovering.pilot.set_operator_wrench((5.0, math.nan, 0.0, 0.0, 0.0, 0.0), "base_link_fsd", stamp, stamp)
    flight = hovering.fly()
    assert flight.refused == "Y: found nan, wanted a finite number"
    assert flight.wrench[0] == 5.0
    hovering.pilot.set_operator_wrench((5.0,) * 6, "map", stamp, stamp)
    assert hovering.fly(armed=False).refused.startswith("wrench: found frame 'map'")
    assert hovering.fly(seconds=REFUSAL_S + 0.1).refused == ""


def test_water_in_the_hull_ends_a_maneuver_refuses_the_next_and_leaves_the_holds(hovering: Hovering) -> None:
    hovering.fly()
    maneuver = hovering.pilot.fly(Goal(("surge",)))
    hovering.fly()
    hovering.pilot.water_in_hull = True
    hovering.fly()
    assert hovering.pilot.flying, "it brakes, and holds where it is"
    assert maneuver.last is not None
    while not maneuver.done:
        hovering.fly()
    assert maneuver.last.aborted.reason is Reason.LEAK
    with pytest.raises(HindraxError, match=r"leak: .*surface, disarm and open the hull"):
        hovering.pilot.fly(Goal(("surge",)))
    assert hovering.pilot.set(Setpoint("depth", value=0.2)) == ""


def test_a_refusal_is_shown_beside_what_the_hold_states_itself(hovering: Hovering) -> None:
    hovering.step()
    hovering.pilot.set(Setpoint("heading"))
    hovering.ideal.heading = math.nan
    hovering.step()
    hovering.pilot.refuse("heading", Refusal(Reason.LATE, "hold heading: 3.0 s old"))
    assert hovering.step()["heading"] == "not measured: no effort; refused: hold heading: 3.0 s old"


def test_disarming_ends_a_maneuver_neutral_with_the_reason_and_lets_go_of_its_place(hovering: Hovering) -> None:
    said = {
        "": "the thrusters give no reason",
        "tether cut": "tether cut",
        "disarmed by request": "by request",
        f"no answer{STILL_ARMED}": "no answer",
    }
    for unarmed, words in said.items():
        hovering.fly()
        maneuver = hovering.pilot.fly(Goal(("surge",), on_cancel="hold"))
        hovering.fly()
        hovering.ideal.time_s += 0.02
        hovering.pilot.step(hovering.ideal.navigation(), hovering.ideal.stamp, armed=False, unarmed=unarmed)
        while not maneuver.done:
            assert hovering.fly(armed=False).wrench == ZERO6
        assert maneuver.last is not None
        assert maneuver.last.aborted == f"disarmed: {words}; arm and fly again"
        assert maneuver.last.neutral
        hovering.ideal.north += 0.1
        assert hovering.fly().wrench[0] == 0.0


@pytest.mark.parametrize("ending", ["hold", "neutral"])
def test_a_cancelled_maneuver_ends_in_its_place_or_neutral_as_it_is_given(hovering: Hovering, ending: str) -> None:
    hovering.pilot.cancel()  # nothing flies: no harm
    hovering.fly()
    maneuver = hovering.pilot.fly(Goal(("surge",)))
    hovering.fly()
    hovering.pilot.cancel(ending=ending)
    for _ in range(100):  # 2 s
        hovering.fly()
    assert maneuver.last is not None
    assert maneuver.last.aborted.reason is Reason.CANCELLED
    hovering.ideal.north += 0.5
    assert (hovering.fly().wrench[0] < -1.0) is (ending == "hold")
    assert (hovering.fly(armed=False).wrench, hovering.fly().wrench[0]) == (ZERO6, 0.0)


def allocated(forces_N: tuple[float, ...], shortfall: Vec6 = ZERO6) -> Allocation:
    count = len(forces_N)
    return Allocation(ZERO6, ZERO6, shortfall, forces_N, (1500,) * count, (False,) * count)


def test_thrusters_that_do_not_push_are_reported_unless_they_are_disabled(
    hovering: Hovering, monkeypatch: pytest.MonkeyPatch
) -> None:
    pilot, ideal = hovering.pilot, hovering.ideal

    def suspected(forces_N: tuple[float, ...] = (5.0,) * 8) -> SuspectedFault | None:
        return pilot.step(ideal.navigation(), ideal.stamp, allocated(forces_N), armed=True).suspected_fault

    assert suspected() is None, "it has just begun"
    found = SuspectedFault("T3", 0.9)
    monkeypatch.setattr(ThrusterFaultDetector, "step", lambda *_: found)
    assert suspected() == found
    assert suspected(()) is None, "nobody knows their forces"
    pilot.disable(frozenset({"T3"}))
    assert suspected() is None
    monkeypatch.setattr(ThrusterFaultDetector, "step", lambda *_: None)
    assert suspected() is None


def test_what_the_thrusters_could_not_give_stops_the_integral_of_a_hold(
    hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]
) -> None:
    moments: list[float] = []
    for short_Nm in (0.0, 5.0):
        pilot, ideal = Pilot(hindrax), ideal_vehicle(hindrax)
        pilot.step(ideal.navigation(), ideal.stamp, armed=True)
        pilot.set(Setpoint("heading", value=0.2))
        allocation = allocated((1.0,) * 8, (0.0, 0.0, 0.0, 0.0, 0.0, short_Nm))
        for _ in range(100):
            ideal.time_s += 0.02
            moments.append(pilot.step(ideal.navigation(), ideal.stamp, allocation, armed=True).wrench[5])
    assert moments[99] > moments[199] + 0.1


def engaged(flight: PilotOutput) -> set[str]:
    return {state.axis for state in flight.holds if state.engaged}


def pushed_by_hand(hovering: Hovering) -> tuple[str, ...]:
    """Reasons of a refusal of 5 N ahead."""
    stamp = hovering.ideal.stamp
    return hovering.pilot.set_operator_wrench((5.0, 0.0, 0.0, 0.0, 0.0, 0.0), "base_link_fsd", stamp, stamp)


def test_a_maneuver_engages_its_holds_and_bears_no_wrench_by_hand(hovering: Hovering) -> None:
    hovering.fly()
    hovering.pilot.set(Setpoint("station"))
    assert engaged(hovering.fly()) == {"station"}
    hovering.pilot.fly(Goal(("surge",)))
    assert engaged(hovering.fly()) == {"heading", "roll", "pitch", "altitude"}
    before = hovering.fly(seconds=0.0).wrench
    assert pushed_by_hand(hovering) == ("wrench: a maneuver is being flown; `./hindrax stop` ends it",)
    assert hovering.fly(seconds=0.0).wrench == before
    hovering.pilot.abandon()
    flight = hovering.fly()
    assert (flight.maneuver, flight.wrench, engaged(flight), hovering.pilot.flying) == (None, ZERO6, set(), False)


def test_a_dead_supply_is_told_by_every_hold_and_guard_until_it_is_disarmed(
    hovering: Hovering, monkeypatch: pytest.MonkeyPatch
) -> None:
    hovering.fly()
    maneuver = hovering.pilot.fly(Goal(("surge",)))
    found = iter([SuspectedFault(EVERY, 1.0)])
    monkeypatch.setattr(ThrusterFaultDetector, "step", lambda *_: next(found, None))
    ideal = hovering.ideal
    suspected = hovering.pilot.step(ideal.navigation(), ideal.stamp, allocated((1.0,) * 8), armed=True)
    assert suspected.suspected_fault is None, "there is none to be left out"
    told = hovering.fly()
    assert "their supply is dead" in told.guards[0]
    assert told.guards[0].reason is Reason.UNOBEYED
    assert engaged(told)
    assert {one.note for one in told.holds if one.engaged} == {told.guards[0]}
    for _ in range(600):
        hovering.fly()
    assert maneuver.last is not None
    assert maneuver.last.aborted == told.guards[0]
    assert "their supply is dead" in hovering.pilot.set(Setpoint("roll"))
    assert any("supply" in one for one in hovering.fly().guards), "it is kept, though nothing more is found"
    hovering.fly(armed=False)
    assert not any("supply" in one for one in hovering.fly().guards)


def test_a_supply_that_measures_nothing_is_told_by_every_hold_though_nothing_is_pushed(hovering: Hovering) -> None:
    hovering.fly()
    hovering.pilot.set(Setpoint("depth"))
    ideal = hovering.ideal
    told = hovering.pilot.step(ideal.navigation(), ideal.stamp, armed=True, battery_V=0.2)
    assert "the supply of the thrusters measures 0.2 V" in told.guards[0]
    assert told.guards[0].reason is Reason.UNOBEYED
    assert {one.note for one in told.holds if one.engaged} == {told.guards[0]}
    assert not any("supply" in one for one in hovering.fly(armed=False).guards)


def test_all_thrusters_rest_when_a_maneuver_wants_it_whatever_the_holds_want(
    hovering: Hovering, monkeypatch: pytest.MonkeyPatch
) -> None:
    hovering.fly()
    maneuver = hovering.pilot.fly(Goal(("roll",)))
    pushing, step = hovering.fly(), maneuver.step
    assert pushing.wrench[2] != 0.0
    monkeypatch.setattr(maneuver, "step", lambda *given, **more: replace(step(*given, **more), resting=True))
    resting = hovering.fly()
    assert (resting.wrench, engaged(resting)) == (ZERO6, engaged(pushing))
    monkeypatch.undo()
    assert hovering.fly().wrench[2] != 0.0


def test_what_holds_and_station_want_of_thrusters_that_rest_is_a_shortfall(
    hovering: Hovering, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a vehicle that drifts while it swings is taken for one that thrust does not move, and integrals wind up."""
    hovering.fly()
    maneuver, reported = hovering.pilot.fly(Goal(("roll",))), []
    step = maneuver.step

    def resting(*given: Any, shortfall: Vec6, **more: Any) -> ManeuverOutput:
        reported.append(shortfall)
        return replace(step(*given, shortfall=shortfall, **more), wrench=(10.0, *ZERO6[1:]), resting=len(reported) == 2)

    monkeypatch.setattr(maneuver, "step", resting)
    wanted = [hovering.fly().wrench for _ in range(4)]
    assert [shortfall[0] for shortfall in reported] == [0.0, 0.0, 10.0, 0.0]
    assert reported[2][2] == pytest.approx(wanted[2][2], rel=0.1), "that of the holds too"
    assert hovering.fly(armed=False).wrench == ZERO6


def test_what_is_abandoned_pushes_no_more(hovering: Hovering) -> None:
    hovering.fly()
    for axis in ("station", "heading"):
        hovering.pilot.set(Setpoint(axis))
    pushed_by_hand(hovering)
    assert hovering.fly().wrench[0] == 5.0
    hovering.pilot.abandon()
    hovering.ideal.north += 0.5
    flight = hovering.fly()
    assert (flight.wrench, engaged(flight)) == (ZERO6, set())


def test_a_wrench_by_hand_ends_with_its_age_and_with_the_arming(hovering: Hovering) -> None:
    age_s = WrenchGuardKnobs().max_age_s
    hovering.fly()
    pushed_by_hand(hovering)
    assert hovering.fly(seconds=0.9 * age_s).wrench == (5.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert hovering.fly(seconds=0.2 * age_s).wrench == ZERO6
    pushed_by_hand(hovering)
    hovering.fly(armed=False)
    assert hovering.fly().wrench == ZERO6


def test_a_wrench_by_hand_takes_the_vehicle_from_the_place_at_which_a_maneuver_ended(hovering: Hovering) -> None:
    hovering.fly()
    hovering.pilot.fly(Goal(("surge",)))
    hovering.fly()
    hovering.pilot.cancel(ending="hold")
    for _ in range(100):
        hovering.fly()
    pushed_by_hand(hovering)
    hovering.ideal.north += 0.5
    assert hovering.fly().wrench[0] == 5.0


def test_an_axis_that_is_lost_ends_a_maneuver(hovering: Hovering) -> None:
    pilot, ideal = hovering.pilot, hovering.ideal
    hovering.fly()
    maneuver = pilot.fly(Goal(("surge",)))
    hovering.fly()
    pilot.step(ideal.navigation(), ideal.stamp, replace(allocated(()), lost_axes=("surge",)), armed=True)
    for _ in range(100):
        hovering.fly()
    assert maneuver.last is not None
    assert maneuver.last.aborted.reason is Reason.THRUSTERS


def test_a_goal_is_checked_before_it_is_flown_and_a_refusal_may_come_before_a_state(hovering: Hovering) -> None:
    hovering.pilot.check(Goal(("surge",)))
    with pytest.raises(UsageError, match="goal: motion 'jump' unknown"):
        hovering.pilot.check(Goal(("jump",)))
    hovering.pilot.refuse("heading", Refusal(Reason.LATE, "late"))
    hovering.ideal.time_s = 0.0
    assert hovering.step(seconds=0.0) == {"heading": "refused: late"}


def test_knobs_that_change_in_flight_are_used_from_then_on(hovering: Hovering) -> None:
    hovering.step()
    hovering.pilot.set(Setpoint("heading", value=0.2))
    hovering.fly()
    brisk = PilotKnobs(holds=HoldKnobs(heading_bandwidth_radps=4.0))
    before = hovering.fly(seconds=0.0).wrench[5]
    parts = (hovering.pilot._allocator, hovering.pilot._fault_detector)
    hovering.pilot.tune(brisk)
    assert hovering.fly(seconds=0.0).wrench[5] > 2.0 * before > 0.0
    assert (hovering.pilot._allocator, hovering.pilot._fault_detector) == parts, "they keep what they have learnt"
    others = replace(brisk, allocation=AllocationKnobs(hop_N=2.0), fault_detector=FaultDetectorKnobs(missing=0.7))
    hovering.pilot.tune(others)
    assert hovering.pilot._allocator is not parts[0]
    assert hovering.pilot._fault_detector is not parts[1]


# ---- place in the pool


def place(hovering: Hovering) -> tuple[float, float]:
    """Where the pilot takes the vehicle to be now [m]."""
    hovering.fly()
    pool = hovering.pilot.pool
    assert pool is not None
    at = pool.place(hovering.ideal.navigation())
    return (at.x_m, at.y_m)


def test_after_a_restart_no_maneuver_begins_until_the_position_is_set(hovering: Hovering) -> None:
    hovering.pilot.lose_place("the vehicle was armed before")
    assert hovering.fly().guards[0].startswith("pool_box: the vehicle was armed before, wanted a known position")
    with pytest.raises(HindraxError, match=r"pool_box: .*hindrax recentre"):
        hovering.pilot.fly(Goal(("surge",)))
    assert hovering.pilot.set(Setpoint("depth", value=0.5)) == ""
    assert hovering.pilot.recentre(4.0, 2.0) == ""
    assert hovering.fly().guards == ()
    assert place(hovering) == pytest.approx((4.0, 2.0))
    hovering.pilot.fly(Goal(("surge",)))


def test_without_a_place_in_words_it_is_at_its_start(hovering: Hovering, hindrax: Vehicle) -> None:
    assert hovering.pilot.recentre(1.0, 2.0).startswith("the heading is unknown")
    hovering.ideal.heading = math.nan
    hovering.fly(armed=False)
    assert hovering.pilot.recentre(1.0, 2.0).startswith("the heading is unknown")
    hovering.ideal.heading = 0.0
    hovering.fly(armed=False)
    middle = (0.5 * hindrax.pool.length_m, 0.5 * hindrax.pool.width_m)
    assert hovering.pilot.recentre(math.nan, 2.0).startswith("x: found nan m, wanted 0.29 to")
    assert hovering.pilot.recentre(4.0, 2.0) == ""
    assert place(hovering) == pytest.approx((4.0, 2.0))
    assert hovering.pilot.recentre() == ""
    assert place(hovering) == pytest.approx(middle)
    hovering.ideal.east = math.nan
    hovering.fly(armed=False)
    assert hovering.pilot.recentre().startswith("the position is unknown")


def test_the_pool_lies_as_the_vehicle_did_until_it_was_armed_or_somebody_reported_where_it_is(
    hovering: Hovering,
) -> None:
    def axis_rad() -> float:
        assert hovering.pilot.pool is not None
        return hovering.pilot.pool.axis_rad

    for heading_rad, armed, axis in ((0.3, False, 0.3), (0.5, False, 0.5), (0.7, True, 0.7), (0.9, False, 0.7)):
        hovering.ideal.heading = heading_rad
        hovering.fly(armed=armed)
        assert axis_rad() == pytest.approx(axis)
    reported = Hovering(hovering.ideal.vehicle, hovering.ideal)
    reported.fly(armed=False)
    assert reported.pilot.recentre(4.0, 2.0) == ""
    reported.ideal.heading = 1.2
    reported.fly(armed=False)
    assert reported.pilot.pool is not None
    assert reported.pilot.pool.axis_rad == pytest.approx(0.9)


def test_a_place_that_was_unknown_when_it_was_armed_counts_from_zero(hovering: Hovering, hindrax: Vehicle) -> None:
    hovering.ideal.north = hovering.ideal.east = math.nan
    hovering.fly()
    hovering.ideal.north, hovering.ideal.east = 1.0, -0.5
    at = (0.5 * hindrax.pool.length_m + 1.0, 0.5 * hindrax.pool.width_m - 0.5)
    assert place(hovering) == pytest.approx(at)


def test_the_origin_of_a_foreign_odometry_is_where_the_vehicle_lay(hovering: Hovering, hindrax: Vehicle) -> None:
    middle = (0.5 * hindrax.pool.length_m, 0.5 * hindrax.pool.width_m)
    hovering.ideal.north, hovering.ideal.east = math.nan, math.nan
    hovering.fly(armed=False)
    hovering.ideal.north, hovering.ideal.east = 120.0, -40.0
    hovering.fly(armed=False)
    hovering.ideal.north += 1.0
    assert place(hovering) == pytest.approx((middle[0] + 1.0, middle[1]))


@pytest.mark.parametrize("armed", [False, True])
def test_an_odometry_that_begins_anew_costs_the_place_once_it_was_armed(
    hovering: Hovering, hindrax: Vehicle, armed: bool
) -> None:
    hovering.fly(armed=armed)
    hovering.ideal.north += 3.0
    hovering.pilot.begin_anew()
    guards = hovering.fly(armed=armed).guards
    if armed:
        assert guards[0].startswith("pool_box: the odometry restarted after the vehicle was armed")
    else:
        assert guards == ()
        assert place(hovering) == pytest.approx((0.5 * hindrax.pool.length_m, 0.5 * hindrax.pool.width_m))


# ---- station


def keeping(hovering: Hovering) -> tuple[bool, float]:
    """Whether the station is held, and the force ahead."""
    flight = hovering.fly()
    (state,) = (one for one in flight.holds if one.axis == "station")
    return state.engaged, flight.wrench[0]


def test_the_station_is_kept_where_the_vehicle_was(hovering: Hovering) -> None:
    hovering.step()
    assert keeping(hovering) == (False, 0.0)
    assert hovering.pilot.set(Setpoint("station")) == ""
    engaged, force = keeping(hovering)
    assert engaged is True
    assert force == pytest.approx(0.0, abs=1e-6)
    hovering.ideal.north += 0.3
    hovering.ideal.east -= 0.4
    engaged, force = keeping(hovering)
    assert engaged
    assert force < -1.0
    flight = hovering.fly()
    (station,) = (one for one in flight.holds if one.axis == "station")
    assert station.setpoint == 0.0
    assert station.error == pytest.approx(0.5)
    assert flight.wrench[1] > 1.0
    assert flight.wrench[2:] == (0.0,) * 4
    assert hovering.fly().wrench[0] == pytest.approx(flight.wrench[0], abs=0.2), "its integral takes seconds"
    hovering.pilot.set(Setpoint("station", engaged=False))
    assert keeping(hovering) == (False, 0.0)


def test_a_station_is_kept_where_the_vehicle_is_when_its_place_is_reported(hovering: Hovering) -> None:
    hovering.step()
    hovering.pilot.set(Setpoint("station"))
    hovering.fly()
    hovering.ideal.north += 0.5
    assert hovering.fly().wrench[0] < -1.0
    assert hovering.pilot.recentre(4.0, 2.0) == ""
    assert keeping(hovering)[1] == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize(
    ("shortfall", "learns"),
    [
        (ZERO6, True),
        ((0.0, 0.0, 9.0, 9.0, 9.0, 9.0), True),
        ((4.0, *ZERO6[1:]), False),
        ((0.0, -4.0, *ZERO6[2:]), False),
    ],
)
def test_a_station_learns_a_current_unless_surge_or_sway_falls_short(
    hovering: Hovering, shortfall: Vec6, learns: bool
) -> None:
    hovering.step()
    hovering.pilot.set(Setpoint("station"))
    hovering.fly()
    hovering.ideal.north += 0.2
    forces = []
    for _ in range(150):
        hovering.ideal.time_s += 0.02
        now, stamp = hovering.ideal.navigation(), hovering.ideal.stamp
        forces.append(hovering.pilot.step(now, stamp, allocated((), shortfall), armed=True).wrench[0])
    assert (forces[-1] < forces[50] - 0.05) is learns


def test_a_disarmed_vehicle_lets_go_of_its_station(hovering: Hovering) -> None:
    hovering.step()
    hovering.pilot.set(Setpoint("station"))
    hovering.step(armed=False)
    hovering.ideal.north += 0.5
    assert keeping(hovering) == (False, 0.0)
    hovering.step(armed=False)
    assert hovering.pilot.set(Setpoint("station"))  # refused: not armed


def test_the_station_makes_no_force_while_the_place_is_unknown(hovering: Hovering) -> None:
    hovering.step()
    hovering.pilot.set(Setpoint("station"))
    hovering.ideal.north = math.nan
    assert keeping(hovering) == (True, 0.0)
    assert "position" in hovering.step()["station"]


def test_after_a_maneuver_the_station_is_held_once_and_let_go_for_good(hovering: Hovering) -> None:
    hovering.fly()
    maneuver = hovering.pilot.fly(Goal(("surge",)))
    hovering.fly()
    hovering.pilot.cancel(ending="hold")
    while not maneuver.done:
        hovering.fly()
    hovering.pilot.set(Setpoint("station"))
    hovering.fly()
    hovering.ideal.north += 0.5
    assert keeping(hovering)[1] < -1.0
    hovering.pilot.set(Setpoint("station", engaged=False))
    assert keeping(hovering) == (False, 0.0)


def test_surge_without_a_dvl_needs_odometry_that_knows_its_velocity(
    hindrax: Vehicle, ideal_vehicle: type[IdealVehicle]
) -> None:
    blind = replace(hindrax, sensors={name: hindrax.sensors[name] for name in hindrax.measuring("rates")})
    pilot, ideal = Pilot(blind), ideal_vehicle(blind)
    known = ideal.navigation()
    pilot.step(replace(known, velocity_mps=(math.nan, math.nan, 0.0)), ideal.stamp, armed=True)
    pilot.check(Goal(("yaw",)))
    for refuse in (pilot.check, pilot.fly):
        with pytest.raises(HindraxError, match="surge: nothing measures its velocity"):
            refuse(Goal(("surge",)))
    assert str(pilot.plans()["sway"]).startswith("sway: nothing measures")
    ideal.time_s += 0.02
    pilot.step(known, ideal.stamp, armed=True)
    pilot.check(Goal(("surge",)))
