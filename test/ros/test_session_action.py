"""`pool-test --session --action` as its client has it: the graph that it prints, and a cancel that ends a flight."""

import os
import threading
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from hindrax_cli.command_line import main
from hindrax_cli.commands.pool import session_by_action, session_steps
from hindrax_core.text.refusals import Reason
from hindrax_core.topics import NAMESPACE
from hindrax_msgs.action import RunSession

pytestmark = pytest.mark.ros

PATIENT_S = 60.0
EXPORT = "export ROS_DOMAIN_ID="


class CancellingClient(threading.Thread):
    """Joins the domain that is printed, begins the session, and cancels it once it flies."""

    def __init__(self, printed: list[str], flying: list[str]) -> None:
        super().__init__(daemon=True)
        self._printed, self._flying = printed, flying
        self.result: Any = None
        self.start()

    def run(self) -> None:
        deadline, context = time.monotonic() + PATIENT_S, Context()
        while not (found := [one for one in self._printed if EXPORT in one]):
            assert time.monotonic() < deadline, self._printed
            time.sleep(0.02)
        rclpy.init(args=[], context=context, domain_id=int(found[0].partition("=")[2]))
        node = rclpy.create_node("planner", namespace=NAMESPACE, context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        client = ActionClient(node, RunSession, "session/run")

        def until(done: Any) -> None:
            while not done():
                assert time.monotonic() < deadline, "no answer"
                executor.spin_once(timeout_sec=0.02)

        until(client.server_is_ready)
        sent = client.send_goal_async(RunSession.Goal())
        until(sent.done)
        handle = sent.result()
        until(lambda: self._flying)
        handle.cancel_goal_async()
        outcome = handle.get_result_async()
        until(outcome.done)
        self.result = outcome.result().result
        client.destroy()
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


def test_a_client_joins_the_printed_graph_and_its_cancel_is_a_ctrl_c(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    printed, flying = list[str](), list[str]()

    def fly(*_: object, **_named: object) -> None:
        flying.append(os.environ["ROS_DOMAIN_ID"])
        time.sleep(PATIENT_S)

    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    monkeypatch.setattr(session_by_action, "print_stderr", printed.append)
    monkeypatch.setattr(session_steps, "fly", fly)
    client = CancellingClient(printed, flying)
    assert main(["pool-test", "--session", str(tmp_path / "day"), "--mock", "--action"]) == 130
    client.join(PATIENT_S)
    assert client.result.error_code == Reason.CANCELLED
    assert (client.result.folder, list(client.result.steps)) == (str(tmp_path / "day"), ["tether"])
    assert f"    {EXPORT}{flying[0]}" in printed, "the stacks of a session are where its action is"
    assert "ROS_DOMAIN_ID" not in os.environ
