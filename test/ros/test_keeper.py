"""The keeper of a vehicle whose operator falls silent: what it asks of the others, once, and what it says."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs", reason="needs the built workspace: run ./hindrax test")

import rclpy
from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticStatus

from hindrax_bringup.nodes.keeper import HOLD, NEUTRAL, STAY, Keeper
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_core.topics import DIAGNOSTICS, HEARTBEAT, NAMESPACE
from hindrax_msgs.msg import Heartbeat
from hindrax_msgs.srv import Arm
from hindrax_ros.graph import publisher, subscription

pytestmark = pytest.mark.ros
PATIENT_S = 60.0


class Vehicle:
    """Beside the keeper, in its process: thrusters and pilot that write down what they are asked, and an operator."""

    def __init__(self, keeper: Keeper) -> None:
        self.keeper, self.said = keeper, []
        self.node = rclpy.create_node("stand_in", namespace=NAMESPACE)
        keeper._executor.add_node(self.node)
        self.armed: list[bool] = []
        self.cancelled = 0
        self.link: dict[str, bytes] = {}
        self.node.create_service(Arm, "thrusters/arm", self._arm)
        self.node.create_service(CancelGoal, "maneuver/fly/_action/cancel_goal", self._cancel)
        subscription(self.node, DIAGNOSTICS, self._diagnose)
        self.beat = publisher(self.node, HEARTBEAT)

    def _arm(self, request, response):
        self.armed.append(request.arm)
        response.accepted = True
        return response

    def _cancel(self, _request, response):
        self.cancelled += 1
        return response

    def _diagnose(self, message) -> None:
        self.link |= {one.message: one.level for one in message.status if one.name == "hindrax: link"}

    def until(self, done: Callable[[], bool], *, beating: bool) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, self.said
            if beating:
                self.beat.publish(Heartbeat(source="test"))
            self.keeper.spin(0.05)
            self.said += self.keeper.news()


@pytest.fixture
def vehicle(request):
    with (
        own_domain(mock=True) as domain,
        adopted(environment(mock=True, domain=domain)),
        Keeper(mock=False, without_operator=request.param) as keeper,
    ):
        made = Vehicle(keeper)
        yield made
        made.node.destroy_node()


@pytest.mark.parametrize(("vehicle", "asked"), [(HOLD, []), (NEUTRAL, [False])], indirect=["vehicle"])
def test_a_silent_operator_ends_what_flies_and_comes_back(vehicle, asked):
    vehicle.until(lambda: "link: the operator is there" in vehicle.said, beating=True)
    assert vehicle.cancelled == 0
    vehicle.until(lambda: vehicle.cancelled > 0 and len(vehicle.armed) == len(asked), beating=False)
    assert any(one.startswith("link: no operator for 2 s") for one in vehicle.said)
    vehicle.until(lambda: any("back after" in one for one in vehicle.said), beating=True)
    vehicle.until(lambda: vehicle.link.get("no operator for 2 s") == DiagnosticStatus.WARN, beating=True)
    assert vehicle.armed == asked
    assert vehicle.cancelled == 1


@pytest.mark.parametrize("vehicle", [STAY], indirect=True)
def test_without_a_tether_it_leaves_the_vehicle_alone(vehicle):
    begin = time.monotonic()
    vehicle.until(lambda: time.monotonic() - begin > 3.0, beating=False)
    assert (vehicle.armed, vehicle.cancelled, vehicle.said) == ([], 0, [])
