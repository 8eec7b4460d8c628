"""Cost of one recorded message: of writing it, and of the whole recorder process under the load that it must bear.

Beside it the plain MCAP writer and that of rosbags write the same messages in the same run.
"""

import importlib.metadata
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_typestore

from hindrax_bag.definitions import definition
from hindrax_bag.metadata import Channel
from hindrax_bag.read.bag_reader import messages
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_bringup.processes import RECORDER, Process
from hindrax_bringup.stack import environment, first_line, own_domain
from hindrax_bringup.supervisor import Supervisor
from hindrax_core.topics import IMU, resolved
from hindrax_ros.messages.share import share_lookup
from hindrax_tools.benchmarks import cpu_s, family, interleaved_us, row

RATE_Hz, SECONDS, BYTES = 2000, 60.0, 300
"""The load that the recorder must bear."""
SHARE_WANTED = 0.25
"""Of one core."""
SPAN = RATE_Hz // 2
"""Messages between two flushes: the recorder's own half second."""
SPANS, ROUNDS = 10, 5
"""Spans per round: several chunks of each writer (rosbags has one in three spans), or the median would lack them."""
CHUNK_BYTES = 262_144
LOAD = Process("hindrax_tools.benchmark_peers", ())
Span = Callable[[], None]
"""Writes so many messages, and flushes."""


def rows() -> list[dict[str, object]]:
    """One row per peer: name, ours_us, peer, peer_us, ratio. Medians over interleaved rounds, flush included."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        ours = _ours(folder / "ours")
        plain = _mcap(folder / "plain.mcap")
        alone = f"mcap {importlib.metadata.version('mcap')}, plain writer"
        rosbags = f"rosbags {importlib.metadata.version('rosbags')}, zstd, no checksum, no flush to disk"
        beside_rosbags = _figure(ours, rosbags, _rosbags(folder / "rosbags"))
        return [_figure(ours, alone, plain), beside_rosbags, _recorder(folder, alone, plain)]


def _ours(folder: Path) -> Span:
    bag = BagWriter(folder, share_lookup, limits=BagLimits(keep_free_MB=0.0))
    bag.open()
    channel = Channel(resolved(IMU), IMU.type, (IMU.quality,))
    return _span(lambda data, stamp: bag.write(channel, data, stamp, stamp), bag.flush)


def _mcap(path: Path) -> Span:
    writer = Writer(path.open("wb"), chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile="ros2", library="benchmark")
    schema = writer.register_schema(IMU.type, "ros2msg", definition(IMU.type, share_lookup).encode())
    number = writer.register_channel(resolved(IMU), "cdr", schema)
    return _span(lambda data, stamp: writer.add_message(number, stamp, data, stamp), writer.flush)


def _rosbags(folder: Path) -> Span:
    """Its MCAP storage keeps chunks of its own size, writes no checksums and offers no flush."""
    writer = RosbagsWriter(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    writer.open()
    connection = writer.add_connection(resolved(IMU), IMU.type, typestore=get_typestore(Stores.ROS2_JAZZY))
    return _span(lambda data, stamp: writer.write(connection, stamp, data), lambda: None)


def _span(write: Callable[[bytes, int], object], flush: Callable[[], object]) -> Span:
    datas = [bytes((index * 31 + byte * 7) % 251 for byte in range(BYTES)) for index in range(SPAN)]

    def write_all() -> None:
        for data in datas:
            write(data, time.time_ns())
        flush()

    return write_all


def _figure(ours: Span, peer: str, theirs: Span) -> dict[str, object]:
    ours_us, peer_us = _message_us(ours, theirs)
    return row(f"record a message of {BYTES} bytes, chunk and flush included", ours_us, peer, peer_us)


def _message_us(*writers: Span) -> list[float]:
    """CPU time per message of writers that take turns."""

    def round_of(write: Span) -> Span:
        def write_round() -> None:
            for _ in range(SPANS):
                write()

        return write_round

    return [one / SPANS / SPAN for one in interleaved_us(tuple(map(round_of, writers)), ROUNDS, time.process_time)]


def _recorder(folder: Path, peer: str, theirs: Span) -> dict[str, object]:
    """CPU time per message of the real recorder process, from the graph to the disk, and what it lost."""
    bag = folder / "bag"
    logs = folder / "logs"
    with own_domain(mock=True) as domain, Supervisor(logs, environment(mock=True, domain=domain)) as children:
        recorder = children.start(RECORDER, ["--ros-args", "-p", f"bag:={bag}", "-p", "keep_free_MB:=0.0"])
        publisher = children.start(LOAD, ["load", str(RATE_Hz), str(BYTES), str(SECONDS)], pipe=True)
        first_line(publisher, 2 * SECONDS, logs / "benchmark_peers.log")
        members = family(recorder.handle.pid)
        before_s = cpu_s(members)
        report = first_line(publisher, 2 * SECONDS, logs / "benchmark_peers.log")
        used_s = cpu_s(members) - before_s
        publisher.handle.wait()
        children.stop("recorder")
    sent, seconds = report["sent"], report["seconds"]
    lost = sent - sum(1 for message in messages(bag) if "/raw/" in message.topic)
    (peer_us,) = _message_us(theirs)
    share = f"{used_s / seconds:.0%} of a core, {SHARE_WANTED:.0%} allowed"
    name = f"recorder process, {sent / seconds:.0f} messages/s for {seconds:.0f} s: {share}; {lost} of {sent} lost"
    return row(name, used_s / sent * 1e6, peer, peer_us)
