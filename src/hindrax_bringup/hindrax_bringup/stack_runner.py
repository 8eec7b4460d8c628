"""The process of a stack: it starts, looks after and ends all others. `hindrax up` becomes it; others are its clients.

    python -m hindrax_bringup.stack_runner OPTIONS

It has no threads, so it forks: what nodes import is imported here once (ADR 44). To a client it prints its entry in the
list of stacks first, and the mock's ground truth last, a line of JSON each.
"""

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Container, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from hindrax_bag.read.recovery import begin_completion, unfinished_files
from hindrax_bag.run_folder import RUNS, RunFolder, make_run_folder, remove_oldest
from hindrax_bringup.child_process import STOP_SIGNALS
from hindrax_bringup.liveness import PROCESSES_START, LivenessFile, reported_armed, tool_liveness
from hindrax_bringup.network.tether import FOREVER_S, Tether, address_of, wait_for_address
from hindrax_bringup.process_state import is_stopped
from hindrax_bringup.processes import EVERY, MOCK, ONBOARD, REPLAY, SAFETY_MONITOR, SENSORS, THRUSTERS
from hindrax_bringup.ros_graph import exported_domain, full_shared_memory, graph_settings, lines_to_join
from hindrax_bringup.stack import OTHER_WORLD, Stack, adopted, own_domain, stack_environment
from hindrax_bringup.stack_lock import CLONE, StackLock, announced, runtime_folder, stacks
from hindrax_bringup.stack_process import LAST_WORDS, UpOptions
from hindrax_bringup.supervisor import Supervisor, stop_signals
from hindrax_core.errors import INTERRUPTED, HindraxError, cause
from hindrax_core.stack_time import STEP_S, StackTime
from hindrax_core.text.screen_text import mute, print_fitted, print_stderr, print_whole
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ros.free_domain import only_stack

VITAL = {MOCK.name, REPLAY.name, THRUSTERS.name, SAFETY_MONITOR.name}
"""Without these nothing is left to operate; without another one the rest still serves."""
TURN_S = 0.1
SETTLED_S = 3.0
"""Time after a step of the wall clock in which its event is recorded, and further ones may come."""


def run_up(options: UpOptions, over: Callable[[], bool]) -> None:
    """Start everything, say how to reach it, look after it until it is `over`; HindraxError where that fails."""
    load_vehicle(options.vehicle_file).output_channels()
    if full := full_shared_memory():
        raise HindraxError(full)
    mock, namespace = options.hardware is not None, options.tuning.namespace
    with (
        own_domain(mock=mock, namespace=namespace) as domain,
        only_stack(exported_domain(os.environ) or 0 if domain is None else domain, namespace),
        tool_liveness() as beating,
    ):
        run = 1
        while not over():
            _run(options, run, domain, over, beating)
            run += 1


def _run(options: UpOptions, run: int, domain: int | None, over: Callable[[], bool], beating: LivenessFile) -> None:
    """One run, until a signal, or until the wall clock was set: the next one has its time, and another folder."""
    folder = RunFolder(Path(options.out)) if options.client and options.out else _new_folder(options, run)
    address = awaited(options.tether, over, beating)
    if over():
        return
    made = stack_environment(mock=options.hardware is not None, domain=domain, tether=options.tether)
    lock = _entry(options, folder, made)
    how_to_reach_it = startup_text(lock, folder, record=options.record)
    if options.mock is not None:
        how_to_reach_it += f"\n  world of the mock: {options.mock.world} ({OTHER_WORLD}), seed {options.mock.seed}"
    if options.client:
        _send(asdict(lock))
    else:
        complete_earlier(RUNS)
    supervised = Supervisor(folder.logs, made, show_reports=not options.client, forks=True, restarts=options.restarts)
    # The client library reads the settings of the graph as it is imported, which is here.
    with adopted(made), supervised as supervisor:
        beating.beat(options.purpose, PROCESSES_START)
        stack = Stack(folder, supervisor, options.client or "up", options.tuning)
        without_operator = options.without_operator if options.tether else ""
        onboard = None if options.processes is None else [one for one in EVERY if one.name in options.processes]
        stack.start(
            options.hardware, record=options.record, onboard=onboard, without_operator=without_operator, over=over
        )
        lock = replace(lock, ports=stack.mock_facts.get("ports", {}))
        clock = ClockStep(StackTime.of(made))
        with announced(lock):
            if not options.client:
                with contextlib.suppress(OSError):  # a vehicle with a full disk can be flown
                    print_fitted(how_to_reach_it)
            _look_after(
                supervisor, lambda: over() or (not options.client and clock.followed()), options, address, beating
            )
        if options.client:
            _send(stack.last_facts())
            return
        print_stderr("ending; the thrusters go neutral and disarm")
    print_stderr("ended; neutral is on the wire")


def _new_folder(options: UpOptions, run: int) -> RunFolder:
    if options.keep_bytes < math.inf:
        in_use = [Path(one.folder).resolve() for one in stacks()]
        for sentence in remove_oldest(RUNS, options.keep_bytes, in_use):
            print_stderr(sentence)
    # A vehicle with a full disk can fly; its recorder reports that it waits for room.
    out = f"{options.out}_{run}" if options.out and run > 1 else options.out
    return make_run_folder(out, options.vehicle_file, wanted_bytes=0)


