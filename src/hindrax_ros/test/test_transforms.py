"""Transforms of the vehicle's frames: what they do to a point, and that they are published where they can be."""

import sys
from types import ModuleType, SimpleNamespace

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from geometry_msgs.msg import Quaternion

from hindrax_core.events import Stamp, Stamped
from hindrax_core.signals import Navigation
from hindrax_ros import transforms
from hindrax_ros.convert import odometry_to_msg

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
FOUND = Stamped(Stamp(3_000_000_007), STATE)
ODOMETRY = odometry_to_msg(FOUND)


class TFMessage:
    """Stand-in of tf2_msgs/msg/TFMessage."""

    def __init__(self, transforms: list[object]) -> None:
        self.transforms = transforms


def turned(q: Quaternion, v: tuple[float, float, float]) -> tuple[float, float, float]:
    """v + 2 w (u x v) + 2 u x (u x v), u the vector part."""

    def cross(a: tuple[float, ...], b: tuple[float, ...]) -> tuple[float, float, float]:
        return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])

    u = (q.x, q.y, q.z)
    once = cross(u, v)
    twice = cross(u, once)
    x, y, z = (a + 2.0 * q.w * b + 2.0 * c for a, b, c in zip(v, once, twice, strict=True))
    return (x, y, z)


def test_the_vehicle_stands_in_the_transform_where_it_stands_in_the_odometry() -> None:
    found = transforms.base_of(ODOMETRY)
    assert (found.header.frame_id, found.child_frame_id) == ("odom", "base_link")
    assert found.header.stamp == ODOMETRY.header.stamp
    place = found.transform.translation
    assert (place.x, place.y, place.z) == (-2.5, 1.5, -0.9)
    assert found.transform.rotation == ODOMETRY.pose.pose.orientation


def test_the_body_axes_of_the_model_are_half_a_turn_away() -> None:
    found = transforms.half_turn_about_x(Stamp(9))
    assert (found.header.frame_id, found.child_frame_id) == ("base_link", "base_link_fsd")
    assert turned(found.transform.rotation, (1.0, 2.0, 3.0)) == pytest.approx((1.0, -2.0, -3.0))


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, object]]:
    """What is published, by topic, with a stand-in of tf2_msgs."""
    for name in ("tf2_msgs", "tf2_msgs.msg"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    sys.modules["tf2_msgs.msg"].TFMessage = TFMessage  # type: ignore[attr-defined]  # a stand-in
    out: list[tuple[str, object]] = []

    def create(_node: object, _kind: object, name: str, _quality: object) -> SimpleNamespace:
        return SimpleNamespace(publish=lambda message: out.append((name, message)))

    monkeypatch.setattr(transforms.Node, "create_publisher", create)
    return out


def test_both_are_published_where_tf2_is_installed(sent: list[tuple[str, TFMessage]]) -> None:
    clock = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=9))
    transforms.Transforms(SimpleNamespace(get_clock=lambda: clock)).publish(FOUND)
    assert [(name, [one.child_frame_id for one in message.transforms]) for name, message in sent] == [
        ("/tf_static", ["base_link_fsd"]),
        ("/tf", ["base_link"]),
    ]


def test_elsewhere_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tf2_msgs", None)
    monkeypatch.setattr(transforms, "optional_class", lambda _: None)
    transforms.Transforms(SimpleNamespace()).publish(FOUND)
