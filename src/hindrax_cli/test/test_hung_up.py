"""A terminal that is closed while a command arms: the command ends as by Ctrl-C, so that arming ends with it."""

import contextlib
import os
import signal
import time
from collections.abc import Iterator

import pytest

from hindrax_cli.command_line import main
from hindrax_cli.commands.operate import manual_control
from hindrax_core.errors import INTERRUPTED


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
