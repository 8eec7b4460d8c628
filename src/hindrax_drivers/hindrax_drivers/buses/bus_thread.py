"""The thread that owns a bus: run programs, deliver readings, sleep until the next is due."""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import TypeAlias, TypeVar

from hindrax_core.bus_operations import Program
from hindrax_drivers.buses.bus_schedule import BusOutput, BusSchedule, Result
from hindrax_drivers.buses.register_bus import RegisterBus
from hindrax_drivers.buses.serving_thread import ServingThread

ResultT = TypeVar("ResultT")
Deliver: TypeAlias = Callable[[str, Sequence[BusOutput]], None]
"""Called on the bus thread with the name of a device and its outputs."""


class BusThread(ServingThread):
    """Host of a schedule. The bus belongs to it: `stop` closes it."""

    def __init__(self, bus: RegisterBus, schedule: BusSchedule, deliver: Deliver) -> None:
        super().__init__("bus")
        self._bus, self._schedule, self._deliver = bus, schedule, deliver
        self._pending: list[Result] = []
        self._inbox: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()

    def request(self, name: str, program: Program[ResultT]) -> Future[ResultT]:
        """Run a program once, as soon as the bus is free. From any thread; see `BusSchedule.request`."""
        future: Future[ResultT] = Future()
        self.call(lambda: self._schedule.request(name, program, future))
        return future

    def call(self, action: Callable[[], object]) -> None:
        """Run an action on the bus thread between two programs. From any thread."""
        self._inbox.put(action)
        self._wake()

    def stop(self, timeout_s: float = 2.0) -> None:
        """Stop the thread, cancel open requests and close the bus; a running program is finished."""
        super().stop(timeout_s)
        self._schedule.close()
        self._bus.close()

    def _wake(self) -> None:
        self._bus.wake()

    def _serve(self) -> None:
        while not self._inbox.empty():
            self._inbox.get()()
        self._pending += self._schedule.run_next(self._bus.now(), self._bus.transfer)
        self._bus.sleep_until(self._schedule.next_due(self._bus.now()), meanwhile=self._deliver_pending)

    def _deliver_pending(self) -> None:
        """Deliver readings while the bus is idle, so that no device waits for a subscriber."""
        pending, self._pending = self._pending, []
        for name, outputs in pending:
            self._deliver(name, outputs)
