"""The control process with a stranger on its graph: it lives, moves nothing and says what it refused."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import hostile
import rclpy
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.readings import Inertial
from hindrax_core.topics import (
    BATTERY,
    DIAGNOSTICS,
    ESTIMATE,
    HOLD_SETPOINT,
    IMU,
    NAMESPACE,
    OPERATOR_WRENCH,
    PRESSURE,
    THRUSTER_COMMAND,
    THRUSTER_HEALTH_ORDER,
    THRUSTER_STATE,
    Topic,
)
from hindrax_msgs.action import FlyManeuver
from hindrax_msgs.msg import HoldSetpoint, ThrusterHealth, ThrusterState
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.convert import stamp_to_msg, wrench_to_msg
from hindrax_ros.messages.serialization import message_class
from hindrax_ros.testing.sensor_messages import inertial_to_msg

pytestmark = pytest.mark.ros

ROOT = Path(__file__).parents[2]
SOURCES = [str(folder) for folder in sorted((ROOT / "src").glob("hindrax_*")) if folder.name != "hindrax_msgs"]
PATIENT_S = 60.0
SENT = (THRUSTER_STATE, THRUSTER_HEALTH_ORDER, HOLD_SETPOINT, OPERATOR_WRENCH, ESTIMATE, BATTERY, PRESSURE)


class Stranger:
    """Beside control on the graph: plays an inertial sensor at rest and armed thrusters, and sends what it likes."""

    def __init__(self, child: subprocess.Popen[bytes]) -> None:
        self.child, self.node = child, Node("stranger", namespace=NAMESPACE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.publishers = {topic: publisher(self.node, topic) for topic in (*SENT, IMU)}
        self.goals = ActionClient(self.node, FlyManeuver, "maneuver/fly")
        self.pulses: set[float] = set()
        self.values: dict[str, str] = {}
        self._sampled = self._start = Stamp(time.time_ns())
        subscription(self.node, THRUSTER_COMMAND, lambda message: self.pulses.update(message.pulses))
        subscription(self.node, DIAGNOSTICS, self._on_diagnostics)

    def _on_diagnostics(self, message: Any) -> None:
        for one in message.status:
            self.values |= {pair.key: pair.value for pair in one.values}

    def turn(self) -> None:
        """Say what keeps control going, and listen."""
        assert self.child.poll() is None, "control has ended"
        while self._sampled < time.time_ns():
            self._sampled = after(self._sampled, 0.01)
            still = Stamped(self._sampled, Inertial((0.0, 0.0, -9.8), (0.0, 0.0, 0.0), 20.0))
            self.publishers[IMU].publish(inertial_to_msg(still, "icm20948_link", 0.1, 0.01))
        armed = ThrusterState(armed=True, state="armed", pulses=[1500.0] * 8, output="pca9685")
        armed.header.stamp = stamp_to_msg(time.time_ns())
        self.publishers[THRUSTER_STATE].publish(armed)
        self._executor.spin_once(timeout_sec=0.01)

    def until(self, done: Callable[[], Any]) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, self.values
            self.turn()

    def send(self, topic: Topic, message: Any) -> None:
        self.publishers[topic].publish(message)
        self.turn()

    def ask(self, goal: Any) -> str:
        """Send a goal; returns why it was not flown."""
        sent = self.goals.send_goal_async(goal)
        self.until(sent.done)
        ended = sent.result().get_result_async()
        self.until(ended.done)
        return str(ended.result().result.aborted)


@pytest.fixture
def stranger(tmp_path: Path) -> Iterator[Stranger]:
    with own_domain(mock=True) as domain:
        made = environment(mock=True, domain=domain)
        made["PYTHONPATH"] = os.pathsep.join([*SOURCES, *filter(None, [os.environ.get("PYTHONPATH")])])
        words = ["-m", "hindrax_control.nodes.control", "--ros-args", "-p", f"vehicle:={default_vehicle()}"]
        with (tmp_path / "log").open("w") as log, adopted(made):
            child = subprocess.Popen([sys.executable, *words], env=made, stdout=log, stderr=log)
            rclpy.init(args=[])
            try:
                yield Stranger(child)
            finally:
                rclpy.try_shutdown()
                child.terminate()
                assert child.wait(PATIENT_S) == 0, (tmp_path / "log").read_text()[-3000:]


def test_control_lives_moves_nothing_and_states_what_it_refused(stranger: Stranger) -> None:
    stranger.until(lambda: stranger.pulses and stranger.goals.server_is_ready())
    now = stamp_to_msg(time.time_ns())
    for topic in SENT:
        for message in hostile.floods(message_class(topic.type), now, every=20):
            stranger.send(topic, message)
    for order in (
        (HOLD_SETPOINT, HoldSetpoint(axis="heading", engaged=True, value=1.0)),
        (OPERATOR_WRENCH, wrench_to_msg(Stamp(0), (30.0, 0.0, 0.0, 0.0, 0.0, 0.0))),
        (THRUSTER_HEALTH_ORDER, ThrusterHealth(disabled=["T1"], reasons=["a test"])),
    ):
        for message in hostile.wrong_stamps(order[1]):
            stranger.send(order[0], message)
    goal = FlyManeuver.Goal(motions=["surge"], excitation="plateaus", on_cancel="hold")
    goal.stamp.sec = 2_000_000_000
    for _ in range(200):  # more than the middleware keeps: what it drops is not answered
        stranger.goals.send_goal_async(goal)
    wanted_words = r"clock: the goal is stamped \d+\.\d+ s in the future, wanted "
    stranger.until(lambda: re.match(wanted_words, stranger.ask(goal)))  # a result behind a flood may have expired
    names = ("ms5837" if topic is PRESSURE else topic.name for topic in SENT)
    wanted = {f"refused: {name}" for name in (*names, "maneuver/fly")}
    stranger.until(lambda: wanted <= stranger.values.keys())
    assert stranger.pulses == {1500.0}
