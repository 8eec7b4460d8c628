"""A battery sensor and the allocator, by messages: with less voltage the same force takes a longer pulse."""

import math
import re
import time
from collections.abc import Iterator

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import BatteryState

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_control.nodes.allocator_node import AllocatorNode
from hindrax_core.events import Stamp, after
from hindrax_core.rotation import FSD
from hindrax_core.topics import ALLOCATION, BATTERY, DIAGNOSTICS, NAMESPACE, THRUSTER_COMMAND, THRUSTER_STATE
from hindrax_core.vehicle import load_vehicle
from hindrax_msgs.msg import AllocationStatus, ThrusterCommand, ThrusterState
from hindrax_ros.graph import publisher, subscription

pytestmark = pytest.mark.ros

PATIENT_S = 60.0
SETTLING = 20
"""Turns in which a command has come back as a state, and the state as an allocation."""
UP = (0.0, 0.0, -30.0, 0.0, 0.0, 0.0)


class Bench:
    """The allocator, and a node that plays battery sensor and thrusters and hears what becomes of a wrench."""

    def __init__(self) -> None:
        self.allocator = AllocatorNode(load_vehicle(default_vehicle()))
        self.node = Node("bench", namespace=NAMESPACE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._executor.add_node(self.allocator)
        self.battery = publisher(self.node, BATTERY)
        self._state = publisher(self.node, THRUSTER_STATE)
        self.said: AllocationStatus | None = None
        self.reports: dict[str, tuple[bytes, str, str]] = {}
        self.later_s = 0.0
        subscription(self.node, THRUSTER_COMMAND, self._obey)
        subscription(self.node, ALLOCATION, lambda message: setattr(self, "said", message))
        subscription(self.node, DIAGNOSTICS, self._read)

    def _obey(self, command: ThrusterCommand) -> None:
        state = ThrusterState(armed=True, state="armed", pulses=command.pulses, sequence=command.sequence)
        state.header.stamp = command.header.stamp
        self._state.publish(state)

    def _read(self, message: DiagnosticArray) -> None:
        """Keep level, sentence and supply of each report."""
        for one in message.status:
            supply = next((pair.value for pair in one.values if pair.key == "supply [V]"), "")
            self.reports[one.name] = (one.level, one.message, supply)

    def until_reported(self, supply: str) -> tuple[bytes, str]:
        """Wait until the allocator's diagnostics say this of the supply; returns their level and sentence."""
        deadline = time.monotonic() + PATIENT_S
        while (found := self.reports.get("hindrax: allocator", (b"", "", "")))[2] != supply:
            assert time.monotonic() < deadline, f"last reported: {found}"
            self.turn()
        return found[:2]

    def until_supplied(self, volts: float, *, measured: bool) -> list[float]:
        """Ask for a wrench until its allocation reckons with a voltage; returns the pulses that follow from it."""
        deadline = time.monotonic() + PATIENT_S
        while self.said is None or (self.said.supply_voltage, self.said.supply_measured) != (volts, measured):
            assert time.monotonic() < deadline, f"last heard: {self.said}"
            if measured:
                self.battery.publish(BatteryState(voltage=volts, present=True))
            self.turn()
        for _ in range(SETTLING):
            self.turn()
        return list(self.said.pulses)

    def until_heard(self) -> None:
        """Publish a voltage until the allocator has it, which has no wrench yet."""
        deadline = time.monotonic() + PATIENT_S
        while math.isnan(self.allocator.supply.battery_V(Stamp(0))):
            assert time.monotonic() < deadline
            self.battery.publish(BatteryState(voltage=12.0, present=True))
            self.allocator.drain()
            self._executor.spin_once(timeout_sec=0.02)

    def turn(self) -> None:
        """Ask for a wrench once, and hear what comes back."""
        now = after(Stamp(self.node.get_clock().now().nanoseconds), self.later_s)
        self.allocator.on_wrench(UP, FSD, now, now)
        self.allocator.drain()
        self.allocator.publish_queue.flush()
        self._executor.spin_once(timeout_sec=0.02)


@pytest.fixture
def bench() -> Iterator[Bench]:
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        rclpy.init(args=[])
        try:
            yield Bench()
        finally:
            rclpy.try_shutdown()


def test_a_measured_voltage_takes_the_place_of_the_nominal_one(bench: Bench) -> None:
    nominal = bench.until_supplied(14.8, measured=False)
    weak = bench.until_supplied(12.0, measured=True)
    assert all(low > full + 10.0 for low, full in zip(weak[4:], nominal[4:], strict=True))
    assert bench.said is not None
    assert bench.said.achieved[2] == pytest.approx(-30.0, abs=0.2)
    bench.battery.publish(BatteryState(voltage=float("nan"), present=True))
    assert bench.until_supplied(12.0, measured=True) == weak


def test_a_voltage_that_came_before_the_first_wrench_is_as_good_as_a_later_one(bench: Bench) -> None:
    bench.until_heard()
    for _ in range(SETTLING):
        bench.turn()
    assert bench.said is not None
    assert (bench.said.supply_voltage, bench.said.supply_measured) == (12.0, True)


def test_a_battery_sensor_that_falls_silent_leaves_the_constant_and_a_complaint(bench: Bench) -> None:
    nominal = bench.until_supplied(14.8, measured=False)
    assert bench.until_reported("14.8 (assumed, no battery sensor)")[0] == DiagnosticStatus.OK
    bench.until_supplied(12.0, measured=True)
    assert bench.until_reported("12.0 (measured)")[0] == DiagnosticStatus.OK
    bench.later_s = 60.0
    assert bench.until_supplied(14.8, measured=False) == nominal
    level, sentence = bench.until_reported("14.8 (assumed, the battery sensor is silent)")
    assert level == DiagnosticStatus.WARN
    assert re.fullmatch(r"battery sensor silent for 6\d s: using 14\.8 V", sentence)
    bench.until_supplied(12.0, measured=True)
