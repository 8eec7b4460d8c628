"""The thread that owns a serial port: feed what arrives, send what the device asks for, tick, reopen when lost."""

from __future__ import annotations

import os
import queue
import signal
import threading
from collections.abc import Callable, Iterable
from typing import TypeAlias

from hindrax_core.bus import DeviceError
from hindrax_core.device import Output, Send, SerialDevice, Trouble
from hindrax_core.events import Stamp, after
from hindrax_drivers.buses.clock import Clock
from hindrax_drivers.buses.line import Line, open_line

TICK_S = 0.05
REOPEN_S = 0.5

Deliver: TypeAlias = Callable[[Iterable[Output]], None]
Tap: TypeAlias = Callable[[Stamp, bool, bytes], None]
"""Told of everything that passes the port: time, whether it was sent, bytes."""


class SerialThread:
    """Host of one serial device. The clock belongs to it: `stop` closes it.

    An error in our own code is kept in `failure` and interrupts the process, as with `BusThread`.
    """

    def __init__(self, path: str, device: SerialDevice, clock: Clock, deliver: Deliver, tap: Tap) -> None:
        self._path, self._device, self._clock = path, device, clock
        self._deliver, self._tap = deliver, tap
        self._port: Line | None = None
        self._said: list[Output] = []
        self._asked: queue.SimpleQueue[Callable[[], Iterable[Output]]] = queue.SimpleQueue()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=path, daemon=True)
        self.failure: BaseException | None = None

    @property
    def ready(self) -> bool:
        """Whether the port is open and the device has identified itself."""
        return self._port is not None and self._device.ready

    def start(self) -> None:
        """Begin to serve the port."""
        self._thread.start()

    def ask(self, question: Callable[[], Iterable[Output]]) -> None:
        """Let the device be asked something on the thread of its port, such as for a profile. From any thread."""
        self._asked.put(question)
        self._clock.wake()

    def stop(self, timeout_s: float = 2.0) -> None:
        """End the thread, close port and clock."""
        self._stopping.set()
        self._clock.wake()
        if self._thread.is_alive():
            self._thread.join(timeout_s)
        if self._port is not None:
            self._port.close()
        self._clock.close()

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self._serve()
        except BaseException as error:
            self.failure = error
            os.kill(os.getpid(), signal.SIGINT)
            raise

    def _serve(self) -> None:
        """Open the port and turn until it is lost; then wait a little."""
        try:
            self._port = open_line(self._path, self._device.baud, self._clock)
            self._tap(self._clock.now(), True, b"")  # an empty frame: from here on the device begins anew
            self._take(self._device.start(self._clock.now()))
            while not self._stopping.is_set():
                self._turn(self._port)
        except DeviceError as error:
            self._port = None
            now = self._clock.now()
            self._said.append(Trouble(now, str(error)))
            self._clock.sleep_until(after(now, REOPEN_S), meanwhile=self._hand_over)

    def _turn(self, port: Line) -> None:
        port.wait(after(self._clock.now(), TICK_S), self._hand_over)
        data, stamp = port.read()
        if data:
            self._tap(stamp, False, data)
            self._take(self._device.feed(data, stamp))
        while not self._asked.empty():
            self._take(self._asked.get()())
        self._take(self._device.tick(stamp))

    def _take(self, outputs: Iterable[Output]) -> None:
        kept = list(outputs)
        for output in kept:
            if isinstance(output, Send) and self._port is not None:
                self._port.send(output)
                self._tap(self._clock.now(), True, output.data)
        self._said += kept

    def _hand_over(self) -> None:
        """Deliver while the line rests."""
        said, self._said = self._said, []
        if said:
            self._deliver(said)
