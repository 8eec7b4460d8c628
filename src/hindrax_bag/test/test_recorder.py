"""The recorder as a process: what is published is in the bag, byte for byte, also after it was killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("hindrax_msgs")

from hindrax_bag.nodes.recorder import parameter_file, type_hash
from hindrax_bag.reader import attachments, messages

COUNT = 300
PUBLISH = """
import time
import rclpy
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu
from hindrax_core.topics import IMU
from hindrax_ros.graph import publisher

rclpy.init()
node = Node("load", namespace="/hindrax")
out = publisher(node, IMU)
deadline = time.monotonic() + 20.0
while out.get_subscription_count() == 0 and time.monotonic() < deadline:
    time.sleep(0.05)
time.sleep(0.3)
message = Imu()
message.header.frame_id = "icm20948_link"
for index in range({count}):
    message.header.stamp.sec, message.angular_velocity.x = index + 1, index * 0.25
    data = serialize_message(message)
    out.publish(data)
    print(data.hex())
    time.sleep(0.003)
time.sleep(1.5)
"""


def test_names_of_hashes_and_parameter_files():
    class Hash:
        version, value = 1, bytes(range(32))

    assert type_hash(Hash()) == "RIHS01_" + bytes(range(32)).hex()
    Hash.value = bytes(32)
    assert type_hash(Hash()) == ""
    assert parameter_file(["recorder", "--ros-args", "--params-file", "a.yaml"]) == "a.yaml"
    assert parameter_file(["recorder"]) == ""


@pytest.mark.ros
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_what_is_published_is_recorded(tmp_path: Path, end: int):
    parameters = tmp_path / "parameters.yaml"
    parameters.write_text("/**:\n  ros__parameters:\n    notes: a test\n")
    environment = {**os.environ, "ROS_DOMAIN_ID": str(150 + end), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    words = ["--ros-args", "--params-file", str(parameters), "-p", f"bag:={tmp_path / 'bag'}"]
    recorder = subprocess.Popen([sys.executable, "-m", "hindrax_bag.nodes.recorder", *words], env=environment)
    try:
        script = [sys.executable, "-c", PUBLISH.format(count=COUNT)]
        said = subprocess.run(script, env=environment, capture_output=True, text=True, timeout=40, check=True)
        recorder.send_signal(end)
        recorder.wait(10)
    finally:
        recorder.kill()
    published = [bytes.fromhex(line) for line in said.stdout.split()]
    assert len(published) == COUNT
    found = [one for one in messages(tmp_path / "bag") if one.topic == "/hindrax/icm20948/data_raw"]
    assert [one.data for one in found] == published
    assert [one.sent for one in found] == [(index + 1) * 1_000_000_000 for index in range(COUNT)]
    assert abs(found[-1].received - time.time_ns()) < 60e9
    assert found[7].decoded().angular_velocity.x == 1.75
    assert b"a test" in attachments(tmp_path / "bag")["parameters.yaml"]
    assert (tmp_path / "bag" / "metadata.yaml").exists() == (end == signal.SIGINT)
    if end == signal.SIGINT:
        assert "RIHS01_" in (tmp_path / "bag" / "metadata.yaml").read_text()
