"""A driver and an emulator on a virtual bus in lock-step: time goes on in steps of 5 ms, truth is set at each."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from hindrax_core.bus_operations import Program, run
from hindrax_core.driver_interface import Identity, RegisterDevice, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, after, stamp_from_s, to_s
from hindrax_drivers.buses.bus_schedule import BusOutput, BusSchedule
from hindrax_sim.devices.emulator import RegisterEmulator
from hindrax_sim.testing.lock_step import LockStep, LoggedI2c

STEP_S = 0.005
START = stamp_from_s(100.0)
ResultT = TypeVar("ResultT")


class Rig:
    """`truth(seconds)` is told to the emulator before every step; times are counted from the start."""

    def __init__(
        self,
        driver: RegisterDevice,
        ports: Mapping[int, RegisterEmulator],
        tell: Callable[[float, float], None],
    ) -> None:
        self.wires = LoggedI2c()
        for address, port in ports.items():
            self.wires.attach(address, port)
        self.bus = LockStep(self.wires, START)
        self.schedule = BusSchedule()
        self.schedule.add("sensor", driver, START)
        self.outputs: list[BusOutput] = []
        self._tell = tell
        self._step = 0

    @property
    def elapsed_s(self) -> float:
        return self._step * STEP_S

    def run(self, seconds: float) -> list[BusOutput]:
        """Let time pass; what the driver said meanwhile."""
        found: list[BusOutput] = []
        for _ in range(round(seconds / STEP_S)):
            self._step += 1
            self._until(after(START, self.elapsed_s), found)
        self.outputs += found
        return found

    def _until(self, stamp: Stamp, found: list[BusOutput]) -> None:
        self._tell(self.elapsed_s, to_s(stamp))
        while self.schedule.next_due(self.bus.now()) <= stamp:
            self.bus.sleep_until(self.schedule.next_due(self.bus.now()))
            for _, outputs in self.schedule.step(self.bus.now(), self.bus.transfer):
                found += outputs
        self.bus.sleep_until(stamp)

    def sleep(self, seconds: float) -> None:
        """Let time pass while the host does nothing at all."""
        self._step += round(seconds / STEP_S)
        self.bus.sleep_until(after(START, self.elapsed_s))

    def alone(self, program: Program[ResultT]) -> ResultT:
        """Run one program to its end, without the schedule."""
        return run(program, self.bus.transfer, lambda seconds: self.bus.sleep_until(after(self.bus.now(), seconds)))


def readings(outputs: list[BusOutput], kind: type[Any]) -> list[Stamped[Any]]:
    return [one for one in outputs if isinstance(one, Stamped) and isinstance(one.reading, kind)]


def reasons(outputs: list[BusOutput]) -> list[str]:
    return [one.reason for one in outputs if isinstance(one, Rejected)] + [
        one.text for one in outputs if isinstance(one, Trouble)
    ]


def identities(outputs: list[BusOutput]) -> list[str]:
    return [one.text for one in outputs if isinstance(one, Identity)]
