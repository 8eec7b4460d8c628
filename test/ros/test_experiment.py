"""The identification node runs the experiment (`ident/run`): with a stand-in pilot, by messages."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.executors import SingleThreadedExecutor

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_control.maneuver.goal import BUSY as PILOT_BUSY
from hindrax_control.nodes.pilot_messages import result_of
from hindrax_core.input_checks import MOCK_ORDER, TypedOrders
from hindrax_core.text.refusals import CANCELLED, Reason, from_sentence
from hindrax_ident.nodes import experiment_server
from hindrax_ident.nodes.identifier import Identifier
from hindrax_ident.online.aim import Aim, ExperimentGoal
from hindrax_msgs.action import FlyManeuver, RunExperiment
from hindrax_operator.nodes.operator_node import Operator
from hindrax_ros.messages.convert import stamp_to_msg

pytestmark = pytest.mark.ros

PATIENT_S = 60.0
BUSY = PILOT_BUSY.within("start: ")


class StandInPilot:
    """Ends each goal with the next of its words, "" where it was flown; without a word it flies on until cancelled."""

    def __init__(self, node: Any) -> None:
        self.goals: list[tuple[str, tuple[float, ...]]] = []
        self.words: list[str] = []
        self.flying: Any = None
        self._server: Any = ActionServer(
            node,
            FlyManeuver,
            "maneuver/fly",
            partial(result_of, BUSY),
            handle_accepted_callback=self._accept,
            cancel_callback=lambda _goal: CancelResponse.ACCEPT,
        )

    def _accept(self, handle: Any) -> None:
        if self.flying is not None:
            handle.execute(partial(result_of, BUSY))
            return
        self.flying = handle
        (motion,) = handle.request.motions
        assert handle.request.excitation == "plateaus"
        assert handle.request.on_cancel == "hold"
        self.goals.append((motion, tuple(handle.request.levels)))

    def turn(self) -> None:
        handle = self.flying
        if handle is None or not (handle.is_cancel_requested or self.words):
            return
        self.flying = None
        handle.publish_feedback(FlyManeuver.Feedback(motion=handle.request.motions[0], phase="plateau"))
        handle.execute(
            partial(result_of, CANCELLED if handle.is_cancel_requested else from_sentence(self.words.pop(0)))
        )

    def close(self) -> None:
        """Go; twice is once."""
        server, self._server = self._server, None
        if server is not None:
            server.destroy()


class Bench:
    """An identifier, a stand-in pilot, and an operator whose every turn is one of both."""

    def __init__(self) -> None:
        self.operator = Operator(mock=False, tick=self.turn)
        self._executor = SingleThreadedExecutor()
        self.identifier = self.begin_identifier()
        self.pilot = StandInPilot(self.operator.node)
        self.client = ActionClient(self.operator.node, RunExperiment, "ident/run")
        self._plans: list[tuple[Callable[[], object], Callable[[], object]]] = []
        self.until(self.client.server_is_ready)
        self.until(self.identifier._experiments._fly.server_is_ready)

    def begin_identifier(self) -> Identifier:
        identifier = Identifier()
        identifier._experiments._goals = TypedOrders(MOCK_ORDER)  # a busy machine takes a second now and then
        self._executor.add_node(identifier)
        return identifier

    def end_identifier(self) -> None:
        self._executor.remove_node(self.identifier)
        self.identifier.close()
        self.identifier.destroy_node()

    def turn(self) -> None:
        if self._plans and self._plans[0][0]():
            self._plans.pop(0)[1]()
        self._executor.spin_once(timeout_sec=0.0)
        self.pilot.turn()

    def until(self, done: Callable[[], object]) -> None:
        self.operator.wait(lambda: bool(done()), PATIENT_S, lambda: "the bench")

    def when(self, true: Callable[[], object], act: Callable[[], object]) -> None:
        """Act once, in the turn in which something is true."""
        self._plans.append((true, act))

    def goal(self, *motions: str, **words: Any) -> RunExperiment.Goal:
        return RunExperiment.Goal(motions=motions, stamp=stamp_to_msg(self.operator.now()), **words)

    def send(self, goal: RunExperiment.Goal) -> Any:
        """Handle of an accepted goal."""
        sent = self.client.send_goal_async(goal)
        self.until(sent.done)
        return sent.result()

    def outcome(self, handle: Any) -> Any:
        ended = handle.get_result_async()
        self.until(ended.done)
        return ended.result()

    def ask(self, goal: RunExperiment.Goal) -> RunExperiment.Result:
        result: RunExperiment.Result = self.outcome(self.send(goal)).result
        return result

    def run(self, *motions: str, until: float = 0.0, minutes: float = 0.0) -> tuple[str, str]:
        """The operator's: why it was aborted, and what was reached."""
        return self.operator.fly(ExperimentGoal(motions, Aim(until, minutes)), PATIENT_S)

    def close(self) -> None:
        self.end_identifier()
        self._executor.shutdown()
        self.pilot.close()
        self.client.destroy()
        self.operator.__exit__()


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        # The operator's node starts ROS for both; the vehicle file is a parameter of the identifier's.
        begin, vehicle = rclpy.init, ["-p", f"vehicle:={default_vehicle()}"]
        monkeypatch.setattr(rclpy, "init", lambda *, args, **rest: begin(args=[*args, *vehicle], **rest))
        made = Bench()
        try:
            yield made
        finally:
            made.close()


