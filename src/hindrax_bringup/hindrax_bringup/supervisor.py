"""Starts processes in their own groups, restarts them when they die or freeze, and ends all of them.

A process that a signal has stopped, or whose heartbeat has stopped, is killed and started again like one that died. One
that drives an output and could not leave it safe itself is run once more for that alone (`Process.last_resort`).

Whatever happens to the tool (Ctrl-C, an exception, SIGTERM, a closed terminal), `close` runs: SIGINT to each group,
then SIGTERM, then SIGKILL, always by the id of a process that was started here. If the tool itself is killed outright,
the kernel sends SIGINT to each child (`child_process.end_with`), so that none is orphaned.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import IO, Any, Self

from hindrax_bringup import child_process
from hindrax_bringup.process_state import HeldProcesses, descendants, is_stopped
from hindrax_bringup.processes import Process
from hindrax_bringup.stack_lock import HEARTBEATS, runtime_folder
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_stderr
from hindrax_ros.heartbeat import VARIABLE, beaten_s
from hindrax_ros.standstill import STOOD_STILL

PATIENCE_S = (5.0, 2.0, 2.0)
RESTARTS_AT_MOST = 5
WELL_AFTER_S = 60.0
"""A process that has lived this long was well: its restarts count from none again."""
LOOK_S = 0.25
HUNG_S = 15.0
"""Without a heartbeat for this long it hangs. A disk may stall a recorder for seconds; thrusters have a dead man."""
GAP_S = 2.0
"""After a gap of our own the others get time to beat: the machine may have stood still as a whole."""
LATE_S, CONTINUED_S = 0.75, 0.5
"""A gap of our own after which a signal may have stopped all of us, and the time that the others get to continue."""
LAST_WORDS_S = 0.3
"""For those below a process that was killed, to end by themselves: the node of the thrusters then leaves neutral."""
LAST_RESORT_S = 10.0
STDERR = 2


@dataclass(slots=True)
class SupervisedProcess:
    """A process that was started here."""

    process: Process
    arguments: tuple[str, ...]
    handle: subprocess.Popen[bytes] | child_process.ForkedProcess
    heartbeat: Path
    started_s: float
    output: IO[bytes] | None = None
    """Its stdout, where that is a pipe."""
    restarts: int = 0
    ended: bool = False
    frozen: str = ""
    """Reason why it was killed here; empty when it was not."""
    stopped: frozenset[int] = frozenset()
    """Processes below it that stand still and were reported."""


@dataclass(slots=True)
class Supervisor:
    """Owner of the processes of one run; use it as a context manager."""

    logs: Path
    environment: Mapping[str, str]
    show_reports: bool = False
    """Whether what a process reports to the operator (`Process.reports`) goes to this terminal."""
    forks: bool = False
    """Whether processes are forked from this one, which then must have no threads (ADR 44)."""
    restarts: int = RESTARTS_AT_MOST
    """Deaths in a row after which a process stays down."""
    children: dict[str, SupervisedProcess] = field(default_factory=dict)
    _heartbeats: Path = field(init=False)
    _looked_s: float = 0.0
    _awake_s: float = 0.0
    _late_s: float = 0.0

    def __enter__(self) -> Self:
        self.logs.mkdir(parents=True, exist_ok=True)
        self._heartbeats = _heartbeat_folder()
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        end_after(error, self.close)

    def start(self, process: Process, arguments: Sequence[str] = (), *, pipe: bool = False) -> SupervisedProcess:
        """Start one process; its output goes to `logs/NAME.log`.

        Parameters
        ----------
        process
            Name, module, and how it is treated when it ends.
        arguments
            Words of its command line.
        pipe
            Whether its stdout goes to a pipe in place of the log.

        Returns
        -------
        SupervisedProcess
            Also in `children`, by its name.
        """
        heartbeat = self._heartbeats / process.name
        read, write = os.pipe() if pipe else (None, None)
        try:
            handle = self._spawn(process, arguments, heartbeat, write)
        finally:
            if write is not None:
                os.close(write)
        output = None if read is None else os.fdopen(read, "rb")
        child = SupervisedProcess(process, tuple(arguments), handle, heartbeat, time.monotonic(), output)
        self.children[process.name] = child
        return child

    def _spawn(
        self, process: Process, arguments: Sequence[str], heartbeat: Path, stdout: int | None = None
    ) -> subprocess.Popen[bytes] | child_process.ForkedProcess:
        with contextlib.suppress(OSError):  # the folder goes with the last session of its user
            heartbeat.write_bytes(b"")
        variables = {**self.environment, VARIABLE: str(heartbeat)}
        # The dead man depends on nothing that others have imported.
        forks = self.forks and not process.last_resort
        begin = child_process.fork if forks else child_process.execute
        with (self.logs / f"{process.name}.log").open("ab") as file:
            log = file.fileno()
            stderr = STDERR if process.reports and self.show_reports else log
            return begin(process.module, arguments, variables, log if stdout is None else stdout, stderr)

    def check(self) -> list[str]:
        """Supervise the processes: kill frozen ones, restart dead ones, one sentence for each."""
        now_s, children = time.monotonic(), self.children.values()
        sentences = [self._look(child, now_s) for child in children] if self._due(now_s) else []
        return [sentence for sentence in (*sentences, *[self._check(child, now_s) for child in children]) if sentence]

    def _due(self, now_s: float) -> bool:
        since_s = now_s - self._looked_s
        if since_s >= LOOK_S:
            self._looked_s = now_s
        if since_s > GAP_S:
            self._awake_s = now_s
        if since_s > LATE_S:
            self._late_s = now_s
        return since_s >= LOOK_S

    def _look(self, child: SupervisedProcess, now_s: float) -> str:
        """Kill a process that is frozen; report one below it, which is its own to look after."""
        if child.frozen or child.handle.poll() is not None:
            return ""
        stops_count = now_s - self._late_s > CONTINUED_S
        child.frozen = _frozen(child, now_s, self._awake_s, stops_count=stops_count)
        if child.frozen:
            _kill(child)
            held = child.handle.poll() is None
            return f"{child.process.name} is frozen ({child.frozen}); killed, but it does not end" if held else ""
        if not stops_count:
            return ""
        before = child.stopped
        child.stopped = frozenset(pid for pid in descendants(child.handle.pid) if is_stopped(pid))
        frozen = [f"{child.process.name}: its process {pid} is frozen" for pid in sorted(child.stopped - before)]
        return "; ".join(frozen)

    def _check(self, child: SupervisedProcess, now_s: float) -> str:
        code = child.handle.poll()
        if code is None or child.ended:
            return ""
        how = f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"
        how = f"was frozen ({child.frozen}), and killed" if child.frozen else how
        if code == STOOD_STILL:  # as often as the machine does: nothing is wrong with the process
            how, child.restarts = "stood still, and ROS may have lost it", 0
        where = self.logs / f"{child.process.name}.log"
        if now_s - child.started_s >= WELL_AFTER_S:
            child.restarts = 0
        if not child.process.restart or child.restarts >= self.restarts:
            child.ended = True
            output = self._secure(child)
            return f"{child.process.name} {how} and stays down; its log is {where}{output and f'; {output}'}"
        child.restarts += 1
        child.handle = self._spawn(child.process, child.arguments, child.heartbeat)
        child.started_s, child.frozen = now_s, ""
        return f"{child.process.name} {how}; restarted (see {where})"

    def _secure(self, child: SupervisedProcess) -> str:
        """Leave the output of a process safe that has ended without doing so; returns what is on the wire, if anything.

        A process that refused its arguments never controlled the output. HindraxError when the output is not safe.
        """
        code, name = child.handle.returncode, child.process.name
        if not child.process.last_resort or code in (0, UsageError.exit_code):
            return ""
        words = [sys.executable, "-m", child.process.module, *child.process.last_resort, *child.arguments]
        try:
            done = subprocess.run(  # noqa: S603  # our own interpreter and our own module
                words, env=dict(self.environment), capture_output=True, text=True, check=False, timeout=LAST_RESORT_S
            )
            failure = "" if done.returncode == 0 else " ".join(done.stderr.split()) or f"code {done.returncode}"
        except subprocess.TimeoutExpired:
            failure = f"no end in {LAST_RESORT_S:g} s"
        if failure:
            raise HindraxError(f"{name}: neutral could not be written ({failure}); cut the power")
        how = "had to be killed" if code == -signal.SIGKILL else f"ended with {code}"
        return f"{name} {how}; {done.stdout.strip()}"

    def require(self, *but: str) -> None:
        """Raise HindraxError, with the end of its log, if a process stays down; except `but`."""
        for name, child in self.children.items():
            if child.ended and name not in but:
                words = last_words(self.logs / f"{name}.log")
                raise HindraxError(
                    f"{name}: the process has ended for good; {words}; look into {self.logs}, start again"
                )

    def stop(self, name: str) -> None:
        """End one process in an orderly way."""
        child = self.children.pop(name, None)
        if child is not None:
            _end([child])

    def close(self) -> None:
        """End all processes, the vehicle's before the mock's, and leave none behind, however often Ctrl-C is pressed.

        HindraxError when a process that drives an output has not left it safe, and no other could in its place.
        """
        with stop_signals(lambda _number, _frame: None):
            self._close()

    def _close(self) -> None:
        children = list(self.children.values())
        self.children.clear()
        hardware = [child for child in children if not child.process.restart]
        vehicle = [child for child in children if child.process.restart]
        _end(vehicle)
        try:
            if all(one.handle.poll() is None for one in hardware):  # without a mock there is no wire either
                for sentence in filter(None, map(self._secure, vehicle)):
                    print_stderr(sentence)
        finally:
            _end(hardware)
            shutil.rmtree(self._heartbeats, ignore_errors=True)


def end_after(error: BaseException | None, end: Callable[[], object]) -> None:
    """End processes; when an output is not safe after that, say so behind what was the cause of the end.

    Parameters
    ----------
    error
        The cause; None: the end was wanted.
    end
        Ends them.

    Raises
    ------
    HindraxError
        Where an output is not safe.
    """
    try:
        end()
    except HindraxError as unsafe:
        if error is None:
            raise
        raise HindraxError(f"{error}; {unsafe}") from error


@contextlib.contextmanager
def stop_signals(handler: Callable[[int, FrameType | None], object]) -> Iterator[None]:
    """Have Ctrl-C, SIGTERM and a closed terminal (but for a `nohup`) handled like this meanwhile.

    In another thread than the main one nothing changes.

    Parameters
    ----------
    handler
        As `signal.signal` takes it.

    Yields
    ------
    None
        Afterwards they are handled as before.
    """
    main = threading.current_thread() is threading.main_thread()
    numbers = [signal.SIGINT, signal.SIGTERM] if main else []
    if main and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    before: dict[int, Any] = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, one in before.items():
            signal.signal(number, one)


@contextlib.contextmanager
def deferred_signals() -> Iterator[None]:
    """Have the signals that stop wait until the block ends, then act as before it.

    Ctrl-C raises wherever Python is; within a message that C++ is converting, that ends as another exception.

    Yields
    ------
    None
        Afterwards the first signal that came is raised again.
    """
    waiting: list[int] = []
    try:
        with stop_signals(lambda number, _frame: waiting.append(number)):
            yield
    finally:
        for number in waiting[:1]:
            signal.raise_signal(number)


def _heartbeat_folder() -> Path:
    """Make a folder for heartbeats, and remove those that killed tools have left behind."""
    place = runtime_folder()
    for old in place.glob(f"*{HEARTBEATS}"):
        if not Path("/proc", old.name.partition("-")[0]).exists():
            shutil.rmtree(old, ignore_errors=True)
    return Path(tempfile.mkdtemp(prefix=f"{os.getpid()}-", suffix=HEARTBEATS, dir=place))


def _frozen(child: SupervisedProcess, now_s: float, awake_s: float, *, stops_count: bool) -> str:
    """Reason why a process that runs does nothing; empty when it does. Before its first beat it may take its time.

    `stops_count`: not while those who were stopped together with the supervisor are continued, one after the other.
    """
    if stops_count and is_stopped(child.handle.pid):
        return "stopped by a signal"
    last_s = beaten_s(child.heartbeat)
    silent_s = 0.0 if last_s is None else now_s - max(last_s, awake_s)
    return f"no heartbeat for {silent_s:.0f} s" if silent_s > HUNG_S else ""


def _kill(child: SupervisedProcess) -> None:
    """Kill a process and what is below it, which gets the time to leave its output safe."""
    below = HeldProcesses(descendants(child.handle.pid))
    child.handle.kill()
    with contextlib.suppress(subprocess.TimeoutExpired):  # a disk or a bus keeps it in the kernel
        child.handle.wait(LAST_WORDS_S)
    below.kill(LAST_WORDS_S)


def last_words(log: Path) -> str:
    """Last line that a process wrote to its log."""
    lines = log.read_text(encoding="utf-8", errors="replace").strip().splitlines() if log.is_file() else []
    return f"end of its log: {lines[-1]}" if lines else f"its log {log} is empty"


def _end(children: Sequence[SupervisedProcess]) -> None:
    below = HeldProcesses(pid for child in children for pid in descendants(child.handle.pid))
    for child in children:
        if is_stopped(child.handle.pid):  # it obeys nothing else
            child.handle.kill()
    for number, patience in zip((signal.SIGINT, signal.SIGTERM, signal.SIGKILL), PATIENCE_S, strict=True):
        alive = [child for child in children if child.handle.poll() is None]
        for child in alive:
            child.handle.send_signal(number)
        deadline = time.monotonic() + patience
        for child in alive:
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.handle.wait(max(0.0, deadline - time.monotonic()))
    for child in children:
        # What a killed process may have left in its group.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.handle.pid, signal.SIGKILL)
    below.kill(LAST_WORDS_S)
