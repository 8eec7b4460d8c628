"""What an operator's tools ask of a lifecycle node, valid or not, and the states that ROS 2 promises for it.

The graph of states is that of design.ros2.org/articles/node_lifecycle.html, written down here once more by hand.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future

GRAPH = {
    "unconfigured": {"configure": "inactive", "shutdown": "finalized"},
    "inactive": {"activate": "active", "cleanup": "unconfigured", "shutdown": "finalized"},
    "active": {"deactivate": "inactive", "shutdown": "finalized"},
    "finalized": {},
}
"""State, request, state after it."""
NUMBERS = {"configure": {1}, "cleanup": {2}, "activate": {3}, "deactivate": {4}, "shutdown": {5, 6, 7}}
LABELS = (
    *NUMBERS,
    "create",
    "destroy",
    "transition_success",
    "transition_error",
    "Activate",
    "aktivieren",
    "\u2620" * 999,
)
TOGETHER = 8
"""As many requests as a service surely keeps: its queue holds ten."""


def invalid(state: str) -> list[tuple[str, int]]:
    """Requests (label, number) that mean nothing in a state."""
    valid = {number for label in GRAPH[state] for number in NUMBERS[label]}
    labels = [(label, 0) for label in LABELS if label not in GRAPH[state]]
    return labels + [("", number) for number in (*range(13), *range(20, 70, 10), 99, 255) if number not in valid]


def done(futures: Sequence[Future]) -> bool:
    """Whether all have an answer."""
    return all(one.done() for one in futures)


class LifecycleClient:
    """Asks one node; `until` turns whatever has to turn until it holds."""

    def __init__(self, node: Node, name: str, until: Callable[[Callable[[], object], str], None]) -> None:
        self._until, self.name = until, name
        self._change = node.create_client(ChangeState, f"{name}/change_state")
        self._get = node.create_client(GetState, f"{name}/get_state")

    def _ask(self, client: Client, *requests: object) -> list[Any]:
        self._until(client.service_is_ready, f"{client.srv_name}")
        answers: list[object] = []
        for begin in range(0, len(requests), TOGETHER):
            futures = [client.call_async(request) for request in requests[begin : begin + TOGETHER]]
            self._until(partial(done, futures), f"answers of {client.srv_name}")
            answers += [one.result() for one in futures]
        return answers

    def state(self) -> str:
        """Name of the state it is in."""
        (answer,) = self._ask(self._get, GetState.Request())
        return str(answer.current_state.label)

    def request(self, *wanted: tuple[str, int]) -> list[bool]:
        """Ask for transitions (label, number) one behind the other; whether each was made."""
        transitions = [Transition(id=number, label=label) for label, number in wanted]
        answers = self._ask(self._change, *[ChangeState.Request(transition=one) for one in transitions])
        return [one.success for one in answers]

    def make(self, label: str) -> None:
        """Make a valid transition, and see that the node is where it leads."""
        before = self.state()
        assert self.request((label, 0)) == [True], f"{self.name}: {label} in {before}"
        assert self.state() == GRAPH[before][label]

    def refuses_the_invalid(self) -> None:
        """Every request that means nothing in the state it is in is refused, and it stays there."""
        before = self.state()
        wanted = invalid(before)
        answers = self.request(*wanted)
        assert not any(answers), [one for one, made in zip(wanted, answers, strict=True) if made]
        assert self.state() == before
