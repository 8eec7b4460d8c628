"""The sensors process while it measures: whatever is asked of one node, the process lives and the others go on."""

import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from rclpy.executors import SingleThreadedExecutor

from hindrax_bag.run_folder import write_parameters
from hindrax_bringup.node_options import wire_parameters
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_core.sensor_table import SENSORS
from hindrax_core.topics import NAMESPACE, TOPICS
from hindrax_core.vehicle import load_vehicle
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.graph import subscription
from hindrax_ros.testing.lifecycle_client import LifecycleClient
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle

pytestmark = pytest.mark.ros

PATIENT_S = 60.0
LISTEN_S = 0.3
VEHICLE = load_vehicle(default_vehicle())
NAMES = [sensor.name for sensor in SENSORS if sensor.name in VEHICLE.sensors]


class Sensors:
    """The process on a mock, a client for every node of it, and how many messages each has published."""

    def __init__(self, process: subprocess.Popen[bytes], mock: MockVehicle) -> None:
        self._process, self._mock = process, mock
        node = BatchedNode("bench")
        self._node = node
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self.received: Counter[str] = Counter()
        for topic in TOPICS:
            device = topic.name.removeprefix("raw/").partition("/")[0]
            if device in NAMES:
                subscription(node, topic, partial(self._hear, topic.name))
        self.nodes = {name: LifecycleClient(node, name, self.until) for name in NAMES}

    def _hear(self, name: str, _message: Any) -> None:
        self.received[name] += 1

    def until(self, done: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, f"waited for {what}; heard {self.received}"
            assert self._process.poll() is None, f"it ended, while waiting for {what}"
            self._mock.step()
            self._executor.spin_once(timeout_sec=0.0)
            self._node.drain()

    def heard_of(self, name: str) -> int:
        """Readings of one device since the last `listen`."""
        return sum(count for topic, count in self.received.items() if topic.startswith(f"{name}/"))

    def listen(self, *names: str) -> None:
        """Hear anew of each of these, and for a while."""
        self.received.clear()
        end = time.monotonic() + LISTEN_S
        self.until(lambda: all(self.heard_of(name) for name in names) and time.monotonic() > end, f"of {names}")

    def silence(self, name: str, others: Sequence[str], *, raw: bool) -> None:
        """See that one falls silent while the others go on; what had been on its way may still come."""

        def silent() -> bool:
            self.listen(*others)
            return self.heard_of(name) == 0 and (raw or self.received[f"raw/{name}"] == 0)

        self.until(silent, f"silence of {name}")


@pytest.fixture
def sensors(tmp_path: Path) -> Iterator[Sensors]:
    with (
        own_domain(mock=True) as domain,
        adopted(made := environment(mock=True, domain=domain)),
        MockVehicle(Hardware(VEHICLE, 1), tmp_path, rate=0.0) as mock,
    ):
        values = wire_parameters({"ports": mock.ports, "clock": mock.clock})
        words = write_parameters(tmp_path / "parameters.yaml", {"/**": {"vehicle": str(default_vehicle())}, **values})
        rclpy.init(args=[])
        arguments = [sys.executable, "-m", "hindrax_drivers.nodes.sensors", *words, "-r", f"__ns:={NAMESPACE}"]
        with subprocess.Popen(arguments, env=made) as process:
            try:
                yield Sensors(process, mock)
            finally:
                process.terminate()
                process.wait(20.0)
                rclpy.try_shutdown()


def test_every_node_through_every_state(sensors: Sensors) -> None:
    sensors.listen(*NAMES)
    for name, node in sensors.nodes.items():
        others = NAMES[NAMES.index(name) + 1 :]  # those before are shut down
        node.refuses_the_invalid()
        for label in ("deactivate", "cleanup", "configure"):
            node.make(label)
            node.refuses_the_invalid()
            sensors.silence(name, others, raw=True)
        node.make("activate")
        sensors.listen(name, *others)
        node.make("shutdown")
        node.refuses_the_invalid()
        sensors.silence(name, others, raw=False)
    assert {node.state() for node in sensors.nodes.values()} == {"finalized"}
