"""Cameras on the graph: found by type, subscribed only while a viewer looks."""

import time
from collections.abc import Callable, Iterator

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage

from hindrax_operator.nodes import cameras
from hindrax_operator.nodes.cameras import Cameras

NAME = "/front/image/compressed"


@pytest.fixture
def node(ros_domain: int) -> Iterator[Node]:
    rclpy.init(domain_id=ros_domain)
    try:
        yield Node("watcher")
    finally:
        rclpy.try_shutdown()


def test_a_camera_is_read_while_somebody_looks(node: Node, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cameras, "LOOK_S", 0.0)
    found = Cameras(node)
    out = node.create_publisher(CompressedImage, NAME, 1)
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def until(done: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 30.0
        while not done():
            assert time.monotonic() < deadline
            found.update()
            out.publish(CompressedImage(format="jpeg", data=b"\xff\xd8\xff"))
            executor.spin_once(timeout_sec=0.02)

    until(lambda: found.names == (NAME,))
    assert out.get_subscription_count() == 0, "nobody has looked yet"
    until(lambda: found.frame(NAME) is not None)
    first = found.frame(NAME)
    assert first is not None
    assert first.content == b"\xff\xd8\xff"
    until(lambda: (found.frame(NAME) or first).number > first.number)
    monkeypatch.setattr(cameras, "WANTED_S", 0.0)
    until(lambda: out.get_subscription_count() == 0)
