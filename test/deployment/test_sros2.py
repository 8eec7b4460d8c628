"""The policies, enforced by the middleware itself: only where the machine's own ROS has sros2 and DDS security."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from hindrax_bringup.network import security
from hindrax_bringup.network.security import FROM_WHEELS, OVERRIDE
from hindrax_bringup.share_files import share_folder
from hindrax_bringup.stack import environment

HEARD_S, STARTED_S = 12.0, 60.0
TALK = """
import sys, time, rclpy
from {package} import {name}
rclpy.init(args=[])
node = rclpy.create_node(sys.argv[1], namespace="/hindrax")
out = node.create_publisher({name}, sys.argv[2], 10)
print("up", flush=True)
while True:
    out.publish({name}())
    rclpy.spin_once(node, timeout_sec=0.1)
"""
HEAR = """
import sys, time, rclpy
from {package} import {name}
rclpy.init(args=[])
node = rclpy.create_node(sys.argv[1], namespace="/hindrax")
heard = []
node.create_subscription({name}, sys.argv[2], heard.append, 10)
deadline = time.monotonic() + float(sys.argv[3])
while not heard and time.monotonic() < deadline:
    rclpy.spin_once(node, timeout_sec=0.1)
print("heard" if heard else "nothing", flush=True)
"""
WRENCH = {"package": "geometry_msgs.msg", "name": "WrenchStamped"}
PULSES = {"package": "hindrax_msgs.msg", "name": "ThrusterCommand"}


def has_sros2() -> bool:
    """Whether keys can be made here, and are obeyed."""
    if FROM_WHEELS in os.environ or shutil.which("ros2") is None:
        return False
    return subprocess.run(["ros2", "security", "--help"], capture_output=True, check=False).returncode == 0


pytestmark = [
    pytest.mark.ros,
    pytest.mark.long,
    pytest.mark.skipif(not has_sros2(), reason="SROS2: needs a ROS installation with ros-jazzy-sros2, found none here"),
]


@pytest.fixture(scope="module")
def keystore(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> dict[str, str]:
    """Environment of a process that enforces a keystore made for this domain; without an identity."""
    folder = tmp_path_factory.mktemp("sros2") / "keys"
    open_graph = environment(mock=False, domain=ros_domain)
    subprocess.run([share_folder("security") / "keystore.sh", folder], env=open_graph, check=True)
    return open_graph | security.settings(str(folder), {})


@contextmanager
def talking(node: str, topic: str, message: Mapping[str, str], variables: Mapping[str, str]) -> Iterator[None]:
    words = [sys.executable, "-c", TALK.format(**message), node, topic]
    with subprocess.Popen(words, env=variables, stdout=subprocess.PIPE, text=True) as child:
        try:
            assert child.stdout is not None
            assert child.stdout.readline() == "up\n"
            yield
        finally:
            child.kill()


def hears(node: str, topic: str, message: Mapping[str, str], variables: Mapping[str, str]) -> bool:
    words = [sys.executable, "-c", HEAR.format(**message), node, topic, str(HEARD_S)]
    done = subprocess.run(words, env=variables, capture_output=True, text=True, timeout=STARTED_S, check=True)
    return done.stdout.strip() == "heard"


def identity(keystore: Mapping[str, str], process: str) -> dict[str, str]:
    return {**keystore, OVERRIDE: security.path(process)}


def test_the_pilot_is_heard_and_a_stranger_is_not(keystore: Mapping[str, str]) -> None:
    control = identity(keystore, "control")
    open_graph = {name: value for name, value in keystore.items() if not name.startswith("ROS_SECURITY_")}
    with talking("stranger", "control/wrench", WRENCH, open_graph):
        assert not hears("allocator", "control/wrench", WRENCH, control)
        with ExitStack() as also:
            also.enter_context(talking("pilot", "control/wrench", WRENCH, control))
            assert hears("allocator", "control/wrench", WRENCH, control)


def test_the_operator_may_make_no_pulses(keystore: Mapping[str, str]) -> None:
    words = [sys.executable, "-c", TALK.format(**PULSES), "operator", "thrusters/command"]
    refused = subprocess.run(
        words, env=identity(keystore, "operator"), capture_output=True, text=True, timeout=STARTED_S, check=False
    )
    assert refused.returncode != 0, "a publisher that the policy does not allow cannot be made"


def test_the_folder_of_keys_is_private(keystore: Mapping[str, str]) -> None:
    assert Path(keystore["ROS_SECURITY_KEYSTORE"]).stat().st_mode & 0o077 == 0
