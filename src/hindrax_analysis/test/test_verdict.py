"""The last screen of a result: a line a motion, and one next experiment with what it buys."""

import copy
import pickle
import sys
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from hindrax_analysis import terminal
from hindrax_analysis.correction import what_was_corrected
from hindrax_analysis.identification.verdict import (
    NextFlight,
    NextReport,
    show_next,
    show_verdicts,
)
from hindrax_analysis.next_step import lacking
from hindrax_analysis.report.run_page import _next
from hindrax_core.text import screen_text
from hindrax_core.text.digits import TWO_SIDED_95
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import array
from hindrax_ident.assess.influences import INFLUENCES
from hindrax_ident.assess.objections import Code, objection
from hindrax_ident.assess.results import DragBand, Interval, MotionResult, NextStep, Results
from hindrax_ident.remedies import FLY_TWICE, THRUSTER_SWEEP, WEIGH_THRUST, Remedy

SPEED, FORCE, STD = np.array([0.1, 0.4]), np.array([1.0, 20.0]), np.array([0.5, 2.0])
SURGE = MotionResult(
    "surge",
    "online",
    {},
    identifiable=True,
    drag=DragBand(SPEED, FORCE, 0.1 * STD, STD),
    quality={"held_out_rmse": 0.013, "held_out_rmse_stays_still": 0.24},
    next_step=NextStep(FLY_TWICE, 1.5),
)
SWAY = replace(
    SURGE,
    motion="sway",
    identifiable=False,
    drag=DragBand(SPEED, FORCE, STD, 3.0 * STD),
    quality={},
    next_step=NextStep(Remedy("wait until the water is still"), 4.0),
)


def rows(printed: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.split("\u2502")] for line in printed.splitlines() if "\u2502" in line]


def test_each_motion_has_a_line_with_the_interval_and_the_held_out_error(capsys: pytest.CaptureFixture[str]) -> None:
    show_verdicts({"surge": SURGE}, {})
    low, high = 20.0 - TWO_SIDED_95 * 2.0, 20.0 + TWO_SIDED_95 * 2.0
    wanted = ["surge", "20.0 N at 0.4 m/s", f"{low:.1f} to {high:.1f}", "10%", "0.013 (0.24)"]
    assert rows(capsys.readouterr().out) == [wanted]
    show_verdicts({"surge": SURGE, "sway": SWAY}, {"surge": 0.12})
    surge, sway = rows(capsys.readouterr().out)
    assert surge == [*wanted[:4], "12%", wanted[4]]
    assert sway[0] == "sway*", "not identifiable"
    assert sway[3:] == ["30%", "", ""]


def test_what_was_corrected_and_how_to_say_that_nothing_is(vehicle: Vehicle) -> None:
    center = array([0.9, 16.4])
    ends = (array(x * center) for x in (0.9, 1.1, 0.8, 1.2))
    drag = DragBand(SPEED, FORCE, 0.1 * STD, STD, Interval(center, *ends))
    motions = {"surge": replace(SURGE, drag=drag), "sway": SWAY, "yaw": replace(SURGE, drag=None)}
    said = what_was_corrected(Results(motions, vehicle))
    assert "surge -18%" in said
    assert "sway" not in said, "its drag is that of the fit"
    assert "`losses: false`" in said
    assert what_was_corrected(Results(motions, vehicle), remedy=False) == said.partition(";")[0]
    assert what_was_corrected(Results({"sway": SWAY}, vehicle)) == ""
    simulated = Results(motions, replace(vehicle, losses=False))
    assert what_was_corrected(simulated) == "no loss of thrust is corrected: `losses: false` in the vehicle file"


@pytest.mark.parametrize(
    ("force", "value", "low", "high"),
    [(-8e-7, 7e-8, -2.1e-3, 2.1e-3), (20.0, 16.4, -3.0, 36.0), (20.0, -4.0, -6.0, -2.0), (20.0, 41.0, 38.0, 44.0)],
    ids=["no more than noise", "interval reaches zero", "other direction", "twice the fit"],
)
def test_a_drag_that_may_be_zero_has_no_correction(
    vehicle: Vehicle, force: float, value: float, low: float, high: float
) -> None:
    """A rest of 9e-05 rad/s was "corrected by -108%" below the sentence that refuses it."""
    ends = (array([0.0, one]) for one in (low, high, low, high))
    drag = DragBand(SPEED, array([0.0, force]), STD, STD, Interval(array([0.0, value]), *ends))
    assert drag.correction is None
    refused = replace(SURGE, motion="yaw", drag=drag, identifiable=False)
    assert what_was_corrected(Results({"yaw": refused}, vehicle)) == ""
    said = what_was_corrected(Results({"yaw": replace(refused, identifiable=True)}, vehicle), remedy=False)
    assert said == "drag not known well enough to state its correction: yaw"


