"""The thread that owns a bus: run programs, deliver readings, sleep until the next is due."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from hindrax_drivers.buses.bus_schedule import BusOutput, BusSchedule, Result
from hindrax_drivers.buses.register_bus import RegisterBus
from hindrax_drivers.buses.serving_thread import ServingThread

Deliver: TypeAlias = Callable[[str, Sequence[BusOutput]], None]
"""Called on the bus thread with the name of a device and its outputs."""


class BusThread(ServingThread):
    """Host of a schedule. The bus belongs to it: `stop` closes it."""

    def __init__(self, bus: RegisterBus, schedule: BusSchedule, deliver: Deliver) -> None:
        super().__init__("bus")
        self._bus, self._schedule, self._deliver = bus, schedule, deliver
        self._pending: list[Result] = []

    def stop(self, timeout_s: float = 2.0) -> None:
        """Stop the thread and close the bus; a program that runs comes as far as its pause."""
        super().stop(timeout_s)
        self._bus.close()

    def _wake(self) -> None:
        self._bus.wake()

    def _serve(self) -> None:
        self._pending += self._schedule.run_next(self._bus.now(), self._bus.transfer)
        self._bus.sleep_until(self._schedule.next_due(self._bus.now()), meanwhile=self._deliver_pending)

    def _deliver_pending(self) -> None:
        """Deliver readings while the bus is idle, so that no device waits for a subscriber."""
        pending, self._pending = self._pending, []
        for name, outputs in pending:
            self._deliver(name, outputs)
