"""The thread of a port: serves until it is stopped, and reports its own failure."""

from __future__ import annotations

import os
import signal
import threading
from abc import abstractmethod


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

    def pause(self, seconds: float) -> None:
        """Wait, on the thread itself, at most until a stop request."""
        self._stopping.wait(seconds)

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
