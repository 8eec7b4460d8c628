"""One device's node under every request in every state, found and lost."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_core.driver_interface import Identity
from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import Leak, Pressure
from hindrax_core.topics import DIAGNOSTICS, NAMESPACE, TOPICS
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.nodes.device_node import LIFECYCLE_PERIOD_S, DeviceNode
from hindrax_ros.batched_node import events_executor
from hindrax_ros.graph import subscription
from hindrax_ros.testing.lifecycle_client import GRAPH, LifecycleClient

PATIENT_S = 30.0
NAME = "ms5837"
READING = Pressure(pressure_Pa=101325.0, temperature_C=20.0)
WAYS = {
    "unconfigured": ["deactivate", "cleanup"],
    "inactive": ["deactivate"],
    "active": [],
    "finalized": ["shutdown"],
}
"""How an operator brings an active node into each state."""


class Bench:
    """The node with a device that comes and goes as told, and a client that watches what it publishes."""

    def __init__(self) -> None:
        self.node = DeviceNode(NAME, load_vehicle(default_vehicle()), NAME)
        self.found, self.released = True, 0
        self.node.ready = lambda: self.found
        self.node.release = self._release
        self._served = events_executor()
        self._served.add_node(self.node)
        self.client = rclpy.create_node("client", namespace=NAMESPACE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.client)
        self.readings: list[Any] = []
        self.frames: list[Any] = []
        self.status = DiagnosticStatus()
        topics = {topic.name: topic for topic in TOPICS}
        subscription(self.client, topics[f"{NAME}/pressure"], self.readings.append)
        subscription(self.client, topics[f"raw/{NAME}"], self.frames.append)
        subscription(self.client, DIAGNOSTICS, self._keep)
        self.lifecycle = LifecycleClient(self.client, NAME, self.until)

    def _release(self) -> None:
        self.released += 1

    def _keep(self, message: DiagnosticArray) -> None:
        (self.status,) = message.status

    def turn(self) -> None:
        self._served.spin_once(timeout_sec=0.01)
        self.node.drain()
        self.node.publish_queue.flush()
        self._executor.spin_once(timeout_sec=0.01)

    def until(self, done: Callable[[], Any], what: str) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done():
            assert time.monotonic() < deadline, f"waited for {what}"
            self.turn()

    def comes_to(self, state: str) -> None:
        self.until(lambda: self.lifecycle.state() == state, state)

    def stays(self, state: str) -> None:
        """See that the node is left alone, for longer than it takes to look after itself."""
        self.wait(3 * LIFECYCLE_PERIOD_S)
        assert self.lifecycle.state() == state

    def says(self, *, readings: bool, frames: bool = True) -> None:
        """Let the device say something, and see which of it is published."""
        self.readings.clear()
        self.frames.clear()
        for stamp in (Stamp(1), Stamp(2_000_000_000)):
            self.node.frame(stamp, sent=False, data=b"\x01")
            self.node.deliver([Stamped(stamp, READING)])
        if not (readings and frames):
            self.wait(0.3)
        self.until(lambda: (bool(self.readings), bool(self.frames)) == (readings, frames), "what it says")

    def is_connected(self) -> bool:
        """Whether the client is connected to what the node publishes."""
        return all(one.get_publisher_count() for one in self.client.subscriptions)

    def wait(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end, "time to pass")

    def bring_to(self, state: str) -> None:
        self.comes_to("active")
        for label in WAYS[state]:
            self.lifecycle.make(label)

    def close(self) -> None:
        for executor in (self._served, self._executor):
            executor.shutdown()
        for node in (self.node, self.client):
            node.destroy_node()


@pytest.fixture
def bench() -> Iterator[Bench]:
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        rclpy.init(args=[])
        made = Bench()
        made.comes_to("active")
        made.until(made.is_connected, "the graph")
        yield made
        made.close()
        rclpy.try_shutdown()


@pytest.mark.parametrize("state", GRAPH)
def test_only_an_active_node_publishes_and_a_state_that_was_asked_for_is_kept(bench: Bench, state: str) -> None:
    bench.bring_to(state)
    bench.lifecycle.refuses_the_invalid()
    bench.stays(state)
    bench.says(readings=state == "active", frames=state != "finalized")
    assert bench.released == (state == "finalized")
    bench.until(lambda: ("on request" in bench.status.message) == (state != "active"), "its diagnostics")


@pytest.mark.parametrize(("state", "label"), [(state, label) for state in GRAPH for label in GRAPH[state]])
def test_every_valid_transition_leads_where_it_should(bench: Bench, state: str, label: str) -> None:
    bench.bring_to(state)
    bench.lifecycle.make(label)
    bench.stays(GRAPH[state][label])


@pytest.mark.parametrize("state", GRAPH)
def test_a_device_that_was_lost_comes_back_to_what_was_asked_for(bench: Bench, state: str) -> None:
    bench.bring_to(state)
    bench.found = False
    bench.comes_to("finalized" if state == "finalized" else "unconfigured")
    bench.lifecycle.refuses_the_invalid()
    if state != "finalized":
        assert bench.lifecycle.request(("configure", 0)) == [False]
    bench.found = True
    bench.comes_to(state)
    bench.stays(state)
    bench.says(readings=state == "active", frames=state != "finalized")


def test_the_last_frames_of_a_wire_are_published_when_its_node_closes(bench: Bench) -> None:
    at_stop = Stamp(3_000_000_000)
    bench.node.stop = lambda: bench.node.frame(at_stop, sent=True, data=b"\x02")
    bench.says(readings=True)
    bench.node.close()
    bench.until(lambda: [stamp for one in bench.frames for stamp in one.stamps][-1] == at_stop, "the last frame")


def test_absent_from_the_start_it_is_shut_down_and_stays_so(bench: Bench) -> None:
    bench.found = False
    bench.comes_to("unconfigured")
    bench.lifecycle.make("shutdown")
    bench.found = True
    bench.stays("finalized")


def test_water_in_the_hull_remains_an_error_until_an_operator_has_seen_it(bench: Bench) -> None:
    bench.node.deliver([Identity("a probe")])
    bench.bring_to("active")
    bench.node.deliver([Stamped(Stamp(1), Leak(wet=True))])
    bench.until(lambda: bench.status.message.startswith("water in the hull: surface"), "the alarm")
    assert bench.status.level == DiagnosticStatus.ERROR
    bench.node.deliver([Stamped(Stamp(2), Leak(wet=False))])
    bench.until(lambda: bench.status.message.startswith("there was water in the hull"), "the memory of it")
    assert bench.status.level == DiagnosticStatus.ERROR
    bench.lifecycle.make("deactivate")
    bench.lifecycle.make("activate")
    bench.until(lambda: bench.status.level == DiagnosticStatus.OK, "all clear")
