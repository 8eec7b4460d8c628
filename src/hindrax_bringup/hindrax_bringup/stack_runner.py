"""A stack that is kept up: processes looked after, its lock file announced, until a signal ends it."""

import contextlib
import math
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from hindrax_bag.read.recovery import begin_completion, unfinished_files
from hindrax_bag.run_folder import RUNS, RunFolder, make_run_folder, remove_oldest
from hindrax_bringup.liveness import STARTING, LivenessFile, reported_armed, tool_liveness
from hindrax_bringup.network.tether import FOREVER_S, Tether, address_of, wait_for_address
from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.processes import MOCK, ONBOARD, SAFETY_MONITOR, THRUSTERS, modules
from hindrax_bringup.ros_graph import PROFILE, set_aside
from hindrax_bringup.stack import MockOptions, Stack, lock_of, own_domain, stack_environment
from hindrax_bringup.stack_lock import StackLock, announced, runtime_folder, stacks
from hindrax_bringup.supervisor import Supervisor, stop_signals
from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.vehicle import load_vehicle
from hindrax_ros.stack_time import STEP_S, StackTime

VITAL = {MOCK.name, THRUSTERS.name, SAFETY_MONITOR.name}
"""Without these nothing is left to operate; without another one the rest still serves."""
SHOWN = ("ROS_DOMAIN_ID", "RMW_IMPLEMENTATION", "ROS_AUTOMATIC_DISCOVERY_RANGE", PROFILE)
"""Settings with which ROS 2 tools join the graph."""
TURN_S = 0.1
SETTLED_S = 3.0
"""Time after a step of the wall clock in which its event is recorded, and further ones may come."""


@dataclass(frozen=True, slots=True)
class UpOptions:
    """Vehicle, mock, recording and tether of a stack."""

    vehicle_file: Path
    mock: MockOptions | None
    record: bool
    out: str | None
    tether: Tether | None = None
    without_operator: str = ""
    tuning: ParameterOverrides = field(default_factory=ParameterOverrides)
    keep_bytes: float = math.inf
    """Room for the runs in `RUNS`: the oldest ones are removed before a start; infinite: none is."""


def run_up(options: UpOptions) -> int:
    """Start everything, print how to reach it, supervise it; 0 when SIGTERM ended it."""
    load_vehicle(options.vehicle_file).output_channels()
    mock, namespace = options.mock is not None, options.tuning.namespace
    with asked_to_end() as over, own_domain(mock=mock, namespace=namespace) as domain, tool_liveness() as beating:
        run = 1
        while not over():
            _run(options, run, domain, over, beating)
            run += 1
    return 0


def _run(options: UpOptions, run: int, domain: int | None, over: Callable[[], bool], beating: LivenessFile) -> None:
    """One run, until a signal, or until the wall clock was set: the next one has its time, and another folder."""
    if options.keep_bytes < math.inf:
        in_use = [Path(one.folder).resolve() for one in stacks()]
        for sentence in remove_oldest(RUNS, options.keep_bytes, in_use):
            print_stderr(sentence)
    # A vehicle with a full disk can fly; its recorder reports that it waits for room.
    out = f"{options.out}_{run}" if options.out and run > 1 else options.out
    folder = make_run_folder(out, options.vehicle_file, wanted_bytes=0)
    address = awaited(options.tether, over, beating)
    if over():
        return
    mock = options.mock is not None
    made = stack_environment(mock=mock, domain=domain, tether=options.tether)
    complete_earlier(RUNS)
    with Supervisor(folder.logs, made, show_reports=True, preload=modules(mock=mock)) as supervisor:
        beating.beat("up", STARTING)
        stack = Stack(folder, supervisor, "up in mock" if mock else "up", options.tuning)
        without_operator = options.without_operator if options.tether else ""
        stack.start(options.mock, record=options.record, without_operator=without_operator)
        lock = lock_of(stack)
        with announced(lock):
            with contextlib.suppress(OSError):  # a vehicle with a full disk can be flown
                print_fitted(startup_text(lock, folder, record=options.record))
            clock = ClockStep(StackTime.of(made))
            _look_after(supervisor, lambda: over() or clock.followed(), options.tether, address, beating)
        print_stderr("ending; the thrusters go neutral and disarm")
    print_stderr("ended; neutral is on the wire")


