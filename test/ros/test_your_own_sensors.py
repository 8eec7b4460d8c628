"""The page "Your DVL, IMU, depth sensor or odometry": each row against a publisher that speaks as theirs does.

The nodes are made as the row says and read from the graph; the publishers are in the same process, so that a row costs
seconds. Types, axes, rates, qualities, units and quirks are those of the drivers' sources, named beside each.
"""

import gc
import math
import random
import re
import shlex
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import count
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, NamedTuple

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
import yaml
from built_messages import built_messages, loaded_here
from diagnostic_msgs.msg import DiagnosticStatus
from documentation.pages import ROOT, block_of
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TwistWithCovarianceStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data, qos_profile_system_default
from sensor_msgs.msg import FluidPressure, Imu, MagneticField, Range
from std_msgs.msg import Empty

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.nodes.control import make_nodes
from hindrax_control.nodes.navigator_node import NavigatorNode
from hindrax_control.nodes.pilot_node import PilotNode
from hindrax_control.testing.motion import Motion, vector
from hindrax_core.errors import UsageError
from hindrax_core.events import NS_PER_S, Stamped, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Inertial, Vec3
from hindrax_core.rotation import matrix, xyzw_from_sname
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import Mount, load_vehicle
from hindrax_ident.nodes.identifier import Identifier, _motions
from hindrax_ros.messages.convert import half_turn, stamp_to_msg
from hindrax_ros.messages.serialization import message_class

pytestmark = [pytest.mark.ros, pytest.mark.long]

PAGE_FILE = ROOT / "docs/how-to/your-own-sensors.md"
PAGE = PAGE_FILE.read_text(encoding="utf-8")
LINES = [line.replace("\\\n", " ") for line in re.findall(r"```sh\n(ros2 run .*?)```", PAGE, re.DOTALL)]
ROW = re.compile(r"^\| (?P<who>.+?) \| `(?P<sensor>\w+: \{.+?\})` \| `(?P<words>-.+?)` \|$", re.MULTILINE)
ROWS = [one.groupdict() for one in ROW.finditer(PAGE)]
MARINE = "marine_acoustic_msgs"
DVL = """
std_msgs/Header header
uint8 DVL_MODE_BOTTOM=1
uint8 velocity_mode
uint8 dvl_type
geometry_msgs/Vector3 velocity
float64[9] velocity_covar
float64 altitude
float64 course_gnd
float64 speed_gnd
uint8 num_good_beams
float32 sound_speed
bool beam_ranges_valid
bool beam_velocities_valid
geometry_msgs/Vector3[4] beam_unit_vec
float64[4] range
float32[4] range_covar
float32[4] beam_quality
float32[4] beam_velocity
float32[4] beam_velocity_covar
"""
"""Fields of marine_acoustic_msgs/Dvl."""
SECONDS, REST_s, SETTLED_s = 16.0, 3.0, 7.0
A50_LATE_S = 0.12
"""Time from the middle of a measurement to its report."""
LOST_s = (10.0, 11.0)
"""While the DVL has no bottom lock."""
BATCH_S = 0.2
FLOOR_m, SURFACE_m = 2.4, 1.8
"""Depth of the floor below the vehicle; height of the surface in the world of the cameras."""
GAUSS = (0.175, 0.0, 0.138)
PATIENT_S = 20.0
LEAST_TURNS = 4
DISCOVERED_S = 0.5
"""A reader may find its publisher later than the publisher finds it."""
NAN = math.nan


def swinging(t: float, period_s: float, size: float) -> float:
    """Begins at rest, without a jump of the acceleration."""
    begun = max(0.0, t - REST_s)
    return size * math.sin(math.tau * begun / period_s) * begun**3 / (1.0 + begun**3)


TRUTH = Motion(
    position=cache(lambda t: (swinging(t, 6.0, 0.5), swinging(t, 9.0, 0.4), 1.2 + swinging(t, 7.0, 0.15))),
    attitude=cache(lambda t: (swinging(t, 5.0, 0.12), swinging(t, 4.0, 0.1), swinging(t, 11.0, 0.8))),
)
"""Surge, sway, heave and all three angles at once: an axis that is another one shows. Every row has the same times."""


class Driver(NamedTuple):
    """What a driver publishes on one topic; `message` is asked at a rate for the message of a time, None: nothing."""

    kind: Callable[[], type]
    quality: QoSProfile | int
    rate_Hz: float
    message: Callable[[float, Mount], Any]


