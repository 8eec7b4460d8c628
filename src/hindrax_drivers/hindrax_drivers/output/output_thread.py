"""The thread that owns the thruster output: open it, run its host, sleep on its clock, end with neutral."""

import contextlib
import queue
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from hindrax_core.bus_operations import DeviceError
from hindrax_core.events import Stamp, seconds_between
from hindrax_core.signals import Command
from hindrax_core.text.coded import Coded
from hindrax_core.text.refusals import Reason, Refusal
from hindrax_drivers.buses.port_threads import ServingThread
from hindrax_drivers.output.output_guard import Answer, OutputGuard, RefusedCommand, Request
from hindrax_drivers.output.output_host import OutputHost, OutputListener
from hindrax_drivers.output.output_ports import ThrusterOutput
from hindrax_drivers.output.output_reasons import NO_REASON, OutputReason

REOPEN_S = 0.5
BEAT_S = 0.1


class OutputThread(ServingThread):
    """Serves one output, opened by `make`, behind one guard. The listener is called on this thread.

    `beat` is called at least ten times a second of the output's clock while the loop lives and has the output in hand.
    If our own code fails, neutral comes before the interrupt.
    """

    def __init__(
        self, make: Callable[[], ThrusterOutput], guard: OutputGuard, listener: OutputListener, beat: Callable[[], None]
    ) -> None:
        super().__init__("output")
        self._make, self._guard, self._listener, self._beat = make, guard, listener, beat
        self._inbox: queue.SimpleQueue[tuple[Callable[[OutputHost], object], Future[object] | None]] = (
            queue.SimpleQueue()
        )
        self._output: ThrusterOutput | None = None
        self.ready = False
        """Whether the output is set up and follows commands."""
        self.left_armed = False
        """Whether its far end may be armed although it should not be."""
        self._closed_because = "the output is not open yet"
        self._inhibited_because = NO_REASON
        self._beaten_at = Stamp(0)

    @property
    def now(self) -> Stamp:
        """Time of the output; zero while it is not open."""
        output = self._output
        return Stamp(0) if output is None else output.now()

    def command(self, command: Command) -> None:
        """Check and apply a command at once. From any thread."""
        self._post(lambda host: host.command(command))

    def refuse(self, refusal: RefusedCommand) -> None:
        """Refuse a command that is not even checked. From any thread."""
        self._post(lambda host: host.refuse(refusal))

    def light(self, levels: tuple[float, ...]) -> None:
        """Set the lamps, 0 (dark) to 1, at once. From any thread."""
        self._post(lambda host: host.light(levels))

    def arm(self, request: Request) -> Future[Answer]:
        """Begin to arm. From any thread."""
        return self._ask(lambda host: host.arm(request))

    def disarm(self, request: Request) -> Future[Answer]:
        """Disarm at once. From any thread."""
        return self._ask(lambda host: host.disarm(request))

    def drop(self, reason: Coded[OutputReason]) -> None:
        """Disarm for an internal reason. From any thread."""
        self._post(lambda host: host.drop(reason))

    def inhibit(self, reason: Coded[OutputReason]) -> None:
        """Hold neutral and disarmed while there is a reason; an empty reason ends it. From any thread."""
        self._inhibited_because = reason
        self._post(lambda host: host.inhibit(reason))

    def stop(self, timeout_s: float = 3.0) -> None:
        """Write neutral and stop the thread. From any other thread."""
        super().stop(timeout_s)

    def _wake(self) -> None:
        output = self._output
        if output is not None:
            with contextlib.suppress(OSError):  # it has just been closed
                output.wake()

    def _ask(self, action: Callable[[OutputHost], Any]) -> Future[Any]:
        future: Future[object] = Future()
        self._post(action, future)
        return future

    def _post(self, action: Callable[[OutputHost], object], future: Future[object] | None = None) -> None:
        self._inbox.put((action, future))
        self._wake()

    def _drain(self, host: OutputHost | None) -> None:
        while not self._inbox.empty():
            action, future = self._inbox.get()
            closed = Answer(accepted=False, reason=Refusal(Reason.FAULTED, self._closed_because))
            answer = action(host) if host else closed
            if future is not None:
                future.set_result(answer)

    def _serve(self) -> None:
        """Open the output and serve it until a stop request; a missing port is retried."""
        try:
            output = self._make()
        except DeviceError as error:
            self._closed_because = str(error)
            self._listener.troubled(str(error))
            self._stopping.wait(REOPEN_S)
            self._drain(None)
            return
        host = OutputHost(output, self._guard, self._listener)
        host.inhibit(self._inhibited_because)
        self._output, self.left_armed = output, host.left_armed
        try:
            while not self.stopping:
                self._turn(output, host)
        finally:
            self._output, self.ready = None, False
            host.end()
            self._drain(None)

    def _turn(self, output: ThrusterOutput, host: OutputHost) -> None:
        now = output.now()
        if not 0.0 <= seconds_between(self._beaten_at, now) < BEAT_S:
            self._beaten_at = now
            self._beat()
        self._drain(host)
        due = host.turn()
        self.ready, self.left_armed = host.ready, host.left_armed
        try:
            output.wait(due, self._listener.on_idle)
        except DeviceError as error:
            host.broken(str(error))