def test_what_has_no_drag_has_no_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    still = replace(SURGE, drag=None, quality={})
    show_verdicts({"surge": still, "sway": SWAY}, {})
    assert [row[0] for row in rows(capsys.readouterr().out)] == ["surge", "sway*"]
    show_verdicts({"surge": still}, {})
    show_verdicts({}, {})
    show_next({"surge": replace(SURGE, drag=None)}, NextFlight())
    show_next({}, NextFlight())
    assert capsys.readouterr().out == ""


def test_a_vehicle_behind_an_autopilot_is_flown_again_as_it_was_named(capsys: pytest.CaptureFixture[str]) -> None:
    """Its file was a copy in a folder that is gone."""
    again = ("--autopilot", "tcp:127.0.0.1:5760", "--vehicle", "my rov.yaml", "--set", "autopilot.barometer:=1")
    show_next({"surge": SURGE, "sway": SWAY}, NextFlight(vehicle="/tmp/copy.yaml", again=again))
    words = "--autopilot tcp:127.0.0.1:5760 --vehicle 'my rov.yaml' --set autopilot.barometer:=1 --dof sway"
    assert capsys.readouterr().out.splitlines()[1:] == [f"  ./hindrax pool-test {words}"]


def test_the_next_experiment_is_that_of_the_worst_motion_and_states_what_it_buys(
    capsys: pytest.CaptureFixture[str],
) -> None:
    show_next({"surge": SURGE, "sway": SWAY}, NextFlight())
    assert capsys.readouterr().out == (
        "best next step: wait until the water is still; std of the drag of sway 30.0% -> 20.0% at best\n"
        "  ./hindrax pool-test --dof sway\n"
    )
    still = replace(SWAY, drag=DragBand(SPEED, FORCE, STD, 900.0 * STD))
    show_next({"surge": SURGE, "sway": still}, NextFlight())
    assert "std of the drag of surge" in capsys.readouterr().out, "sway hardly moved"
    show_next({"heave_down": replace(SURGE, motion="heave_down")}, NextFlight(["--mock"]))
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == f"best next step: {FLY_TWICE}; std of the drag of heave_down 10.0% -> 7.5% at best"
    assert printed[1:] == ["  ./hindrax pool-test --mock --dof heave"]


def test_where_no_step_makes_a_drag_known_it_says_what_the_record_lacks_and_no_such_numbers(
    capsys: pytest.CaptureFixture[str],
) -> None:
    unknown = objection(Code.UNKNOWN_DRAG, wanted=0.2, influence="drag of the tether", remedy="fly near its end")
    still = objection(Code.HARDLY_MOVED, speed=0.01, unit="m/s")
    wide = replace(
        SURGE,
        identifiable=False,
        drag=DragBand(SPEED, FORCE, STD, 400.0 * STD),
        reasons=(unknown, still),
        next_step=NextStep(WEIGH_THRUST, 220.0),
    )
    wider = replace(wide, motion="sway", next_step=NextStep(WEIGH_THRUST, 700.0))
    show_verdicts({"surge": wide}, {})
    assert rows(capsys.readouterr().out)[0][3] == ">100%"
    show_next({"sway": wider, "surge": wide}, NextFlight())
    assert capsys.readouterr().out == (
        f"best next step: another record of surge; this one lacks: {still}\n  ./hindrax pool-test --dof surge\n"
    )
    on_page = _next(wide)
    assert str(still) in on_page
    assert "%" not in on_page
    assert lacking(replace(wide, reasons=(unknown,))) == unknown, "there is nothing else"
    assert "fly it faster" in lacking(replace(wide, reasons=()))
    show_next({"surge": replace(wide, next_step=NextStep(FLY_TWICE, 8.0))}, NextFlight())
    bought = "std of the drag of surge >100% -> 40.0% at best"
    assert capsys.readouterr().out.splitlines()[0] == f"best next step: {FLY_TWICE}; {bought}"