class Noise:
    """Noise of one kind of sensor."""

    def __init__(self, sigma: float) -> None:
        self._random, self._sigma = random.Random(1), sigma

    def on(self, values: Sequence[float]) -> list[float]:
        return [value + self._random.gauss(0.0, self._sigma) for value in values]


RATE, FORCE, SPEED, DEPTH = Noise(0.002), Noise(0.02), Noise(0.005), Noise(0.003)


def stamped(message: Any, t: float, frame: str = "") -> Any:
    message.header.stamp, message.header.frame_id = stamp_to_msg(round(t * NS_PER_S)), frame
    return message


def set_xyz(target: Any, values: Sequence[float]) -> None:
    target.x, target.y, target.z = map(float, values)


def imu(t: float, mount: Mount, axes: Callable[[Vec3], Sequence[float]], frame: str, variance: float) -> Imu:
    """Rates and accelerations in the axes of a driver; `axes` makes them of SNAME's."""
    made: Imu = stamped(Imu(), t, frame)
    set_xyz(made.angular_velocity, RATE.on(axes(TRUTH.rates(t))))
    set_xyz(made.linear_acceleration, FORCE.on(axes(TRUTH.specific_force(t, mount.position_m))))
    for covariance in (made.angular_velocity_covariance, made.linear_acceleration_covariance):
        covariance[::4] = [variance] * 3
    return made


def field(t: float, axes: Callable[[Vec3], Sequence[float]], unit: float) -> MagneticField:
    """Magnetic field; -1 says that its covariance is not known."""
    turn = matrix(TRUTH.attitude(t))
    here = vector(sum(turn[row][axis] * GAUSS[row] for row in range(3)) for axis in range(3))
    made: MagneticField = stamped(MagneticField(), t)
    set_xyz(made.magnetic_field, [unit * part for part in axes(here)])
    made.magnetic_field_covariance[0] = -1.0
    return made


def fsd(one: Vec3) -> Vec3:
    return one


def enu_of_vectornav(one: Vec3) -> Vec3:
    """`convert_to_enu` of vn_sensor_msgs.cc: x and y change places, also of vectors in the body."""
    return (one[1], one[0], -one[2])


def of_mavros(t: float, mount: Mount) -> Imu:
    """RAW_IMU in steps of 1 mrad/s and 1 mg; imu.cpp of MAVROS, whose covariances follow its parameters."""
    made = imu(t, mount, half_turn, "base_link", 1e-7)
    mg = 1e-3 * GRAVITY_mps2
    for part, step in ((made.angular_velocity, 1e-3), (made.linear_acceleration, mg)):
        set_xyz(part, [step * round(getattr(part, axis) / step) for axis in "xyz"])
    made.orientation_covariance[0] = -1.0
    return made


def of_xsens(t: float, mount: Mount) -> Imu:
    """imupublisher.h publishes a packet with an orientation alone, too: what it does not have is zero, and marked."""
    made = imu(t, mount, half_turn, "imu_link", 0.0004)
    if round(t * 200) % 2:
        set_xyz(made.angular_velocity, (0.0, 0.0, 0.0))
        set_xyz(made.linear_acceleration, (0.0, 0.0, 0.0))
        made.angular_velocity_covariance[0] = made.linear_acceleration_covariance[0] = -1.0
    return made


def lost(t: float) -> bool:
    return LOST_s[0] <= t < LOST_s[1]


def speed(t: float, mount: Mount) -> list[float]:
    return SPEED.on(TRUTH.velocity(t, mount.position_m))


def velocity_report(t: float, mount: Mount) -> Any:
    """waterlinked_dvl_driver.cpp: axes of the instrument; without lock zeros, of the covariance as well."""
    made = stamped(message_class(f"{MARINE}/msg/Dvl")(), t, "dvl_link")
    made.velocity_mode, made.beam_ranges_valid = 1, True
    if not lost(t):
        set_xyz(made.velocity, speed(t, mount))
        made.velocity_covar[::4] = [2.5e-5] * 3
        made.beam_velocities_valid, made.num_good_beams = True, 4
    return made


