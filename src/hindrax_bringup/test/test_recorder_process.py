"""The recorder as a process: what is published is in the bag, byte for byte, also after it was killed."""

import select
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Self

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("hindrax_msgs")

from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from hindrax_bag import software_version
from hindrax_bag.nodes.recorder import QUEUE
from hindrax_bag.read.bag_reader import BagMessage, attachments, messages
from hindrax_bag.read.recovery import recover
from hindrax_bag.testing.bag_samples import offered_qualities, summary_of
from hindrax_bringup.stack import environment
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import JOYSTICK, SENSOR, resolved

COUNT = 300
PATIENT_S = 60.0
RECORDER = ("-m", "hindrax_bag.nodes.recorder")
IMU_TOPIC = "/hindrax/icm20948/data_raw"
SPEAK = """
import struct
import sys
import time
import rclpy
from rclpy.node import Node
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, Joy
from hindrax_core.topics import IMU, JOYSTICK
from hindrax_ros.graph import publisher

def heard(topic):
    rclpy.init()
    node = Node("load", namespace="/hindrax")
    out = publisher(node, topic)
    deadline = time.monotonic() + 20.0
    while out.get_subscription_count() == 0 and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.3)
    return node, out
"""
PUBLISH = f"""{SPEAK}
def say(count, pause_s):
    global sent
    for sent in range(sent + 1, sent + 1 + count):
        message.header.stamp.sec, message.angular_velocity.x = sent, sent * 0.25
        data = serialize_message(message)
        out.publish(data)
        said.append(data.hex())
        time.sleep(pause_s)

node, out = heard(IMU)
sent, said, message = 0, [], Imu()
message.header.frame_id = "icm20948_link"
for line in sys.stdin:
    count, pause_s = line.split()
    said.clear()
    say(int(count), float(pause_s))
    print(*said, flush=True)
"""
STUCK = """
import sys
import time
from pathlib import Path
from hindrax_bag.nodes import recorder

class Stuck(recorder.Recorder):
    def _flush(self):
        while Path(sys.argv[-1]).exists():
            time.sleep(0.01)
        super()._flush()

recorder.Recorder = Stuck
recorder.main()
"""


