"""The sensors process by itself: it waits for what is not there yet; /diagnostics tell how each device is."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from hindrax_bag.run_folder import write_parameters
from hindrax_bringup.node_options import Blocks
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_core.sensor_table import SENSORS
from hindrax_core.topics import DIAGNOSTICS, NAMESPACE
from hindrax_core.vehicle import load_vehicle
from hindrax_ros.graph import subscription
from hindrax_sim.faults.fault_registry import parse_fault
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle

pytestmark = pytest.mark.ros

VEHICLE = load_vehicle(default_vehicle())
CARRIED = [sensor for sensor in SENSORS if sensor.name in VEHICLE.sensors]
PATIENT_S = 60.0
FAULTS = {"dvl75": "garbage", "ping1d": "garbage", "icm20948": "nack", "ms5837": "nack"}
LAST_S = 5
RATES_Hz = {"dvl75": (55.0, 65.0), "ping1d": (5.0, 25.0), "icm20948": (200.0, 260.0), "ms5837": (20.0, 60.0)}
"""What each device says in a second, readings of every kind; the pinger adapts its interval."""

Values = Mapping[str, str]


class Reports:
    """A node that keeps the last report of every sensor; a mock, once there is one, is stepped meanwhile."""

    def __init__(self) -> None:
        node = Node("bench", namespace=NAMESPACE)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._last: dict[str, DiagnosticStatus] = {}
        self.step: Callable[[], None] = lambda: time.sleep(0.01)
        subscription(node, DIAGNOSTICS, self._keep)

    def _keep(self, message: DiagnosticArray) -> None:
        self._last |= {one.name.removeprefix("hindrax: "): one for one in message.status}

    def until(self, holds: Callable[[str, DiagnosticStatus, Values], bool]) -> None:
        """Wait until it holds of the last report of every sensor."""
        deadline = time.monotonic() + PATIENT_S
        while not all(self._holds(sensor.name, holds) for sensor in CARRIED):
            assert time.monotonic() < deadline, self._told()
            self.step()
            self._executor.spin_once(timeout_sec=0.0)

    def _told(self) -> str:
        return "\n".join(
            f"{name}: {one.message}; " + ", ".join(f"{pair.key} {pair.value}" for pair in one.values)
            for name, one in sorted(self._last.items())
        )

    def _holds(self, name: str, holds: Callable[[str, DiagnosticStatus, Values], bool]) -> bool:
        status = self._last.get(name)
        return status is not None and holds(name, status, {pair.key: pair.value for pair in status.values})


@pytest.fixture
def reports(tmp_path: Path) -> Iterator[Reports]:
    """The process, told to use a mock that is not there yet."""
    clock = f"mock:{tmp_path}/i2c"
    values: Blocks = {
        f"/**/{sensor.name}": {"port": f"{tmp_path}/{sensor.name}" if sensor.serial else clock, "clock": clock}
        for sensor in CARRIED
    }
    words = write_parameters(tmp_path / "parameters.yaml", {"/**": {"vehicle": str(default_vehicle())}, **values})
    arguments = [sys.executable, "-m", "hindrax_drivers.nodes.sensors", *words, "-r", f"__ns:={NAMESPACE}"]
    with own_domain(mock=True) as domain, adopted(made := environment(mock=True, domain=domain)):
        rclpy.init(args=[])
        with subprocess.Popen(arguments, env=made) as process:
            try:
                yield Reports()
            finally:
                process.terminate()
                process.wait(20.0)
                rclpy.try_shutdown()


def test_a_late_mock_is_waited_for_and_every_device_states_how_it_is(reports: Reports, tmp_path: Path) -> None:
    def waiting(_name: str, status: DiagnosticStatus, values: Values) -> bool:
        return status.level == DiagnosticStatus.ERROR and "no mock hardware answers" in values["last trouble"]

    def measuring(name: str, status: DiagnosticStatus, values: Values) -> bool:
        low, high = RATES_Hz[name]
        well = status.level == DiagnosticStatus.OK and low < float(values["rate [Hz]"]) < high
        return well and bool(values["identity"]) and float(values["age [s]"]) < 1.0

    def knows_what_was_wrong(values: Values) -> bool:
        reasons = [int(value) for key, value in values.items() if key.startswith("rejected: ")]
        return int(values["rejects"]) == sum(reasons) and (
            sum(reasons) > 0 or "EREMOTEIO, 121" in values["last trouble"]
        )

    reports.until(waiting)
    faults = [parse_fault(f"{fault}:{name}@0+{LAST_S}") for name, fault in FAULTS.items()]
    with MockVehicle(Hardware(VEHICLE, 1, faults=faults), tmp_path, rate=0.0) as mock:
        reports.step = mock.step
        reports.until(lambda name, status, values: measuring(name, status, values) and knows_what_was_wrong(values))
