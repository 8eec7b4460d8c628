"""A peer for the benchmark of the stack: subscribes to every topic with plain rclpy and discards the messages."""

from __future__ import annotations

import sys

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from hindrax_core.topics import NAMESPACE, TOPICS
from hindrax_ros.checked_node import CheckedNode
from hindrax_ros.graph import subscription


def main() -> int:
    """Listen until a signal."""
    rclpy.init(args=[])
    node = CheckedNode("listener", namespace=NAMESPACE)
    for topic in TOPICS:
        subscription(node, topic, lambda _message: None)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (ExternalShutdownException, RCLError, KeyboardInterrupt) as error:
        # A signal shuts the context down under the executor, which raises one of these.
        if rclpy.ok() and not isinstance(error, KeyboardInterrupt):
            raise
    return 0


if __name__ == "__main__":
    sys.exit(main())
