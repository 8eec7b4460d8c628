"""Ctrl-C at every stage of the tool's own process: 130, one sentence, no traceback."""

import os
import signal
import subprocess
import sys

import pytest

BEFORE = """
import signal, sys
from hindrax_cli import command_line, interrupt
from hindrax_cli.command import ToolCommand

def ring():
    signal.raise_signal(signal.SIGINT)

interrupt.listen()
"""
RUN = """
code = command_line.run_command(ToolCommand(arm, "./hindrax arm", (), passes_on=False), [])
"""
PRINTED = "hindrax: stopped by Ctrl-C\n"
PRINTED_BY_COMMAND = "hindrax arm: stopped by Ctrl-C\n"


def run(script: str) -> tuple[int, str]:
    done = subprocess.run([sys.executable, "-c", script], stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    return done.returncode, done.stderr


def ring_blocked() -> None:
    """Leave a SIGINT to what is started, as `./hindrax` does with one that comes while Python starts."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    signal.raise_signal(signal.SIGINT)


def test_on_a_terminal_the_sentence_stands_below_the_echo_of_the_key() -> None:
    master, slave = os.openpty()
    script = f"{BEFORE}def arm(_words):\n    ring()\n{RUN}sys.exit(code)"
    assert subprocess.run([sys.executable, "-c", script], stderr=slave, timeout=60, check=False).returncode == 130
    os.close(slave)
    printed = os.read(master, 1000)
    os.close(master)
    assert printed == b"\r\n" + PRINTED_BY_COMMAND.replace("\n", "\r\n").encode()


def test_one_that_waits_since_python_started_ends_the_tool() -> None:
    tool = [sys.executable, "-m", "hindrax_cli", "papers"]
    done = subprocess.run(tool, capture_output=True, text=True, timeout=60, check=False, preexec_fn=ring_blocked)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", PRINTED)


def test_one_while_what_catches_it_is_imported_ends_the_tool() -> None:
    find = "lambda self, name, *_: os.kill(os.getpid(), 2) if name == 'signal' else None"
    finder = f"type('Finder', (), {{'find_spec': {find}}})()"
    early = f"import os, sys\nsys.modules.pop('signal', None)\nsys.meta_path.insert(0, {finder})\n"
    assert run(f"{early}from hindrax_cli.__main__ import without_ros\nprint('goes on')") == (130, PRINTED)


def test_one_in_an_import_ends_the_tool() -> None:
    assert run(f"{BEFORE}ring()") == (130, PRINTED)


@pytest.mark.parametrize(
    "does",
    [
        "def arm(_words):\n    ring()",
        "def arm(_words):\n    exec('ring()')",
        "def arm(_words):\n    try:\n        ring()\n    except KeyboardInterrupt:\n        raise ImportError('half')",
    ],
    ids=["plain", "in code that Python notes to have been interrupted", "that a library makes another error of"],
)
def test_one_in_a_command_is_its_sentence(does: str) -> None:
    assert run(f"{BEFORE}{does}\n{RUN}sys.exit(code)") == (130, PRINTED_BY_COMMAND)


def test_an_error_of_ours_after_it_is_given() -> None:
    """A flight that was interrupted goes on to its results, and these may fail for their own reason."""
    does = (
        "from hindrax_core.errors import HindraxError\n"
        "def arm(_words):\n    try:\n        ring()\n    except KeyboardInterrupt:\n        raise HindraxError('full')"
    )
    assert run(f"{BEFORE}{does}\n{RUN}sys.exit(code)") == (1, "hindrax arm: full\n")


def test_one_after_the_work_ends_at_once() -> None:
    assert run(f"{BEFORE}def arm(_words):\n    return 0\n{RUN}ring()\nsys.exit(code)") == (130, PRINTED)


def test_one_when_python_has_ended_changes_nothing() -> None:
    late = "class Late:\n    def __del__(self, ring=ring):\n        ring()\n\nlate = Late()\n"
    assert run(f"{BEFORE}{late}sys.exit(3)") == (3, "")