def _entry(options: UpOptions, folder: RunFolder, made: Mapping[str, str]) -> StackLock:
    return StackLock(
        os.getpid(),
        options.hardware is not None,
        str(folder.vehicle),
        str(folder.path),
        graph_settings(made),
        purpose=options.purpose,
        namespace=options.tuning.namespace,
        bag=str(folder.bag) if options.record else "",
        clone=os.environ.get(CLONE, ""),
    )


def _send(document: Mapping[str, object]) -> None:
    try:
        print_whole(json.dumps(document))
    except OSError:  # the client has died; so will this process, in order
        mute(sys.stdout)


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
    """Wait for the tether, however long that takes.

    Parameters
    ----------
    tether
        None: there is none to wait for.
    over
        Whether to wait no longer.
    beating
        Gets a heartbeat at each look, with the tether as the trouble: a service manager must not take it for hung.

    Returns
    -------
    str
        IPv4 address of this end; empty without a tether, or when it is `over`.
    """
    if tether is None:
        return ""

    def beat_until_over() -> bool:
        waiting = f"waiting for the tether {tether.interface}"
        beating.beat(waiting, {"tether": waiting})
        return over()

    return wait_for_address(tether, FOREVER_S, beat_until_over, print_stderr)


def _look_after(
    supervisor: Supervisor, over: Callable[[], bool], options: UpOptions, address: str, beating: LivenessFile
) -> None:
    needed = VITAL if options.needed is None else set(options.needed)
    awaited = awaited_nodes(supervisor.children, load_vehicle(options.vehicle_file))
    while not over():
        time.sleep(TURN_S)
        for sentence in supervisor.check():
            print_stderr(sentence)
        _require_same(options.tether, address)
        frozen = bool(options.client) and is_stopped(os.getppid())
        troubles = {options.purpose: "stopped, as by Ctrl-Z"} if frozen else {}
        beating.beat(options.purpose, troubles, awaited=awaited)
        supervisor.require(*(supervisor.children.keys() - needed))


def awaited_nodes(running: Container[str], vehicle: Vehicle) -> tuple[str, ...]:
    """Nodes of the devices, each of which reports once before the stack is well: those of processes that run."""
    if SAFETY_MONITOR.name not in running:  # who listens to them
        return ()
    of_processes = {SENSORS: tuple(vehicle.sensors), THRUSTERS: THRUSTERS.nodes}
    return tuple(node for process, nodes in of_processes.items() if process.name in running for node in nodes)


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
    """Only note the signals that stop, however often they come.

    Yields
    ------
    Callable[[], bool]
        Whether one has come.

    Raises
    ------
    KeyboardInterrupt
        At the end, when it was Ctrl-C: its exit code is one, also of what goes on until then.
    """
    came: list[int] = []
    with stop_signals(lambda number, _frame: came.append(number)):
        yield lambda: bool(came)
    if signal.SIGINT in came:
        raise KeyboardInterrupt


def startup_text(lock: StackLock, folder: RunFolder, *, record: bool) -> str:
    """Return how to reach the stack from other terminals.

    Parameters
    ----------
    lock
        Its entry in the list of stacks, with the settings of its graph.
    folder
        Of the run.
    record
        Whether it has a bag.

    Returns
    -------
    str
        Lines: commands, settings for ROS 2 tools, processes and logs, bag.
    """
    lines = [
        f"up: {lock.title}",
        "  from any terminal: ./hindrax monitor | web | arm | hold | wrench | disarm | stop",
        "  with ROS 2 tools:",
        *(f"    {line}" for line in lines_to_join(os.environ, lock.graph)),
        f"  processes:         {', '.join(process.name for process in ONBOARD)}; logs in {folder.logs}",
    ]
    lines += [f"  bag:               {folder.bag}"] if record else []
    return "\n".join([*lines, "  Ctrl-C ends it"])


def main() -> int:
    """Run the stack that the one argument describes; an error is one line and its exit code."""
    options, came = UpOptions.from_json(sys.argv[1]), list[int]()
    for number in STOP_SIGNALS:
        signal.signal(number, lambda number, _frame: came.append(number))
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)
    try:
        run_up(options, lambda: bool(came))
    except HindraxError as error:
        print_stderr(f"{LAST_WORDS}{error}")
        return error.exit_code
    except OSError as error:
        print_stderr(f"{LAST_WORDS}{error.filename or 'output'}: cannot be written ({cause(error)}); make room")
        return HindraxError.exit_code
    finally:
        for number in STOP_SIGNALS:  # it ends already, and its code is to be this one
            signal.signal(number, signal.SIG_IGN)
    if signal.SIGINT in came:
        print_stderr(f"{LAST_WORDS}stopped by Ctrl-C")
        return 0 if options.launched else INTERRUPTED
    return 0


if __name__ == "__main__":
    sys.exit(main())
