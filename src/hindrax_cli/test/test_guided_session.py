"""The guided session on the command line: what it refuses, and a whole one with flights and estimates of a stand-in."""

import contextlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import pytest
import yaml

from hindrax_analysis.identification.pool_session import PoolSession, Reached, Step, load, save
from hindrax_analysis.identification.supply_at_rest import RestVolts
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.share_files import default_vehicle
from hindrax_cli.command_line import main
from hindrax_cli.commands.pool import guided_session, lockstep_session, session_by_action, session_steps
from hindrax_cli.commands.pool.lockstep_session import SessionTrial, session_summary
from hindrax_cli.commands.pool.session_steps import StackStepRunner
from hindrax_control.commissioning.findings import OPEN, PROVEN, WRONG, Finding, Findings, Mend
from hindrax_control.commissioning.record import unproven
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, Stamped
from hindrax_core.signals import Thrust
from hindrax_core.text.refusals import NOTHING, STOPPED, Reason, Refusal
from hindrax_core.vehicle import AxisGain, Vehicle, load_vehicle
from hindrax_operator.pool_run import Act, FlownManeuver, PoolOptions
from hindrax_operator.progress import Progress
from hindrax_operator.session_question import answer, asked
from hindrax_sim.flights.weighing_flight import WeighingFlight

if TYPE_CHECKING:
    from hindrax_operator.nodes.operator_node import Operator


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["--until", "2%"], "--until"),
        (["--plan"], "--plan"),
        (["--excitation", "multisine"], "--excitation multisine"),
        (["--mock", "--fault", "dvl75:dead"], "--fault"),
    ],
)
def test_a_session_refuses_options_of_a_single_flight(
    words: list[str], found: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["pool-test", "--session", str(tmp_path / "day"), *words]) == 2
    assert f"--session: found {found}" in capsys.readouterr().err
    assert not (tmp_path / "day").exists()


def test_a_graph_that_no_stack_can_have_spends_no_steps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "abc")
    assert main(["pool-test", "--session", str(tmp_path / "day"), "--mock"]) == 2
    assert "ROS_DOMAIN_ID: found 'abc'" in capsys.readouterr().err
    assert not (tmp_path / "day").exists()


def test_options_of_a_session_need_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["pool-test", "--mock", "--load", "15"]) == 2
    assert "found --load without --session" in capsys.readouterr().err


def test_without_a_terminal_nobody_can_do_the_steps_of_a_person(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["pool-test", "--session", str(tmp_path / "day"), "--load", "15"]) == 2
    assert "found no terminal for the steps of a person" in capsys.readouterr().err


def test_a_load_that_pulls_the_vehicle_away_is_refused_before_anything_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["pool-test", "--session", str(tmp_path / "day"), "--yes", "--load", "5000"]) == 2
    assert "weigh surge: found a load of 5000 N" in capsys.readouterr().err


def flights_without_a_stack(
    patch: pytest.MonkeyPatch, *, interrupt: bool = False, failures: Sequence[str] = ()
) -> list[str]:
    """Legs that fly nothing, checks, weighings and estimates of fixed size; the names of the legs that were flown."""
    flown, fails = list[str](), list(failures)

    def fly(_options: PoolOptions, folder: RunFolder, *_: object) -> FlownManeuver:
        folder.bag.mkdir()
        if fails:
            raise HindraxError(fails.pop())
        flown.append(folder.path.name)
        return FlownManeuver(armed=True, interrupted=interrupt, vehicle_s=90.0)

    def weigh(*_: object) -> tuple[AxisGain, float, str]:
        return AxisGain(load=15.0, sigma=0.004, positive=0.94, negative=0.94), 200.0, ""

    def estimate(
        _runner: StackStepRunner, bags: Mapping[Path, RestVolts | None], session: PoolSession
    ) -> Mapping[str, Reached]:
        drag = 0.2 / (len(bags) + len(session.gains))
        return {"surge": Reached(drag, 0.05, drag, drag, 0.06, "own wake", "rest between legs")}

    patch.setattr(session_steps, "fly", fly)
    patch.setattr(StackStepRunner, "thrusters", lambda *_: (50.0, ""))
    patch.setattr(StackStepRunner, "weigh", weigh)
    patch.setattr(StackStepRunner, "estimate", estimate)
    return flown


