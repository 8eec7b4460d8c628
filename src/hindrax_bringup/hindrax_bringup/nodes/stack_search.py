"""The node `search`: prints which nodes of a stack are in the ROS domain of its environment, and ends."""

from __future__ import annotations

import json
import sys
import time

import rclpy

from hindrax_core.text.screen_text import print_whole

STACK_NODES = ("thrusters", "pilot")
LOOK_S = 1.5
"""Longest wait for these nodes; participants announce themselves every 0.1 s to a new one."""


def stack_nodes(space: str) -> list[str]:
    """Names of the nodes of a stack in a namespace, as soon as one is seen; empty after `LOOK_S`."""
    wanted = {f"{space}/{name}" for name in STACK_NODES}
    rclpy.init(args=[])
    node = rclpy.create_node("search", namespace=space, use_global_arguments=False, enable_rosout=False)
    deadline = time.monotonic() + LOOK_S
    found: set[str] = set()
    while not found and time.monotonic() < deadline:
        time.sleep(0.05)
        found = wanted & {f"{own.rstrip('/')}/{name}" for name, own in node.get_node_names_and_namespaces()}
    node.destroy_node()
    rclpy.shutdown()
    return sorted(found)


if __name__ == "__main__":
    print_whole(json.dumps(stack_nodes(sys.argv[1])))
