"""Find stacks in a ROS domain of this machine: lock files cover only stacks whose tool still runs.

As a program, `python -m hindrax_bringup.nodes.graph_search NAMESPACE`, it prints the nodes of a stack in the domain
of its environment.
"""

import json
import subprocess
import sys
import time
from collections.abc import Mapping

from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import print_whole
from hindrax_ros.free_domain import occupied_domains

LOOK_AT_MOST_S = 20.0
"""Longest time for the process that looks, on a busy machine."""
STACK_NODES = ("thrusters", "pilot")
LOOK_S = 1.5
"""Longest wait for these nodes; participants announce themselves every 0.1 s to a new one."""


def require_no_stack(domain: int, namespace: str, environment: Mapping[str, str]) -> None:
    """HindraxError when nodes of a stack of this namespace are in this domain; other nodes may be there."""
    if domain not in occupied_domains():
        return
    words = [sys.executable, "-m", "hindrax_bringup.nodes.graph_search", namespace]
    # A process of its own: the middleware keeps the profile of the first node for as long as its process lives.
    try:
        done = subprocess.run(  # noqa: S603  # our own module
            words, env=dict(environment), capture_output=True, text=True, timeout=LOOK_AT_MOST_S, check=True
        )
    except subprocess.SubprocessError as error:
        raise HindraxError(f"ROS domain {domain}: cannot be searched for a stack ({error}); try again") from error
    found = json.loads(done.stdout)
    if found:
        raise HindraxError(
            f"ROS domain {domain}: found the nodes {', '.join(found)} of a stack, wanted none; "
            "end that stack, or unset ROS_DOMAIN_ID for a free domain"
        )


def stack_nodes(space: str) -> list[str]:
    """Names of the nodes of a stack in a namespace, as soon as one is seen; empty after `LOOK_S`."""
    import rclpy  # noqa: PLC0415  # only in the process that looks

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
