"""A recorder that stands still for a moment misses nothing of what is said meanwhile."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

import rclpy
from rclpy.duration import Duration
from rclpy.publisher import Publisher

from hindrax_bag.read.bag_reader import messages
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_core.topics import IMU, resolved
from hindrax_ros.batched_node import BatchedNode, events_executor
from hindrax_ros.graph import publisher
from hindrax_ros.messages.serialization import message_class

pytestmark = pytest.mark.ros

PATIENT_S = 60.0
BURST = 1000
"""Messages of a second of a mock that runs at five times real time; 20 times what the publisher keeps."""
WANTED_BYTES = 4 << 20
GRANTED = Path("/proc/sys/net/core/rmem_max")


def say(out: Publisher) -> None:
    out.publish(message_class(IMU.type)())
    assert out.wait_for_all_acked(Duration(seconds=PATIENT_S))


@pytest.mark.skipif(int(GRANTED.read_text()) < WANTED_BYTES, reason="this kernel grants sockets too little")
def test_what_is_reported_while_it_stands_still_is_in_the_bag(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    words = ["-m", "hindrax_bag.nodes.recorder", "--ros-args", "-p", f"bag:={bag}"]
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        rclpy.init(args=[])
        node, executor = BatchedNode("speaker", ros_time=False), events_executor()
        executor.add_node(node)
        recorder = subprocess.Popen([sys.executable, *words])
        try:
            out = publisher(node, IMU, held=False)
            deadline = time.monotonic() + PATIENT_S
            while not out.get_subscription_count():
                assert time.monotonic() < deadline
                executor.spin_once(timeout_sec=0.05)
            say(out)  # the recorder has found its speaker when it acknowledges this one
            recorder.send_signal(signal.SIGSTOP)
            for _ in range(BURST):
                out.publish(message_class(IMU.type)())
            recorder.send_signal(signal.SIGCONT)
            say(out)
            recorder.send_signal(signal.SIGINT)
            assert recorder.wait(PATIENT_S) == 0
        finally:
            recorder.kill()
            executor.shutdown()
            node.destroy_node()
            rclpy.try_shutdown()
    assert sum(message.topic == resolved(IMU) for message in messages(bag)) == BURST + 2
