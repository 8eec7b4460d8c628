"""Processes that compute are ended, whatever has not been read of what they were given."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from hindrax_analysis.identification.executor import run_all
from hindrax_core.errors import HindraxError

LARGE = b"x" * 2_000_000
"""More than a pipe holds: as large as a record."""
ITEMS = [(number, LARGE) for number in range(12)]
LIMIT_S = 100.0
"""For a process that would wait forever."""


def wait(item: tuple[int, bytes]) -> int:
    """The first is done at once, the others never."""
    if item[0]:
        signal.pause()
    return item[0]


def end(_item: tuple[int, bytes]) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def left_early() -> None:
    for number in run_all(wait, ITEMS, workers=2):
        assert number == 0
        break


def killed_outside() -> None:
    with pytest.raises(HindraxError, match="a process that computed was killed"):
        list(run_all(end, ITEMS, workers=2))


@pytest.mark.parametrize("case", ["left_early", "killed_outside"])
def test_processes_end_with_large_items_on_their_way(case: str) -> None:
    """Before Python closed the pipe itself, as in the 3.11.2 of Debian 12, Ctrl-C waited for a reader that was gone."""
    here = Path(__file__)
    words = [sys.executable, "-c", f"import {here.stem} as cases; cases.{case}()"]
    path = os.pathsep.join([str(here.parent), *sys.path])
    done = subprocess.run(
        words, env={**os.environ, "PYTHONPATH": path}, timeout=LIMIT_S, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
