"""The thread of a port: serves until it is stopped, and reports its own failure."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable


class ServingThread:
    """Calls `serve` again and again.

    An error in our own code must not leave a node that seems alive: it is stored in `failure`, and the process is
    interrupted as by Ctrl-C, so that it ends the way it always ends and the supervisor starts it again.
    """

    def __init__(self, name: str, serve: Callable[[], None]) -> None:
        self._serve = serve
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self.failure: BaseException | None = None

    @property
    def stopping(self) -> bool:
        """Whether a stop was requested; long-running code checks this."""
        return self._stopping.is_set()

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def pause(self, seconds: float) -> None:
        """Wait, on the thread itself, at most until a stop request."""
        self._stopping.wait(seconds)

    def stop(self, wake: Callable[[], None], timeout_s: float) -> None:
        """Request a stop, `wake` the thread and wait for its end. From any other thread."""
        self._stopping.set()
        wake()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self._serve()
        except BaseException as error:
            self.failure = error
            os.kill(os.getpid(), signal.SIGINT)
            raise