def test_where_motions_run_against_their_thrust_no_other_record_is_the_next_step(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Of a force with the sign of other axes, twice the time was said to make the drag better known."""
    turned = objection(Code.AGAINST_THRUST)
    sway = replace(SWAY, reasons=(objection(Code.HARDLY_MOVED, speed=0.01, unit="m/s"), turned))
    motions = {"surge": SURGE, "sway": sway, "yaw": replace(sway, motion="yaw")}
    assert _next(sway) == f"<p>Best next step: {turned}.</p>"
    show_next(motions, NextReport("./hindrax identify a.csv --report a.html"))
    assert capsys.readouterr().out == (
        f"best next step: sway, yaw: {turned}\n  ./hindrax identify a.csv --report a.html\n"
    )


@pytest.mark.parametrize(
    ("flight", "motion", "words"),
    [
        (NextFlight(["--mock"]), "surge", "./hindrax pool-test --session --mock --dof surge"),
        (NextFlight(again=("--autopilot", "udpin:0.0.0.0:14550")), "surge", "./hindrax weigh --help"),
        (NextFlight(["--mock"], "ideal"), "surge", "./hindrax pool-test --session --mock --world ideal --dof surge"),
        (NextFlight(), "heave_up", "./hindrax pool-test --session --load 15 --dof heave"),
        (NextFlight(), "yaw", "./hindrax pool-test --session --load 15 --lever 0.15 --dof yaw"),
        (
            NextFlight(["--mock"], vehicle="my rov.yaml"),
            "sway",
            "./hindrax pool-test --session --mock --vehicle 'my rov.yaml' --dof sway",
        ),
        (NextFlight(), "roll", "./hindrax bollard --help"),
    ],
)
def test_a_weighing_is_the_session_of_a_pool_day(flight: NextFlight, motion: str, words: str) -> None:
    assert " ".join(flight.words(motion, WEIGH_THRUST)) == words


@pytest.mark.parametrize("remedy", sorted({row.remedy for row in INFLUENCES} | {FLY_TWICE}))
def test_every_step_has_a_command(remedy: Remedy) -> None:
    water, mock = NextFlight(), NextFlight(["--mock"], "pool,wake=0.1")
    for flight in (water, mock):
        for motion in ("surge", "roll"):
            assert flight.words(motion, remedy)[0] == "./hindrax"
    assert NextReport("./hindrax identify a.csv --report a.html").words("surge", remedy)
    if remedy.condition:
        named = f" --world pool,wake=0.1,{remedy.condition}=0"
        assert f"./hindrax pool-test --mock{named} --dof roll" == " ".join(mock.words("roll", remedy))


def test_a_step_whose_command_is_not_installed_is_followed_by_the_report() -> None:
    sweep, again = Remedy("measure it", THRUSTER_SWEEP), "./hindrax identify a.csv --report a.html"
    assert NextReport(again).words("surge", sweep) == [THRUSTER_SWEEP]
    assert NextReport(again, lambda name: name != "thruster").words("surge", sweep) == [again]


def test_a_remedy_in_other_words_keeps_its_command() -> None:
    said = Remedy("weigh it", THRUSTER_SWEEP, "wake")
    assert NextFlight().words("surge", said) == THRUSTER_SWEEP.split()
    assert copy.deepcopy(said).command == pickle.loads(pickle.dumps(said)).command == THRUSTER_SWEEP
    assert NextFlight(["--mock"]).words("surge", Remedy("rest", condition="wake"))[-3] == "pool,wake=0"


def test_the_last_screen_of_all_motions_is_one_screen(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(terminal, "console", lambda: Console(width=80, file=sys.stdout))
    monkeypatch.setattr(screen_text, "screen_width", lambda _: 80)
    forces = DragBand(SPEED * 1.11, 0.0444 * FORCE, STD, 0.5 * STD)
    motions = {
        name: replace(SURGE, motion=name, identifiable=False, drag=forces, next_step=NextStep(WEIGH_THRUST, 1.0))
        for name in ("surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw")
    }
    show_verdicts(motions, {})
    show_next(motions, NextFlight(["--mock"]))
    printed = capsys.readouterr().out
    lines = printed.splitlines()
    assert len(rows(printed)) == len(motions)
    assert "no room" not in printed, "of no column"
    assert max(map(len, lines)) <= 80
    assert len(lines) <= 24 - 4, "what aborted it, its pace, the report and the prompt stand there too"
