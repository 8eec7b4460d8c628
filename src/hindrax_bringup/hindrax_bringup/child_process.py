"""From a new process to the `main` of its module: executed by itself, or forked from who has imported it (ADR 44).

Both ways end in `_become`. Parents with threads (operators, tests) execute: between fork and exec `subprocess` runs no
Python, so what only Linux can do, the child does itself. Only a stack's own process forks: it has no threads of ours.
"""

import contextlib
import ctypes
import gc
import importlib
import inspect
import os
import select
import signal
import subprocess
import sys
import traceback
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, NoReturn

PR_SET_PDEATHSIG, PR_SET_NAME = 1, 15
STDERR = 2
STOP_SIGNALS = {signal.SIGINT, signal.SIGTERM}
_prctl = ctypes.CDLL(None).prctl


class ForkedProcess:
    """Interface of `subprocess.Popen` for a child that was forked."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Exit code, negative for a signal; None while it runs."""
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.returncode = os.waitstatus_to_exitcode(status) if pid else None
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Exit code when it has ended; `subprocess.TimeoutExpired` after this many seconds."""
        if self.poll() is None:
            ended = os.pidfd_open(self.pid)
            try:
                select.select([ended], (), (), timeout)
            finally:
                os.close(ended)
        if (code := self.poll()) is None:
            raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal, if it still runs."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Send SIGKILL, if it still runs."""
        self.send_signal(signal.SIGKILL)


def execute(
    module: str,
    arguments: Sequence[str],
    environment: Mapping[str, str],
    stdout: int | IO[bytes],
    stderr: int | IO[bytes],
) -> subprocess.Popen[bytes]:
    """Run `main` of a module in a process of its own group that ends with this one.

    Parameters
    ----------
    module, arguments
        Dotted name of the module, and the words after its name in `sys.argv`.
    environment
        All of its environment variables.
    stdout, stderr
        File or descriptor of each; the caller may close them at once.

    Returns
    -------
    subprocess.Popen[bytes]
        The process; `wait` and `poll` give its exit code.
    """
    return subprocess.Popen(  # noqa: S603  # our own interpreter and our own module
        command_line(module, arguments),
        env=dict(environment),
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=stderr,
        process_group=0,
    )


def command_line(module: str, arguments: Sequence[str]) -> list[str]:
    """Words of `execute`, for who starts processes by other means; the process ends with this one all the same."""
    return [sys.executable, "-m", __name__, str(os.getpid()), module, *arguments]


def fork(
    module: str, arguments: Sequence[str], environment: Mapping[str, str], stdout: int, stderr: int
) -> ForkedProcess:
    """The same by a fork: what the module imports is imported here first, once for all that need it.

    Parameters
    ----------
    module, arguments, environment
        As of `execute`.
    stdout, stderr
        Descriptors; the child has copies of them.

    Returns
    -------
    ForkedProcess
        In a group of its own; this process must have no threads that a fork would have to copy.
    """
    with contextlib.suppress(Exception):  # it is imported again where its log is
        importlib.import_module(module)
    here = inspect.currentframe()
    assert here is not None
    inspect.getframeinfo(here)  # looks up the files of all modules, which every process would do (`spin`)
    gc.freeze()
    parent, before = os.getpid(), signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # LTTng, which rclpy loads, has threads that only sleep
        pid = os.fork()
    if pid == 0:
        for number in STOP_SIGNALS:  # what comes meanwhile waits, and is not noted where nobody looks
            signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    if pid == 0:
        _enter(parent, module, arguments, environment, (stdout, stderr))
    with contextlib.suppress(OSError):  # it does so itself too: whoever comes first
        os.setpgid(pid, pid)
    return ForkedProcess(pid)


def _enter(
    parent: int, module: str, arguments: Sequence[str], environment: Mapping[str, str], outputs: tuple[int, int]
) -> NoReturn:
    """Become in a fork what an executed process is; what its parent was about is never unwound here."""
    code = 1
    try:
        os.setpgid(0, 0)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        for own, given in enumerate(outputs, start=1):
            os.dup2(given, own)
        for held in [int(one.name) for one in Path("/proc/self/fd").iterdir()]:
            with contextlib.suppress(OSError):  # that of the list itself
                if held > STDERR and not os.get_inheritable(held):  # as exec would: locks of the parent, for one
                    os.close(held)
        sys.stdout, sys.stderr = (os.fdopen(own, "w", buffering=1, closefd=False) for own in (1, STDERR))
        os.environ.clear()
        os.environ.update(environment)
        code = _become(parent, module, arguments)
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:  # noqa: BLE001  # as Python itself at the end of a process
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError):
                stream.flush()
        os._exit(code)


def end_with(parent: int) -> None:
    """Have the kernel interrupt this process, without a traceback, when its parent ends, and end if it has already."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _prctl(PR_SET_PDEATHSIG, signal.SIGINT)
    if os.getppid() != parent:
        sys.exit(1)


def _become(parent: int, module: str, arguments: Sequence[str]) -> int:
    end_with(parent)
    _prctl(PR_SET_NAME, module.rpartition(".")[2].encode())
    found = importlib.import_module(module)
    sys.argv = [str(found.__file__), *arguments]
    code: int = found.main()
    return code


if __name__ == "__main__":
    sys.exit(_become(int(sys.argv[1]), sys.argv[2], sys.argv[3:]))
