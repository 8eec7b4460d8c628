"""The control process, or one of its nodes alone, as arguments and launch files name it; and places of the operator."""

import math
from collections.abc import Callable, Collection
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy

from hindrax_control.nodes.control import make_nodes
from hindrax_control.nodes.pilot_messages import place_from_msg
from hindrax_core.topics import ALLOCATION, ODOMETRY, THRUSTER_COMMAND, THRUSTER_STATE, WRENCH
from hindrax_msgs.srv import Recentre
from hindrax_ros.process import scoped

VEHICLE = Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml"


@pytest.fixture
def edges(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> Callable[..., dict[str, tuple[set[str], set[str]]]]:
    """What each node made with these arguments publishes and subscribes to, by the name of the node."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))

    def made(wanted: Collection[str], *words: str) -> dict[str, tuple[set[str], set[str]]]:
        rclpy.init(args=["--ros-args", *words])
        nodes = make_nodes(wanted)
        try:
            graph = nodes[0]
            return {
                name: (
                    {topic for topic, _ in graph.get_publisher_names_and_types_by_node(name, space)},
                    {topic for topic, _ in graph.get_subscriber_names_and_types_by_node(name, space)},
                )
                for name, space in ((node.get_name(), node.get_namespace()) for node in nodes)
            }
        finally:
            for node in nodes:
                node.destroy_node()
            rclpy.shutdown()

    return made


def test_the_graph_shows_the_documented_edges_also_those_within_the_process(edges: Callable[..., object]) -> None:
    found = edges(("allocator", "pilot", "navigator"), "-p", f"vehicle:={VEHICLE}")
    assert isinstance(found, dict)
    for publisher, topic, subscribers in (
        ("navigator", ODOMETRY, ("pilot",)),
        ("pilot", WRENCH, ("allocator",)),
        ("allocator", ALLOCATION, ("pilot", "navigator")),
        ("allocator", THRUSTER_COMMAND, ()),
    ):
        name = f"/hindrax/{topic.name}"
        assert name in found[publisher][0]
        assert [one for one in subscribers if name not in found[one][1]] == []
    state = f"/hindrax/{THRUSTER_STATE.name}"
    assert [one for one in ("allocator", "pilot") if state not in found[one][1]] == []


@pytest.mark.parametrize(("name", "nodes"), [("allocator", {"mine"}), ("pilot", {"mine", "estimator_health"})])
def test_one_node_alone_takes_its_name_and_its_vehicle_as_launch_gives_them(
    name: str, nodes: set[str], edges: Callable[..., object], tmp_path: Path
) -> None:
    parameters = tmp_path / "launch.yaml"
    parameters.write_text(f"/hindrax/mine: {{ros__parameters: {{vehicle: {VEHICLE}}}}}")
    words = scoped(["-r", "__node:=mine", "--params-file", str(parameters)], name)
    found = edges((name,), *words)
    assert isinstance(found, dict)
    assert found.keys() == nodes


def test_a_request_without_fields_recentres_at_the_start_and_keeps_the_heading() -> None:
    assert all(map(math.isnan, place_from_msg(Recentre.Request())))
    assert place_from_msg(Recentre.Request(x=5.0, y=3.0))[:2] == (5.0, 3.0)
    assert math.isnan(place_from_msg(Recentre.Request(x=5.0, y=3.0, turned=0.5))[2])
    assert place_from_msg(Recentre.Request(x=5.0, y=3.0, set_heading=True)) == (5.0, 3.0, 0.0)