class Rig:
    """A recorder and a publisher beside it, as processes."""

    def __init__(self, folder: Path, domain: int, recorder: Sequence[str] = RECORDER) -> None:
        self.bag = folder / "bag"
        parameters = folder / "parameters.yaml"
        parameters.write_text("/**:\n  ros__parameters:\n    notes: a test\n")
        # No shared memory: what the killed leave there hangs others.
        self.environment = environment(mock=True, domain=domain)
        words = ["--ros-args", "--params-file", str(parameters), "-p", f"bag:={self.bag}", "--", str(folder / "stuck")]
        self._start = partial(subprocess.Popen, [sys.executable, *recorder, *words], env=self.environment)
        self.recorder = self._start()
        self._publisher = subprocess.Popen(
            [sys.executable, "-c", PUBLISH],
            env=self.environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self._publisher.stdin is not None
        assert self._publisher.stdout is not None
        self._orders, self._answers = self._publisher.stdin, self._publisher.stdout

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in (self.recorder, self._publisher):
            process.kill()
            process.wait()

    def order(self, count: int, pause_s: float) -> None:
        """Have messages published."""
        self._orders.write(f"{count} {pause_s}\n")
        self._orders.flush()

    def published(self) -> list[bytes]:
        """What was published of an order, once it is done."""
        ready, _, _ = select.select([self._answers], (), (), PATIENT_S)
        assert ready, "the publisher hangs"
        return [bytes.fromhex(word) for word in self._answers.readline().split()]

    def end(self, number: int) -> None:
        """End the recorder."""
        self.recorder.send_signal(number)
        self.recorder.wait(10)

    def restart(self) -> None:
        """Start the recorder again with the same words, as a supervisor does."""
        self.recorder = self._start()

    def wait_for(self, count: int, file: str = "") -> None:
        """Wait until there are so many messages in the bag, or in one of its files."""
        place, deadline = self.bag / file, time.monotonic() + PATIENT_S
        while not place.exists() or not any(self.bag.glob("*.mcap")) or len(received(place)) < count:
            assert time.monotonic() < deadline, f"fewer than {count} messages in {place}"
            time.sleep(0.1)

    def recorded(self) -> list[BagMessage]:
        """What is in the bag of what was published."""
        return received(self.bag)

    def last_words(self) -> dict[str, str]:
        """What the recorder said of itself last."""
        found = [status for one in messages(self.bag, {"/diagnostics"}) for status in one.decoded().status]
        return [{pair.key: pair.value for pair in one.values} for one in found if one.name == "hindrax: recorder"][-1]


def received(place: Path) -> list[BagMessage]:
    """What a bag, or a file of it, holds of what was published."""
    return list(messages(place, {IMU_TOPIC}))


@pytest.mark.ros
def test_what_is_published_is_recorded(tmp_path: Path, ros_domain: int) -> None:
    with Rig(tmp_path, ros_domain) as rig:
        rig.order(COUNT, 0.003)
        published = rig.published()
        time.sleep(0.5)
        rig.end(signal.SIGINT)
    found = rig.recorded()
    assert len(published) == COUNT
    assert [one.data for one in found] == published
    assert [one.sent for one in found] == [(index + 1) * 1_000_000_000 for index in range(COUNT)]
    assert abs(found[-1].received - time.time_ns()) < 60e9
    assert found[7].decoded().angular_velocity.x == 2.0
    assert b"a test" in attachments(rig.bag)["parameters.yaml"]
    with Reader(rig.bag) as reader:
        (connection,) = [one for one in reader.connections if one.topic == IMU_TOPIC]
        (offered,) = offered_qualities(connection)
    assert connection.digest.startswith("RIHS01_")
    assert (offered.depth, offered.reliability.name, offered.durability.name) == (SENSOR.depth, "RELIABLE", "VOLATILE")
    with rig.bag.joinpath("bag_0.mcap").open("rb") as stream:
        inside = {one.name: one.metadata for one in make_reader(stream).iter_metadata()}
    assert inside["hindrax"]["version"] == software_version()


@pytest.mark.ros
def test_a_recorder_that_is_killed_loses_less_than_a_second(tmp_path: Path, ros_domain: int) -> None:
    with Rig(tmp_path, ros_domain) as rig:
        rig.order(100_000, 0.003)
        rig.wait_for(COUNT)
        time.sleep(0.45)
        killed = time.time_ns()
        rig.end(signal.SIGKILL)
    found = rig.recorded()
    assert killed - found[-1].received < 1_000_000_000
    assert [one.sent for one in found] == [found[0].sent + index * 1_000_000_000 for index in range(len(found))]
    assert not (rig.bag / "metadata.yaml").exists()
    made = recover(rig.bag, tmp_path / "recovered")
    assert [one.data for one in messages(made.output, {IMU_TOPIC})] == [one.data for one in found]


@pytest.mark.ros
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_restarted_recorder_goes_on_in_the_next_file_and_the_bag_is_whole(
    tmp_path: Path, ros_domain: int, how: int
) -> None:
    with Rig(tmp_path, ros_domain) as rig:
        rig.order(100_000, 0.003)
        rig.wait_for(COUNT)
        rig.end(how)
        before = rig.recorded()
        rig.restart()
        rig.wait_for(COUNT, "bag_1.mcap")
        rig.end(signal.SIGINT)
    after = rig.recorded()
    assert [one.data for one in after[: len(before)]] == [one.data for one in before]
    assert len(after) >= len(before) + COUNT
    assert sorted(file.name for file in rig.bag.iterdir()) == ["bag_0.mcap", "bag_1.mcap", "metadata.yaml"]
    with Reader(rig.bag) as reader:
        connections = [one for one in reader.connections if one.topic == IMU_TOPIC]
        assert [bytes(data) for _, _, data in reader.messages(connections)] == [one.data for one in after]
    for file in rig.bag.glob("*.mcap"):
        with file.open("rb") as stream:
            assert summary_of(make_reader(stream, validate_crcs=True))[1].message_count


HOSTILE_JOY = f"""{SPEAK}
node, out = heard(JOYSTICK)
whole = serialize_message(Joy())
for stamp in ((-1, 0), (-(2**31), 2**32 - 1), (0, 10**9), (7, 5)):
    out.publish(whole[:4] + struct.pack("<iI", *stamp) + whole[12:])
for data in (b"", whole[:4], whole[:7], bytes(3), bytes([255]) * 40):
    out.publish(data)
time.sleep(2.5)
"""


@pytest.mark.ros
def test_hostile_stamps_and_bytes_are_recorded_and_counted_and_end_nothing(tmp_path: Path, ros_domain: int) -> None:
    with Rig(tmp_path, ros_domain) as rig:
        subprocess.run([sys.executable, "-c", HOSTILE_JOY], env=rig.environment, check=True, timeout=PATIENT_S)
        assert rig.recorder.poll() is None
        rig.order(10, 0.01)
        assert len(rig.published()) == 10
        time.sleep(0.5)
        rig.end(signal.SIGINT)
        assert rig.recorder.returncode == 0
    assert len(rig.recorded()) == 10
    joys = list(messages(rig.bag, {resolved(JOYSTICK)}))
    assert [one.sent for one in joys if one.sent != one.received] == [7 * NS_PER_S + 5]
    bad = len(joys) - 1
    assert bad >= 3
    assert rig.last_words()[f"invalid stamps: {JOYSTICK.name}"] == str(bad)


@pytest.mark.ros
def test_what_does_not_fit_into_the_queue_is_counted_and_given(tmp_path: Path, ros_domain: int) -> None:
    stuck = tmp_path / "stuck"
    with Rig(tmp_path, ros_domain, ("-c", STUCK)) as rig:
        rig.order(10, 0.01)
        published = rig.published()
        stuck.touch()
        time.sleep(0.6)
        rig.order(2 * QUEUE, 0.0)
        published += rig.published()
        stuck.unlink()
        time.sleep(0.3)
        rig.order(10, 0.01)
        published += rig.published()
        time.sleep(2.0)
        rig.end(signal.SIGINT)
    lost = len(published) - len(rig.recorded())
    assert lost >= QUEUE // 2
    assert rig.last_words()["lost: icm20948/data_raw"] == str(lost)
