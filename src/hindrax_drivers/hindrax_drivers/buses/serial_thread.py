"""The thread that owns a serial port: decode received bytes, send requests, tick, reopen after a loss."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterable
from typing import TypeAlias

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Output, Send, SerialDevice, Trouble
from hindrax_core.events import Stamp, after
from hindrax_drivers.buses.clock import Clock
from hindrax_drivers.buses.line import Line, open_line
from hindrax_drivers.buses.serving_thread import ServingThread

TICK_S = 0.05
REOPEN_S = 0.5

Deliver: TypeAlias = Callable[[Iterable[Output]], None]
Tap: TypeAlias = Callable[[Stamp, bool, bytes], None]
"""Called for every frame of the port: time, whether it was sent, bytes."""


class SerialThread(ServingThread):
    """Host of one serial device. The clock belongs to it: `stop` closes it."""

    def __init__(self, path: str, device: SerialDevice, clock: Clock, deliver: Deliver, tap: Tap) -> None:
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
            self._handle(self._device.start(self._clock.now()))
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
            self._handle(self._device.feed(data, stamp))
        while not self._calls.empty():
            self._handle(self._calls.get()())
        self._handle(self._device.tick(stamp))

    def _handle(self, outputs: Iterable[Output]) -> None:
        kept = list(outputs)
        for output in kept:
            if isinstance(output, Send) and self._port is not None:
                self._port.send(output)
                self._tap(self._clock.now(), True, output.data)
        self._pending += kept

    def _deliver_pending(self) -> None:
        """Deliver readings while the line is idle."""
        pending, self._pending = self._pending, []
        if pending:
            self._deliver(pending)
