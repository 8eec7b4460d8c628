"""The threads that own a port: serve it until they are stopped, deliver what came, and report their own failure."""

import os
import queue
import signal
import threading
from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import TypeAlias

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Output, SerialDevice, Trouble
from hindrax_core.events import after
from hindrax_drivers.buses.bus_schedule import BusOutput, BusSchedule, Result
from hindrax_drivers.buses.clock import Clock, RegisterBus
from hindrax_drivers.buses.line import Line, Tap, open_line

TICK_S = 0.05
REOPEN_S = 0.5

Deliver: TypeAlias = Callable[[str, Sequence[BusOutput]], None]
"""Called on the bus thread with the name of a device and its outputs."""


class ServingThread(threading.Thread):
    """Serves again and again.

    An error in our own code must not leave a node that seems alive: it is stored in `failure`, and the process is
    interrupted as by Ctrl-C, so that it ends the way it always ends and the supervisor starts it again.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._stopping = threading.Event()
        self.failure: BaseException | None = None

    @abstractmethod
    def _serve(self) -> None:
        """Serve once."""

    @abstractmethod
    def _wake(self) -> None:
        """End what `_serve` waits for. From any thread."""

    @property
    def stopping(self) -> bool:
        """Whether a stop was requested; long-running code checks this."""
        return self._stopping.is_set()

    def stop(self, timeout_s: float = 2.0) -> None:
        """Request a stop, wake the thread and wait for its end. From any other thread."""
        self._stopping.set()
        self._wake()
        if self.is_alive():
            self.join(timeout_s)

    def run(self) -> None:
        """Serve until a stop request."""
        try:
            while not self._stopping.is_set():
                self._serve()
        except BaseException as error:
            self.failure = error
            os.kill(os.getpid(), signal.SIGINT)
            raise


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


class SerialThread(ServingThread):
    """Host of one serial device: feeds it, sends its requests, reopens after a loss. `stop` closes the clock."""

    def __init__(
        self, path: str, device: SerialDevice, clock: Clock, deliver: Callable[[Iterable[Output]], None], tap: Tap
    ) -> None:
        super().__init__(path)
        self._path, self._device, self._clock = path, device, clock
        self._deliver, self._tap = deliver, tap
        self._port: Line | None = None
        self._pending: list[Output] = []
        self._calls: queue.SimpleQueue[Callable[[], Iterable[Output]]] = queue.SimpleQueue()

    @property
    def ready(self) -> bool:
        """Whether the port is open and the device has identified itself."""
        return self._port is not None and self._device.ready

    def call(self, action: Callable[[], Iterable[Output]]) -> None:
        """Run an action on the thread of the port, such as a request for a profile. From any thread."""
        self._calls.put(action)
        self._wake()

    def stop(self, timeout_s: float = 2.0) -> None:
        """Stop the thread, close port and clock."""
        super().stop(timeout_s)
        if self._port is not None:
            self._port.close()
        self._clock.close()

    def _wake(self) -> None:
        self._clock.wake()

    def _serve(self) -> None:
        """Open the port and serve it until it is lost; then wait before the next attempt."""
        try:
            self._port = open_line(self._path, self._device.baud, self._clock)
            self._tap(self._clock.now(), True, b"")  # an empty frame marks a restart of the device
            self._pending += self._port.send_all(self._device.start(self._clock.now()), self._tap)
            while not self.stopping:
                self._run_once(self._port)
        except DeviceError as error:
            self._port = None
            now = self._clock.now()
            self._pending.append(Trouble(now, str(error)))
            self._clock.sleep_until(after(now, REOPEN_S), meanwhile=self._deliver_pending)

    def _run_once(self, port: Line) -> None:
        port.wait(after(self._clock.now(), TICK_S), self._deliver_pending)
        data, stamp = port.read()
        if data:
            self._tap(stamp, False, data)
            self._pending += port.send_all(self._device.feed(data, stamp), self._tap)
        while not self._calls.empty():
            self._pending += port.send_all(self._calls.get()(), self._tap)
        self._pending += port.send_all(self._device.tick(stamp), self._tap)

    def _deliver_pending(self) -> None:
        """Deliver readings while the line is idle."""
        pending, self._pending = self._pending, []
        if pending:
            self._deliver(pending)
