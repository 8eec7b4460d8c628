"""Ctrl-C is one sentence and exit code 130, at whatever moment it comes."""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import sys
from collections.abc import Iterator
from types import FrameType

from hindrax_core.errors import INTERRUPTED, HindraxError

STDERR = 2


def sentence(who: str = "hindrax") -> str:
    """Message at a Ctrl-C."""
    return f"{who}: stopped by Ctrl-C"


def _go_below_the_key() -> None:
    """A terminal has echoed ^C; what follows stands below."""
    if os.isatty(STDERR):
        os.write(STDERR, b"\n")


def end_now(_number: int, _frame: object) -> None:
    """End where nothing is begun yet, or all is done; an exception within an import would come out as another."""
    _go_below_the_key()
    os.write(STDERR, f"{sentence()}\n".encode())
    os._exit(INTERRUPTED)


def listen() -> None:
    """End by `end_now` from here on, also by what has been waiting since `./hindrax` started Python."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else whoever started this wants it ignored
        signal.signal(signal.SIGINT, end_now)
        # Called last: beyond it Python gives signals back to the kernel, which would kill with another code.
        atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Have KeyboardInterrupt raised meanwhile, and come out as that, whatever a library has made of it."""
    if signal.getsignal(signal.SIGINT) is not end_now:
        yield
        return
    interrupted = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        _go_below_the_key()
        signal.default_int_handler(number, frame)

    try:
        signal.signal(signal.SIGINT, interrupt)
        yield
    except HindraxError:
        raise
    except BaseException as error:
        if interrupted:
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, end_now)
        # Python notes where one leaves an `exec`, as of a named tuple in an import, and would kill itself at its end.
        exec("")  # noqa: S102


@contextlib.contextmanager
def hung_up_alike() -> Iterator[None]:
    """Have SIGTERM and a closed terminal end what is done meanwhile as Ctrl-C does, but for a `nohup`."""
    # Killed at once, a command that arms leaves the thrusters arming.
    numbers = [signal.SIGTERM, *([] if sys.platform == "win32" else [signal.SIGHUP])]
    before = {number: signal.getsignal(number) for number in numbers}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
