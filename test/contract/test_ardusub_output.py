"""The ArduSub output behind no guard, against the emulated firmware: no port, no thread, 5 ms a step."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_control.allocation.allocation_cycle import AllocationCycle
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_core.driver_interface import Output, Send, Trouble
from hindrax_core.events import Stamp, Stamped, stamp_from_s, to_s
from hindrax_core.readings import AppliedPulses, vec6
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_drivers.devices.ardupilot.output import ArduSub
from hindrax_sim.devices.ardupilot import firmware
from hindrax_sim.devices.ardupilot.wire import frame

BOX = Path(__file__).parents[2] / "src/hindrax_bringup/vehicles"
HEAVY, STANDARD = load_vehicle(BOX / "bluerov2-heavy.yaml"), load_vehicle(BOX / "bluerov2.yaml")
STEP_S = 0.005
BODY = "base_link_fsd"
NEUTRAL = (1500.0,) * 8


class Bench:
    """Driver and firmware on one wire; `pulses` are handed over fifty times a second while `alive`."""

    def __init__(self, vehicle: Vehicle = HEAVY, control: str = "manual_control") -> None:
        self.board = firmware.ArduSub(vehicle.thrusters, now_s=10.0)
        self.device = ArduSub(replace(vehicle, output=replace(vehicle.output, device="ardusub", control=control)))
        self.now: Stamp = stamp_from_s(10.0)
        self.pulses: tuple[float, ...] = (1500.0,) * len(vehicle.thrusters)
        self.armed, self.alive = False, True
        self.outputs: list[Output] = []
        self.to_board, self.turn = b"", 0
        self.take(self.device.start(self.now))

    def take(self, outputs: Iterable[Output]) -> None:
        for one in outputs:
            if isinstance(one, Send):
                self.to_board += one.data
            else:
                self.outputs.append(one)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.now = Stamp(self.now + stamp_from_s(STEP_S))
            sent, self.to_board = self.to_board, b""
            data = self.board.receive(sent, to_s(self.now)) + self.board.step(to_s(self.now))
            self.turn += 1
            if not self.alive:
                continue
            self.take(self.device.feed(data, self.now))
            self.take(self.device.tick(self.now))
            if self.turn % 4 == 0:
                self.take(self.device.drive(self.pulses, (), self.now, armed=self.armed))

    def fly(self, *pulses_us: float) -> None:
        """Set up, armed, at some pulses."""
        self.run(3.0)
        assert self.device.ready, self.device.trouble
        self.armed = True
        self.run(0.5)
        assert self.board.armed, self.texts()
        self.pulses = pulses_us
        self.run(0.5)

    def stranger(self, number: int, *values: object) -> None:
        """A frame of another ground station with the number that the autopilot obeys."""
        self.board.receive(frame(number, values, 0, 255, 190), to_s(self.now))

    def wire(self) -> tuple[float, ...]:
        return tuple(pulse or 0.0 for pulse in self.board.pulses_us()[: len(self.pulses)])

    def applied(self) -> tuple[float, ...]:
        readings = [one.reading for one in self.outputs if isinstance(one, Stamped)]
        return [one.pulses_us for one in readings if isinstance(one, AppliedPulses)][-1]

    def texts(self) -> list[str]:
        return [one.text for one in self.outputs if isinstance(one, Trouble)]


AHEAD = (1420.0, 1420.0, 1580.0, 1580.0, 1500.0, 1500.0, 1500.0, 1500.0)
ALL_AXES = (1440.0, 1480.0, 1550.0, 1530.0, 1560.0, 1480.0, 1540.0, 1460.0)
"""In the range of the mixer: no pair of thrusters works against another."""


@pytest.mark.parametrize("control", ["manual_control", "motor_test"])
@pytest.mark.parametrize("pulses", [AHEAD, ALL_AXES])
def test_the_pulses_that_were_asked_for_are_output_and_reported(control: str, pulses: tuple[float, ...]) -> None:
    bench = Bench(control=control)
    bench.fly(*pulses)
    bench.run(1.0)
    assert bench.wire() == pytest.approx(pulses, abs=3.0)
    assert bench.applied() == bench.wire()
    assert bench.texts() == []
    bench.armed = False
    bench.run(0.1)
    assert bench.wire() == NEUTRAL
    assert not bench.board.armed
    assert bench.device.fault() == ""


def wrench(vehicle: Vehicle, pulses: tuple[float, ...]) -> tuple[float, ...]:
    applied = AppliedWrench(vehicle)
    return applied.wrench(applied.forces_N(pulses))


@pytest.mark.parametrize("axis", range(6))
def test_a_small_wrench_gets_through_the_mixer_although_each_thruster_has_a_dead_band(axis: int) -> None:
    wanted = vec6((1.5 if at == axis else 0.4) * arm for at, arm in enumerate((1.0, 1.0, 1.0, 0.2, 0.15, 0.2)))
    command = AllocationCycle(HEAVY).command(wanted, BODY, Stamp(1), Stamp(1))
    assert command is not None
    bench = Bench()
    bench.fly(*command.pulses_us)
    asked, found = wrench(HEAVY, command.pulses_us), wrench(HEAVY, bench.wire())
    assert found == pytest.approx(asked, abs=0.12)