@dataclass(slots=True)
class ClockStep:
    """Decides to restart a stack after a step of the wall clock: disarmed, and no further steps follow."""

    of_stack: StackTime
    armed: Callable[[], bool] = lambda: reported_armed(runtime_folder(), os.getpid())
    now_s: Callable[[], float] = time.monotonic
    _step_s: float = 0.0
    _since_s: float = 0.0

    def followed(self) -> bool:
        """Whether the stack is to end now; prints it."""
        step, step_s, now_s = self.of_stack.step_reason(), self.of_stack.step_s(), self.now_s()
        if abs(step_s - self._step_s) > STEP_S:
            self._step_s, self._since_s = step_s, now_s
        if not step or now_s - self._since_s < SETTLED_S or self.armed():
            return False
        print_stderr(f"clock: {step}; the stack restarts, in a new run, to follow it")
        return True


def complete_earlier(runs: Path) -> subprocess.Popen[bytes] | None:
    """Complete in the background what a power cut or a kill left unfinished in the bags of earlier runs."""
    files = unfinished_files(runs)
    for bag in sorted({file.parent for file in files}):
        print_stderr(f"{bag}: was left unfinished; it is completed in the background")
    return begin_completion(files)


def awaited(tether: Tether | None, over: Callable[[], bool], beating: LivenessFile) -> str:
    """Wait for the tether, however long that takes; returns its address, empty without one."""
    if tether is None:
        return ""

    def beat_until_over() -> bool:
        waiting = f"waiting for the tether {tether.interface}"
        beating.beat(waiting, {"tether": waiting})
        return over()

    return wait_for_address(tether, FOREVER_S, beat_until_over, print_stderr)


def _look_after(
    supervisor: Supervisor, over: Callable[[], bool], tether: Tether | None, address: str, beating: LivenessFile
) -> None:
    while not over():
        time.sleep(TURN_S)
        for sentence in supervisor.check():
            print_stderr(sentence)
        _require_same(tether, address)
        beating.beat("up", {})
        supervisor.require(*(supervisor.children.keys() - VITAL))


def _require_same(tether: Tether | None, address: str) -> None:
    """HindraxError when the tether has another address than before: the middleware would never notice."""
    if tether is None:
        return
    try:
        now = address_of(tether.interface)
    except HindraxError:  # a cut: the address comes back with the carrier
        return
    if now != address:
        raise HindraxError(f"{tether.interface}: its address was {address} and is {now}; start again to be found there")


@contextlib.contextmanager
def asked_to_end() -> Iterator[Callable[[], bool]]:
    """Only note SIGINT and SIGTERM, however often they come; yields the question whether one has come.

    KeyboardInterrupt at the end when it was Ctrl-C: its exit code is one, also of what goes on until then.
    """
    came: list[int] = []
    with stop_signals(lambda number, _frame: came.append(number)):
        yield lambda: bool(came)
    if signal.SIGINT in came:
        raise KeyboardInterrupt


def startup_text(lock: StackLock, folder: RunFolder, *, record: bool) -> str:
    """Return how to reach the stack."""
    lines = [
        f"up: {lock.title}",
        "  from any terminal: ./hindrax monitor | web | arm | hold | wrench | disarm | stop",
        "  with ROS 2 tools:",
        *(f"    unset {name}" for name in set_aside(os.environ, lock.graph)),
        *(f"    export {key}={value}" for key, value in sorted(lock.graph.items()) if key in SHOWN),
        f"  processes:         {', '.join(process.name for process in ONBOARD)}; logs in {folder.logs}",
    ]
    lines += [f"  bag:               {folder.bag}"] if record else []
    return "\n".join([*lines, "  Ctrl-C ends it"])
