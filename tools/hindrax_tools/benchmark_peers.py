"""A listener that subscribes to every topic, or a steady load: `listen`, or `load RATE_Hz BYTES SECONDS`."""

import json
import sys
import time

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from hindrax_core.events import Stamp
from hindrax_core.sensor_table import SENSORS
from hindrax_core.topics import NAMESPACE, TOPICS, raw_topic, resolved
from hindrax_msgs.msg import RawFrames
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.convert import stamp_to_msg
from hindrax_ros.messages.serialization import serialized
from hindrax_ros.parameters import CheckedNode

READY_S = 20.0
SETTLE_S = 1.0


def listen() -> None:
    """Subscribe to every topic with plain rclpy and discard the messages, until a signal."""
    rclpy.init(args=[])
    node = CheckedNode("listener", namespace=NAMESPACE)
    for topic in TOPICS:
        subscription(node, topic, lambda _message: None)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (ExternalShutdownException, RCLError, KeyboardInterrupt) as error:
        # A signal shuts the context down under the executor, which raises one of these.
        if rclpy.ok() and not isinstance(error, KeyboardInterrupt):
            raise


def message_of(size: int) -> bytes:
    """Bytes of a RawFrames message of this size [byte]."""
    bare = len(serialized(RawFrames(source="load")))
    message = RawFrames(source="load", data=bytes(index * 31 % 251 for index in range(size - bare)))
    message.header.stamp = stamp_to_msg(Stamp(time.time_ns()))
    return serialized(message)


def load(rate_Hz: float, size: int, seconds: float) -> None:
    """Wait for the recorder, report it, publish on the raw topics in bursts of 10 ms, and report the count."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node("load", namespace=NAMESPACE, enable_rosout=False, start_parameter_services=False)
    raw = [raw_topic(source) for source in (*(row.name for row in SENSORS), "thrusters")]
    out = [publisher(node, topic) for topic in raw]
    data, deadline = message_of(size), time.monotonic() + READY_S
    while time.monotonic() < deadline and not all(map(node.count_subscribers, map(resolved, raw))):
        time.sleep(0.05)
    time.sleep(SETTLE_S)
    print(json.dumps({"bytes": len(data)}), flush=True)
    begin, sent = time.monotonic(), 0
    while (elapsed := time.monotonic() - begin) < seconds:
        while sent < elapsed * rate_Hz:
            out[sent % len(out)].publish(data)
            sent += 1
        time.sleep(0.01)
    print(json.dumps({"sent": sent, "seconds": time.monotonic() - begin}), flush=True)
    time.sleep(SETTLE_S)
    node.destroy_node()
    rclpy.try_shutdown()


def main() -> int:
    """Listen, or load the recorder, as the words of this process say."""
    if sys.argv[1] == "listen":
        listen()
    else:
        load(float(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
