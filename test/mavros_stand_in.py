"""A BlueROV2 on ArduSub behind MAVROS, as its topics look, for the identifier: a program of its own.

`python mavros_stand_in.py SECONDS RATE [FOLDER]` flies so many seconds, RATE times as fast as a vehicle lives, and
writes what it publishes as a bag.
"""

import math
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from mavros_msgs.msg import RCOut
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from rclpy.serialization import serialize_message

from hindrax_bag.metadata import Channel
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_core.topics import Quality
from hindrax_ros.messages.convert import stamp_to_msg
from hindrax_ros.messages.share import share_lookup
from hindrax_tools.ardusub import STEP_S, flight

VELOCITY_mps, RATE_radps = 0.003, 0.002
"""Noise."""
TOPICS = {"/mavros/rc/out": "mavros_msgs/msg/RCOut", "/mavros/local_position/odom": "nav_msgs/msg/Odometry"}


def odometry(stamp: Any, speeds: dict[str, float], heading_rad: float, noise: np.random.Generator) -> Odometry:
    """Make what the plugin `local_position` of MAVROS publishes: in `map`, z up, without covariance."""
    made = Odometry(child_frame_id="base_link")
    made.header.stamp, made.header.frame_id = stamp, "map"
    made.pose.pose.position.z = -1.0
    made.pose.pose.orientation.z, made.pose.pose.orientation.w = math.sin(heading_rad / 2), math.cos(heading_rad / 2)
    (u, v, w), (p, q, r) = noise.normal(0.0, VELOCITY_mps, 3).tolist(), noise.normal(0.0, RATE_radps, 3).tolist()
    linear, angular = made.twist.twist.linear, made.twist.twist.angular
    linear.x, linear.y, linear.z = speeds["surge"] + u, v - speeds["sway"], w - speeds["heave"]
    angular.x, angular.y, angular.z = p, q, r - speeds["yaw"]
    return made


def main(seconds: float, rate: float, folder: str = "") -> None:
    """Fly as soon as both topics have a reader."""
    rclpy.init(args=[])
    node, noise, heading_rad = rclpy.create_node("mavros"), np.random.default_rng(2), 0.0
    sources = zip(TOPICS, (RCOut, Odometry), (10, qos_profile_sensor_data), strict=True)
    outs = [node.create_publisher(kind, name, quality) for name, kind, quality in sources]
    while not all(out.get_subscription_count() for out in outs):
        time.sleep(0.1)
    with ExitStack() as closing:
        bag = BagWriter(Path(folder), share_lookup) if folder else None
        if bag is not None:
            bag.open()
            closing.callback(bag.close)
        begin, begin_ns = time.monotonic(), time.time_ns()
        for step, (pulses, speeds) in enumerate(flight(seconds)):
            if not rclpy.ok():
                return
            at_ns = begin_ns + round(step * STEP_S * 1e9)
            stamp = stamp_to_msg(at_ns)
            heading_rad -= STEP_S * speeds["yaw"]
            told = RCOut(channels=[*pulses, *[0] * 8])
            told.header.stamp = stamp
            sent = (told, odometry(stamp, speeds, heading_rad, noise))
            for (name, kind), out, message in zip(TOPICS.items(), outs, sent, strict=True):
                out.publish(message)
                if bag is not None:
                    bag.write(Channel(name, kind, (Quality(),), ""), serialize_message(message), at_ns, at_ns)
            time.sleep(max(0.0, begin + (step + 1) * STEP_S / rate - time.monotonic()))
    rclpy.try_shutdown()


if __name__ == "__main__":
    main(float(sys.argv[1]), float(sys.argv[2]), *sys.argv[3:])