class WaterLinkedOdometry:
    """The same driver's odometry: x forward, y starboard, z down; each dead reckoning sends the last twist again.

    A velocity is stamped with its time of validity, a dead reckoning with that of its report: the stamps step back.
    """

    def __init__(self) -> None:
        self._made = Odometry()

    def __call__(self, t: float, mount: Mount) -> Odometry | None:
        turn = round(t * 40)
        if turn % 5 == 0:
            at = max(0.0, t - A50_LATE_S)
            set_xyz(self._made.twist.twist.linear, (0.0, 0.0, 0.0) if lost(at) else speed(at, mount))
            self._made.twist.covariance[:15:7] = [0.0 if lost(at) else 2.5e-5] * 3
        elif turn % 8 == 0:
            at = t
            self._made.pose.covariance[21:36:7] = [-1.0] * 3
        else:
            return None
        message: Odometry = stamped(self._made, at, "dvl_link")
        return message


def twist(t: float, mount: Mount) -> TwistWithCovarianceStamped:
    """What `nucleus.py` makes of the bottom track of a Nortek Nucleus (BottomTrack.msg of its driver)."""
    u, v, w = speed(t, mount)
    at = stamp_to_msg(round(t * NS_PER_S))
    track = SimpleNamespace(system_timestamp=at, velocity_x=u, velocity_y=v, velocity_z=w, fom_x=0.005)
    track.x_velocity_valid = track.y_velocity_valid = track.z_velocity_valid = not lost(t)
    return bridged(track)


def bridged(track: SimpleNamespace) -> TwistWithCovarianceStamped:
    """Run the program of the page up to `spin`, and give it one message."""
    sent: list[Any] = []
    listening: list[Callable[[Any], None]] = []
    node = SimpleNamespace(
        create_publisher=lambda *_: SimpleNamespace(publish=sent.append),
        create_subscription=lambda _kind, _topic, listen, _depth: listening.append(listen),
    )
    ros = SimpleNamespace(init=lambda: None, create_node=lambda _: node, spin=lambda _: listening[0](track))
    interfaces, messages = ModuleType("interfaces"), ModuleType("interfaces.msg")
    messages.__dict__["BottomTrack"] = Empty
    with pytest.MonkeyPatch.context() as patch:
        for name, module in (("rclpy", ros), ("interfaces", interfaces), ("interfaces.msg", messages)):
            patch.setitem(sys.modules, name, module)
        exec(compile(block_of(PAGE_FILE, "nucleus.py"), "nucleus.py", "exec"), {})
    (found,) = sent
    assert isinstance(found, TwistWithCovarianceStamped)
    return found


def odometry(t: float, mount: Mount, frame: str, child: str, zero_m: float = 0.0) -> Odometry:
    """Of an estimator, in REP-105, which says nothing of its covariance."""
    made: Odometry = stamped(Odometry(child_frame_id=child), t, frame)
    north, east, depth = TRUTH.point(t)
    set_xyz(made.pose.pose.position, (east, north, zero_m - DEPTH.on([depth])[0]))
    q = made.pose.pose.orientation
    q.x, q.y, q.z, q.w = xyzw_from_sname(*TRUTH.attitude(t))
    set_xyz(made.twist.twist.linear, half_turn(speed(t, mount)))
    set_xyz(made.twist.twist.angular, half_turn(TRUTH.rates(t)))
    return made


def of_ardusub(t: float, mount: Mount) -> Odometry:
    """global_position.cpp of MAVROS, of an ArduSub that knows no place: the height in millimeters, velocities of zero.

    Its place is counted from the middle of the earth, and its covariances are those of a GPS without a fix.
    """
    made: Odometry = stamped(Odometry(child_frame_id="base_link"), t, "map")
    set_xyz(made.pose.pose.position, (6378137.0, 0.0, -round(depth_at(t, mount), 3)))
    made.pose.covariance[:15:7], made.pose.covariance[21::7] = [9998.0] * 3, [99999.0] * 3
    made.twist.covariance[0] = -1.0
    return made


def filtered(t: float, mount: Mount) -> Odometry:
    """ros_filter.cpp of robot_localization: covariances of both."""
    made = odometry(t, mount, "odom", "base_link")
    made.pose.covariance[::7] = made.twist.covariance[::7] = [1e-4] * 6
    return made


def depth_at(t: float, mount: Mount) -> float:
    return DEPTH.on([TRUTH.point(t, mount.position_m)[2]])[0]


