"""The node `teleop` as a process: messages of standard joystick and keyboard tools become wrenches."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from geometry_msgs.msg import Twist, WrenchStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Joy

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_core.topics import NAMESPACE, OPERATOR_WRENCH
from hindrax_ros.graph import subscription

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[2]
SOURCES = [str(folder) for folder in sorted((ROOT / "src").glob("hindrax_*")) if folder.name != "hindrax_msgs"]
PATIENT_S = 60.0


class Desk:
    """What sits on the operator's desk: publishers with the quality that `joy_node` and the keyboard tool have."""

    def __init__(self) -> None:
        self.node = Node("desk", namespace=NAMESPACE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._joy = self.node.create_publisher(Joy, "/hindrax/joy", 10)
        self._twist = self.node.create_publisher(Twist, "/hindrax/cmd_vel", 10)
        self.wrench: WrenchStamped | None = None
        subscription(self.node, OPERATOR_WRENCH, lambda message: setattr(self, "wrench", message))

    def joy(self, button: int) -> None:
        message = Joy(axes=[0.0, 1.0, 0.0, 0.0, 0.0], buttons=[0, 0, 0, 0, button])
        message.header.stamp = self.node.get_clock().now().to_msg()
        self._joy.publish(message)

    def twist(self) -> None:
        message = Twist()
        message.angular.z = 1.0
        self._twist.publish(message)

    def until(self, x_N: float, n_Nm: float, say: object, *arguments: int) -> None:
        deadline = time.monotonic() + PATIENT_S
        while self.wrench is None or (self.wrench.wrench.force.x, self.wrench.wrench.torque.z) != (x_N, n_Nm):
            assert time.monotonic() < deadline, f"last heard: {self.wrench}"
            say(*arguments)  # type: ignore[operator]  # one of the two above
            self._executor.spin_once(timeout_sec=0.05)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    with own_domain(mock=True) as domain:
        made = environment(mock=True, domain=domain)
        made["PYTHONPATH"] = os.pathsep.join([*SOURCES, *filter(None, [os.environ.get("PYTHONPATH")])])
        words = ["-m", "hindrax_control.nodes.teleop_node", "--ros-args", "-p", f"vehicle:={default_vehicle()}"]
        with (tmp_path / "log").open("w") as log, adopted(made):
            child = subprocess.Popen([sys.executable, *words], env=made, stdout=log, stderr=log)
            rclpy.init(args=[])
            try:
                yield Desk()
            finally:
                rclpy.try_shutdown()
                child.terminate()
                assert child.wait(PATIENT_S) == 0, (tmp_path / "log").read_text()


def test_the_hand_moves_the_vehicle_only_while_it_holds_the_button(desk: Desk) -> None:
    desk.until(30.0, 0.0, desk.joy, 1)
    assert desk.wrench is not None
    assert desk.wrench.header.frame_id == "base_link_fsd"
    assert desk.wrench.header.stamp.sec > 0
    desk.until(0.0, 0.0, desk.joy, 0)
    desk.until(0.0, -15.0, desk.twist)
