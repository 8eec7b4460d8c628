"""Both stages of a replay in parallel: the second follows the first in a process of its own.

The second reads the bag itself. The first sends it the number of settled messages, and the replacements of those that
the replayed devices publish differently.
"""

import gc
import multiprocessing
import signal
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any, Self

from hindrax_bag.read.bag_reader import BagMessage
from hindrax_core.errors import HindraxError

TOGETHER = 200
"""Messages per report to the second stage."""
COLLECT_AFTER = 100_000
"""Allocations between garbage collections; readings hold no reference cycles."""
SettledMessage = tuple[BagMessage, bytes | None]
"""A message, and its replacement if the replayed device publishes something else."""
_fork = multiprocessing.get_context("fork")


class SecondStage:
    """Handle of the second stage in the first; use it as a context manager, which ends the process."""

    def __init__(self, bag: Iterable[BagMessage], follow: Callable[[Iterator[SettledMessage]], Any]) -> None:
        """`bag`: the messages that the first stage will forward; `follow` processes them and returns its result."""
        self._pipe, theirs = _fork.Pipe()
        self._settled, self._replacements = 0, dict[int, bytes]()
        self._process = _fork.Process(target=_run, args=(theirs, self._pipe, bag, follow), daemon=True)
        self._process.start()
        theirs.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()

    def forward(self, replaced: bytes | None) -> None:
        """Send that the next message is settled, with its replacement if there is one."""
        if replaced is not None:
            self._replacements[self._settled] = replaced
        self._settled += 1
        if self._settled % TOGETHER == 0:
            self._send()

    def result(self) -> Any:
        """Result of the second stage once it is through; raises its exception if it had one."""
        self._send()
        try:
            found = self._pipe.recv()
        except (EOFError, OSError) as error:
            raise HindraxError("the second stage of the replay was killed; is there too little memory?") from error
        if isinstance(found, BaseException):
            raise found
        return found

    def _send(self) -> None:
        replacements, self._replacements = self._replacements, {}
        # If it has ended early, its result holds the reason.
        with suppress(OSError):
            self._pipe.send((self._settled, replacements))


def _run(
    pipe: Connection,
    other_end: Connection,
    bag: Iterable[BagMessage],
    follow: Callable[[Iterator[SettledMessage]], Any],
) -> None:
    """The second process."""
    # Ctrl-C is for the first stage, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    other_end.close()
    with suppress(EOFError, OSError):
        try:
            pipe.send(follow(_settled(bag, pipe)))
        except Exception as error:  # noqa: BLE001  # raised again in the first process
            error.add_note(traceback.format_exc())
            pipe.send(error)


def _settled(bag: Iterable[BagMessage], pipe: Connection) -> Iterator[SettledMessage]:
    """Messages of the bag as far as the first stage has settled them, in their order."""
    settled, replacements = 0, dict[int, bytes]()
    for index, message in enumerate(bag):
        while index >= settled:
            settled, more = pipe.recv()
            replacements |= more
        yield message, replacements.pop(index, None)


@contextmanager
def hardly_collecting() -> Iterator[None]:
    """Collect garbage rarely, and never among the objects that exist now."""
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(COLLECT_AFTER)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
