"""The recorder in the process of its test: stamps, the clock of a mock, what it says of itself, what it leaves."""

import os
import struct
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from mcap.reader import make_reader
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import Reader
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import Float32MultiArray

from hindrax_bag import software_version
from hindrax_bag.metadata import is_whole
from hindrax_bag.nodes import recorder as module
from hindrax_bag.nodes.recorder import QUEUE, SYNC_EVERY, Recorder
from hindrax_bag.read.bag_reader import BagMessage, attachments, messages
from hindrax_bag.read.recovery import complete
from hindrax_bag.testing.bag_samples import offered_qualities, small_bag
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_core.events import NS_PER_S
from hindrax_core.topics import (
    DIAGNOSTICS,
    IMU,
    LIGHTS,
    NAMESPACE,
    ROSOUT,
    STATE,
    THRUSTER_COMMAND,
    TOPICS,
    Topic,
    resolved,
)
from hindrax_ros.batched_node import BatchedNode, SpinLoop, events_executor
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.serialization import message_class

PATIENT_S = 60.0
CLOCK = Topic("/clock", "rosgraph_msgs/msg/Clock", STATE, 0, "time of a mock")


class Bench:
    """A recorder, turned by hand, and a node that publishes to it."""

    def __init__(self, folder: Path, **parameters: object) -> None:
        self.bag = folder / "bag"
        knobs = {"bag": self.bag, **parameters}
        rclpy.init(args=["--ros-args", *(word for key, value in knobs.items() for word in ("-p", f"{key}:={value}"))])
        self.recorder, self.closed = Recorder(), False
        self.speaker = rclpy.create_node("speaker", namespace=NAMESPACE)
        self.statuses: list[DiagnosticStatus] = []
        subscription(self.speaker, DIAGNOSTICS, self._keep)
        self._executor = events_executor()
        for node in (self.recorder, self.speaker):
            self._executor.add_node(node)
        self._loop = SpinLoop([self.recorder], self._executor)

    def _keep(self, message: DiagnosticArray) -> None:
        self.statuses += message.status

    def voice(self, topic: Topic) -> Any:
        """A publisher that the recorder has found."""
        made = publisher(self.speaker, topic)
        self.until(lambda: made.get_subscription_count() > 0)
        return made

    def until(self, done: Callable[[], Any], *, turning: bool = True) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline
            if turning:
                self._loop.spin_once()

    def report(self) -> DiagnosticStatus:
        """What the recorder says of itself next."""
        self.statuses.clear()
        for _ in range(SYNC_EVERY):
            self.recorder._flush()
        self.until(lambda: self.statuses)
        return self.statuses[-1]

    def close(self) -> None:
        if not self.closed:
            self.closed = True
            self.recorder.close()

    def recorded(self, topic: Topic) -> list[BagMessage]:
        """What is in the bag of a topic, once the recorder has ended."""
        self.close()
        return list(messages(self.bag, {resolved(topic)}))

    def end(self) -> None:
        self.close()
        self._executor.shutdown()
        for node in (self.recorder, self.speaker):
            node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def bench(tmp_path: Path, ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Bench]]:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    monkeypatch.setattr(sys, "argv", ["recorder"])
    made: list[Bench] = []

    def make(**parameters: object) -> Bench:
        made.append(Bench(tmp_path, **parameters))
        return made[-1]

    yield make
    for one in made:
        one.end()


