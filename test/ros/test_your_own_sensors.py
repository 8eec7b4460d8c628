"""The page "Your DVL, IMU, depth sensor or odometry": each line against publishers that speak as theirs do.

The nodes are made as the line says and read from the graph; the publishers are in the same process, so that each line
costs a second. Types, axes, frames and qualities of the topics are those of the drivers' sources.
"""

import re
import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
import yaml
from documentation.pages import ROOT
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, qos_profile_system_default
from sensor_msgs.msg import FluidPressure, Imu

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.nodes.control import make_nodes
from hindrax_control.nodes.navigator_node import NavigatorNode
from hindrax_control.nodes.pilot_node import PilotNode
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamped
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.signals import Navigation
from hindrax_ros.messages.convert import stamp_to_msg

pytestmark = pytest.mark.ros

PAGE = (ROOT / "docs/how-to/your-own-sensors.md").read_text(encoding="utf-8")
LINES = [line.replace("\\\n", " ") for line in re.findall(r"```sh\n(ros2 run .*?)```", PAGE, re.DOTALL)]
MARINE, MARINE_TOPIC = "marine_acoustic_msgs", "/waterlinked_dvl_driver/velocity_report"
RATE_Hz, AID_EVERY, BATCH = 50, 5, 50
SURGE_mps, DRIFT_mps, DEPTH_m = 0.3, 0.1, 1.2
"""Of the vehicle: forward, to starboard, below the surface; level, on a straight way."""
PATIENT_S = 10.0


def imu(stamp: Any) -> Imu:
    """At rest or on a straight way: gravity on the axis that points up (REP-103)."""
    made = Imu()
    made.header.stamp, made.linear_acceleration.z = stamp, GRAVITY_mps2
    return made


def pressure(stamp: Any) -> FluidPressure:
    made = FluidPressure(fluid_pressure=101325.0 + 1000.0 * GRAVITY_mps2 * DEPTH_m)
    made.header.stamp = stamp
    return made


def pose(stamp: Any) -> PoseWithCovarianceStamped:
    made = PoseWithCovarianceStamped()
    made.header.stamp, made.header.frame_id, made.pose.pose.position.z = stamp, "odom", -DEPTH_m
    return made


def twist(stamp: Any) -> TwistWithCovarianceStamped:
    made = TwistWithCovarianceStamped()
    made.header.stamp = stamp
    made.twist.twist.linear.x, made.twist.twist.linear.y = SURGE_mps, -DRIFT_mps
    made.twist.covariance[0] = 1e-4
    return made


def odometry(stamp: Any) -> Odometry:
    """Of an estimator, in REP-105, which says nothing of its covariance."""
    made = Odometry(child_frame_id="base_link")
    made.header.stamp, made.header.frame_id, made.pose.pose.position.z = stamp, "odom", -DEPTH_m
    made.pose.pose.orientation.w = 1.0
    made.twist.twist.linear.x, made.twist.twist.linear.y = SURGE_mps, -DRIFT_mps
    return made


THEIRS: dict[str, tuple[type, Any, Callable[[Any], Any]]] = {
    "/vectornav/imu": (Imu, qos_profile_system_default, imu),
    "/imu/data": (Imu, qos_profile_sensor_data, imu),
    "/mavros/imu/data_raw": (Imu, qos_profile_sensor_data, imu),
    "/zed/zed_node/imu/data": (Imu, qos_profile_system_default, imu),
    "/bar30/pressure": (FluidPressure, qos_profile_sensor_data, pressure),
    "/depth/pose": (PoseWithCovarianceStamped, qos_profile_system_default, pose),
    "/dvl/velocity": (TwistWithCovarianceStamped, 10, twist),
    "/waterlinked_dvl_driver/odom": (Odometry, qos_profile_system_default, odometry),
    "/odometry/filtered": (Odometry, 10, odometry),
    "/mavros/local_position/odom": (Odometry, qos_profile_sensor_data, odometry),
}
"""Topic of a driver: type, quality, message at a stamp. The message of the DVL's report is in no wheel."""


@pytest.fixture
def vehicle(tmp_path: Path) -> Path:
    """The vehicle file with the sensors of the page."""
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    text = default_vehicle().read_text(encoding="utf-8")
    begin, end = text.index("\nsensors:"), text.index("\noutput:")
    file = tmp_path / "myrov.yaml"
    file.write_text(f"{text[:begin]}\n{block}{text[end:]}", encoding="utf-8")
    assert yaml.safe_load(file.read_text())["sensors"].keys() == {"dvl", "imu", "depth"}
    return file