def pressure(t: float, mount: Mount) -> FluidPressure:
    pressure_Pa = 101325.0 + 1000.0 * GRAVITY_mps2 * depth_at(t, mount)
    made: FluidPressure = stamped(FluidPressure(fluid_pressure=pressure_Pa), t)
    return made


def bar30_odometry(t: float, mount: Mount) -> Odometry:
    """bar30_component.py: the height alone, in millimeters, without a child frame."""
    made: Odometry = stamped(Odometry(), t, "bar30_link")
    made.pose.pose.position.z = -round(depth_at(t, mount), 3)
    return made


def echo(t: float, mount: Mount) -> Range:
    """ping1d_component.py: whole millimeters; as other drivers, infinity once in a while where nothing answered."""
    down = matrix(TRUTH.attitude(t))[2][2]
    slant = math.cos(max(0.0, math.acos(down) - math.radians(12.5)))
    made: Range = stamped(Range(radiation_type=Range.ULTRASOUND, field_of_view=0.1, min_range=0.1, max_range=3.0), t)
    made.range = round((FLOOR_m - TRUTH.point(t, mount.position_m)[2]) / slant, 3)
    if round(t * 10) % 7 == 0:
        made.range = math.inf
    return made


def pose(kind: type, t: float, mount: Mount, zero_m: float) -> Any:
    made = stamped(kind(), t, "world")
    place = made.pose if kind is PoseStamped else made.pose.pose
    place.position.z = zero_m - depth_at(t, mount)
    return made


PLACE = Noise(0.001)


def tracked(t: float, mount: Mount) -> PoseStamped:
    """Pose of the markers; while they are hidden, the last one again."""
    seen_s = LOST_s[0] if lost(t) else t
    made: PoseStamped = pose(PoseStamped, t, mount, SURFACE_m)
    north, east, depth_m = TRUTH.point(seen_s, mount.position_m)
    q = made.pose.orientation
    q.x, q.y, q.z, q.w = xyzw_from_sname(*TRUTH.attitude(seen_s))
    set_xyz(
        made.pose.position,
        (east, north, SURFACE_m - depth_m) if lost(t) else PLACE.on((east, north, SURFACE_m - depth_m)),
    )
    return made


def on_zed(t: float, mount: Mount) -> Odometry:
    """zed_camera_component_main.cpp: velocity of the camera in its own axes, x forward, y left, z up."""
    return odometry(t, mount, "odom", "zed_camera_link")


