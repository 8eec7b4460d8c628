"""Frames of the vehicle: what they do to a point, on /tf, on /tf_static and in the URDF alike."""

import json
import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from ament_index_python.packages import get_package_share_directory
from geometry_msgs.msg import Quaternion

from hindrax_core.events import Stamp, Stamped
from hindrax_core.messages.frames import frames_of, urdf_of
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import Mount, Vehicle, load_vehicle
from hindrax_ros import transforms
from hindrax_ros.testing.state_messages import odometry_to_msg
from hindrax_ros.transforms import fixed

HINDRAX = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
STATE = Navigation(
    attitude_rad=(0.1, -0.2, 0.7),
    rate_radps=(0.0, 0.0, 0.0),
    velocity_mps=(0.4, 0.0, 0.0),
    depth_m=0.9,
    altitude_m=0.8,
    position_m=(1.5, -2.5),
    dvl_locked=True,
    ages_s={},
)
STAMPED = Stamped(Stamp(3_000_000_007), STATE)
ODOMETRY = odometry_to_msg(STAMPED)
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
FORWARD, LEFT, UP = X, Y, Z


def turned(q: Quaternion, v: tuple[float, float, float]) -> tuple[float, float, float]:
    """v + 2 w (u x v) + 2 u x (u x v), u the vector part."""

    def cross(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, float, float]:
        return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])

    u = (q.x, q.y, q.z)
    once = cross(u, v)
    twice = cross(u, once)
    x, y, z = (a + 2.0 * q.w * b + 2.0 * c for a, b, c in zip(v, once, twice, strict=True))
    return (x, y, z)


def axes(vehicle: Vehicle, name: str) -> list[tuple[float, float, float]]:
    """Directions of x, y and z of a frame in base_link."""
    (frame,) = (one for one in frames_of(vehicle) if one.name == name)
    rotation = fixed(frame).transform.rotation
    return [turned(rotation, axis) for axis in (X, Y, Z)]


def minus(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = vector
    return (-x, -y, -z)


def mounted(name: str, *rotation_deg: float) -> Vehicle:
    roll, pitch, yaw = rotation_deg
    mount = Mount(name, position_m=(0.1, 0.2, 0.3), rotation_deg=(roll, pitch, yaw))
    return replace(HINDRAX, sensors={name: mount})


def test_the_vehicle_stands_in_the_transform_where_it_stands_in_the_odometry() -> None:
    found = transforms.base_of(STAMPED)
    assert (found.header.frame_id, found.child_frame_id) == ("odom", "base_link")
    assert found.header.stamp == ODOMETRY.header.stamp
    place = found.transform.translation
    assert (place.x, place.y, place.z) == (-2.5, 1.5, -0.9)
    assert found.transform.rotation == ODOMETRY.pose.pose.orientation


@pytest.mark.parametrize(
    ("vehicle", "frame", "wanted"),
    [
        (HINDRAX, "base_link_fsd", (FORWARD, minus(LEFT), minus(UP))),
        (mounted("icm20948", 0.0, 0.0, 0.0), "icm20948_link", (FORWARD, minus(LEFT), minus(UP))),
        (mounted("icm20948", 0.0, 0.0, 90.0), "icm20948_link", (minus(LEFT), minus(FORWARD), minus(UP))),
        (mounted("dvl75", 0.0, 0.0, 0.0), "dvl75_link", (FORWARD, LEFT, UP)),
        (mounted("dvl75", 0.0, 0.0, 90.0), "dvl75_link", (minus(LEFT), FORWARD, UP)),
        (mounted("ping1d", 0.0, 0.0, 0.0), "ping1d_link", (minus(UP), LEFT, FORWARD)),
        (mounted("ping1d", 180.0, 0.0, 0.0), "ping1d_link", (UP, minus(LEFT), FORWARD)),
        (mounted("ping1d", 0.0, 90.0, 0.0), "ping1d_link", (FORWARD, LEFT, UP)),
    ],
)
def test_a_sensor_has_the_axes_of_its_messages(
    vehicle: Vehicle, frame: str, wanted: tuple[tuple[float, ...], ...]
) -> None:
    for found, axis in zip(axes(vehicle, frame), wanted, strict=True):
        assert found == pytest.approx(axis, abs=1e-9)


def test_a_sensor_is_where_the_vehicle_file_has_it() -> None:
    (frame,) = (one for one in frames_of(mounted("ms5837", 0.0, 0.0, 0.0)) if one.name == "ms5837_link")
    place = fixed(frame).transform.translation
    assert (place.x, place.y, place.z) == (0.1, -0.2, -0.3)


def test_a_thruster_pushes_along_its_x() -> None:
    for thruster in HINDRAX.thrusters:
        x, y, z = thruster.direction
        assert axes(HINDRAX, f"{thruster.name}_link")[0] == pytest.approx((x, -y, -z), abs=1e-9)


def test_the_description_has_a_link_for_every_frame_and_states_where_it_is() -> None:
    robot = ET.fromstring(urdf_of(HINDRAX))
    frames = frames_of(HINDRAX)
    assert [one.get("name") for one in robot.findall("link")] == ["base_link", *(frame.name for frame in frames)]
    for joint, frame in zip(robot.findall("joint"), frames, strict=True):
        child, origin = joint.find("child"), joint.find("origin")
        assert child is not None
        assert origin is not None
        assert (child.get("link"), joint.get("type")) == (frame.name, "fixed")
        for name, values in (("xyz", frame.position_m), ("rpy", frame.rpy_rad)):
            assert list(map(float, origin.get(name, "").split())) == pytest.approx(values, abs=1e-8)
    mass = robot.find("link/inertial/mass")
    assert mass is not None
    assert float(mass.get("value", "")) == HINDRAX.mass_kg
    assert math.isclose(HINDRAX.envelope_m[0], float(robot.find("link/visual/geometry/box").get("size").split()[0]))  # type: ignore[union-attr]


def test_the_message_is_that_of_ros() -> None:
    # RIHS01 hash of tf2_msgs/msg/TFMessage in ROS 2 Jazzy, as `ros2 topic info --verbose /tf` prints it.
    wanted = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
    description = Path(get_package_share_directory("tf2_msgs")) / "msg" / "TFMessage.json"
    hashes = json.loads(description.read_text(encoding="utf-8"))["type_hashes"]
    assert {one["type_name"]: one["hash_string"] for one in hashes}["tf2_msgs/msg/TFMessage"] == wanted
