"""Hardware that ends together with its clients: the thruster output is written last."""

import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from vehicles_beside import vehicle_beside

from hindrax_core.bus_operations import run
from hindrax_drivers.buses.clock import pause
from hindrax_drivers.buses.ports import open_bus
from hindrax_drivers.devices.pca9685 import pca9685_of
from hindrax_drivers.output.output_guard import guard_of
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle
from hindrax_sim.nodes.hardware_process import outlast_output

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
