"""Hardware that ends together with its clients: the thruster output is written last."""

import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from vehicles_beside import vehicle_beside

pytest.importorskip("rclpy", reason="needs the ROS environment")

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from hindrax_core.bus_operations import run
from hindrax_core.topics import CLOCK, NAMESPACE
from hindrax_drivers.buses.clock import pause
from hindrax_drivers.buses.ports import open_bus
from hindrax_drivers.devices.pca9685 import pca9685_of
from hindrax_drivers.output.output_guard import guard_of
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle
from hindrax_sim.nodes.hardware_process import outlast_output
from hindrax_sim.nodes.mock import ClockPublisher

VEHICLE = vehicle_beside()
CHIP = pca9685_of(VEHICLE, guard_of(VEHICLE).neutral.all_us)


@pytest.fixture
def mock(tmp_path: Path) -> Iterator[MockVehicle]:
    with MockVehicle(Hardware(VEHICLE, 1), tmp_path, rate=0.0) as made:
        yield made


class Client(threading.Thread):
    """Joins the bus, and when told to end sets the chip up, puts neutral on it if it is an output, and leaves."""

    def __init__(self, mock: MockVehicle, name: str) -> None:
        super().__init__(daemon=True)
        self._mock, self._name = mock, name
        self.neutral_written, self.told = False, threading.Event()

    def run(self) -> None:
        bus = open_bus(self._mock.ports["thrusters"], self._name)
        self.told.wait()
        for program in (CHIP.configure(), CHIP.hold()):
            run(program, bus.transfer, partial(pause, bus))
        self.neutral_written = True
        bus.close()

    def join_bus(self) -> None:
        self.start()
        while self._mock.serve_clients(0.01) != [self._name]:
            pass


@pytest.mark.parametrize("name", ["thrusters", "thrusters dead man"])
def test_neutral_is_written_before_the_hardware_goes(mock: MockVehicle, name: str) -> None:
    client = Client(mock, name)
    client.join_bus()
    client.told.set()
    outlast_output(mock, shutdown_s=60.0)
    assert not mock.serve_clients(0.0)
    client.join()
    assert client.neutral_written


@pytest.mark.parametrize(("name", "shutdown_s"), [("sensors", 60.0), ("thrusters", 0.1)])
def test_who_reads_only_or_stays_is_not_waited_for(mock: MockVehicle, name: str, shutdown_s: float) -> None:
    client = Client(mock, name)
    client.join_bus()
    outlast_output(mock, shutdown_s)
    assert mock.serve_clients(0.0) == [name]


def test_after_a_standstill_the_clock_of_a_mock_is_published_by_another_participant(
    mock: MockVehicle, ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The vehicle goes on: its process cannot begin anew as all others do."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    with ClockPublisher(mock, NAMESPACE) as clock:

        def heard() -> tuple[int, ...]:
            """Identifier of the one publisher of the clock, as another participant sees it."""
            end_s = time.monotonic() + 20.0
            while time.monotonic() < end_s:
                found = listener.get_publishers_info_by_topic(CLOCK)
                if len(found) == 1 and found[0].endpoint_gid not in before:
                    mock.step()
                    executor.spin_once(timeout_sec=0.01)
                    if seen:
                        return tuple(found[0].endpoint_gid)
                time.sleep(0.01)
            return ()

        context = Context()
        context.init()
        listener = Node("listener", context=context, enable_rosout=False, start_parameter_services=False)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(listener)
        seen: list[object] = []
        listener.create_subscription(Clock, CLOCK, seen.append, 1)
        before: list[list[int]] = []
        first = heard()
        assert first
        assert not clock.keep()
        before.append(list(first))
        clock._watch._standstills.append(8.0)
        assert clock.keep()
        seen.clear()
        assert heard()
        executor.shutdown()
        listener.destroy_node()
        context.shutdown()
