"""The mock vehicle with an STM32 as its output: a guard in a thread, on a pty and the mock's clock."""

import dataclasses
import os
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from hindrax_core.driver_interface import Output
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.signals import AppliedOutput, Command
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_drivers.output.output_guard import ArmingPhase, OutputGuardKnobs, RefusedCommand, Request, guard_of
from hindrax_drivers.output.output_ports import open_output
from hindrax_drivers.output.output_thread import OutputThread
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle

FILE = Path(__file__).parents[2] / "src/hindrax_bringup/vehicles/hindrax.yaml"
MOVING = (1650.0,) * 8


def run_for(mock: MockVehicle, seconds: float) -> None:
    end = mock.hardware.stamp + stamp_from_s(seconds)
    while mock.hardware.stamp < end:
        mock.step()


class Ears:
    def __init__(self) -> None:
        self.last: AppliedOutput | None = None
        self.identity = ""

    def applied(self, applied: AppliedOutput) -> None:
        self.last = applied

    def refused(self, refusal: RefusedCommand, stamp: Stamp) -> None:
        raise AssertionError(f"{refusal.text} at {stamp}")

    def found(self, identity: str) -> None:
        self.identity = identity

    def troubled(self, text: str) -> None:
        raise AssertionError(text)

    def deliver(self, outputs: Iterable[Output]) -> None:
        pass

    def on_idle(self) -> None:
        pass


def with_stm32() -> Vehicle:
    vehicle = load_vehicle(FILE)
    return dataclasses.replace(vehicle, output=dataclasses.replace(vehicle.output, device="stm32"))


def test_the_guard_flies_the_mock_through_the_firmware(tmp_path: Path) -> None:
    vehicle, ears = with_stm32(), Ears()
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0) as mock:
        port = mock.ports["thrusters"]
        assert port == str(tmp_path / "thrusters")
        # The mock does not wait for the thread: on a busy machine it is seconds ahead of a command that is taken.
        patient = {"command_lifespan_s": 2.0, "silence_s": 2.0, "arm_lifespan_s": 5.0, "disarm_after_s": 600.0}
        guard = guard_of(vehicle, OutputGuardKnobs(arming_s=7.2, **patient))
        thread = OutputThread(
            lambda: open_output(vehicle, port, mock.clock, lambda *_: None, "thrusters", neutral=guard.neutral),
            guard,
            ears,
            lambda: None,
        )
        thread.start()

        def until(done: Callable[[], bool], what: str) -> None:
            deadline, sequence = time.monotonic() + 60.0, 0
            while not done():
                assert time.monotonic() < deadline, what
                sequence += 1
                thread.command(Command(MOVING, (), mock.hardware.stamp, round(mock.hardware.stamp / 1e6)))
                run_for(mock, 0.02)

        until(lambda: thread.ready, "the board")
        assert ears.identity.startswith("MAVLink system 1 component 1")
        answer = thread.arm(Request(mock.hardware.stamp, 1))
        until(answer.done, "an answer")
        assert answer.result().accepted
        until(lambda: mock.hardware.output.pulses_us()[:8] == MOVING, "pulses")
        assert ears.last is not None
        assert ears.last.phase is ArmingPhase.ARMED
        thread.light((1.0, 0.0))
        until(lambda: mock.hardware.output.pulses_us()[8:10] == (1900.0, 1100.0), "light")
        speed = mock.hardware.world.velocity_mps(mock.hardware.world.mounting(vehicle.sensors["dvl75"]))
        until(
            lambda: mock.hardware.world.velocity_mps(mock.hardware.world.mounting(vehicle.sensors["dvl75"])) != speed,
            "motion",
        )
        thread.stop(0.0)
        run_for(mock, 0.5)
        thread.stop()
        assert mock.hardware.output.pulses_us()[:8] == (1500.0,) * 8


def test_nobody_waits_for_a_ground_station_as_for_a_control_loop(tmp_path: Path) -> None:
    with MockVehicle(Hardware(with_stm32(), 1), tmp_path, rate=0.0) as mock:
        descriptor = os.open(mock.ports["thrusters"], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        os.write(descriptor, bytes.fromhex("fd 09 00 00 00 01 bf 00 00 00 00 00 00 00 12 08 00 04 03 ae c6"))
        run_for(mock, 0.1)
        os.close(descriptor)
        assert mock.last_write is None, "time would nearly stand still between two of its frames"


@pytest.mark.parametrize("fault", ["reset", "bit_flips", "absent", "nack"])
def test_faults_of_the_thrusters_fall_on_the_line_as_far_as_a_line_has_them(tmp_path: Path, fault: str) -> None:
    from hindrax_sim.faults.fault_registry import FaultSpec

    hardware = Hardware(with_stm32(), 1, faults=[FaultSpec(fault, ("thrusters",), 0.0, 0.2)])
    with MockVehicle(hardware, tmp_path, rate=0.0) as mock:
        run_for(mock, 0.1)
        assert mock.hardware.output.pulses_us()[:8] == (1500.0,) * 8
