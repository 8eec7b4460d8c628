"""What the pilot tells of what it was told: a setpoint that is refused is seen in the state of its hold."""

from __future__ import annotations

import math
from typing import Any

import pytest
from ideal_vehicle import IdealVehicle

from hindrax_control.hold.holds import Setpoint
from hindrax_control.maneuver.goal import Goal
from hindrax_control.pilot import REFUSAL_S, Pilot, PilotOutput
from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import Vehicle


class Hovering:
    """A vehicle that hangs still; `notes` are those of the holds after a step."""

    def __init__(self, vehicle: Vehicle, ideal: IdealVehicle) -> None:
        self.pilot, self.ideal = Pilot(vehicle), ideal

    def fly(self, *, armed: bool = True, seconds: float = 0.02) -> PilotOutput:
        self.ideal.time_s += seconds
        return self.pilot.step(self.ideal.navigation(), self.ideal.stamp, armed=armed)

    def step(self, *, armed: bool = True, seconds: float = 0.02) -> dict[str, Any]:
        flight = self.fly(armed=armed, seconds=seconds)
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
    hovering.pilot.refuse("heading", "hold heading: 3.0 s old")
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
    assert maneuver.last.aborted.startswith("leak: found water in the hull")
    with pytest.raises(HindraxError, match=r"leak: .*surface, disarm and open the hull"):
        hovering.pilot.fly(Goal(("surge",)))
    assert hovering.pilot.set(Setpoint("depth", value=0.2)) == ""


# ---- place in the pool


def place(hovering: Hovering) -> tuple[float, float]:
    """Where the pilot takes the vehicle to be now [m]."""
    hovering.fly()
    pool = hovering.pilot.pool
    assert pool is not None
    at = pool.place(hovering.ideal.navigation())
    return (at.x_m, at.y_m)


def test_after_a_restart_no_maneuver_begins_until_somebody_says_where_the_vehicle_is(hovering: Hovering) -> None:
    hovering.pilot.lose_place("the vehicle was armed before")
    assert hovering.fly().guards[0].startswith("pool_box: the vehicle was armed before, wanted a known place")
    with pytest.raises(HindraxError, match=r"pool_box: .*hindrax recentre"):
        hovering.pilot.fly(Goal(("surge",)))
    assert hovering.pilot.set(Setpoint("depth", value=0.5)) == ""
    assert hovering.pilot.recentre(4.0, 2.0) == ""
    assert hovering.fly().guards == ()
    assert place(hovering) == pytest.approx((4.0, 2.0))
    hovering.pilot.fly(Goal(("surge",)))


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
        assert guards[0].startswith("pool_box: the odometry began anew after the vehicle was armed")
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
    hovering.ideal.north += 0.5
    engaged, force = keeping(hovering)
    assert engaged
    assert force < -1.0
    hovering.pilot.set(Setpoint("station", engaged=False))
    assert keeping(hovering) == (False, 0.0)


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