RELIABLE, BEST_EFFORT = qos_profile_system_default, qos_profile_sensor_data
DRIVERS: dict[str, Driver] = {
    "/waterlinked_dvl_driver/velocity_report": Driver(
        lambda: message_class(f"{MARINE}/msg/Dvl"), RELIABLE, 8.0, velocity_report
    ),
    "/waterlinked_dvl_driver/odom": Driver(lambda: Odometry, RELIABLE, 40.0, WaterLinkedOdometry()),
    "/nucleus/velocity": Driver(lambda: TwistWithCovarianceStamped, 10, 8.0, twist),
    "/zed/zed_node/odom": Driver(lambda: Odometry, 10, 15.0, on_zed),
    "/zed/zed_node/imu/data": Driver(
        lambda: Imu, 10, 200.0, lambda t, mount: imu(t, mount, half_turn, "zed_imu_link", 1e-6)
    ),
    "/vectornav/imu": Driver(lambda: Imu, 10, 200.0, lambda t, mount: imu(t, mount, fsd, "vectornav", 0.0)),
    "/vectornav/magnetic": Driver(lambda: MagneticField, 10, 25.0, lambda t, _: field(t, fsd, 1.0)),
    "/imu/data": Driver(lambda: Imu, 5, 200.0, of_xsens),
    "/imu/mag": Driver(lambda: MagneticField, 5, 25.0, lambda t, _: field(t, half_turn, 2.0)),
    "/mavros/imu/data_raw": Driver(lambda: Imu, BEST_EFFORT, 50.0, of_mavros),
    "/mavros/imu/mag": Driver(lambda: MagneticField, BEST_EFFORT, 50.0, lambda t, _: field(t, half_turn, 1e6)),
    "/mavros/global_position/local": Driver(lambda: Odometry, BEST_EFFORT, 10.0, of_ardusub),
    "/mavros/local_position/odom": Driver(
        lambda: Odometry, BEST_EFFORT, 20.0, lambda t, mount: odometry(t, mount, "map", "base_link")
    ),
    "/bar30/pressure": Driver(lambda: FluidPressure, BEST_EFFORT, 20.0, pressure),
    "/bar30/odom": Driver(lambda: Odometry, 10, 50.0, bar30_odometry),
    "/ping1d/range": Driver(lambda: Range, 10, 10.0, echo),
    "/vrpn_mocap/rov/pose": Driver(lambda: PoseStamped, BEST_EFFORT, 100.0, tracked),
    "/usbl/pose": Driver(
        lambda: PoseWithCovarianceStamped, 10, 5.0, lambda t, mount: pose(PoseWithCovarianceStamped, t, mount, 0.0)
    ),
    "/odometry/filtered": Driver(lambda: Odometry, 10, 30.0, filtered),
}
"""By topic. Fields in gauss, in shares of the earth's field, and of MAVROS a thousand times its milligauss."""
OF_ROWS = {
    "use_enu: true": {
        "/vectornav/imu": Driver(lambda: Imu, 10, 200.0, lambda t, at: imu(t, at, enu_of_vectornav, "vectornav", 0.0))
    },
    "microstrain": {
        "/imu/data": Driver(lambda: Imu, 100, 100.0, lambda t, at: imu(t, at, half_turn, "imu_link", 0.01)),
        "/imu/mag": Driver(lambda: MagneticField, 100, 25.0, lambda t, _: field(t, half_turn, 1e-4)),
    },
}
"""By a word of the row, drivers of topics that another row has too; of MicroStrain by its publishers.cpp."""
OTHERS = {
    "dvl": "-p input.velocity:=odometry -r dvl/odometry:=/waterlinked_dvl_driver/odom",
    "imu": "-r imu/data_raw:=/vectornav/imu",
    "depth": "-r depth/pressure:=/bar30/pressure",
}
"""Arguments of the sensors that a row does not speak of."""
SENSORS = """
  dvl: {device: a50, position_m: [0.10, 0.0, 0.12], rotation_deg: [180.0, 0.0, 0.0]}
  imu: {device: icm20948}
  depth: {device: ms5837, position_m: [-0.2, 0.0, 0.0]}
"""


