"""The stages of a replay at the same time: the second follows the first in a process of its own.

It reads the bag itself. What travels between them is how far the first has settled what was recorded, and what the
devices say now where that is something else.
"""

from __future__ import annotations

import gc
import multiprocessing
import signal
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from typing import Any, Self

from hindrax_bag.reader import BagMessage
from hindrax_core.errors import HindraxError

TOGETHER = 200
"""Messages that are reported to the second stage at once."""
COLLECT_AFTER = 100_000
"""New objects after which garbage is looked for; of ten thousands of readings none refers to itself."""
Heard = tuple[BagMessage, bytes | None]
"""A message, and what a device says instead."""
_fork = multiprocessing.get_context("fork")


class Follower:
    """The second stage, as the first sees it; to be left as a context, which ends its process."""

    def __init__(self, bag: Iterable[BagMessage], follow: Callable[[Iterator[Heard]], Any]) -> None:
        """`bag`: the messages that the first stage will tell of; `follow` hears them and gives what it found."""
        self._pipe, theirs = _fork.Pipe()
        self._settled, self._instead = 0, dict[int, bytes]()
        self._process = _fork.Process(target=_run, args=(theirs, self._pipe, bag, follow), daemon=True)
        self._process.start()
        theirs.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.join()
        self._pipe.close()

    def tell(self, _message: BagMessage, said: bytes | None) -> None:
        """Report that the next message is settled."""
        if said is not None:
            self._instead[self._settled] = said
        self._settled += 1
        if self._settled % TOGETHER == 0:
            self._report()

    def result(self) -> Any:
        """What the second stage found, once it has heard all; its exception when it had one."""
        self._report()
        try:
            found = self._pipe.recv()
        except (EOFError, OSError) as error:
            raise HindraxError("the second stage of the replay was killed; is there too little memory?") from error
        if isinstance(found, BaseException):
            raise found
        return found

    def _report(self) -> None:
        instead, self._instead = self._instead, {}
        # Where it has ended early, its result says why.
        with suppress(OSError):
            self._pipe.send((self._settled, instead))


def _run(
    pipe: Connection, other_end: Connection, bag: Iterable[BagMessage], follow: Callable[[Iterator[Heard]], Any]
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


def _settled(bag: Iterable[BagMessage], pipe: Connection) -> Iterator[Heard]:
    """Messages of the bag as far as the first stage has settled them, in their order."""
    settled, instead = 0, dict[int, bytes]()
    for index, message in enumerate(bag):
        while index >= settled:
            settled, more = pipe.recv()
            instead |= more
        yield message, instead.pop(index, None)


@contextmanager
def hardly_collecting() -> Iterator[None]:
    """Look for garbage seldom, and never again among what is there now."""
    before = gc.get_threshold()
    gc.freeze()
    gc.set_threshold(COLLECT_AFTER)
    try:
        yield
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