def test_ctrl_c_ends_a_session_that_goes_on_as_it_began(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    day = tmp_path / "day"
    flights_without_a_stack(monkeypatch, interrupt=True)
    assert main(["pool-test", "--session", str(day), "--mock", "--seed", "7"]) == 130
    assert f"`./hindrax pool-test --session {day} --mock` goes on" in capsys.readouterr().err
    assert main(["pool-test", "--session", str(day)]) == 2
    assert "was begun with --mock, found without" in capsys.readouterr().err
    kept = yaml.safe_load((day / "session.yaml").read_text())
    assert kept["settings"]["mock"] == {"seed": 7, "world": "pool"}
    assert [step["name"] for step in kept["done"]] == ["tether", "thrusters"]
    flown = flights_without_a_stack(monkeypatch)
    # Bags without contents: the last identification says so, when all steps are done and kept.
    assert main(["pool-test", "--session", str(day), "--mock"]) != 0
    said = capsys.readouterr().err
    assert flown == ["legs-1-again", "legs-2"]
    assert "weigh surge: drag of surge 20.0% -> 10.0%, wanted 5%" in said
    kept = yaml.safe_load((day / "session.yaml").read_text())
    assert [step["name"] for step in kept["done"]] == ["tether", "thrusters", "legs 1", "weigh surge", "legs 2"]


def test_the_folder_of_a_session_is_named_once_by_either_option(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    flights_without_a_stack(monkeypatch)
    day = str(tmp_path / "day")
    main(["pool-test", "--session", "--mock", "--out", day, "--repeats", "1"])
    assert (tmp_path / "day" / "session.yaml").is_file()
    capsys.readouterr()
    assert main(["pool-test", "--session", day, "--mock", "--out", str(tmp_path / "other")]) == 2
    assert f"--session {day} names the folder already" in capsys.readouterr().err


def test_a_page_shows_what_is_to_be_done_before_the_legs_and_only_enter_arms(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    day, asking = tmp_path / "day", list[str]()

    def tap(_pause_s: float) -> None:
        question = asked(day)
        assert question is not None
        asking.append(question.sentence)
        assert not answer(day, question.number)

    flights_without_a_stack(monkeypatch)
    monkeypatch.setattr(guided_session, "require_tty", lambda: None)
    monkeypatch.setattr(session_steps, "forget_what_was_typed", lambda: None)
    monkeypatch.setattr(session_steps, "entered", lambda: bool(asking))
    monkeypatch.setattr(session_steps, "entered_line", lambda: "" if len(asking) == 2 else None)
    monkeypatch.setattr("time.sleep", tap)
    main(["pool-test", "--session", str(day), "--repeats", "1", "--uncommissioned"])
    assert asking == [session_steps.LEAD_AWAY, f"{session_steps.READ_SUPPLY}; Enter alone: it cannot be read"]
    assert "then press Enter" in capsys.readouterr().err
    assert yaml.safe_load((day / "session.yaml").read_text())["done"][0]["remark"] == ""
    assert asked(day) is None


@pytest.mark.parametrize(
    ("lines", "volts"),
    [
        (["16.4", "15.9", "", "15.2"], [[16.4, 15.9], [15.9, 15.2]]),
        ([""], [None, None]),
        (["4.1", "four", "16.4 V", "", "", ""], [[16.4, 16.4], [16.4, 16.4]]),
    ],
)
def test_who_can_read_the_supply_is_asked_before_and_after_each_flight(
    lines: list[str],
    volts: list[list[float] | None],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    typed = list(lines)
    flights_without_a_stack(monkeypatch)
    monkeypatch.setattr(guided_session, "require_tty", lambda: None)
    monkeypatch.setattr(session_steps, "forget_what_was_typed", lambda: None)
    monkeypatch.setattr(session_steps, "entered", lambda: True)
    monkeypatch.setattr(session_steps, "entered_line", lambda: typed.pop(0))
    main(["pool-test", "--session", str(tmp_path / "day"), "--dof", "roll", "--repeats", "2", "--uncommissioned"])
    said = capsys.readouterr().err
    done = yaml.safe_load((tmp_path / "day" / "session.yaml").read_text())["done"]
    found = [step["volts"] and [*step["volts"].values()] for step in done if step["name"].startswith("legs")]
    assert found == volts
    assert not typed
    assert said.count("legs 1: thrust is that at 16.4 V, falling to ") == (volts[0] is not None)
    # Of one cell, and no number at all.
    for refused in {"4.1", "four"} & set(lines):
        assert f"found '{refused}', wanted the volts of the supply, 11.1 to 18.5" in said


def test_a_supply_that_a_sensor_measures_is_not_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flights_without_a_stack(monkeypatch)
    monkeypatch.setattr(guided_session, "require_tty", lambda: None)
    monkeypatch.setattr(session_steps, "forget_what_was_typed", lambda: None)
    monkeypatch.setattr(session_steps, "entered", lambda: True)
    monkeypatch.setattr(session_steps, "entered_line", lambda: pytest.fail("asked for the supply"))
    plain = yaml.safe_load(default_vehicle().read_text())
    optional = default_vehicle().parent.parent / "config" / "optional_sensors.yaml"
    plain["sensors"]["ina226"] = yaml.safe_load(optional.read_text())["ina226"]
    (tmp_path / "supplied.yaml").write_text(yaml.safe_dump(plain))
    words = ["--dof", "yaw", "--repeats", "1", "--uncommissioned", "--vehicle", str(tmp_path / "supplied.yaml")]
    main(["pool-test", "--session", str(tmp_path / "day"), *words])
    assert yaml.safe_load((tmp_path / "day" / "session.yaml").read_text())["done"][2]["volts"] is None


def test_legs_that_did_not_start_are_tried_once_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    flown = flights_without_a_stack(monkeypatch, failures=["the thrusters stopped arming"])
    day = tmp_path / "day"
    main(["pool-test", "--session", str(day), "--mock", "--repeats", "1"])
    assert "legs did not start: the thrusters stopped arming" in capsys.readouterr().err
    assert flown == ["legs-1-again"]
    legs = yaml.safe_load((day / "session.yaml").read_text())["done"][2]
    assert (legs["folder"], legs["remark"]) == ("legs-1-again", "")


def test_the_summary_of_sessions_has_the_goal_beside_what_was_reached() -> None:
    def at(drag: float) -> Mapping[str, Reached]:
        return {"surge": Reached(drag, 0.05, drag, drag, 0.04, "own wake", "")}

    steps = (Step("legs 1", seconds=60.0, reached=at(0.2)), Step("weigh surge", seconds=60.0, reached=at(0.08)))
    trials = [
        SessionTrial(seed, (*steps, Step("legs 2", seconds=60.0, reached=at(last))), {"surge": error})
        for seed, last, error in ((1, 0.06, 0.5), (2, 0.07, -2.5), (3, 0.08, 1.0))
    ]
    document = session_summary(trials)
    (row,) = document["motions"]
    assert (document["runs"], document["minutes"]) == (3, 3.0)
    assert (row["goal_drag"], row["drag_first"], row["drag_weighed"], row["drag"]) == (0.05, 0.2, 0.08, 0.07)
    assert row["drag_p90"] == pytest.approx(0.078)
    assert row["coverage95"] == pytest.approx(2.0 / 3.0)
    assert row["cause"] == "own wake"
    assert document["errors"] == {"1": {"surge": 0.5}, "2": {"surge": -2.5}, "3": {"surge": 1.0}}
    json.dumps(document)


def test_a_weighing_that_a_guard_ends_costs_its_gain_and_not_the_session(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of forty sessions in mock the fourth drifted toward a wall, and the other thirty-nine were lost with it."""
    spans = [(Stamp(0), Stamp(20_000_000_000), 1.0)]
    flight = WeighingFlight([Stamped(Stamp(10**9 + n), Thrust((1.0,) * 6)) for n in range(50)], spans)
    monkeypatch.setattr(lockstep_session, "fly_weighing", lambda *_: flight)
    vehicle = load_vehicle(default_vehicle())
    gain, seconds, remark = lockstep_session.weigh_in_lockstep(vehicle, "surge", "pool", 4)
    assert (gain, seconds) == (None, 20.0)
    assert remark == "hold with +1: found 50 wrenches and 0 velocities in 20 s, wanted 40 and 2"
    ended = replace(flight, aborted="weigh surge: disarmed")
    monkeypatch.setattr(lockstep_session, "fly_weighing", lambda *_: ended)
    assert lockstep_session.weigh_in_lockstep(vehicle, "surge", "pool", 4) == (None, 20.0, "weigh surge: disarmed")


@pytest.mark.parametrize(
    ("mock", "drag", "words"),
    [
        ({"seed": 1, "world": "pool"}, 0.09, "pool-test --session --mock --vehicle {}/vehicle.yaml --dof heave"),
        ({"seed": 1, "world": "ideal"}, 0.09, "--session --mock --world ideal --vehicle {}/vehicle.yaml --dof heave"),
        (None, 0.09, "pool-test --session --vehicle {}/vehicle.yaml --dof heave"),
        (None, math.nan, "pool-test --session --vehicle {}/vehicle.yaml --dof surge heave"),
        (None, 0.01, "./hindrax tune {0}/coefficients.yaml --vehicle {0}/vehicle.yaml"),
    ],
)
def test_the_end_of_a_session_names_the_next_command(mock: object, drag: float, words: str, tmp_path: Path) -> None:
    reached = Reached(drag, 0.1, drag, drag, drag, "own wake", "rest")
    session = PoolSession({"mock": mock, "motions": ["surge", "heave"]}, ())
    session = replace(session, done=(Step("legs 1", reached={"heave_down": reached}),))
    assert words.format(tmp_path) in guided_session.next_command(session, RunFolder(tmp_path))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"vehicle": ""}, "./hindrax pool-test --session --dof surge"),
        ({"vehicle": "lbv", "load_N": 15.0, "lever_m": 0.3}, "--load 15 --lever 0.3 --vehicle lbv --dof surge"),
    ],
)
def test_the_next_command_has_the_words_that_the_session_was_begun_with(more: dict[str, object], words: str) -> None:
    reached = Reached(0.09, 0.1, 0.09, 0.09, 0.09, "own wake", "rest")
    session = PoolSession(
        {"mock": None, "motions": ["surge"], **more}, (), (Step("legs 1", reached={"surge": reached}),)
    )
    assert guided_session.next_command(session, RunFolder(Path("/runs/1"))).endswith(words)
    good = replace(session, done=(Step("legs 1", reached={"surge": replace(reached, drag=0.01)}),))
    here = RunFolder(Path.cwd() / "runs" / "1")
    words = "./hindrax tune runs/1/coefficients.yaml --vehicle runs/1/vehicle.yaml"
    assert guided_session.next_command(good, here) == words


class StandInServer:
    """Goals of a client that has given them before, and how each ended."""

    def __init__(self, *goals: tuple[list[str], int]) -> None:
        self._goals = list(goals)
        self.cancelled = False
        self.shown: list[str] = []
        self.ended: list[tuple[Reason, str, bool]] = []
        self.aborted = NOTHING

    def goal(self) -> SimpleNamespace:
        motions, repeats = self._goals.pop(0)
        return SimpleNamespace(motions=motions, repeats=repeats)

    def show(self, session: PoolSession, _folder: Path) -> None:
        self.shown.append(", ".join(session.left))
        self.aborted = session.aborted

    def end(self, aborted: Refusal, *, identified: bool = False) -> None:
        self.ended.append((aborted.reason, str(aborted), identified))


def by_action(patch: pytest.MonkeyPatch, *goals: tuple[list[str], int]) -> StandInServer:
    """Have `--action` served by a stand-in."""
    server = StandInServer(*goals)
    patch.setattr(session_by_action, "served", lambda **_: contextlib.nullcontext(server))
    return server


def test_a_goal_chooses_motions_and_repeats_and_one_that_cannot_be_flown_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    day = tmp_path / "day"
    flown = flights_without_a_stack(monkeypatch)
    server = by_action(monkeypatch, (["sideways"], 0), (["yaw"], 1))
    assert main(["pool-test", "--session", str(day), "--mock", "--action"]) != 0  # its bags hold nothing
    (refused, sentence, _), (*_, identified) = server.ended
    assert refused is Reason.GOAL
    assert "sideways" in sentence
    assert not identified
    assert flown == ["legs-1"]
    steps = ["tether", "thrusters", "legs 1", "weigh yaw"]
    assert server.shown == [", ".join(steps[done:]) for done in range(5)]
    assert yaml.safe_load((day / "session.yaml").read_text())["settings"]["motions"] == ["yaw"]
    again = by_action(monkeypatch, (["surge"], 0), ([], 0))
    main(["pool-test", "--session", str(day), "--mock", "--action"])
    assert "wanted neither: it goes on as it began" in again.ended[0][1]


def test_a_client_that_cancels_gets_that_and_a_ctrl_c_is_told_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flights_without_a_stack(monkeypatch, interrupt=True)
    for cancelled, reason in ((True, Reason.CANCELLED), (False, Reason.OPERATOR)):
        server = by_action(monkeypatch, ([], 0))
        server.cancelled = cancelled
        assert main(["pool-test", "--session", str(tmp_path / str(reason)), "--mock", "--action"]) == 130
        assert [one[0] for one in server.ended] == [reason]


def test_what_a_session_flies_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    flights_without_a_stack(monkeypatch)
    by_action(monkeypatch, ([], 0))
    main(["pool-test", "--session", str(tmp_path / "day"), "--mock", "--action"])
    assert capsys.readouterr().err.count("hindrax flies surge") == 1
    by_action(monkeypatch, ([], 0))
    main(["pool-test", "--session", str(tmp_path / "day"), "--mock", "--action"])
    assert capsys.readouterr().err.count("goes on with the vehicle") == 1


def test_why_legs_were_aborted_is_told_to_the_client_by_its_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flights_without_a_stack(monkeypatch, failures=["pool_box: too near to a wall", "pool_box: too near to a wall"])
    server = by_action(monkeypatch, ([], 1))
    assert main(["pool-test", "--session", str(tmp_path / "day"), "--mock", "--action"]) == 1
    assert "no legs were flown" in server.ended[0][1]
    assert (server.aborted.reason, str(server.aborted)) == (
        Reason.POOL_BOX,
        "legs 1: aborted twice, by pool_box: too near to a wall",
    )


def test_no_client_arms_a_real_vehicle(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    day, asking, flown_before = tmp_path / "day", list[str](), list[list[str]]()
    assert main(["pool-test", "--session", str(day), "--action", "--yes"]) == 2
    assert "--action: found --yes too, wanted a person at this terminal" in capsys.readouterr().err
    assert main(["pool-test", "--session", str(day), "--action"]) == 2
    assert "found no terminal" in capsys.readouterr().err
    flown = flights_without_a_stack(monkeypatch)

    def tap(_pause_s: float) -> None:
        question = asked(day)
        assert question is not None
        assert question.arms
        asking.append(question.sentence)
        flown_before.append(list(flown))

    monkeypatch.setattr(guided_session, "require_tty", lambda: None)
    monkeypatch.setattr(session_steps, "forget_what_was_typed", lambda: None)
    monkeypatch.setattr(session_steps, "entered", lambda: bool(asking))
    monkeypatch.setattr(session_steps, "entered_line", lambda: "")
    monkeypatch.setattr("time.sleep", tap)
    by_action(monkeypatch, ([], 1))
    main(["pool-test", "--session", str(day), "--action", "--uncommissioned"])
    assert (asking, flown_before) == ([session_steps.LEAD_AWAY], [[]])
    # Its tether was led away, so no step asks: the client that goes on waits for Enter all the same.
    kept = load(day)
    save(replace(kept, done=kept.done[:2]), day)
    for before in (asking, flown_before, flown):
        before.clear()
    by_action(monkeypatch, ([], 0))
    main(["pool-test", "--session", str(day), "--action", "--uncommissioned"])
    assert (asking, flown_before) == ([session_steps.GO_ON], [[]])
    assert flown == ["legs-1-again"]


def test_nothing_is_armed_again_while_a_weight_is_taken_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The next step began by itself, seconds after "take the weight off": hands were at a vehicle that armed."""
    day, happened = tmp_path / "day", list[str]()
    weigh = StackStepRunner.weigh
    flights_without_a_stack(monkeypatch)

    def fly(_options: PoolOptions, folder: RunFolder, *_: object) -> FlownManeuver:
        folder.bag.mkdir()
        happened.append(folder.path.name)
        return FlownManeuver(armed=True, vehicle_s=90.0)

    def enter() -> bool:
        question = asked(day)
        assert question is not None
        assert question.arms
        happened.append(question.sentence)
        return True

    monkeypatch.setattr(session_steps, "fly", fly)
    monkeypatch.setattr(StackStepRunner, "weigh", weigh)
    monkeypatch.setattr(guided_session, "require_tty", lambda: None)
    monkeypatch.setattr(session_steps, "forget_what_was_typed", lambda: None)
    monkeypatch.setattr(session_steps, "entered", enter)
    monkeypatch.setattr(session_steps, "entered_line", lambda: "")
    main(["pool-test", "--session", str(day), "--load", "15", "--uncommissioned"])
    off = session_steps.TAKE_OFF
    assert happened == [session_steps.LEAD_AWAY, "legs-1", "weigh-surge", off, "legs-2"]


def test_legs_that_were_aborted_are_flown_again_when_somebody_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The remedy of an abort is often a person's, such as to bring the vehicle back to the middle of the pool."""
    day, asking = tmp_path / "day", list[str]()
    flown = flights_without_a_stack(monkeypatch, failures=["pool_box: too near to a wall"])

    def enter() -> bool:
        question = asked(day)
        assert question is not None
        assert question.arms
        assert flown == []
        asking.append(question.sentence)
        return True

    monkeypatch.setattr(guided_session, "require_tty", lambda: None)
    monkeypatch.setattr(session_steps, "forget_what_was_typed", lambda: None)
    monkeypatch.setattr(session_steps, "entered", enter)
    monkeypatch.setattr(session_steps, "entered_line", lambda: "")
    main(["pool-test", "--session", str(day), "--repeats", "1", "--uncommissioned"])
    assert asking[0] == session_steps.LEAD_AWAY
    assert asking[1:] == [session_steps.AGAIN.format("pool_box: too near to a wall")]
    assert flown == ["legs-1-again"]


def checked(patch: pytest.MonkeyPatch, findings: Findings) -> list[str]:
    """Have the check of the thrusters find this, on a stack that is none; the names of the legs that were flown."""
    flown, thrusters = list[str](), StackStepRunner.thrusters
    flights_without_a_stack(patch)

    def fly(
        options: PoolOptions, folder: RunFolder, progress: Progress, act: Act | None = None, *, arm: bool = True
    ) -> FlownManeuver:
        folder.bag.mkdir()
        if act is None:
            flown.append(folder.path.name)
            return FlownManeuver(armed=True, vehicle_s=90.0)
        assert not arm, "it rests before it is armed"
        try:
            return FlownManeuver(act(options, cast("Operator", None), progress), armed=True, vehicle_s=50.0)
        except KeyboardInterrupt:
            return FlownManeuver(interrupted=True)

    def commission(_operator: object, vehicle: Vehicle, *_: object, arm: bool) -> Findings:
        assert arm
        assert vehicle.thrusters
        return findings

    patch.setattr(session_steps, "fly", fly)
    patch.setattr(session_steps, "commission_beside", commission)
    patch.setattr(StackStepRunner, "thrusters", thrusters)
    return flown


PROOF = Finding("T1 direction", PROVEN, "pushes", "pushes")
BACKWARD = Finding("T3 direction", WRONG, "pushes", "pulls", mends=(Mend(("thrusters", "T3", "reversed"), True),))
DEAD = Finding("T5 output", WRONG, "T5", "turns nothing", remedy="look for its cable")
LISTS = Finding("trim at rest", WRONG, "level", "roll +11.0 deg", remedy="add lead to port")
HIDDEN = Finding("ping1d mount", OPEN, "looks down", "no echo")


@pytest.mark.parametrize(
    ("finding", "said"),
    [
        (BACKWARD, "(T3 direction), so no legs are flown; `./hindrax commission --vehicle lbv --write` mends it"),
        (DEAD, "(T5 output), so no legs are flown; look for its cable"),
    ],
)
def test_no_legs_are_flown_by_a_vehicle_that_is_not_as_its_file_says(
    finding: Finding,
    said: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    day = tmp_path / "day"
    flown = checked(monkeypatch, Findings((PROOF, finding, LISTS)))
    assert main(["pool-test", "--session", str(day), "--yes", "--vehicle", "lbv"]) == 1
    assert said in " ".join(capsys.readouterr().err.split())
    assert flown == []
    assert [step.name for step in load(day).done] == ["tether"], "it is checked again before anything flies"
    assert "T1 direction" in (day / "thrusters" / "commissioning.txt").read_text()


def test_a_file_that_is_proven_in_a_session_flies_as_fast_as_it_says_and_stays_as_it_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    day, own = tmp_path / "day", tmp_path / "own.yaml"
    own.write_text(default_vehicle().read_text())
    before = own.read_text()
    flown = checked(monkeypatch, Findings((PROOF,)))
    main(["pool-test", "--session", str(day), "--yes", "--vehicle", str(own), "--repeats", "1"])
    slow, _, fast = capsys.readouterr().err.partition("commissioned on")
    assert "maneuvers no faster than 0.1 m/s" in slow
    assert "plan: surge: 0.45" in fast
    assert flown == ["legs-1"]
    assert not unproven(load_vehicle(day / "vehicle.yaml"))
    assert own.read_text() == before


@pytest.mark.parametrize(
    ("findings", "remark"), [((PROOF, HIDDEN), "open: ping1d mount"), ((PROOF, LISTS), "wrong: trim at rest")]
)
def test_what_a_check_does_not_show_is_said_and_the_legs_are_flown(
    findings: tuple[Finding, ...], remark: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    day = tmp_path / "day"
    flown = checked(monkeypatch, Findings(findings))
    main(["pool-test", "--session", str(day), "--mock", "--repeats", "1"])
    assert flown == ["legs-1"]
    assert load(day).done[1].remark == remark
    assert load(day).seconds == 50.0 + 90.0 + 200.0


def test_a_ctrl_c_in_the_check_ends_the_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flown = checked(monkeypatch, Findings((PROOF,), ended=STOPPED))
    assert main(["pool-test", "--session", str(tmp_path / "day"), "--mock"]) == 130
    assert flown == []
    assert load(tmp_path / "day").left[0] == "thrusters"