def values_of(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


def logged_by(bench: Bench) -> list[str]:
    """What is in the bag of the log, which the recorder finds in the graph like any other topic."""
    bench.report()
    return [one.decoded().msg for one in bench.recorded(ROSOUT)]


def imu(stamp_s: int) -> Imu:
    made = Imu()
    made.header.stamp.sec = stamp_s
    return made


def test_what_comes_before_the_clock_of_a_mock_waits_for_it_and_is_written_once(bench: Callable[..., Bench]) -> None:
    made = bench(use_sim_time="true")
    inertial, lamps, clock = made.voice(IMU), made.voice(LIGHTS), made.voice(CLOCK)
    inertial.publish(imu(95))
    lamps.publish(Float32MultiArray())
    made.recorder.drain()
    clock.publish(Clock(clock=imu(100).header.stamp))
    made.until(made.recorder.now)
    inertial.publish(imu(96))
    lamps.publish(Float32MultiArray())
    made.recorder.drain()
    found = [(one.received, one.sent) for one in made.recorded(IMU)]
    assert found == [(100 * NS_PER_S, 95 * NS_PER_S), (100 * NS_PER_S, 96 * NS_PER_S)]
    assert [(one.received, one.sent) for one in made.recorded(LIGHTS)] == [(100 * NS_PER_S, 100 * NS_PER_S)] * 2


def test_without_any_clock_what_came_is_still_in_the_bag_at_the_latest_time_that_was_reported(
    bench: Callable[..., Bench],
) -> None:
    made = bench(use_sim_time="true")
    inertial, lamps = made.voice(IMU), made.voice(LIGHTS)
    for message in (imu(7), imu(9), imu(8)):
        inertial.publish(message)
    lamps.publish(Float32MultiArray())
    assert [(one.received, one.sent) for one in made.recorded(IMU)] == [
        (9 * NS_PER_S, stamp_s * NS_PER_S) for stamp_s in (7, 9, 8)
    ]
    assert [(one.received, one.sent) for one in made.recorded(LIGHTS)] == [(9 * NS_PER_S, 9 * NS_PER_S)]


def test_messages_that_are_taken_together_have_one_time_of_receipt_and_later_ones_a_later(
    bench: Callable[..., Bench],
) -> None:
    made = bench()
    inertial = made.voice(IMU)
    for stamps_s in ((1, 2), (3, 4)):
        for stamp_s in stamps_s:
            inertial.publish(imu(stamp_s))
        made.recorder.drain()
    one, same, later, last = (message.received for message in made.recorded(IMU))
    assert one == same < later == last
    assert abs(last - time.time_ns()) < 60 * NS_PER_S


def test_a_stamp_that_is_none_is_counted_and_the_message_recorded_as_received(bench: Callable[..., Bench]) -> None:
    made = bench()
    inertial, lamps = made.voice(IMU), made.voice(LIGHTS)
    whole = serialize_message(imu(7))
    for seconds, nanoseconds in ((-1, 0), (0, NS_PER_S), (7, 5)):
        inertial.publish(whole[:4] + struct.pack("<iI", seconds, nanoseconds) + whole[12:])
    lamps.publish(Float32MultiArray())
    made.recorder.drain()
    words = values_of(made.report())
    assert {key: value for key, value in words.items() if key.startswith("invalid")} == {
        f"invalid stamps: {IMU.name}": "2"
    }
    found = made.recorded(IMU)
    assert [one.sent == one.received for one in found] == [True, True, False]
    assert found[2].sent == 7 * NS_PER_S + 5
    assert found[2].data[12:] == whole[12:]
    (lamp,) = made.recorded(LIGHTS)
    assert lamp.sent == lamp.received


def test_it_states_that_it_records_and_how_much_fits(bench: Callable[..., Bench]) -> None:
    made = bench()
    inertial = made.voice(IMU)
    for stamp_s in range(300):
        inertial.publish(imu(stamp_s))
    made.recorder.drain()
    status = made.report()
    words = values_of(status)
    assert not any("recording continues" in text for text in logged_by(made))
    assert (status.name, status.level, status.message) == ("hindrax: recorder", DiagnosticStatus.OK, "recording")
    assert int(words["messages"]) >= 300
    assert words["lost"] == "0"
    assert words["bag"] == str(made.bag / "bag_0.mcap")
    free = os.statvfs(made.bag)
    assert float(words["free [MB]"]) == pytest.approx(free.f_bavail * free.f_frsize / 1e6, rel=0.05)
    assert float(words["size [MB]"]) == pytest.approx((made.bag / "bag_0.mcap").stat().st_size / 1e6, abs=0.1)


def test_a_power_cut_costs_a_second_and_the_operator_receives_every_second(
    bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    timers: list[tuple[float, Callable[[], None]]] = []
    syncs: list[bool] = []
    reports: list[DiagnosticStatus] = []

    def flush(_bag: BagWriter, *, sync: bool) -> list[str]:
        syncs.append(sync)
        return []

    monkeypatch.setattr(Recorder, "every", lambda _node, seconds, act: timers.append((seconds, act)))
    monkeypatch.setattr(BagWriter, "flush", flush)
    made = bench()
    monkeypatch.setattr(made.recorder._reporter, "publish", lambda _now, status: reports.append(status))
    ((period_s, act),) = timers
    for _ in range(6):
        act()
    assert (period_s, syncs) == (0.5, [False, True] * 3), "given to the disk once a second"
    assert len(reports) == 3


def test_it_records_the_sensors_of_the_vehicle_by_their_names(bench: Callable[..., Bench], tmp_path: Path) -> None:
    file = tmp_path / "vehicle.yaml"
    ahead = "  ahead: {device: ping1d, port: /dev/hindrax/ahead, rotation_deg: [0.0, 90.0, 0.0]}"
    hindrax = Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml"
    file.write_text(hindrax.read_text().replace("\nsensors:", f"\nsensors:\n{ahead}"))
    made = bench(vehicle=file)
    found = {one.topic_name for one in super(BatchedNode, made.recorder).subscriptions}
    assert {f"{NAMESPACE}/ahead/range", f"{NAMESPACE}/raw/ahead", resolved(IMU)} <= found


def test_it_takes_whatever_is_offered_and_keeps_it_until_its_turn(bench: Callable[..., Bench]) -> None:
    made = bench()
    found = {one.topic_name: one.qos_profile for one in super(BatchedNode, made.recorder).subscriptions}
    assert found.keys() >= {resolved(topic) for topic in TOPICS}
    for topic in TOPICS:
        quality = found[resolved(topic)]
        assert quality.depth == QUEUE
        assert (quality.deadline.nanoseconds, quality.lifespan.nanoseconds) == (0, 0), "unlimited"


def test_what_its_queue_has_lost_is_a_warning_with_the_topic(bench: Callable[..., Bench]) -> None:
    made = bench()
    inertial = made.voice(IMU)
    inertial.publish(imu(1))
    made.recorder.drain()
    for _ in range(QUEUE + 100):
        inertial.publish(imu(2))
    made.recorder.drain()
    status = made.report()
    lost = QUEUE + 101 - len(made.recorded(IMU))
    assert lost >= 100
    assert (status.level, status.message) == (DiagnosticStatus.WARN, f"recording; {lost} messages lost")
    assert (values_of(status)["lost"], values_of(status)[f"lost: {IMU.name}"]) == (str(lost), str(lost))


def test_a_bag_that_may_not_grow_is_an_error_that_states_why_and_is_logged_then_and_in_the_end(
    bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    made, warnings, errors = bench(budget_MB=0.001), list[str](), list[str]()
    logger = SimpleNamespace(warning=warnings.append, error=errors.append)
    monkeypatch.setattr(made.recorder, "get_logger", lambda: logger)
    inertial = made.voice(IMU)
    for stamp_s in range(300):
        inertial.publish(imu(stamp_s))
    made.recorder.drain()
    made.report()
    status = made.report()
    assert status.level == DiagnosticStatus.ERROR
    assert status.message == "the bag has used its 0.001 MB of the disk; recording stopped"
    assert (warnings, errors) == ([status.message], [])
    made.close()
    assert (warnings, errors) == ([status.message], [status.message])


def test_the_bag_states_what_the_run_was(
    bench: Callable[..., Bench], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {name: tmp_path / name for name in ("sub.yaml", "given.yaml")}
    for file in files.values():
        file.write_text(f"# {file.name}\n")
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    monkeypatch.setattr(sys, "argv", ["recorder", "--params-file", str(files["given.yaml"])])
    made = bench(vehicle=files["sub.yaml"], notes="a dive", truth="none")
    made.close()
    assert attachments(made.bag) == {"vehicle.yaml": b"# sub.yaml\n", "parameters.yaml": b"# given.yaml\n"}
    with (made.bag / "bag_0.mcap").open("rb") as stream:
        inside = {one.name: one.metadata for one in make_reader(stream).iter_metadata()}
    assert inside["hindrax"] == {
        "notes": "a dive",
        "truth": "none",
        "version": software_version(),
        "rmw": "rmw_fastrtps_cpp",
        "namespace": NAMESPACE,
    }


def test_the_bag_names_the_quality_that_was_offered_and_that_of_the_table_if_the_publisher_is_gone(
    bench: Callable[..., Bench],
) -> None:
    made = bench()
    lasting = replace(THRUSTER_COMMAND, quality=replace(THRUSTER_COMMAND.quality, lifespan_s=7.0))
    orders, lamps = made.voice(lasting), made.voice(LIGHTS)
    orders.publish(message_class(THRUSTER_COMMAND.type)())
    lamps.publish(Float32MultiArray())
    made.speaker.destroy_publisher(lamps)
    made.until(lambda: not made.recorder.get_publishers_info_by_topic(resolved(LIGHTS)), turning=False)
    made.close()
    with Reader(made.bag) as reader:
        found = {one.topic: one for one in reader.connections}
        (offered,) = offered_qualities(found[resolved(THRUSTER_COMMAND)])
        (assumed,) = offered_qualities(found[resolved(LIGHTS)])
    assert offered.lifespan.sec == 7
    assert (assumed.depth, assumed.reliability.name) == (LIGHTS.quality.depth, "RELIABLE")


def test_a_bag_that_a_killed_recorder_left_is_resumed_and_in_the_end_whole(
    bench: Callable[..., Bench], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def completed_when_waited_for(files: Sequence[Path]) -> object:
        return SimpleNamespace(wait=lambda: [complete(file) for file in files])

    monkeypatch.setattr(module, "begin_completion", completed_when_waited_for)
    left = small_bag(tmp_path / "bag")
    left.write_bytes(left.read_bytes()[:-20])
    (tmp_path / "bag" / "metadata.yaml").unlink()
    made = bench()
    inertial = made.voice(IMU)
    inertial.publish(imu(3))
    # The log is found in the graph like any other topic, which may take longer than the reports that are waited for.
    made.until(lambda: (part := made.recorder._bag._part) and part.contents.counts[resolved(ROSOUT)])
    assert any("recording continues in bag_1.mcap" in text for text in logged_by(made))
    assert [is_whole(file) for file in sorted(made.bag.glob("*.mcap"))] == [True, True]
    with Reader(made.bag) as reader:
        assert {"/demo/level", resolved(IMU)} <= {one.topic for one in reader.connections}
