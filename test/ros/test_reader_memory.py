"""What a reader of a topic costs in memory: a stack has hundreds, in processes that share none of it."""

import subprocess
import sys

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_bringup.stack import environment, own_domain

pytestmark = pytest.mark.ros
READERS = 40
MEASURE = f"""
import re
import rclpy
from nav_msgs.msg import Odometry

def private_kB():
    with open("/proc/self/smaps_rollup") as file:
        return int(re.search(r"Private_Dirty: +([0-9]+)", file.read())[1])

rclpy.init()
node = rclpy.create_node("reader")
node.create_subscription(Odometry, "first", print, 1)
before = private_kB()
for number in range({READERS}):
    node.create_subscription(Odometry, f"topic_{{number}}", print, 1)
print((private_kB() - before) / {READERS})
"""
STATE_kB = 0.7
"""Size of a state on the wire."""


def test_a_reader_of_one_message_has_no_room_for_a_hundred() -> None:
    with own_domain(mock=True) as domain:
        settings = environment(mock=True, domain=domain)
        done = subprocess.run(  # our own interpreter
            [sys.executable, "-c", MEASURE], env=settings, capture_output=True, text=True, timeout=120, check=False
        )
    assert done.returncode == 0, done.stderr
    assert 0.0 < float(done.stdout) < 100 * STATE_kB
