"""The page "Use one node", word for word: each of our nodes beside a program of ten lines that replaces another one."""

import shlex
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from built_messages import built_messages
from documentation.pages import ROOT, block_of
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import UInt16MultiArray
from std_srvs.srv import Trigger

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_control.allocation.thrust_curve import AppliedWrench, pulses_of_channels
from hindrax_core.events import Stamp, Stamped
from hindrax_core.signals import NAN, Navigation
from hindrax_core.topics import (
    ALLOCATION,
    DIAGNOSTICS,
    ESTIMATE,
    HOLD_SETPOINT,
    MANEUVER,
    NAMESPACE,
    NAVIGATION,
    THRUSTER_COMMAND,
    THRUSTER_STATE,
    WRENCH,
)
from hindrax_core.vehicle import load_vehicle
from hindrax_msgs.msg import AllocationStatus, HoldSetpoint, ManeuverStatus, ModelEstimate, ThrusterState
from hindrax_msgs.srv import Arm
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.convert import stamp_from_msg, stamp_to_msg, wrench_from_msg
from hindrax_ros.testing.state_messages import navigation_to_msg

pytestmark = pytest.mark.ros

PAGE = ROOT / "docs" / "how-to" / "use-one-node.md"
ARDUSUB_PAGE = ROOT / "docs" / "how-to" / "bluerov2-on-ardusub.md"
INSTALLED = ROOT / "ros_ws" / "install"
PATIENT_S = 60.0


