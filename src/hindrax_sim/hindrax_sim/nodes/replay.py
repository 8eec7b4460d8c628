"""The replay process: a bag's wire frames at ports, its time on /clock, and the recorded commands to the vehicle.

Sensors, navigator, allocator and identifier run on it as they do on the vehicle. The pilot's side of the record
(pulses applied, maneuver) is played as messages: no pilot runs.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from rosgraph_msgs.msg import Clock

from hindrax_bag.read.bag_reader import BagMessage, attached_vehicle, attachments, messages
from hindrax_core import topics
from hindrax_core.events import NS_PER_S, Stamp, to_s
from hindrax_core.vehicle import load_vehicle
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.convert import stamp_to_msg
from hindrax_ros.messages.serialization import current_bytes
from hindrax_ros.process import StopSignal
from hindrax_sim.hardware import STEP_ns
from hindrax_sim.mock_vehicle import Ports
from hindrax_sim.nodes.hardware_process import graph, main_of, outlast_output
from hindrax_sim.recorded_hardware import RecordedHardware, recorded_frames

PLAYED = (topics.THRUSTER_STATE, topics.MANEUVER, topics.THRUSTER_HEALTH, topics.BATTERY)
CLOCK_NS = 4 * STEP_ns
PATIENCE_S = 30.0
"""Wall time for which the beginning waits for everybody; then it begins without."""
SETTLING_S = 1.0
"""Wall time in which the last subscriptions match, once all nodes are up."""
AFTER_NS = NS_PER_S
"""So long goes time on behind the end of the record, for what is still under way."""


def parser() -> argparse.ArgumentParser:
    """Arguments of the process."""
    made = argparse.ArgumentParser(prog="replay", description="recorded wires as hardware")
    made.add_argument("--bag", required=True, type=Path)
    made.add_argument("--vehicle", help="vehicle file; default: the one inside the bag")
    made.add_argument("--rate", type=float, default=0.0, help="times real time at most; default: as the nodes follow")
    made.add_argument("--namespace", default=topics.NAMESPACE, help="in which it is played")
    made.add_argument("--folder", help="where sockets and ptys lie; default a temporary folder")
    return made


class RecordedPorts(Ports):
    """Recorded hardware behind ports; steps end where bytes arrive, so that their times are right."""

    hardware: RecordedHardware

    def _next_stamp(self) -> Stamp:
        return self.hardware.next_stamp(super()._next_stamp())

    @property
    def all_open(self) -> bool:
        """Whether a client waits at every port."""
        there = set(self.serve_clients(0.02))
        return set(self.hardware.serial) <= there and (not self.hardware.registers or "sensors" in there)


class Player(BatchedNode):
    """Publishes /clock and the played topics, and follows the progress of the navigator."""

    def __init__(self, bag: Path, ports: RecordedPorts) -> None:
        super().__init__("replay", enable_rosout=False, start_parameter_services=False)
        self._ports, self._clock_at = ports, 0
        self._clock = self.create_publisher(Clock, topics.CLOCK, 1)
        self._out = {topics.resolved(topic): publisher(self, topic) for topic in PLAYED}
        self._messages: Iterator[BagMessage] = messages(bag, self._out)
        self._next_message = next(self._messages, None)
        subscription(self, topics.NAVIGATION, self._on_navigation, raw=True)
        ports.after_step.append(self.play)

    @property
    def complete(self) -> bool:
        """Whether navigator, identifier and subscribers of the thruster topics are on the graph."""
        subscribed = self.count_subscribers(topics.THRUSTER_STATE.name) > 0
        return subscribed and all(self.count_publishers(one.name) for one in (topics.NAVIGATION, topics.ESTIMATE))

    def play(self, now: Stamp) -> None:
        """Publish the messages that are due."""
        if now - self._clock_at >= CLOCK_NS:
            self._clock_at = now
            self._clock.publish(Clock(clock=stamp_to_msg(now)))
        while self._next_message is not None and self._next_message.received <= now:
            data = current_bytes(self._next_message)
            self._out[self._next_message.topic].publish(data)
            self._next_message = next(self._messages, None)
        self.publish_queue.flush()
        self.drain()

    def _on_navigation(self, _data: bytes) -> None:
        self._ports.last_write = self._ports.hardware.stamp


def run(words: argparse.Namespace, folder: Path) -> int:
    """Replay once, or until a signal."""
    stop = StopSignal()
    given = load_vehicle(words.vehicle) if words.vehicle else None
    vehicle = given or attached_vehicle(words.bag, attachments(words.bag))
    hardware = RecordedHardware(vehicle, recorded_frames(words.bag, vehicle))
    with graph(words.namespace), RecordedPorts(hardware, folder, rate=words.rate) as ports:
        player = Player(words.bag, ports)
        try:
            print(json.dumps({"ports": ports.ports, "clock": ports.clock}), flush=True)  # noqa: T201  # for the parent
            begin = hardware.stamp
            wait_for_all(ports, player, stop)
            while not stop.asked and hardware.stamp < hardware.end + AFTER_NS:
                ports.step()
            if stop.asked:
                outlast_output(ports)
        finally:
            player.destroy_node()
    print(json.dumps({"vehicle_s": to_s(Stamp(hardware.stamp - begin))}), flush=True)  # noqa: T201  # for the parent
    return 0


def wait_for_all(ports: RecordedPorts, player: Player, stop: StopSignal) -> None:
    """Let time stand still until every port is all_open and the nodes are on the graph, for a while at most."""
    deadline = time.monotonic() + PATIENCE_S
    while not stop.asked and time.monotonic() < deadline and not (ports.all_open and player.complete):
        player.play(ports.hardware.stamp)
    settled = time.monotonic() + SETTLING_S
    while not stop.asked and time.monotonic() < settled:
        ports.serve_clients(0.02)


def main() -> int:
    """Run the replay in a folder of its own."""
    return main_of(parser(), run)


if __name__ == "__main__":
    sys.exit(main())