@pytest.fixture(scope="module", autouse=True)
def marine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The message of a DVL, which is in no wheel."""
    if any((Path(entry) / MARINE).is_dir() for entry in sys.path):
        yield
        return
    built = built_messages(tmp_path_factory.mktemp(MARINE), MARINE, "Dvl", DVL, "std_msgs", "geometry_msgs")
    with loaded_here(built, MARINE):
        yield


def vehicle_with(sensors: dict[str, Any], folder: Path) -> Path:
    """The vehicle file with these sensors."""
    text = default_vehicle().read_text(encoding="utf-8")
    begin, end = text.index("\nsensors:"), text.index("\noutput:")
    file = folder / "myrov.yaml"
    file.write_text(f"{text[:begin]}\n{yaml.safe_dump({'sensors': sensors})}{text[end:]}", encoding="utf-8")
    return file


class Graph:
    """The nodes of one line, and a publisher for each topic of a driver in it."""

    def __init__(self, words: Sequence[str], vehicle: Path, drivers: dict[str, Driver]) -> None:
        rclpy.init(args=["--ros-args", "-p", f"vehicle:={vehicle}", *words])
        self._topics = [word.partition(":=")[2] for word in words if ":=/" in word]
        assert all(topic in DRIVERS for topic in self._topics)
        self._mounts = load_vehicle(vehicle).sensors
        self._owners = {word.partition(":=")[2]: word.partition("/")[0] for word in words if ":=/" in word}
        self._drivers = drivers
        self.nodes: Sequence[Any] = ()
        self.driver: Node | None = None

    def make(self) -> None:
        """Make nodes and publishers."""
        self.nodes = make_nodes()
        self.driver = Node("drivers")
        self._publishers = [
            (self.driver.create_publisher(made.kind(), topic, made.quality), made, self._mount(topic))
            for topic, made in ((topic, self._drivers[topic]) for topic in self._topics)
        ]
        self._begin_s = 0.0

    def _mount(self, topic: str) -> Mount:
        return self._mounts.get(self._owners[topic], Mount("a50"))

    def fly(self, arrived: Callable[[], float], from_s: float = 0.0, *, paced: bool = False) -> None:
        """Publish the truth from a time on; each batch waits until a state of about its end has arrived.

        Paced, it is published when it happens: the pilot refuses states of the future.
        """
        assert self.driver is not None
        self._drain(lambda: all(out.get_subscription_count() for out, _, _ in self._publishers))
        time.sleep(DISCOVERED_S)
        self._begin_s = self.driver.get_clock().now().nanoseconds / NS_PER_S - from_s
        self._sent = [math.ceil(from_s * made.rate_Hz) for _, made, _ in self._publishers]
        for batch in range(round((SECONDS - from_s) / BATCH_S)):
            end = from_s + (batch + 1) * BATCH_S
            if paced:
                time.sleep(max(0.0, self._begin_s + end - time.time()))
            for index, (out, made, mount) in enumerate(self._publishers):
                while (t := self._sent[index] / made.rate_Hz) < end:
                    message = made.message(t, mount)
                    self._sent[index] += 1
                    if message is None:
                        continue
                    stamp = message.header.stamp
                    message.header.stamp = stamp_to_msg(
                        round(self._begin_s * NS_PER_S) + stamp.sec * NS_PER_S + stamp.nanosec
                    )
                    out.publish(message)
                    message.header.stamp = stamp
            self._drain(lambda end=end: end < REST_s or arrived() > end - BATCH_S)  # type: ignore[misc]

    def time(self, stamp: int) -> float:
        """Seconds of the truth."""
        return stamp / NS_PER_S - self._begin_s

    def _drain(self, done: Callable[[], bool]) -> None:
        deadline, turns = time.monotonic() + PATIENT_S, count()
        while next(turns) < LEAST_TURNS or not done():
            assert time.monotonic() < deadline, "no state came of what was published"
            time.sleep(0.002)
            for node in self.nodes:
                node.drain()

    def close(self) -> None:
        """End all."""
        for node in (*self.nodes, *([self.driver] if self.driver else [])):
            node.destroy_node()
        gc.collect()  # of nodes that could not all be made nothing is destroyed: others would meet them in this domain
        rclpy.try_shutdown()


@pytest.fixture
def graph_of(tmp_path: Path, ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Graph]]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    made: list[Graph] = []

    def make(line: str, sensor: str = "{}", drivers: dict[str, Driver] = DRIVERS) -> Graph:
        sensors = yaml.safe_load(SENSORS) | yaml.safe_load(sensor)
        words = shlex.split(line)
        made.append(Graph(words, vehicle_with(sensors, tmp_path), drivers))
        return made[-1]

    yield make
    for one in made:
        one.close()


def node_of(graph: Graph, kind: type) -> Any:
    (found,) = [node for node in graph.nodes if isinstance(node, kind)]
    return found


def test_each_row_and_line_has_its_publisher() -> None:
    named = set(re.findall(r":=(/[\w/]+)", " ".join([*(row["words"] for row in ROWS), *LINES])))
    assert named == set(DRIVERS)
    assert len(ROWS) == 17
    assert len(LINES) == 3


def rms(values: Sequence[float]) -> float:
    return math.sqrt(sum(value * value for value in values) / len(values))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: re.sub(r"\W+", "-", row["who"])[:40])
def test_the_navigator_follows_the_truth_by_a_publisher_of_others(
    row: dict[str, str], graph_of: Callable[..., Graph]
) -> None:
    name = row["sensor"].partition(":")[0]
    others = [words for sensor, words in OTHERS.items() if sensor != name]
    compass = "imu/mag" in row["words"]
    drivers = DRIVERS | next((of for word, of in OF_ROWS.items() if word in row["who"]), {})
    graph = graph_of(" ".join([row["words"], *others]), row["sensor"], drivers)
    graph.make()
    navigator, states = node_of(graph, NavigatorNode), list[Stamped[Navigation]]()
    navigator.on_state = states.append
    graph.fly(lambda: graph.time(states[-1].stamp) if states else 0.0)
    settled = [(graph.time(one.stamp), one.reading) for one in states if graph.time(one.stamp) > SETTLED_s]
    assert len(settled) > 0.9 * (SECONDS - SETTLED_s) * (50 if "mavros/imu" not in row["words"] else 25)
    off = [vector(a - b for a, b in zip(one.velocity_mps, TRUTH.velocity(t), strict=True)) for t, one in settled]
    sigma = [rms([one.velocity_sigma_mps[axis] for _, one in settled]) for axis in range(3)]
    for axis in range(3):
        assert rms([one[axis] for one in off]) < min(0.05, 2.0 * sigma[axis] + 0.005), (axis, sigma)
    assert rms([one.depth_m - TRUTH.position(t)[2] for t, one in settled]) < 0.02
    for axis, most_rad in ((0, 0.02), (1, 0.02), (2, 0.1 if compass else 0.06)):
        turned = [one.attitude_rad[axis] - TRUTH.attitude(t)[axis] for t, one in settled]
        assert rms(turned) < most_rad, axis
    last = settled[-1][1]
    assert last.dvl_locked
    assert max(last.ages_s.values()) < 1.0, last.ages_s
    if name == "sonar":
        assert last.altitude_m == pytest.approx(FLOOR_m - TRUTH.position(settled[-1][0])[2], abs=0.03)
    if name == "dvl" and "/zed" not in row["words"]:
        assert not all(one.dvl_locked for _, one in settled), "the DVL had lost the bottom"


@pytest.mark.parametrize("line", LINES[1:])
def test_the_pilot_flies_on_an_estimator_of_others(line: str, graph_of: Callable[..., Graph]) -> None:
    graph = graph_of(" ".join(shlex.split(line)[7:]))
    graph.make()
    states: list[Stamped[Navigation]] = []
    pilot = node_of(graph, PilotNode)
    step = pilot.health.on_navigation

    def on_navigation(stamped: Stamped[Navigation]) -> None:
        states.append(stamped)
        step(stamped)

    pilot.health.on_navigation = on_navigation
    graph.fly(lambda: graph.time(states[-1].stamp) if states else 0.0, SECONDS - 4.0, paced=True)
    assert len(states) > 20
    for found in states:
        t = graph.time(found.stamp)
        assert found.reading.velocity_mps == pytest.approx(TRUTH.velocity(t), abs=0.03)
        assert found.reading.depth_m == pytest.approx(TRUTH.position(t)[2], abs=0.02)
        assert found.reading.attitude_rad == pytest.approx(TRUTH.attitude(t), abs=1e-6)
    assert not pilot.health.failed()


K_Q, K_L, INERTIA_kg = 60.0, 5.0, 25.0
PUSHED_s = 72.0


def pushed(rate_Hz: float) -> Iterator[tuple[float, float, float]]:
    """Time, force and speed of a vehicle that is pushed forth and back along surge."""
    speed_mps, steps = 0.0, 20
    for step in range(round(PUSHED_s * rate_Hz)):
        t = step / rate_Hz
        force = (20.0, 12.0, 6.0)[int(t // 12.0) % 3] * (1.0 if t % 12.0 < 6.0 else -1.0)
        yield t, force, speed_mps
        for _ in range(steps):
            drag = K_Q * abs(speed_mps) * speed_mps + K_L * speed_mps
            speed_mps += (force - drag) / INERTIA_kg / rate_Hz / steps


@pytest.mark.parametrize(("topic", "variance"), [("/odometry/filtered", 1e-4), ("/mavros/local_position/odom", 0.0)])
@pytest.mark.usefixtures("graph_of")
def test_the_identifier_finds_the_drag_on_an_estimator_of_others(topic: str, variance: float, tmp_path: Path) -> None:
    _, quality, rate_Hz, _ = DRIVERS[topic]
    vehicle = vehicle_with(yaml.safe_load(SENSORS), tmp_path)
    words = ["-p", f"vehicle:={vehicle}", "-r", f"odometry:={topic}", "-r", "wrench:=/myrov/wrench"]
    rclpy.init(args=["--ros-args", *words])
    node, driver = Identifier(), Node("drivers")
    try:
        out = driver.create_publisher(Odometry, topic, quality)
        thrust = driver.create_publisher(WrenchStamped, "/myrov/wrench", 10)
        deadline = time.monotonic() + PATIENT_S
        while not (out.get_subscription_count() and thrust.get_subscription_count()):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        time.sleep(DISCOVERED_S)
        # A stamp may not be far ahead of the clock.
        begin_ns = node.now() - round(PUSHED_s * NS_PER_S)
        for step, (t, force, speed_mps) in enumerate(pushed(rate_Hz)):
            stamp = stamp_to_msg(begin_ns + round(t * NS_PER_S))
            state, push = Odometry(child_frame_id="base_link"), WrenchStamped()
            state.header.frame_id, push.header.frame_id = "map", "base_link"
            state.header.stamp = push.header.stamp = stamp
            state.twist.twist.linear.x, push.wrench.force.x = SPEED.on([speed_mps])[0], force
            state.twist.covariance[::7] = [variance] * 6
            thrust.publish(push)
            out.publish(state)
            if step % 20 == 0:
                time.sleep(0.01)
                node.drain()
        time.sleep(DISCOVERED_S)
        node.drain()
        (found,) = _motions(node._any).values()
    finally:
        for one in (node, driver):
            one.destroy_node()
        rclpy.try_shutdown()
    assert found.identifiable, found.reasons
    drag = found.coefficients["k_q"]
    assert drag.std < 0.1 * K_Q
    assert abs(drag.value - K_Q) < 2.5 * drag.std


def test_a_message_that_is_not_installed_is_named_with_the_remedy(
    graph_of: Callable[..., Graph], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, MARINE, None)
    monkeypatch.setitem(sys.modules, f"{MARINE}.msg", None)
    message_class.cache_clear()
    graph = graph_of(ROWS[0]["words"], ROWS[0]["sensor"])
    with pytest.raises(UsageError, match="sudo apt install ros-jazzy-marine-acoustic-msgs"):
        graph.make()


def test_a_navigator_without_a_state_says_why(graph_of: Callable[..., Graph], monkeypatch: pytest.MonkeyPatch) -> None:
    graph = graph_of(OTHERS["imu"])
    graph.make()
    node, said = node_of(graph, NavigatorNode), list[Any]()
    monkeypatch.setattr(node._reporter, "publish", lambda _, status: said.append(status))
    for number in range(1000):
        free = Stamped(stamp_from_s(5.0 + 0.01 * number), Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), NAN))
        assert node._navigator.step(free, "imu") is None
    node._report_silence()
    assert said == [], "it has just started"
    node._report_silence()
    assert said[-1].level == DiagnosticStatus.WARN
    assert said[-1].message.startswith("no state: it takes samples of an inertial sensor; refused: imu: found mean acc")


def turned_report(t: float, mount: Mount) -> Any:
    """A DVL told a mounting rotation of 180 degrees, as the Water Linked driver does unless its parameters say 0."""
    made = velocity_report(t, mount)
    made.velocity.x, made.velocity.y = -made.velocity.x, -made.velocity.y
    return made


def mirrored_pressure(t: float, mount: Mount) -> FluidPressure:
    """A pressure that falls where it should rise."""
    made = pressure(t, mount)
    made.fluid_pressure = 2.0 * (101325.0 + 1000.0 * GRAVITY_mps2 * TRUTH.position(0.0)[2]) - made.fluid_pressure
    return made


@pytest.mark.parametrize(
    ("topic", "message", "words"),
    [
        ("/waterlinked_dvl_driver/velocity_report", turned_report, "velocities contradict the accelerometer: check"),
        ("/bar30/pressure", mirrored_pressure, "depths contradict the accelerometer: check"),
    ],
)
def test_a_sensor_that_is_turned_is_named_by_the_navigator(
    topic: str, message: Callable[[float, Mount], Any], words: str, graph_of: Callable[..., Graph]
) -> None:
    others = [arguments for sensor, arguments in OTHERS.items() if sensor != "dvl"]
    line, drivers = " ".join([ROWS[0]["words"], *others]), DRIVERS | {topic: DRIVERS[topic]._replace(message=message)}
    graph = graph_of(line, ROWS[0]["sensor"], drivers)
    graph.make()
    navigator, states, said = node_of(graph, NavigatorNode), list[Stamped[Navigation]](), list[str]()

    def on_state(one: Stamped[Navigation]) -> None:
        states.append(one)
        said.extend(navigator._wrong(one.reading))

    navigator.on_state = on_state
    graph.fly(lambda: graph.time(states[-1].stamp) if states else 0.0)
    assert any(words in one for one in said), set(said)


def test_the_whole_line_of_the_page_starts(graph_of: Callable[..., Graph]) -> None:
    (block,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    graph = graph_of(" ".join(shlex.split(LINES[0])[7:]), yaml.safe_dump(yaml.safe_load(block)["sensors"]))
    graph.make()
    assert node_of(graph, NavigatorNode)
