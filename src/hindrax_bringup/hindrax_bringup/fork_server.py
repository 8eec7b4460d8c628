"""The fork server: imports once what the processes of a stack need, and forks each of them from itself (ADR 33).

A process that it made is a child of the supervisor: the process between the two ends at once, and the kernel hands its
child to the supervisor (PR_SET_CHILD_SUBREAPER, prctl(2)). The server makes no node, opens no port and starts no thread
of ours, which a fork would not copy.
"""

import contextlib
import ctypes
import gc
import importlib
import inspect
import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from hindrax_bringup.process_state import is_stopped

PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36
FIRST_S = 30.0
"""For an answer that waits for an import; without any it takes at most `AGAIN_S`."""
AGAIN_S = 2.0
LONGEST = 1 << 16
"""Of a request, and room for a command line [bytes]."""
ROOM = 2048
"""Kept free in the command line of the server, for those of what it forks [bytes]."""
_prctl = ctypes.CDLL(None).prctl


class ForkedProcess:
    """Interface of `subprocess.Popen` for a child that this process did not start itself."""

    def __init__(self, pid: int, stdout: IO[bytes] | None) -> None:
        self.pid, self.stdout = pid, stdout
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Exit code, negative for a signal; None while it runs."""
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.returncode = os.waitstatus_to_exitcode(status) if pid else None
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Exit code when it has ended; `subprocess.TimeoutExpired` after this many seconds."""
        if self.returncode is None:
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


class ForkServer:
    """The supervisor's end: starts the server, which at once imports these modules one by one."""

    def __init__(self, environment: Mapping[str, str], modules: Sequence[str], log: IO[bytes]) -> None:
        self._channel, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._forked: set[str] = set()
        with theirs:
            self._handle = subprocess.Popen(  # noqa: S603  # our own interpreter and our own module
                [sys.executable, "-m", __name__, str(theirs.fileno()), " " * ROOM],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                # The matrices of a vehicle are small, and the threads of BLAS would not outlive a fork.
                env={**environment, "OPENBLAS_NUM_THREADS": "1"},
                preexec_fn=in_a_group_of_its_own,  # noqa: PLW1509  # no threads here, and nothing else can set the death signal
            )
        self._channel.send(json.dumps(list(modules)).encode())  # who looks for a process by its module finds no other

    @property
    def pid(self) -> int:
        """Process of the server."""
        return self._handle.pid

    def start(
        self,
        module: str,
        arguments: Sequence[str],
        variables: Mapping[str, str],
        outputs: tuple[int, int],
        *,
        pipe: bool,
    ) -> ForkedProcess:
        """Run `main` of a module in a process with these descriptors as stdout, or a pipe instead, and stderr.

        OSError when it has died, is frozen, or could not fork: there will be no such process, also not later.
        """
        stdout, stderr = outputs
        read_end, write_end = os.pipe() if pipe else (None, stdout)
        made = None if read_end is None else os.fdopen(read_end, "rb")
        request = json.dumps([module, list(arguments), dict(variables)])
        try:
            return ForkedProcess(self._ask(module, request, write_end, stderr), made)
        except OSError:
            self.close()
            raise
        finally:
            if pipe:
                os.close(write_end)

    def _ask(self, module: str, request: str, stdout: int, stderr: int) -> int:
        if self._handle.poll() is not None:
            raise OSError("it has died")
        if is_stopped(self.pid):
            raise OSError("it is frozen")
        gate, theirs = socket.socketpair()
        with gate, theirs, _adopting():
            gate.settimeout(AGAIN_S if module in self._forked else FIRST_S)
            socket.send_fds(self._channel, [request.encode()], [stdout, stderr, theirs.fileno()])
            theirs.close()
            answer = gate.recv(LONGEST)
            if not answer:
                raise OSError("it could not fork")
            gate.send(b"!")  # it waits for this, so that no unknown process runs
        self._forked.add(module)
        return int(answer)

    def close(self) -> None:
        """End the server; what it forked lives on."""
        self._channel.close()
        self._handle.kill()
        self._handle.wait()


@contextlib.contextmanager
def _adopting() -> Iterator[None]:
    """Become the parent of what loses its own below this process."""
    _prctl(PR_SET_CHILD_SUBREAPER, 1)
    try:
        yield
    finally:
        _prctl(PR_SET_CHILD_SUBREAPER, 0)


def in_a_group_of_its_own() -> None:
    """Make this process the head of a group that SIGINT ends, without a traceback, at the latest with its parent."""
    os.setpgid(0, 0)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    _prctl(PR_SET_PDEATHSIG, signal.SIGINT)


def serve(channel: socket.socket) -> tuple[list[Any], list[int]] | None:
    """Fork what is asked for; returns request and descriptors in each process that it forked, None at the end.

    A request does not wait: a process forked before its imports imports them itself.
    """
    supervisor, to_import = os.getppid(), json.loads(channel.recv(LONGEST) or "[]")
    while True:
        if to_import and not select.select([channel], (), (), 0.0)[0]:
            _import(to_import.pop(0))
            continue
        request, descriptors, _, _ = socket.recv_fds(channel, LONGEST, 3)
        if not request:
            return None
        wanted = json.loads(request)
        gc.freeze()
        between = os.fork()
        if between:
            os.waitpid(between, 0)
            for one in descriptors:
                os.close(one)
            continue
        between = os.getpid()
        if os.fork():
            os._exit(0)
        while os.getppid() == between:
            time.sleep(0.0005)
        in_a_group_of_its_own()
        if os.getppid() != supervisor:
            os._exit(1)
        channel.close()
        return wanted, descriptors


def _import(module: str) -> None:
    with contextlib.suppress(Exception):  # it is imported again where its log is
        importlib.import_module(module)
    here = inspect.currentframe()
    assert here is not None
    inspect.getframeinfo(here)  # looks up the files of all modules, which every process would do (`spin`)


def run(module: str, arguments: Sequence[str], variables: Mapping[str, str], descriptors: Sequence[int]) -> int:
    """Become the process that was asked for; returns its exit code."""
    stdout, stderr, gate = descriptors
    os.dup2(stdout, 1)
    os.dup2(stderr, 2)
    os.close(stdout)
    os.close(stderr)
    _set_command_line([sys.executable, "-m", module, *arguments])
    with socket.socket(fileno=gate) as supervisor:
        supervisor.send(str(os.getpid()).encode())
        if not supervisor.recv(1):
            return 1
    os.environ.update(variables)
    gc.enable()
    found = importlib.import_module(module)
    sys.argv = [str(found.__file__), *arguments]
    code: int = found.main()
    return code


def _set_command_line(words: Sequence[str]) -> None:
    """Write over the command line that `ps` shows, in its place (fields 48 and 49 of /proc/PID/stat, proc(5))."""
    fields = Path("/proc/self/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    begin, end = int(fields[45]), int(fields[46])
    text = b"\0".join(os.fsencode(word) for word in words)[: end - begin - 1]
    ctypes.memset(begin, 0, end - begin)
    ctypes.memmove(begin, text, len(text))


def main() -> int:
    """Serve on the socket that the arguments name until it is closed, or become what was asked for."""
    warnings.filterwarnings("ignore", "This process .* is multi-threaded")  # those of LTTng, which sleep
    gc.disable()
    forked = serve(socket.socket(fileno=int(sys.argv[1])))
    if forked is None:
        return 0
    (module, arguments, variables), descriptors = forked
    return run(module, arguments, variables, descriptors)


if __name__ == "__main__":
    sys.exit(main())
