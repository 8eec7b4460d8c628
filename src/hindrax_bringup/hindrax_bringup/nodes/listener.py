"""A peer for the benchmark of the stack: listens to every topic the way rclpy offers it, and does nothing with it."""

from __future__ import annotations

import sys

import rclpy
from rclpy.executors import SingleThreadedExecutor

from hindrax_core.topics import NAMESPACE, TOPICS
from hindrax_ros.graph import subscription


def main() -> int:
    """Listen until a signal."""
    rclpy.init(args=[])
    node = rclpy.create_node("listener", namespace=NAMESPACE)
    for topic in TOPICS:
        subscription(node, topic, lambda _message: None)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()
    return 0


if __name__ == "__main__":
    sys.exit(main())
