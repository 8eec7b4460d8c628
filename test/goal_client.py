"""A third-party action client, as a process of its own: sends goals one after the other and records the answers.

    python goal_client.py '[["surge", "cancel"], ["yaw", ""]]'

Each goal is a motion and what to do once it is flown: cancel, or nothing. One line of JSON per goal comes back: its
status, its result, the motions that its feedback named, and the seconds it took.
"""

import json
import sys
import time
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node

from hindrax_core.topics import NAMESPACE
from hindrax_msgs.action import FlyManeuver

PATIENT_S = 90.0


class Client:
    """One action client on a plain node."""

    def __init__(self) -> None:
        self.node = Node("client", namespace=NAMESPACE)
        self._client = ActionClient(self.node, FlyManeuver, "maneuver/fly")
        assert self._client.wait_for_server(PATIENT_S)
        self._motions: list[str] = []

    def fly(self, motion: str, act: str) -> dict[str, Any]:
        """Fly one goal to its end."""
        self._motions = []
        goal = FlyManeuver.Goal(motions=[motion], excitation="plateaus", on_cancel="hold")
        goal.stamp = self.node.get_clock().now().to_msg()
        begun = time.monotonic()
        handle = self._answer(self._client.send_goal_async(goal, feedback_callback=self._on_feedback))
        ended = handle.get_result_async()
        if act == "cancel":
            self._until(lambda: self._motions or ended.done())
            self._answer(handle.cancel_goal_async())
        outcome = self._answer(ended)
        return {
            "status": outcome.status,
            "completed": outcome.result.completed,
            "aborted": outcome.result.aborted,
            "motions": sorted(set(self._motions)),
            "seconds": time.monotonic() - begun,
        }

    def _on_feedback(self, message: Any) -> None:
        self._motions.append(message.feedback.motion)

    def _answer(self, future: Any) -> Any:
        self._until(future.done)
        return future.result()

    def _until(self, done: Any) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, "no answer"
            rclpy.spin_once(self.node, timeout_sec=0.05)


def main() -> None:
    """Fly what the command line says."""
    rclpy.init(args=[])
    client = Client()
    for motion, act in json.loads(sys.argv[1]):
        sys.stdout.write(json.dumps(client.fly(motion, act)) + "\n")
        sys.stdout.flush()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
