"""A terminal that is closed while a command arms or flies: the command ends as by Ctrl-C, and what it began with it.

And a pipe whose reader has read enough.
"""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from hindrax_cli.command_line import main
from hindrax_cli.commands.operate import manual_control
from hindrax_cli.commands.pool import guided_session, pool_flight
from hindrax_core.errors import INTERRUPTED
from hindrax_operator.pool_run import interrupted_once


class Arming:
    """An operator whose arming is interrupted by a signal."""

    output = "mock"

    def __init__(self, number: signal.Signals) -> None:
        self._number = number
        self.gave_up = False

    def wait_for_thrusters(self) -> None: ...

    def arm(self, *, seconds: float) -> None:
        try:
            os.kill(os.getpid(), self._number)
            time.sleep(0.2 * seconds)
        except KeyboardInterrupt:
            self.gave_up = True
            raise


@pytest.fixture(autouse=True)
def of_a_terminal() -> Iterator[None]:
    """As a shell starts a command, whatever has started these tests; `nohup` has SIGHUP ignored."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_arming_ends_with_its_terminal(number: signal.Signals, monkeypatch: pytest.MonkeyPatch) -> None:
    """Killed at once, it left the thrusters arming: they were armed seconds later, and nobody was there."""
    operator = Arming(number)

    @contextlib.contextmanager
    def operator_of(_arguments: object) -> Iterator[Arming]:
        yield operator

    monkeypatch.setattr(manual_control, "operator_of", operator_of)
    before = signal.getsignal(number)
    assert main(["arm"]) == INTERRUPTED
    assert operator.gave_up
    assert signal.getsignal(number) is before


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
@pytest.mark.parametrize("words", [["--mock"], ["--session", "--mock"]])
def test_a_flight_lands_when_its_terminal_is_closed(
    number: signal.Signals, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed at once, it left a bag without results."""
    landed = []

    def fly(_options: object) -> int:
        try:
            with interrupted_once():
                try:
                    os.kill(os.getpid(), number)
                    time.sleep(1.0)
                finally:
                    os.kill(os.getpid(), number)  # does not interrupt the landing
                    landed.append(number)
        except KeyboardInterrupt:
            return INTERRUPTED
        return 0

    monkeypatch.setattr(pool_flight, "run_pool_test", fly)
    monkeypatch.setattr(guided_session, "guide", fly)
    assert main(["pool-test", *words]) == INTERRUPTED
    assert landed == [number]


def test_whoever_asked_for_no_hang_up_gets_none() -> None:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with interrupted_once():
        os.kill(os.getpid(), signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN


@pytest.mark.parametrize("words", [["papers"], ["allocate", "--wrench", "1", "0", "0", "0", "0", "0"]])
def test_a_reader_that_has_enough_is_no_failure(words: list[str]) -> None:
    """`papers | head -2` ended with 1: the library of the tables ends the process with it."""
    reads, writes = os.pipe()
    os.close(reads)
    with os.fdopen(writes, "wb") as pipe:
        found = subprocess.run(
            [sys.executable, "-m", "hindrax_cli", *words], stdout=pipe, stderr=subprocess.PIPE, check=False
        )
    assert (found.returncode, found.stderr) == (0, b"")
