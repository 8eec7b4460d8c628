"""The thread that owns a bus: turn, deliver, sleep until the next turn is due."""

from __future__ import annotations

import os
import queue
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import TypeAlias, TypeVar

from hindrax_core.bus import Program
from hindrax_drivers.buses.bus import RegisterBus
from hindrax_drivers.buses.schedule import BusOutput, BusSchedule, Result

ResultT = TypeVar("ResultT")
Deliver: TypeAlias = Callable[[str, Sequence[BusOutput]], None]
"""Called on the bus thread with the name of a device and what it said."""


class BusThread:
    """Host of a schedule. The bus belongs to it: `stop` closes it.

    An error in our own code must not leave a node that looks alive: it is kept in `failure`, and the process is
    interrupted as by Ctrl-C, so that it ends the way it always ends and the supervisor starts it again.
    """

    def __init__(self, bus: RegisterBus, schedule: BusSchedule, deliver: Deliver) -> None:
        self._bus, self._schedule, self._deliver = bus, schedule, deliver
        self._said: list[Result] = []
        self._inbox: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bus", daemon=True)
        self.failure: BaseException | None = None

    def start(self) -> None:
        """Begin to serve the schedule."""
        self._thread.start()

    def request(self, name: str, program: Program[ResultT]) -> Future[ResultT]:
        """Run a program once, as soon as the bus is free. From any thread; see `BusSchedule.request`."""
        future: Future[ResultT] = Future()
        self.call(lambda: self._schedule.request(name, program, future))
        return future

    def call(self, action: Callable[[], object]) -> None:
        """Let the bus thread do something to its schedule between two turns, soon. From any thread."""
        self._inbox.put(action)
        self._bus.wake()

    def stop(self, timeout_s: float = 2.0) -> None:
        """End the thread, cancel open requests and close the bus; a turn that is under way is finished."""
        self._stopping.set()
        self._bus.wake()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        self._schedule.close()
        self._bus.close()

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self._turn()
        except BaseException as error:
            self.failure = error
            os.kill(os.getpid(), signal.SIGINT)
            raise

    def _turn(self) -> None:
        while not self._inbox.empty():
            self._inbox.get()()
        self._said += self._schedule.turn(self._bus.now(), self._bus.transfer)
        self._bus.sleep_until(self._schedule.next_due(self._bus.now()), meanwhile=self._hand_over)

    def _hand_over(self) -> None:
        """Deliver while the bus rests: it is not for the devices to wait for who listens."""
        said, self._said = self._said, []
        for name, outputs in said:
            self._deliver(name, outputs)