class Graph:
    """The nodes of one line, and a publisher for each topic of a driver in it."""

    def __init__(self, line: str, vehicle: Path) -> None:
        words = [word.replace("myrov.yaml", str(vehicle)) for word in shlex.split(line)][4:]
        rclpy.init(args=words)
        self.theirs = [word.partition(":=")[2] for word in words if ":=/" in word and not word.startswith("vehicle:=")]
        self.nodes: Sequence[Any] = ()
        self.driver: Node | None = None

    def make(self) -> None:
        """Make nodes and publishers."""
        self.nodes = make_nodes()
        self.driver = Node("drivers")
        self._publishers = [
            (self.driver.create_publisher(kind, topic, quality), message)
            for topic, (kind, quality, message) in THEIRS.items()
            if topic in self.theirs
        ]

    def fly(self, seen: Callable[[], bool]) -> bool:
        """Publish second after second, of stamps, until this is seen."""
        assert self.driver is not None
        deadline, at_ns = time.monotonic() + PATIENT_S, self.driver.get_clock().now().nanoseconds
        while not seen() and time.monotonic() < deadline:
            for index in range(BATCH):
                at_ns += 1_000_000_000 // RATE_Hz
                for out, message in self._publishers:
                    if message is imu or index % AID_EVERY == 0:
                        out.publish(message(stamp_to_msg(at_ns)))
            for _ in range(10):
                time.sleep(0.002)
                for node in self.nodes:
                    node.drain()
        return seen()

    def close(self) -> None:
        """End all."""
        for node in (*self.nodes, *([self.driver] if self.driver else [])):
            node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def graph_of(vehicle: Path, ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], Graph]]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    made: list[Graph] = []

    def make(line: str) -> Graph:
        made.append(Graph(line, vehicle))
        return made[-1]

    yield make
    for one in made:
        one.close()


def node_of(graph: Graph, kind: type) -> Any:
    (found,) = [node for node in graph.nodes if isinstance(node, kind)]
    return found


def test_the_page_has_a_line_for_each_driver() -> None:
    assert len(LINES) == 5
    text = "\n".join(LINES)
    assert [topic for topic in THEIRS if f":={topic}" not in text] == []


@pytest.mark.parametrize("line", [line for line in LINES if "navigator:" not in line and MARINE_TOPIC not in line])
def test_the_navigator_knows_velocity_and_depth_from_drivers_of_others(
    line: str, graph_of: Callable[[str], Graph]
) -> None:
    graph = graph_of(line)
    graph.make()
    states: list[Navigation] = []
    navigator = node_of(graph, NavigatorNode)
    navigator.on_state = lambda stamped: states.append(stamped.reading)
    assert graph.fly(lambda: bool(states) and states[-1].dvl_locked and states[-1].depth_age_s < 1.0), navigator
    assert graph.fly(lambda: abs(states[-1].velocity_mps[0] - SURGE_mps) < 0.02)
    state = states[-1]
    assert state.velocity_mps[:2] == pytest.approx((SURGE_mps, DRIFT_mps), abs=0.03)
    assert state.depth_m == pytest.approx(DEPTH_m, abs=0.05)
    assert state.attitude_rad[:2] == pytest.approx((0.0, 0.0), abs=0.02)


@pytest.mark.parametrize("line", [line for line in LINES if "navigator:" in line])
def test_the_pilot_flies_on_an_estimator_of_others(line: str, graph_of: Callable[[str], Graph]) -> None:
    graph = graph_of(line)
    graph.make()
    states: list[Stamped[Navigation]] = []
    pilot = node_of(graph, PilotNode)
    step = pilot.health.on_navigation

    def on_navigation(stamped: Stamped[Navigation]) -> None:
        states.append(stamped)
        step(stamped)

    pilot.health.on_navigation = on_navigation
    assert graph.fly(lambda: bool(states))
    assert states[-1].reading.velocity_mps[:2] == pytest.approx((SURGE_mps, DRIFT_mps))
    assert states[-1].reading.depth_m == pytest.approx(DEPTH_m)


def test_a_message_that_is_not_installed_is_named_with_the_remedy(graph_of: Callable[[str], Graph]) -> None:
    (line,) = [line for line in LINES if MARINE_TOPIC in line]
    graph = graph_of(line)
    try:
        __import__(MARINE)
    except ModuleNotFoundError:
        with pytest.raises(UsageError, match="sudo apt install ros-jazzy-marine-acoustic-msgs"):
            graph.make()
    else:
        graph.make()
