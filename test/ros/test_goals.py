"""Goals in a row on one running pilot, from a client in a process of its own: each has its own feedback and result."""

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.executors import SingleThreadedExecutor

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_control.allocation.allocation_cycle import SupplyVoltage
from hindrax_control.nodes.pilot_node import PilotNode
from hindrax_control.testing.ideal_vehicle import IdealVehicle
from hindrax_core.events import Stamp, Stamped
from hindrax_core.vehicle import load_vehicle
from hindrax_msgs.msg import ThrusterState
from hindrax_ros.messages.serialization import serialized

pytestmark = pytest.mark.ros

CLIENT = Path(__file__).parents[1] / "goal_client.py"
SOURCES = [str(folder) for folder in sorted((CLIENT.parents[1] / "src").glob("hindrax_*"))]
PATIENT_S = 120.0
CYCLES_PER_TURN = 10
"""Between two looks at the graph: a vehicle that lives faster than the clock, so that whole maneuvers are flown."""


class Flight:
    """A pilot who flies an ideal vehicle, armed until a motion is flown in which the thrusters fail."""

    def __init__(self, *, failing: str) -> None:
        vehicle = load_vehicle(default_vehicle())
        self.ideal, self._failing = IdealVehicle(vehicle), failing
        self._start = time.time_ns()
        self.pilot = PilotNode(
            vehicle, SupplyVoltage(vehicle.supply_V), send_wrench=lambda wrench, *_: self.ideal.step(wrench)
        )
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.pilot)

    def turn(self) -> None:
        for _ in range(CYCLES_PER_TURN):
            motion = self.pilot._phase[0]
            state = ThrusterState(
                armed=motion != self._failing, state="armed", reason="no answer", sequence=1, pulses=[1500.0] * 8
            )
            self.pilot._on_thrusters(serialized(state))
            self.pilot.on_navigation(Stamped(Stamp(self._start + self.ideal.stamp), self.ideal.navigation()))
        self._executor.spin_once(timeout_sec=0.0)
        self.pilot.drain()
        self.pilot.publish_queue.flush()

    def close(self) -> None:
        self._executor.shutdown()
        self.pilot.close()
        self.pilot.destroy_node()


@pytest.fixture
def flight() -> Iterator[Flight]:
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        rclpy.init(args=[])
        made = Flight(failing="sway")
        try:
            yield made
        finally:
            made.close()
            rclpy.try_shutdown()


def outcomes(flight: Flight, *goals: tuple[str, str]) -> list[dict[str, Any]]:
    """What a client of its own is told of goals (motion, and what it does once that is flown) in a row."""
    made = environment(mock=True, domain=None)
    made["PYTHONPATH"] = ":".join([*SOURCES, made.get("PYTHONPATH", "")])
    words = [sys.executable, str(CLIENT), json.dumps(goals)]
    with subprocess.Popen(words, env=made, stdout=subprocess.PIPE, text=True) as client:
        deadline = time.monotonic() + PATIENT_S
        while client.poll() is None and time.monotonic() < deadline:
            flight.turn()
        client.terminate()
        assert client.stdout is not None
        printed = client.stdout.read().splitlines()
    return [json.loads(line) for line in printed]


def test_each_of_three_goals_in_a_row_has_its_own_feedback_and_its_own_result(flight: Flight) -> None:
    cancelled, completed, aborted = outcomes(flight, ("surge", "cancel"), ("yaw", ""), ("sway", ""))
    assert cancelled["status"] == GoalStatus.STATUS_CANCELED
    assert (cancelled["aborted"], cancelled["motions"]) == ("cancelled: by the operator", ["surge"])
    assert completed["status"] == GoalStatus.STATUS_SUCCEEDED
    assert (completed["completed"], completed["aborted"], completed["motions"]) == (True, "", ["yaw"])
    assert aborted["status"] == GoalStatus.STATUS_ABORTED
    assert aborted["aborted"] == "disarmed: no answer; arm and fly again"
    assert aborted["motions"] == ["sway"]