class Surroundings:
    """Plays thrusters for the nodes under test, starts them by the lines of the page, and hears what they say."""

    def __init__(self, folder: Path, processes: ExitStack, environ: dict[str, str]) -> None:
        self.folder, self._processes, self.environ = folder, processes, environ
        (folder / "myrov.yaml").write_text(default_vehicle().read_text(encoding="utf-8"), encoding="utf-8")
        self.node = Node("surroundings", namespace=NAMESPACE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._state = publisher(self.node, THRUSTER_STATE)
        self.setpoint = publisher(self.node, HOLD_SETPOINT)
        self.armed = False
        self.pulses: tuple[float, ...] = ()
        self.wrench: tuple[float, ...] = ()
        self.values: dict[str, dict[str, str]] = {}
        self.disarmed_because: list[str] = []
        subscription(self.node, THRUSTER_COMMAND, lambda message: setattr(self, "pulses", tuple(message.pulses)))
        subscription(self.node, WRENCH, self._on_wrench)
        subscription(self.node, DIAGNOSTICS, self._on_diagnostics)
        self.node.create_service(Arm, "thrusters/arm", self._on_arm)

    def _on_wrench(self, message: Any) -> None:
        force, torque = message.wrench.force, message.wrench.torque
        self.wrench = (force.x, force.y, force.z, torque.x, torque.y, torque.z)

    def _on_diagnostics(self, message: Any) -> None:
        for one in message.status:
            self.values[one.name.removeprefix("hindrax: ")] = {pair.key: pair.value for pair in one.values}

    def _on_arm(self, request: Any, response: Any) -> Any:
        self.disarmed_because += [] if request.arm else [request.reason]
        self.armed, response.accepted = self.armed and request.arm, True
        return response

    def run(self, line: str, page: Path = PAGE) -> subprocess.Popen[bytes]:
        """Start a line of a page in its folder: `ros2 run` by the installed program, where ros2 is not there."""
        assert f"\n{line}\n" in page.read_text(encoding="utf-8"), f"{line}: not on {page}"
        package, program, *words = shlex.split(line)[2:]
        return self.start([sys.executable, INSTALLED / package / "lib" / package / program, *words])

    def program(self, name: str, old: str = "", new: str = "") -> subprocess.Popen[bytes]:
        """Start a program of the page, maybe with another word in it."""
        file = self.folder / f"{time.monotonic_ns()}_{name}"
        file.write_text(block_of(PAGE, name).replace(old, new), encoding="utf-8")
        return self.start([sys.executable, file])

    def start(self, words: list[Any]) -> subprocess.Popen[bytes]:
        """Start a program, which is ended with the surroundings."""
        child = subprocess.Popen(list(map(str, words)), env=self.environ, cwd=self.folder)
        self._processes.callback(end, child)
        return child

    def until(self, done: Callable[[], Any]) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, self.values
            state = ThrusterState(armed=self.armed, state="armed", pulses=[1500.0] * 8, output="pca9685")
            state.header.stamp = stamp_to_msg(time.time_ns())
            self._state.publish(state)
            self._executor.spin_once(timeout_sec=0.02)

    def value(self, node: str, key: str) -> str:
        return self.values.get(node, {}).get(key, "")


def end(child: subprocess.Popen[bytes]) -> None:
    child.terminate()
    child.wait(PATIENT_S)


@pytest.fixture
def around(tmp_path: Path) -> Iterator[Surroundings]:
    with own_domain(mock=True) as domain, ExitStack() as processes:
        made = environment(mock=True, domain=domain)
        with adopted(made):
            rclpy.init(args=[])
            try:
                yield Surroundings(tmp_path, processes, made)
            finally:
                rclpy.try_shutdown()


def test_the_allocator_obeys_ten_lines_of_anybody_but_not_two_of_them(around: Surroundings) -> None:
    around.run("ros2 run hindrax_control allocator --ros-args -p vehicle:=myrov.yaml")
    around.program("push.py")
    around.until(lambda: any(pulse != 1500.0 for pulse in around.pulses))
    around.until(lambda: around.value("allocator", "commander") == "/my_controller")
    around.armed = True
    other = around.program("push.py", "my_controller", "another")
    around.until(lambda: around.value("allocator", "last refused").endswith("(/another, /my_controller), wanted one"))
    end(other)
    pushed = around.pulses
    around.pulses = ()
    around.until(lambda: around.pulses == pushed)


def test_the_pilot_flies_on_ten_lines_of_anybody_and_disarms_when_they_cannot_be_true(around: Surroundings) -> None:
    around.run(
        "ros2 run hindrax_control control --ros-args -p vehicle:=myrov.yaml "
        "-r navigator:navigation/odometry:=navigator/odometry"
    )
    level = around.program("float.py")
    around.until(lambda: around.value("pilot", "state from") == "/my_navigator")
    around.armed = True

    def dives() -> bool:
        wanted = HoldSetpoint(axis="depth", engaged=True, value=1.5)
        wanted.header.stamp = stamp_to_msg(time.time_ns())
        around.setpoint.publish(wanted)
        return bool(around.wrench) and around.wrench[2] > 5.0

    around.until(dives)
    around.until(lambda: any(pulse != 1500.0 for pulse in around.pulses))
    end(level)
    keel_up = "orientation.w, state.pose.pose.orientation.x = 0.0, 1.0"
    around.program("float.py", "orientation.w = 1.0", keel_up)
    # Another process with the same name is another one: it is not flown on before the thrusters were disarmed.
    around.until(lambda: "found another /my_navigator" in around.value("pilot", "last refused"))
    around.armed = False
    around.until(lambda: around.wrench == (0.0,) * 6)
    around.armed = True
    around.until(lambda: around.disarmed_because)
    assert around.disarmed_because[0].startswith("tilt: 180 deg, wanted at most ")
    assert not around.armed


IDENTIFIER = (
    "ros2 run hindrax_ident identifier --ros-args -r __ns:=/myrov -p vehicle:=myrov.yaml "
    "-r odometry:=/mavros/local_position/odom"
)
IDENT, MY_ROV = "hindrax_ident", "vehicle:=myrov.yaml"
K_Q, K_L, MASS_kg = 60.0, 5.0, 25.0
SPAN_S, STEP_S, BURST = 15.0, 0.05, 8


def pushed() -> Iterator[tuple[float, float]]:
    """Force [N, N m] and speed [m/s, rad/s] of a vehicle that is pushed forth and back, every `STEP_S`."""
    speed = 0.0
    for step in range(round(SPAN_S / STEP_S)):
        force = (20.0 if step * STEP_S % 20.0 < 10.0 else 8.0) * (1.0 if step * STEP_S % 10.0 < 5.0 else -1.0)
        yield force, speed
        for _ in range(10):
            speed += 0.1 * STEP_S * (force - K_Q * abs(speed) * speed - K_L * speed) / MASS_kg


def test_the_identifier_learns_any_vehicle_in_any_namespace_and_shows_its_verdict(around: Surroundings) -> None:
    around.run(IDENTIFIER)
    odometry = around.node.create_publisher(Odometry, "/mavros/local_position/odom", 10)
    wrench = around.node.create_publisher(WrenchStamped, "/myrov/wrench", 10)
    learned: list[ModelEstimate] = []
    around.node.create_subscription(ModelEstimate, "/myrov/ident/estimate", learned.append, 200)
    around.until(lambda: odometry.get_subscription_count() and wrench.get_subscription_count())
    begin_ns = time.time_ns()
    state, push = Odometry(child_frame_id="base_link"), WrenchStamped()
    state.header.frame_id, push.header.frame_id = "map", "base_link"
    for step, (force, speed) in enumerate(pushed()):
        stamp = stamp_to_msg(begin_ns + round(step * STEP_S * 1e9))
        state.header.stamp = push.header.stamp = stamp
        push.wrench.force.x, state.twist.twist.linear.x = force, speed
        wrench.publish(push)
        odometry.publish(state)
        if step % BURST == 0:  # four times as fast as a vehicle lives, which the identifier can follow
            time.sleep(0.1)
    around.until(lambda: learned)
    assert {one.motion for one in learned} == {"surge"}
    client = around.node.create_client(Trigger, "/myrov/ident/assess")
    around.until(client.service_is_ready)
    asked = client.call_async(Trigger.Request())
    around.until(asked.done)
    # Whether the verdict is that over the record is tested without ROS: here a busy machine may lose some of it.
    assert asked.result().success
    assert asked.result().message.startswith("surge: ")


def test_the_identifier_receives_any_navigator_allocator_and_pilot(around: Surroundings) -> None:
    around.start([sys.executable, INSTALLED / IDENT / "lib" / IDENT / "identifier", "--ros-args", "-p", MY_ROV])
    navigation, allocation, maneuver = (publisher(around.node, topic) for topic in (NAVIGATION, ALLOCATION, MANEUVER))
    learned: list[ModelEstimate] = []
    subscription(around.node, ESTIMATE, learned.append)
    around.until(lambda: all(one.get_subscription_count() for one in (navigation, allocation, maneuver)))
    begin_ns = time.time_ns()
    level = Navigation((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0, NAN, (0.0, 0.0), dvl_locked=True)
    for step, (moment, rate) in enumerate(pushed()):
        now = Stamp(begin_ns + round(step * STEP_S * 1e9))
        flown, given = ManeuverStatus(motion="yaw", phase="excite"), AllocationStatus(forces=[0.0] * 8)
        flown.header.stamp = given.header.stamp = stamp_to_msg(now)
        given.achieved[5] = moment
        maneuver.publish(flown)
        allocation.publish(given)
        navigation.publish(navigation_to_msg(Stamped(now, replace(level, rate_radps=(0.0, 0.0, rate)))))
        if step % BURST == 0:
            time.sleep(0.1)
    around.until(lambda: learned)
    assert {one.motion for one in learned} == {"yaw"}


def test_pulses_of_anybody_become_the_wrench_that_they_achieve(around: Surroundings) -> None:
    around.run(
        "ros2 run hindrax_control thrust --ros-args -r __ns:=/myrov -p vehicle:=myrov.yaml -r pulses:=/mavros/rc/out"
        " -r battery:=/mavros/battery"
    )
    vehicle = load_vehicle(default_vehicle())
    pulses = [1500 + 40 * index for index in range(8)]
    received: list[WrenchStamped] = []
    around.node.create_subscription(WrenchStamped, "/myrov/wrench", received.append, 10)
    out = around.node.create_publisher(UInt16MultiArray, "/mavros/rc/out", 10)

    def answered() -> bool:
        out.publish(UInt16MultiArray(data=pulses))
        return bool(received)

    around.until(answered)
    applied = AppliedWrench(vehicle)
    wanted = applied.wrench(applied.forces_N(pulses_of_channels(vehicle, pulses)))
    assert wrench_from_msg(received[0]) == pytest.approx(wanted)
    assert received[0].header.frame_id == "base_link_fsd"
    assert stamp_from_msg(received[0].header.stamp) > 0


@pytest.fixture(scope="module")
def mavros_msgs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment with `mavros_msgs/RCOut`, which is in no wheel."""
    folder = tmp_path_factory.mktemp("mavros_msgs")
    return built_messages(folder, "mavros_msgs", "RCOut", "std_msgs/Header header\nuint16[] channels\n", "std_msgs")


def test_a_bluerov_on_ardusub_is_identified_beside_mavros(around: Surroundings, mavros_msgs: dict[str, str]) -> None:
    around.environ |= mavros_msgs
    (around.folder / "bluerov.yaml").write_text(block_of(ARDUSUB_PAGE, "bluerov.yaml"), encoding="utf-8")
    learned: list[ModelEstimate] = []
    around.node.create_subscription(ModelEstimate, "/bluerov/ident/estimate", learned.append, 200)
    ours = "--ros-args -r __ns:=/bluerov -p vehicle:=bluerov.yaml"
    of_mavros = "-r pulses:=/mavros/rc/out -r battery:=/mavros/battery"
    around.run(f"ros2 run hindrax_control thrust {ours} {of_mavros}", ARDUSUB_PAGE)
    around.run(f"ros2 run hindrax_ident identifier {ours} -r odometry:=/mavros/local_position/odom", ARDUSUB_PAGE)
    around.start([sys.executable, ROOT / "test" / "mavros_stand_in.py", "40", "4"])
    around.until(lambda: any(one.motion == "surge" and one.state == "learning" for one in learned))
