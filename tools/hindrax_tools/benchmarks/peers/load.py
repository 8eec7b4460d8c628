"""A publisher of a steady load, for measuring the recorder: messages of a given size on the raw topics."""

from __future__ import annotations

import argparse
import json
import sys
import time

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from hindrax_core.events import Stamp
from hindrax_core.topics import NAMESPACE, RAW_FRAMES, resolved
from hindrax_msgs.msg import RawFrames
from hindrax_ros.graph import publisher
from hindrax_ros.messages.convert import stamp_to_msg
from hindrax_ros.messages.serialization import serialized

READY_S = 20.0
SETTLE_S = 1.0


def message_of(size: int) -> bytes:
    """Bytes of a RawFrames message of this size [byte]."""
    bare = len(serialized(RawFrames(source="load")))
    message = RawFrames(source="load", data=bytes(index * 31 % 251 for index in range(size - bare)))
    message.header.stamp = stamp_to_msg(Stamp(time.time_ns()))
    return serialized(message)


def run(words: argparse.Namespace) -> int:
    """Wait for the recorder, report it, publish in bursts of 10 ms, and report the count."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node("load", namespace=NAMESPACE, enable_rosout=False, start_parameter_services=False)
    out = [publisher(node, topic) for topic in RAW_FRAMES.values()]
    data = message_of(words.size)
    deadline = time.monotonic() + READY_S
    while time.monotonic() < deadline and not all(
        node.count_subscribers(resolved(topic)) for topic in RAW_FRAMES.values()
    ):
        time.sleep(0.05)
    time.sleep(SETTLE_S)
    print(json.dumps({"bytes": len(data)}), flush=True)
    begin, sent = time.monotonic(), 0
    while (elapsed := time.monotonic() - begin) < words.seconds:
        while sent < elapsed * words.rate:
            out[sent % len(out)].publish(data)
            sent += 1
        time.sleep(0.01)
    print(json.dumps({"sent": sent, "seconds": time.monotonic() - begin}), flush=True)
    time.sleep(SETTLE_S)
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


def main() -> int:
    """Publish once."""
    words = argparse.ArgumentParser(prog="load")
    words.add_argument("--rate", type=float, default=2000.0)
    words.add_argument("--size", type=int, default=300)
    words.add_argument("--seconds", type=float, default=60.0)
    return run(words.parse_args())


if __name__ == "__main__":
    sys.exit(main())
