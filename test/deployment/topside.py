"""An operator at the far end of the tether: arms, dives, flies, is cut off, comes back, disarms. One line per event."""

import json
import sys
import time

from hindrax_operator.connection import joined
from hindrax_operator.nodes.operator_node import Operator
from hindrax_operator.snapshot import holds_of
from hindrax_ros.batched_node import BatchedNode

PATIENT_S = 90.0
SILENT_S = 3.0
"""More than a busy machine makes by itself."""


def tell(event: str, **facts: object) -> None:
    sys.stdout.write(json.dumps({"event": event} | facts) + "\n")
    sys.stdout.flush()


class Received:
    """How long ago the vehicle was heard, on the clock of the wall: the mock's own time stops with the tether."""

    def __init__(self, operator: Operator) -> None:
        self._operator, self._last, self._at = operator, operator.thrusters, time.monotonic()

    def silent_s(self) -> float:
        now = time.monotonic()
        if self._operator.thrusters is not self._last:
            self._last, self._at = self._operator.thrusters, now
        return now - self._at


def fly(operator: Operator) -> None:
    from hindrax_msgs.action import FlyManeuver
    from hindrax_ros.messages.convert import stamp_to_msg

    goal = FlyManeuver.Goal(motions=["surge"], excitation="plateaus", seed=1, on_cancel="hold")
    goal.stamp = stamp_to_msg(operator.now())
    future = operator._fly.send_goal_async(goal)
    operator.wait(future.done, PATIENT_S, lambda: "the pilot to answer")
    assert future.result().accepted
    operator.wait(lambda: operator.flying == "surge", PATIENT_S, lambda: "the maneuver")


def depth_m(operator: Operator) -> float:
    assert operator.navigation is not None
    return operator.navigation.reading.depth_m


def graph(node: BatchedNode) -> dict[str, dict[str, list[str]]]:
    """What every node of the vehicle says, hears and answers, as the middleware sees it."""
    asked = {
        "says": node.get_publisher_names_and_types_by_node,
        "hears": node.get_subscriber_names_and_types_by_node,
        "answers": node.get_service_names_and_types_by_node,
    }
    found = {}
    for name, space in node.get_node_names_and_namespaces():
        found[name] = {verb: [one for one, _ in ask(name, space)] for verb, ask in asked.items()}
    return found


def seen_by_vehicle(operator: Operator) -> bool:
    """A heartbeat takes up to half a second: who leaves before was never back."""
    link = operator.diagnostics.get("hindrax: link")
    return link is not None and link.message.startswith("an operator is connected")


def main() -> None:
    with joined(None, sim_time=True) as operator:
        from hindrax_operator.nodes.orders import hold

        operator.wait(lambda: operator.navigation is not None, PATIENT_S, lambda: "a navigation solution")
        operator.arm(seconds=PATIENT_S)
        hold(operator, ["depth"], 0.6, engaged=True)
        operator.wait(lambda: depth_m(operator) > 0.5, PATIENT_S, lambda: "the depth")
        fly(operator)
        tell("flying", graph=graph(operator.node))
        received = Received(operator)
        operator.wait(lambda: received.silent_s() > SILENT_S, PATIENT_S, lambda: "the cut")
        tell("cut")
        operator.diagnostics.clear()
        begin = time.monotonic()
        operator.wait(lambda: received.silent_s() < SILENT_S, PATIENT_S, lambda: "the vehicle to come back")
        tell("back", cut_s=time.monotonic() - begin + SILENT_S)
        before = operator.holds
        operator.wait(lambda: operator.holds is not before, PATIENT_S, lambda: "the holds")
        held = [one.axis for one in holds_of(operator.holds) if one.engaged]
        tell("found", armed=operator.armed, held=held, depth_m=depth_m(operator))
        # Its result was told into the cut and is lost: what flies is seen in the topic alone.
        operator.wait(lambda: not operator.flying, PATIENT_S, lambda: "the end of the maneuver")
        operator.wait(lambda: seen_by_vehicle(operator), PATIENT_S, lambda: "the vehicle to hear its operator again")
        operator.arm(arm=False)
        tell("disarmed")


if __name__ == "__main__":
    main()
