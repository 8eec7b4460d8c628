"""The thread that owns the thruster output: open it, turn its host, sleep on its clock, leave neutral behind."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial

from hindrax_core.bus import DeviceError
from hindrax_core.events import Stamp, seconds_between
from hindrax_drivers.arming import Answer, Command, Guard, Request
from hindrax_drivers.buses.output_host import Listener, OutputHost
from hindrax_drivers.buses.outputs import ThrusterOutput

REOPEN_S = 0.5
BEAT_S = 0.1


class OutputThread:
    """Serves one output, opened by `make`, behind one guard. The listener is told on this thread.

    `beat` is called at least ten times a second of the output's clock while the loop lives and has the output in hand.
    An error in our own code is kept in `failure` and interrupts the process, as with `BusThread`; neutral goes first.
    """

    def __init__(
        self, make: Callable[[], ThrusterOutput], guard: Guard, listener: Listener, beat: Callable[[], None]
    ) -> None:
        self._make, self._guard, self._listener, self._beat = make, guard, listener, beat
        self._inbox: queue.SimpleQueue[Callable[[OutputHost | None], None]] = queue.SimpleQueue()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="output", daemon=True)
        self._output: ThrusterOutput | None = None
        self._ready = False
        self._closed_because = "the output is not open yet"
        self._beaten_at = Stamp(0)
        self.failure: BaseException | None = None

    @property
    def ready(self) -> bool:
        """Whether the output is set up and does what it is told."""
        return self._ready

    @property
    def now(self) -> Stamp:
        """Time of the output; zero while it is not open."""
        output = self._output
        return Stamp(0) if output is None else output.now()

    def start(self) -> None:
        """Begin: neutral first."""
        self._thread.start()

    def command(self, command: Command) -> None:
        """Judge and obey a command, at once. From any thread."""
        self._put(lambda host: host.command(command) if host else None)

    def light(self, levels: tuple[float, ...]) -> None:
        """Set the lamps, 0 (dark) to 1, at once. From any thread."""
        self._put(lambda host: host.light(levels) if host else None)

    def arm(self, request: Request) -> Future[Answer]:
        """Begin to arm. From any thread."""
        return self._ask(lambda host: host.arm(request))

    def disarm(self, request: Request) -> Future[Answer]:
        """Disarm at once. From any thread."""
        return self._ask(lambda host: host.disarm(request))

    def drop(self, reason: str) -> None:
        """Disarm for a reason of our own. From any thread."""
        self._put(lambda host: host.drop(reason) if host else None)

    def stop(self, timeout_s: float = 3.0) -> None:
        """Leave neutral behind and end the thread. From any other thread."""
        self._stopping.set()
        self._put(lambda _host: None)
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _put(self, action: Callable[[OutputHost | None], None]) -> None:
        self._inbox.put(action)
        output = self._output
        if output is not None:
            with contextlib.suppress(OSError):  # it has just been closed
                output.wake()

    def _ask(self, question: Callable[[OutputHost], Answer]) -> Future[Answer]:
        future: Future[Answer] = Future()
        self._put(partial(self._answer, question, future))
        return future

    def _answer(
        self, question: Callable[[OutputHost], Answer], future: Future[Answer], host: OutputHost | None
    ) -> None:
        closed = Answer(accepted=False, reason=self._closed_because)
        future.set_result(closed if host is None else question(host))

    def _drain(self, host: OutputHost | None) -> None:
        while not self._inbox.empty():
            self._inbox.get()(host)

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self._serve()
        except BaseException as error:
            self.failure = error
            os.kill(os.getpid(), signal.SIGINT)
            raise

    def _serve(self) -> None:
        """Open the output and turn until asked to stop; a port that is not there is tried again."""
        try:
            output = self._make()
        except DeviceError as error:
            self._closed_because = str(error)
            self._listener.troubled(str(error))
            self._stopping.wait(REOPEN_S)
            self._drain(None)
            return
        host = OutputHost(output, self._guard, self._listener)
        self._output = output
        try:
            while not self._stopping.is_set():
                self._turn(output, host)
        finally:
            self._output, self._ready = None, False
            host.end()
            self._drain(None)

    def _turn(self, output: ThrusterOutput, host: OutputHost) -> None:
        now = output.now()
        if not 0.0 <= seconds_between(self._beaten_at, now) < BEAT_S:
            self._beaten_at = now
            self._beat()
        self._drain(host)
        due = host.turn()
        self._ready = host.ready
        try:
            output.wait(due, self._listener.rest)
        except DeviceError as error:
            host.broken(str(error))
