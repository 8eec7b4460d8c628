"""A sensor of the table on its wire: the real driver at one end, the emulator at the other, in lock-step."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

from contract.serial_bench import Bench, world_s
from register_rig import START, STEP_S, Rig

from hindrax_bringup.share_files import default_vehicle, hindrax_with, optional_sensors
from hindrax_core.bus_operations import EDGES
from hindrax_core.driver_interface import Identity, Output, RegisterDevice, SerialDevice, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, seconds_between, to_s
from hindrax_core.readings import BottomVelocity
from hindrax_core.vehicle import Mount, Vehicle, load_vehicle
from hindrax_drivers.buses.bus_schedule import BusOutput
from hindrax_drivers.driver_registry import driver_of
from hindrax_sim.faults.fault_registry import FaultSpec, with_bus_faults
from hindrax_sim.hardware import emulator_of

Truth = Callable[[float], Any]
"""What is true, by the seconds since the start."""


def mount_of(name: str) -> tuple[Vehicle, Mount]:
    """Vehicle and mount of a sensor, which is on board, among the optional ones, or of an installed package."""
    on_board = load_vehicle(default_vehicle())
    if name not in on_board.sensors and name not in optional_sensors():
        return on_board, Mount(name, address=emulator_of(name).address)
    vehicle = on_board if name in on_board.sensors else hindrax_with(name)
    return vehicle, vehicle.sensors[name]


class SerialLine(Bench[SerialDevice]):
    """Driver and emulator on a serial line, and everything that the driver was fed."""

    def __init__(
        self, driver: SerialDevice, emulator: Any, truth: Truth, faults: Sequence[FaultSpec], seed: int
    ) -> None:
        super().__init__(driver, emulator, truth, faults=list(faults), seed=seed)
        self.received: list[bytes] = []
        self.said: list[tuple[float, Any]] = []

    def _feed(self, data: bytes, stamp: Stamp) -> None:
        self.received.append(data)
        super()._feed(data, stamp)

    def _handle(self, outputs: Iterable[Output]) -> None:
        outputs = list(outputs)
        self.said += [(self.now_s, one) for one in outputs]
        super()._handle(outputs)

    def seconds(self, stamped: Stamped[Any]) -> float:
        return world_s(stamped)


class RegisterBus(Rig):
    """Driver and emulator on a virtual I2C bus."""

    def __init__(self, driver: RegisterDevice, ports: dict[int, Any], tell: Callable[[float, float], None]) -> None:
        super().__init__(driver, ports, tell)
        self.said: list[tuple[float, Any]] = []

    def run(self, seconds: float) -> list[BusOutput]:
        before = len(self.outputs)
        for _ in range(round(seconds / STEP_S)):
            self.said += [(self.elapsed_s, one) for one in super().run(STEP_S)]
        return self.outputs[before:]

    def seconds(self, stamped: Stamped[Any]) -> float:
        return seconds_between(START, stamped.stamp)


class Plugged:
    """`run` lets time pass; what the driver said is asked for by kind and time. Times count from the start."""

    def __init__(
        self, name: str, faults: Sequence[FaultSpec] = (), truth: Truth | None = None, seed: int = 3, **changes: Any
    ) -> None:
        vehicle, mount = mount_of(name)
        mount = replace(mount, **changes)
        row, self.emulator = driver_of(name), emulator_of(name)
        self.truth = truth or self.emulator.example
        driver, part = row.make(row.knobs(), mount, vehicle), self.emulator.make(seed)
        self._wire: Any = (
            SerialLine(driver, part, self.truth, faults, seed)
            if row.serial
            else self._bus(name, driver, part, mount, faults=faults, seed=seed)
        )

    def _bus(
        self, name: str, driver: Any, part: Any, mount: Mount, *, faults: Sequence[FaultSpec], seed: int
    ) -> RegisterBus:
        afflicted = with_bus_faults(name, part, faults, seed, to_s(START))
        at = self.emulator.address if mount.address is None else mount.address
        ports = {at: part, **self.emulator.also_at(part, mount)}

        def tell(elapsed_s: float, now_s: float) -> None:
            part.set_truth(self.truth(elapsed_s), now_s)

        wired = {at: port if at >= EDGES else afflicted(port) for at, port in ports.items()}
        return RegisterBus(driver, wired, tell)

    def run(self, seconds: float) -> None:
        self._wire.run(seconds)

    def _said(self, kind: type | tuple[type, ...], since_s: float, until_s: float) -> list[Any]:
        return [one for at, one in self._wire.said if since_s <= at < until_s and isinstance(one, kind)]

    def readings(self, since_s: float = 0.0, until_s: float = 1e9) -> list[Stamped[Any]]:
        """Readings with something in them: a velocity that is not there is none."""
        found = self._said(Stamped, since_s, until_s)
        return [one for one in found if not isinstance(one.reading, BottomVelocity) or one.reading.velocity_mps]

    def complaints(self, since_s: float = 0.0, until_s: float = 1e9) -> list[str]:
        found = self._said((Rejected, Trouble), since_s, until_s)
        return [one.reason if isinstance(one, Rejected) else one.text for one in found]

    def troubles(self) -> list[str]:
        return [one.text for one in self._said(Trouble, 0.0, 1e9)]

    def received(self) -> bytes:
        """Everything that a serial driver was fed."""
        return b"".join(self._wire.received)

    def identities(self) -> list[str]:
        return [one.text for one in self._said(Identity, 0.0, 1e9)]

    def false(self) -> list[Stamped[Any]]:
        """Readings that must not be said of what was true at their stamps."""
        return [one for one in self.readings() if not self.emulator.agrees(self.truth(self.seconds(one)), one.reading)]

    def seconds(self, one: Stamped[Any]) -> float:
        """Time of a reading, by its stamp, since the start."""
        return float(self._wire.seconds(one))

    def beside_the_truth(self, one: Stamped[Any]) -> str:
        """A reading, its time, and what was true then."""
        at_s = self.seconds(one)
        return f"{one.reading} at {at_s:.2f} s, where the truth was {self.truth(at_s)}"