def test_every_motion_is_flown_at_its_extremes_and_a_second_experiment_after_the_first(bench: Bench) -> None:
    bench.pilot.words = ["", ""]
    wanted = "50 minutes leave no time for another leg; more was wanted of surge, yaw"
    assert bench.run("surge", "yaw") == ("", wanted), "a pilot that flies nothing teaches nothing"
    assert bench.pilot.goals == [("surge", (1.0, 0.0, 1.0)), ("yaw", (1.0, 0.0, 1.0))]
    bench.pilot.words = [""]
    assert bench.run("heave", until=0.02)[0] == ""
    assert bench.pilot.goals[2:] == [("heave", (1.0, 0.0, 1.0))]


def test_hostile_goals_are_refused_in_one_sentence_and_fly_nothing(bench: Bench) -> None:
    unstamped = RunExperiment.Goal(motions=["surge"])
    refused = {
        "goal: no motion, wanted some of surge, ": bench.goal(),
        "goal: motion 'loop' unknown, wanted one of surge, ": bench.goal("surge", "loop"),
        "goal: 3000 motions, one of them twice, wanted each once": bench.goal(*["surge"] * 3000),
        "goal: until nan, wanted 0.0001 to 1": bench.goal("surge", until=float("nan")),
        "goal: minutes -1, wanted more than 0, at most 50": bench.goal("surge", minutes=-1.0),
        "goal: ending 'drift' unknown, wanted hold or neutral": RunExperiment.Goal(
            motions=["surge"], plan=True, on_cancel="drift"
        ),
        "repeat: the goal is not stamped, wanted the time at which it was made; repeat it within 8 s with ": unstamped,
    }
    for sentence, goal in refused.items():
        outcome = bench.outcome(bench.send(goal))
        found, code = outcome.result, Reason.GOAL if sentence.startswith("goal") else Reason.REPEAT
        assert (found.aborted[: len(sentence)], found.error_code, found.completed) == (sentence, code, False)
        assert outcome.status == GoalStatus.STATUS_ABORTED, "a rejection would have no room for the code"
    assert bench.pilot.goals == []


def test_a_plan_is_reported_and_not_flown(bench: Bench) -> None:
    found = bench.ask(RunExperiment.Goal(motions=["surge"], until=0.02, plan=True))
    assert found.completed
    assert found.ended.startswith("surge: fastest, slowest, fastest, each out and back; then most informative, until ")
    assert bench.pilot.goals == []


def test_a_second_goal_is_reported_so_and_a_cancel_ends_what_is_flown(bench: Bench) -> None:
    first = bench.send(bench.goal("surge", "yaw"))
    bench.until(lambda: bench.pilot.flying)
    assert bench.ask(bench.goal("yaw")).aborted == experiment_server.BUSY
    cancelling = first.cancel_goal_async()
    found = bench.outcome(first)
    assert cancelling.done()
    assert (found.status, found.result.aborted) == (GoalStatus.STATUS_CANCELED, CANCELLED)
    assert [motion for motion, _ in bench.pilot.goals] == ["surge"]


def test_what_the_pilot_refuses_ends_it_and_what_was_late_is_asked_again(bench: Bench) -> None:
    bench.pilot.words = ["late: the goal is 1.2 s old", "", "disarmed: the thrusters were disarmed"]
    aborted, reached = bench.run("surge", "yaw", "sway")
    assert (aborted, reached) == ("disarmed: the thrusters were disarmed", "")
    assert [motion for motion, _ in bench.pilot.goals] == ["surge", "surge", "yaw"]


def test_minutes_cut_what_is_flown(bench: Bench) -> None:
    aborted, reached = bench.run("surge", "yaw", minutes=1e-3)
    assert (aborted, reached) == ("", "0.001 minutes are over before yaw")
    assert bench.pilot.flying is None
    assert [motion for motion, _ in bench.pilot.goals] == ["surge"]


def test_a_pilot_that_states_nothing_more_or_is_not_there_ends_it(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(experiment_server, "SILENT_S", 0.5)
    assert bench.run("surge")[0] == experiment_server.NO_FEEDBACK
    bench.until(lambda: bench.pilot.flying is None)  # it was told to end, and it did
    bench.pilot.close()
    bench.until(lambda: not bench.identifier._experiments._fly.server_is_ready())
    assert bench.run("surge")[0] == experiment_server.PILOT_GONE


def test_an_identifier_that_starts_again_hangs_nothing(bench: Bench) -> None:
    bench.send(bench.goal("surge"))
    bench.until(lambda: (run := bench.identifier._experiments._run) and run.maneuver)
    bench.end_identifier()
    bench.identifier = bench.begin_identifier()
    bench.until(bench.identifier._experiments._fly.server_is_ready)
    assert bench.ask(bench.goal("yaw")).aborted == BUSY
    bench.pilot.words = [""]  # the leg ends by itself
    bench.until(lambda: bench.pilot.flying is None)
    bench.pilot.words = [""]
    assert bench.ask(bench.goal("yaw")).completed
