"""The link to another simulator: a pause stops the time of the stack, an end ends the mock with a sentence."""

import time
from collections.abc import Iterator
from dataclasses import replace

import pytest
from vehicles_beside import vehicle_beside

pytest.importorskip("rclpy", reason="needs the ROS environment")

from rclpy.context import Context
from rclpy.node import Node

from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import Hydrodynamics
from hindrax_sim.nodes.simulator_link import SimulatorLink
from hindrax_sim.physics.followed_plant import FollowedPlant
from hindrax_sim.simulators import simulator_of

VEHICLE = replace(vehicle_beside(), hydrodynamics=Hydrodynamics((0.0,) * 6))


@pytest.fixture
def node(ros_domain: int) -> Iterator[Node]:
    context = Context()
    context.init(domain_id=ros_domain)
    made = Node("mock", context=context, enable_rosout=False, start_parameter_services=False)
    yield made
    made.destroy_node()
    context.shutdown()


def test_a_simulator_that_has_ended_ends_the_mock_before_its_processes_count_as_hung(
    node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    began_s = time.monotonic()
    link = SimulatorLink(node, simulator_of("mujoco", VEHICLE.name), VEHICLE, FollowedPlant(VEHICLE))
    monkeypatch.setattr(time, "monotonic", lambda: began_s + 9.5)
    link.require_going_on()
    monkeypatch.setattr(time, "monotonic", lambda: began_s + 11.5)
    with pytest.raises(HindraxError, match=r"no state for 10 s; has it ended"):
        link.require_going_on()
