"""The action of the guided session: a client of another participant, and a stand-in for what flies."""

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from hindrax_analysis.identification.pool_session import PoolSession, Reached, Step
from hindrax_bringup.stack import adopted, environment
from hindrax_core.text.refusals import CANCELLED, NOTHING, Reason, Refusal
from hindrax_core.topics import NAMESPACE
from hindrax_msgs.action import RunSession
from hindrax_msgs.srv import AnswerQuestion
from hindrax_operator.nodes import session_server
from hindrax_operator.nodes.session_server import SessionServer
from hindrax_operator.session_question import SessionQuestions

pytestmark = pytest.mark.ros

PATIENT_S = 60.0
BEGUN = PoolSession({"motions": ["surge"]}, ("tether", "legs 1", "weigh surge", "legs 2"), (Step("tether"),))
REACHED = {"surge": Reached(0.084, 0.2, 0.06, 0.08, 0.05, "own wake", "rest")}


class Client:
    """A mission planner: one action client and one service client on a node of its own."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(args=[], context=self.context)
        self.node = rclpy.create_node("planner", namespace=NAMESPACE, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._goals = ActionClient(self.node, RunSession, "session/run")
        self._answers = self.node.create_client(AnswerQuestion, "session/answer")
        self.feedback: Any = None
        self.until(lambda: self._goals.server_is_ready() and self._answers.service_is_ready())

    def until(self, done: Callable[[], Any]) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, "no answer"
            self._executor.spin_once(timeout_sec=0.02)

    def send(self, **words: Any) -> Any:
        """Handle of a goal."""

        def keep(message: Any) -> None:
            self.feedback = message.feedback

        sent = self._goals.send_goal_async(RunSession.Goal(**words), feedback_callback=keep)
        self.until(sent.done)
        return sent.result()

    def outcome(self, handle: Any) -> Any:
        found = handle.get_result_async()
        self.until(found.done)
        return found.result()

    def answer(self, question: int) -> Any:
        asked = self._answers.call_async(AnswerQuestion.Request(question=question))
        self.until(asked.done)
        return asked.result()

    def close(self) -> None:
        self._goals.destroy()
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture(scope="module")
def stopped() -> list[str]:
    """A word for each time that the session was interrupted."""
    return []


@pytest.fixture(scope="module")
def pair(ros_domain: int, stopped: list[str]) -> Iterator[tuple[SessionServer, Client]]:
    """Server and client, which the tests of this file use one after the other."""
    with pytest.MonkeyPatch.context() as patch, adopted(environment(mock=True, domain=ros_domain)):
        patch.setattr(session_server, "FETCHED_S", 0.0)
        patch.setattr(session_server, "FEEDBACK_S", 0.1)
        with SessionServer(lambda: stopped.append("stop")) as server, contextlib.closing(Client()) as client:
            yield server, client


def test_a_client_follows_a_session_answers_it_and_gets_what_it_reached(
    pair: tuple[SessionServer, Client], tmp_path: Path, stopped: list[str]
) -> None:
    server, client = pair
    assert client.answer(0).error_code == Reason.LATE, "no session has begun"
    handle = client.send(motions=["surge"], repeats=2)
    asked = server.goal()
    assert (list(asked.motions), asked.repeats) == (["surge"], 2)
    server.show(BEGUN, tmp_path)
    second = client.outcome(client.send())
    assert (second.status, second.result.error_code) == (GoalStatus.STATUS_ABORTED, Reason.BUSY)

    questions = SessionQuestions(tmp_path)
    questions.ask("lead the tether away", arms=True)
    client.until(lambda: client.feedback and client.feedback.question)
    seen = client.feedback
    assert (seen.step, list(seen.left)) == ("legs 1", ["weigh surge", "legs 2"])
    assert (seen.asked, seen.arms, list(seen.motions)) == ("lead the tether away", True, [])
    refused = client.answer(seen.question)
    assert (refused.accepted, refused.error_code) == (False, Reason.TERMINAL)
    assert not questions.answered()

    questions.ask("hang 15 N")
    client.until(lambda: client.feedback.question not in (0, seen.question))
    assert client.answer(seen.question).error_code == Reason.LATE, "of the question before"
    assert not questions.answered()
    assert client.answer(client.feedback.question).accepted
    assert questions.answered()
    questions.close()

    weighed = Step("weigh surge", remark="left out"), Step("legs 2", reached=REACHED)
    server.show(replace(BEGUN, done=(*BEGUN.done, Step("legs 1"), *weighed)), tmp_path)
    client.until(lambda: client.feedback.step == "")
    assert (client.feedback.question, list(client.feedback.drag)) == (0, [0.084])
    server.end(server.aborted, identified=True)
    outcome = client.outcome(handle)
    assert (outcome.status, outcome.result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0)
    found = outcome.result
    assert (found.completed, found.identified, found.folder) == (True, True, str(tmp_path))
    assert list(zip(found.steps, found.remarks, strict=True))[2] == ("weigh surge", "left out")
    assert (list(found.motions), list(found.drag), list(found.goals)) == (["surge"], [0.084], [0.05])
    assert found.next.startswith("surge is known to 8.4%")
    assert stopped == []


def test_a_cancel_interrupts_the_session_once_and_a_refused_goal_leaves_room_for_the_next(
    pair: tuple[SessionServer, Client], tmp_path: Path, stopped: list[str]
) -> None:
    server, client = pair
    wrong = client.send(motions=["sideways"])
    server.goal()
    server.end(Refusal(Reason.GOAL, "found motion sideways"))
    outcome = client.outcome(wrong)
    assert (outcome.status, outcome.result.error_code) == (GoalStatus.STATUS_ABORTED, Reason.GOAL)
    assert outcome.result.aborted == "found motion sideways"

    handle = client.send()
    server.goal()
    server.show(BEGUN, tmp_path)
    handle.cancel_goal_async()
    client.until(lambda: server.cancelled)
    server.end(CANCELLED)
    outcome = client.outcome(handle)
    assert (outcome.status, outcome.result.error_code) == (GoalStatus.STATUS_CANCELED, Reason.CANCELLED)
    assert (outcome.result.completed, list(outcome.result.steps)) == (False, ["tether"])
    assert stopped == ["stop"]
    server.end(NOTHING)  # nobody waits any more
