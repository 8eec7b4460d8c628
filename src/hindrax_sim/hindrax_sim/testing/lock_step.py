"""A virtual bus without a process: a test sets its time."""

from collections.abc import Callable

from hindrax_core.bus_operations import Program, Transaction, run, wire_error
from hindrax_core.events import Stamp, after
from hindrax_drivers.buses.clock import EPOCH
from hindrax_sim.buses.virtual_i2c import VirtualI2c


class LoggedI2c(VirtualI2c):
    """A virtual bus that keeps what was on its wires: time, transaction, answer."""

    def __init__(self) -> None:
        super().__init__()
        self.log: list[tuple[Stamp, Transaction, bytes]] = []

    def transfer(self, transaction: Transaction, now: Stamp) -> bytes:
        answer = super().transfer(transaction, now)
        self.log.append((now, transaction, answer))
        return answer


class LockStep:
    """A virtual bus as a RegisterBus of the same process: the stepper of the world sets the time, nothing sleeps."""

    def __init__(self, bus: VirtualI2c, now: Stamp = EPOCH) -> None:
        self._bus = bus
        self.time = now

    def now(self) -> Stamp:
        """Time as set."""
        return self.time

    def transfer(self, transaction: Transaction) -> bytes:
        """Run one transaction, with the errors of a real bus."""
        try:
            return self._bus.transfer(transaction, self.time)
        except OSError as error:
            raise wire_error("virtual bus", transaction.address, error.errno or 0) from error

    def sleep_until(self, stamp: Stamp, _readable: int | None = None) -> None:
        """Jump to the stamp."""
        self.time = max(self.time, stamp)

    def wake(self) -> None:
        """Do nothing: no one sleeps."""

    def close(self) -> None:
        """Do nothing."""


def run_at_once(wires: VirtualI2c) -> Callable[[str, Program[object]], object]:
    """Return what runs programs on a virtual bus, whatever port is named."""
    bus = LockStep(wires, Stamp(10**9))
    return lambda _port, program: run(program, bus.transfer, lambda seconds: bus.sleep_until(after(bus.now(), seconds)))
