"""A stack in a process of its own, as its clients see it: `pool-test`, benchmarks, `ros2 launch`, `hindrax up` itself.

The process (`stack_runner`) has a group of its own, so that Ctrl-C in the terminal of a client reaches the client only,
and ends with it, whatever ends the client. Its sentences go to `logs/up.log`: a client that stands still holds up no
process of a vehicle, as a full pipe would.
"""

import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn, Self

from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.child_process import execute
from hindrax_bringup.network.tether import Tether
from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.process_state import is_stopped
from hindrax_bringup.stack import MockOptions, ReplayOptions
from hindrax_bringup.stack_lock import UP, StackLock
from hindrax_bringup.supervisor import RESTARTS_AT_MOST, end_after, last_words, stop_signals
from hindrax_core.errors import HindraxError, UsageError

RUNNER, LAST_WORDS = "hindrax_bringup.stack_runner", "hindrax up: "
"""Module of the process, and the beginning of the sentence with which it ends."""
SETTINGS = {"OPENBLAS_NUM_THREADS": "1"}
"""The matrices of a vehicle are small, and the threads of BLAS would not outlive a fork."""
END_S = 40.0
"""Longer than a supervisor needs at most (`supervisor.PATIENCE_S`, twice, and the last resort)."""


@dataclass(frozen=True, slots=True)
class UpOptions:
    """Vehicle, what replaces it, recording and tether of a stack; a client, and what it needs."""

    vehicle_file: Path
    mock: MockOptions | None = None
    record: bool = False
    out: str | None = None
    tether: Tether | None = None
    without_operator: str = ""
    tuning: ParameterOverrides = field(default_factory=ParameterOverrides)
    keep_bytes: float = math.inf
    """Room for the runs in `RUNS`: the oldest ones are removed before a start; infinite: none is."""
    replay: ReplayOptions | None = None
    client: str = ""
    """Words of the client that follows the stack, for the notes of the bag; it has made the folder `out`."""
    needed: tuple[str, ...] | None = None
    """Processes without which it ends; None: those without which nothing is left to operate."""
    restarts: int = RESTARTS_AT_MOST
    processes: tuple[str, ...] | None = None
    """Onboard processes to start, beside what replaces the vehicle; None: all."""
    launched: bool = False
    """Whether `ros2 launch` started it, which reports any other code than 0 as a process that has died."""

    @property
    def hardware(self) -> MockOptions | ReplayOptions | None:
        """What replaces the vehicle."""
        return self.mock or self.replay

    @property
    def purpose(self) -> str:
        """First word of the client."""
        return self.client.partition(" ")[0] or UP

    def to_json(self) -> str:
        """As the argument of the process."""
        return json.dumps(asdict(self), default=str)

    @classmethod
    def from_json(cls, text: str) -> "UpOptions":
        """Options of `to_json`."""
        nested = {"mock": MockOptions, "tether": Tether, "tuning": ParameterOverrides, "replay": ReplayOptions}
        values = _tuples(json.loads(text))
        made = {name: kind(**_tuples(values[name])) for name, kind in nested.items() if values[name] is not None}
        return cls(**{**values, **made, "vehicle_file": Path(values["vehicle_file"])})


def _tuples(values: Mapping[str, object]) -> dict[str, Any]:
    return {name: tuple(one) if isinstance(one, list) else one for name, one in values.items()}


def become(options: UpOptions) -> NoReturn:
    """Replace this process by that of the stack; a Ctrl-C meanwhile waits for it."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    words = [sys.executable, "-m", RUNNER, options.to_json()]
    os.execve(sys.executable, words, {**os.environ, **SETTINGS})  # noqa: S606  # ourselves


class StackProcess:
    """The client's end; use it as a context manager, with which the stack ends."""

    def __init__(self, options: UpOptions) -> None:
        self.folder = RunFolder(Path(options.out or ""))
        self.folder.logs.mkdir(parents=True, exist_ok=True)
        self.log = self.folder.logs / "up.log"
        self._read, self._reported = 0, False
        with self.log.open("ab") as log:
            self._handle = execute(RUNNER, [options.to_json()], {**os.environ, **SETTINGS}, subprocess.PIPE, log)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        end_after(error, self.end)

    @property
    def pid(self) -> int:
        """Process of the stack."""
        return self._handle.pid

    @cached_property
    def entry(self) -> StackLock:
        """How to join its graph, before its processes are up; HindraxError when it was refused."""
        if line := self._line():
            return StackLock(**json.loads(line))
        self._handle.wait()
        raise self._ended()

    def check(self) -> list[str]:
        """What it has reported since the last time; HindraxError when it has ended."""
        with self.log.open("rb") as log:
            log.seek(self._read)
            whole = log.read().rpartition(b"\n")[0]
        self._read += len(whole) + 1 if whole else 0
        if self._handle.poll() is not None:
            raise self._ended()
        found = whole.decode(errors="replace").splitlines()
        return [line for line in found if not line.startswith(LAST_WORDS)]

    def end(self) -> Mapping[str, object]:
        """End it in order, however often Ctrl-C is pressed.

        HindraxError when an output could not be left safe, in the words of the stack.

        Returns
        -------
        Mapping[str, object]
            Ground truth of its mock; empty without one.
        """
        with stop_signals(lambda _number, _frame: None):
            if is_stopped(self.pid):  # it obeys nothing else; its processes end with it
                self._handle.kill()
            self._handle.terminate()
            try:
                self._handle.wait(END_S)
            except subprocess.TimeoutExpired:
                self._handle.kill()
                self._handle.wait()
        if self._handle.returncode and not self._reported:
            raise self._ended()
        line = self._line()
        found: Mapping[str, object] = json.loads(line) if line else {}
        return found

    def _line(self) -> bytes:
        assert self._handle.stdout is not None
        return self._handle.stdout.readline()

    def _ended(self) -> HindraxError:
        """Reason of its end, once."""
        self._reported = True
        code = self._handle.returncode
        words = last_words(self.log).removeprefix("end of its log: ").removeprefix(LAST_WORDS)
        if code < 0:
            words = f"its process was killed by signal {-code}; see {self.log}"
        return UsageError(words) if code == UsageError.exit_code else HindraxError(words)
