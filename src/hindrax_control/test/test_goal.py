"""Goals without a flight: what a goal must hold, when it may begin, and each sentence of a refusal."""

import re
from dataclasses import replace

import pytest

from hindrax_control.maneuver.goal import (
    BUSY,
    ENDINGS,
    EXCITATIONS,
    MOST_LEVELS,
    MOST_MOTIONS,
    PLATEAUS,
    Goal,
    check_goal,
    no_state,
    not_armed,
    require_ready,
    unobeyed,
)
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.refusals import SENSELESS, Reason
from hindrax_core.vehicle import AXES

SURGE = Goal(("surge",))


def test_the_usual_goal() -> None:
    assert (SURGE.excitation, SURGE.seed, SURGE.on_cancel, SURGE.levels) == ("plateaus", 0, "hold", ())
    check_goal(SURGE)


@pytest.mark.parametrize(
    "goal",
    [
        Goal(AXES),
        Goal(("surge",) * MOST_MOTIONS),
        *(Goal(AXES, excitation=one) for one in (PLATEAUS, *EXCITATIONS)),
        *(replace(SURGE, on_cancel=one) for one in ENDINGS),
        replace(SURGE, levels=(0.0, 0.5, 1.0)),
        replace(SURGE, levels=(1.0,) * MOST_LEVELS),
    ],
)
def test_goals_that_are_taken(goal: Goal) -> None:
    check_goal(goal)


@pytest.mark.parametrize(
    ("goal", "sentence"),
    [
        (Goal(()), "goal: no motion, wanted some of surge, sway, heave, roll, pitch, yaw"),
        (Goal(("surge",) * 13), "goal: 13 motions, wanted at most 12; fly the rest after them"),
        (Goal(("surge", "up")), "goal: motion 'up' unknown, wanted one of surge, sway, heave, roll, pitch, yaw"),
        (
            replace(SURGE, excitation="noise"),
            "goal: excitation 'noise' unknown, wanted plateaus or steps, doublets, chirp, multisine",
        ),
        (replace(SURGE, on_cancel="sink"), "goal: ending 'sink' unknown, wanted hold or neutral"),
        (
            Goal(("surge", "sway"), levels=(0.5,)),
            "goal: levels of surge, sway by plateaus, wanted the levels of one motion by plateaus",
        ),
        (
            replace(SURGE, excitation="chirp", levels=(0.5,)),
            "goal: levels of surge by chirp, wanted the levels of one motion by plateaus",
        ),
        (replace(SURGE, levels=(0.5,) * 21), "goal: 21 levels, wanted at most 20; fly the rest after them"),
        (replace(SURGE, levels=(0.5, 1.01)), "goal: level 1.01, wanted 0 (the slowest plateau) to 1 (the fastest)"),
        (replace(SURGE, levels=(-0.01,)), "goal: level -0.01, wanted 0 (the slowest plateau) to 1 (the fastest)"),
        (replace(SURGE, levels=(float("nan"),)), "goal: level nan, wanted 0 (the slowest plateau) to 1 (the fastest)"),
    ],
)
def test_each_fault_of_a_goal_has_its_sentence(goal: Goal, sentence: str) -> None:
    with pytest.raises(UsageError, match=f"^{re.escape(sentence)}$"):
        check_goal(goal)


READY = {
    "flying": False,
    "armed": True,
    "unarmed": "",
    "disobeying": "",
    "guards": (),
    "heading_known": True,
}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"flying": True, "armed": False}, BUSY),
        ({"armed": False, "unarmed": "leak"}, "the vehicle is not armed (leak); `./hindrax arm` first"),
        ({"armed": False, "disobeying": "two publishers"}, "the vehicle is not armed; `./hindrax arm` first"),
        ({"disobeying": "two publishers", "guards": ("a",)}, unobeyed("two publishers")),
        ({"guards": ("depth_band: 9 m", "speed"), "heading_known": False}, "depth_band: 9 m"),
        (
            {"heading_known": False},
            "the heading is unknown; see which sensor is silent (`./hindrax doctor`), then fly again",
        ),
    ],
)
def test_a_maneuver_begins_when_nothing_speaks_against_it(change: dict[str, object], sentence: str) -> None:
    require_ready(**READY)  # type: ignore[arg-type]  # a table of arguments
    with pytest.raises(HindraxError, match=f"^{re.escape(sentence)}$"):
        require_ready(**(READY | change))  # type: ignore[arg-type]  # as above


def test_what_keeps_the_thrusters_from_turning_is_named() -> None:
    assert not_armed("") == "the vehicle is not armed; `./hindrax arm` first"
    assert unobeyed("no command is taken").startswith("the thrusters are armed, but no command is taken; disarm")


def test_a_computer_that_stood_still_blames_no_sensor() -> None:
    assert "no state of the vehicle yet, so" in no_state(None, 60.0, 5.0)
    assert "no state of the vehicle for 6 s, so" in no_state(6.0, 0.5, 5.0)
    stood = no_state(10.0, 9.9, 5.0)
    assert stood.startswith("navigation: the pilot itself stood still for 10 s, in which the thrusters went neutral; ")
    assert SENSELESS not in stood
    assert stood.reason is Reason.NAVIGATION
