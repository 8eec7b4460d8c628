"""Beside ros2_control: what the launch file starts, against a publisher and subscribers that speak as auv_controllers.

The chain of controllers is C++ and not among the wheels. Its ends are: `geometry_msgs/Wrench` without a header on the
reference of the allocation, `std_msgs/Float64` on that of every thruster, the last one kept.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pytest
from documentation.pages import ROOT, block_of
from launch_stand_in import Said, actions_of, put_in_place

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from geometry_msgs.msg import Wrench, WrenchStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_system_default
from std_msgs.msg import Float64, Header

from hindrax_bringup.stack import environment
from hindrax_core.vehicle import load_vehicle
from hindrax_msgs.msg import ThrusterState
from hindrax_msgs.srv import Arm
from hindrax_ros.messages.convert import stamp_to_msg, wrench_from_msg

FILE = ROOT / "src/hindrax_bringup/launch/ros2_control.launch.py"
PATIENT_S = 30.0
TAM = np.array(
    [
        [-0.707, -0.707, 0.707, 0.707, 0.0, 0.0, 0.0, 0.0],
        [0.707, -0.707, 0.707, -0.707, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0],
        [0.0, 0.0, 0.0, 0.0, -0.21805, 0.21805, -0.21805, 0.21805],
        [0.0, 0.0, 0.0, 0.0, -0.12, -0.12, 0.12, 0.12],
        [0.1888, -0.1888, -0.1888, 0.1888, 0.0, 0.0, 0.0, 0.0],
    ]
)
"""auv_control_demos 0.4.2, chained_controllers/config/chained_controllers.yaml, `tam`."""
RESOLUTION_N = 0.5 * 0.15
"""Half a microsecond on the curve of the file."""
WANTED = (20.0, -8.0, 12.0, 1.0, -1.5, 2.0)


class Chain:
    """Both ends of the chain of auv_controllers, and an operator who arms."""

    def __init__(self, domain: int) -> None:
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.node = rclpy.create_node("chain", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.kept = [float("nan")] * 8
        self.phase, self.reason, self.speaking = "", "", True
        for index in range(8):
            topic = f"/thruster_{index + 1}_controller/reference"
            self.node.create_subscription(Float64, topic, partial(self._keep, index), qos_profile_system_default)
        topic = "/thruster_allocation_matrix_controller/reference"
        self.out = self.node.create_publisher(Wrench, topic, qos_profile_system_default)
        self.node.create_subscription(ThrusterState, "/hindrax/thrusters/state", self._on_state, 20)
        self.client = self.node.create_client(Arm, "/hindrax/thrusters/arm")
        self.node.create_timer(0.02, self.speak)

    def _keep(self, index: int, force: Float64) -> None:
        self.kept[index] = force.data

    def _on_state(self, state: ThrusterState) -> None:
        self.phase, self.reason = state.state, state.reason

    def speak(self) -> None:
        if self.speaking:
            wrench = Wrench()
            wrench.force.x, wrench.force.y, wrench.force.z, *turns = WANTED
            wrench.torque.x, wrench.torque.y, wrench.torque.z = turns
            self.out.publish(wrench)

    def until(self, done: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, f"waited for {what}; {self.phase}: {self.reason} {self.kept}"
            self.executor.spin_once(timeout_sec=0.02)

    def arm(self) -> None:
        self.until(self.client.service_is_ready, "the service")
        self.until(self.out.get_subscription_count, "an allocator that listens: without commands the output disarms")
        self.until(lambda: self.phase == "disarmed", "an output that is set up")
        refusals: list[str] = []

        def accepted() -> bool:
            """Ask again: an allocator that a test before this one has killed is known until its lease ends."""
            stamp = stamp_to_msg(self.node.get_clock().now().nanoseconds)
            future = self.client.call_async(Arm.Request(arm=True, sequence=len(refusals) + 1, stamp=stamp))
            self.until(future.done, "an answer")
            answer = future.result()
            assert answer is not None
            if not answer.accepted:
                refusals.append(answer.reason)
            return bool(answer.accepted)

        self.until(accepted, "an output that arms")

    def is_zero(self) -> bool:
        return self.kept == [0.0] * 8

    def flies(self) -> bool:
        return bool(np.allclose(TAM @ self.kept, WANTED, atol=4 * RESOLUTION_N))

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


def launched(monkeypatch: pytest.MonkeyPatch) -> dict[str, list[str]]:
    """Arguments of each process that the launch file describes, with its defaults."""
    put_in_place(monkeypatch)
    actions = actions_of(FILE)
    default = {one.words[0]: one.keywords["default_value"] for one in actions if one.kind == "DeclareLaunchArgument"}

    def value(said: Said) -> str:
        return str(default[said.words[0]])

    nodes = [one.keywords for one in actions if one.kind == "Node"]
    made: dict[str, list[str]] = {}
    for node in nodes:
        words = ["--ros-args", "-r", f"__ns:={value(node['namespace'])}"]
        words += [word for name, one in node["parameters"][0].items() for word in ("-p", f"{name}:={value(one)}")]
        words += [word for name, one in node["remappings"] for word in ("-r", f"{name}:={value(one)}")]
        made[node["executable"]] = words
    return made


@pytest.fixture
def processes(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    words, running = launched(monkeypatch), {}
    words["thrusters"] += ["-p", "arming_s:=0.1"]
    monkeypatch.undo()
    variables = environment(mock=False, domain=ros_domain)
    program = "import sys; from hindrax_control.nodes.control import main; sys.exit(main(('allocator',)))"
    commands = {"thrusters": ["-m", "hindrax_drivers.nodes.thrusters"], "allocator": ["-c", program]}
    for name, command in commands.items():
        running[name] = subprocess.Popen([sys.executable, *command, *words[name]], env=variables)
    yield running
    for one in running.values():
        for child in psutil.Process(one.pid).children() if one.poll() is None else ():
            child.kill()
        one.kill()
        one.wait()


def test_the_launch_file_names_what_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    words = launched(monkeypatch)
    assert list(words) == ["thrusters", "allocator", "identifier"]
    assert "odometry:=/odometry" in words["identifier"]
    (file,) = (word.partition(":=")[2] for word in words["identifier"] if word.startswith("vehicle:="))
    vehicle = load_vehicle(file)
    assert [one.name for one in vehicle.thrusters] == [f"thruster_{number}" for number in range(1, 9)]


def test_a_wrench_of_theirs_becomes_the_forces_of_their_thrusters_and_zeros_when_we_die(
    processes: dict[str, subprocess.Popen[bytes]], ros_domain: int
) -> None:
    chain = Chain(ros_domain)
    try:
        chain.until(chain.is_zero, "zeros before anybody arms")
        chain.arm()
        chain.until(chain.flies, "the wrench of the forces by their matrix")

        chain.speaking = False
        chain.until(chain.is_zero, "zeros in silence")
        chain.speaking = True
        chain.until(chain.flies, "the wrench again")

        (node,) = (one for one in psutil.Process(processes["thrusters"].pid).children() if "--node" in one.cmdline())
        os.kill(node.pid, signal.SIGKILL)
        chain.until(chain.is_zero, "zeros after the death of the node")
    finally:
        chain.close()


def test_the_wrench_of_a_chain_is_handed_on_with_its_stamp(monkeypatch: pytest.MonkeyPatch) -> None:
    """control_msgs is not among the wheels; its message here has the fields that the status of the chain has."""
    sent: list[WrenchStamped] = []
    takers: list[Callable[[Any], None]] = []
    node = SimpleNamespace(
        create_publisher=lambda *_: SimpleNamespace(publish=sent.append),
        create_subscription=lambda _kind, _topic, take, _depth: takers.append(take),
    )
    stub = SimpleNamespace(init=lambda: None, create_node=lambda _name: node, spin=lambda _node: None)
    monkeypatch.setitem(sys.modules, "rclpy", stub)
    monkeypatch.setitem(sys.modules, "control_msgs.msg", SimpleNamespace(MultiDOFStateStamped=object))
    exec(block_of(ROOT / "docs/how-to/ros2-control.md", "chain.py"), {})  # our own page
    header = Header(stamp=stamp_to_msg(7))
    takers[0](SimpleNamespace(header=header, dof_states=[SimpleNamespace(output=value) for value in WANTED]))
    (made,) = sent
    assert (made.header.frame_id, made.header.stamp) == ("base_link_fsd", stamp_to_msg(7))
    assert wrench_from_msg(made) == WANTED
