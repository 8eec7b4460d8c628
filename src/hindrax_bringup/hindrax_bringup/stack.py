"""A running stack: the mock on request, the onboard processes, the recorder, and their parameters."""

import contextlib
import json
import os
import select
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hindrax_bag.run_folder import RunFolder, write_parameters
from hindrax_bringup import ros_graph
from hindrax_bringup.liveness import NOTIFY
from hindrax_bringup.network import security
from hindrax_bringup.network.tether import Tether, profile_file
from hindrax_bringup.node_options import NodeOptions, ParameterOverrides
from hindrax_bringup.nodes.graph_search import require_no_stack
from hindrax_bringup.processes import CONTROL, MOCK, ONBOARD, PILOT_STATUS_ASIDE, RECORDER, REPLAY, REPLAYED, Process
from hindrax_bringup.ros_graph import PROFILE, graph_settings, without_graph
from hindrax_bringup.stack_lock import StackLock
from hindrax_bringup.supervisor import SupervisedProcess, Supervisor, last_words
from hindrax_core import stack_time
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.topics import NAMESPACE
from hindrax_ros.free_domain import free_domain

MOCK_READY_S, LOOK_S = 60.0, 0.1
FAULT_HELP = "mock: fault, device, start and duration [s]: garbage:dvl75@30+5; repeatable, any other name lists all"
WORLD_HELP = (
    "mock: effects outside the model: ideal, pool (all drawn from the seed), or NAME[=SIZE],... such as tether=1; "
    "any other name lists all"
)
SIMULATOR_HELP = (
    "mock: the vehicle of another simulator moves instead of ours, over topics: mujoco, gz, stonefish, or one with its "
    "prefix such as gz:/model/rov (docs/how-to/fly-a-simulated-vehicle.md)"
)
OTHER_WORLD = "pool-test flies in pool where none is named; --world chooses"


def world_of_pool_test(named: str | None, simulator: str = "") -> str:
    """World of a pool test, its session, plan and prediction: the named one, else pool; ideal in another's water."""
    usual = "ideal" if simulator else "pool"
    return usual if named is None else named


@dataclass(frozen=True, slots=True)
class MockOptions:
    """Options of the mock vehicle: seed, upper bound of its pace (0: as fast as the computer keeps up), faults, world.

    `truth`: file for the log of true states and pulses. `simulator`: another simulator that moves the vehicle over
    topics, as KIND or KIND:/PREFIX. `waits`: whether its time waits for a stack that is late; without, it goes at the
    pace, as for a real vehicle.
    """

    seed: int = 1
    rate: float = 0.0
    faults: tuple[str, ...] = ()
    world: str = "ideal"
    truth: str = ""
    simulator: str = ""
    waits: bool = True

    def words(self) -> list[str]:
        """Arguments of its process."""
        words = ["--seed", str(self.seed), "--rate", str(self.rate), "--world", self.world]
        words += [] if self.waits else ["--no-wait"]
        words += [word for fault in self.faults for word in ("--fault", fault)]
        words += ["--simulator", self.simulator] if self.simulator else []
        return [*words, "--truth", self.truth] if self.truth else words


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """A recorded run in place of the vehicle, and its pace."""

    bag: str
    rate: float = 1.0

    def words(self) -> list[str]:
        """Arguments of its process."""
        return ["--bag", self.bag, "--rate", str(self.rate)]


@dataclass(slots=True)
class Stack:
    """Starts everything of one run in order; the supervisor ends it."""

    folder: RunFolder
    supervisor: Supervisor
    notes: str = ""
    tuning: ParameterOverrides = field(default_factory=ParameterOverrides)
    mock_facts: Mapping[str, Any] = field(default_factory=dict)

    def start(
        self,
        hardware: MockOptions | ReplayOptions | None,
        *,
        record: bool,
        onboard: Sequence[Process] | None = None,
        without_operator: str = "",
        over: Callable[[], bool] = lambda: False,
    ) -> None:
        """Start what replaces the vehicle (when asked for by name), the recorder, and the onboard processes.

        Parameters
        ----------
        hardware
            The mock or a recorded run in place of the vehicle; None: the vehicle itself.
        record
            Whether everything is recorded into the bag of the folder, from before the first node.
        onboard
            Processes to start in this order; None: the recorder on request, then all that belong to the hardware.
        without_operator
            What the thrusters do without heartbeats of an operator; empty: as the parameters say.
        over
            Whether to stop starting; looked at before each process.
        """
        replayed = isinstance(hardware, ReplayOptions)
        if hardware is not None:
            self.start_mock(hardware, "--namespace", self.tuning.namespace, over=over)
            if over():
                return
        options = NodeOptions(
            str(self.folder.vehicle),
            self.tuning,
            str(self.folder.bag) if record else "",
            self.notes,
            without_operator,
            self.mock_facts if hardware is not None else None,
            {CONTROL.name: PILOT_STATUS_ASIDE} if replayed else {},
        )
        for sentence in options.unknown_blocks():
            print_stderr(sentence)
        words = write_parameters(self.folder.parameters, options.parameters())
        if onboard is None:  # the recorder first, so that it misses nothing
            onboard = (*((RECORDER,) if record else ()), *(REPLAYED if replayed else ONBOARD))
        for process in onboard:
            if not over():
                self.supervisor.start(process, [*words, *options.arguments(process)])

    def start_mock(
        self, options: MockOptions | ReplayOptions, *more: str, over: Callable[[], bool] = lambda: False
    ) -> None:
        """Start what replaces the vehicle alone; `mock_facts` then names its ports.

        Parameters
        ----------
        options
            Of the mock, or of the recorded run.
        *more
            Further arguments of its process.
        over
            Whether to wait no longer for its devices; `mock_facts` is empty then.
        """
        if keystore := self.supervisor.environment.get(security.KEYSTORE, ""):
            print_stderr(security.unenforced(keystore))
        words = [*more, "--vehicle", str(self.folder.vehicle), *options.words()]
        process = REPLAY if isinstance(options, ReplayOptions) else MOCK
        child = self.supervisor.start(process, words, pipe=True)
        self.mock_facts = first_line(child, MOCK_READY_S, self.folder.logs / f"{process.name}.log", over)

    def last_facts(self) -> Mapping[str, object]:
        """End all of it and return the ground truth of the mock; empty without one."""
        child = self.supervisor.children.get(MOCK.name)
        self.supervisor.close()
        lines = child.output.read().splitlines() if child is not None and child.output is not None else []
        found: Mapping[str, object] = json.loads(lines[-1]) if lines else {}
        return found


def first_line(
    child: SupervisedProcess, seconds: float, log: Path, over: Callable[[], bool] = lambda: False
) -> Mapping[str, Any]:
    """Read the one line of JSON that the mock prints when its devices are up.

    Parameters
    ----------
    child
        Its process, started with a pipe.
    seconds : [s]
        Longest wait for the line.
    log
        Its log, of which the end explains a failure.
    over
        Whether to wait no longer.

    Returns
    -------
    Mapping[str, Any]
        Its ports and clock; empty when it was `over` before.

    Raises
    ------
    HindraxError
        Where no line came in time, or it ended without one.
    UsageError
        Where it refused its arguments.
    """
    pipe, deadline_s = child.output, time.monotonic() + seconds
    assert pipe is not None
    while not (readable := select.select([pipe], (), (), LOOK_S)[0]) and time.monotonic() < deadline_s:
        if over():
            return {}
    if readable and (line := pipe.readline()):
        found: Mapping[str, object] = json.loads(line)
        return found
    if readable and child.handle.wait(seconds) == UsageError.exit_code:
        raise UsageError(f"the mock vehicle refused; {last_words(log)}")
    raise HindraxError(f"the mock vehicle did not come up; {last_words(log)}")


def environment(*, mock: bool, domain: int | None, tether: Tether | None = None) -> dict[str, str]:
    """Environment of the processes: this machine only, unless the user has a profile; in mock a domain of its own.

    Where a tether is named the graph reaches over it, and nowhere else. Where a keystore is named (a real vehicle on a
    ROS installation), every process proves who it is.

    The profile replaces all other settings of the graph that this terminal has, but for its domain. It replaces the
    discovery range too: with LOCALHOST the middleware would bring shared memory back in, where every killed process
    slows all later ones down.

    Parameters
    ----------
    mock
        Whether something replaces the vehicle; then nothing of this terminal's graph but its domain is kept.
    domain
        ROS domain; None: that of this terminal.
    tether
        Interface to another machine; None: the graph stays here.

    Returns
    -------
    dict[str, str]
        All environment variables of a process.

    Raises
    ------
    UsageError
        For a domain or a middleware that no graph can have.
    """
    made = dict(os.environ)
    ros_graph.exported_domain(made)
    if mock or tether is not None or not ros_graph.has_own_profile(made):
        kept = (ros_graph.DOMAIN,) if mock else (ros_graph.DOMAIN, ros_graph.SECURITY)
        made = without_graph(made, *kept)
        made[ros_graph.RMW] = ros_graph.OUR_RMW
        made[PROFILE] = str(profile_file(tether))
        made[ros_graph.RANGE] = "SYSTEM_DEFAULT"
    else:
        made.setdefault(ros_graph.RMW, ros_graph.OUR_RMW)
    if wrong := ros_graph.missing_rmw(made):
        raise UsageError(f"{ros_graph.RMW}: {wrong}; `unset {ros_graph.RMW}`")
    made["PYTHONUNBUFFERED"] = "1"
    made.pop(NOTIFY, None)  # only the tool itself notifies the service manager
    made.pop(stack_time.VARIABLE, None)
    if domain is not None:
        made[ros_graph.DOMAIN] = str(domain)
    return made if mock else made | security.settings(made.get(security.KEYSTORE, ""), made)


def environment_beside(stack: StackLock) -> dict[str, str]:
    """Environment of a command that joins a stack here: its graph; an identity that the user chose stays."""
    kept = () if stack.mock else (security.OVERRIDE,)
    return without_graph(os.environ, *kept) | dict(stack.graph)


def stack_environment(*, mock: bool, domain: int | None, tether: Tether | None = None) -> dict[str, str]:
    """Environment of the processes of a stack that starts now; a real one has its own time from now on.

    Parameters
    ----------
    mock, domain, tether
        As of `environment`.

    Returns
    -------
    dict[str, str]
        As of `environment`; of a real stack with the epoch of its time (ADR 9).
    """
    made = environment(mock=mock, domain=domain, tether=tether)
    return made if mock else made | {stack_time.VARIABLE: str(stack_time.epoch_ns())}


@contextlib.contextmanager
def adopted(wanted: Mapping[str, str]) -> Iterator[None]:
    """Use exactly the ROS settings of a stack in this process, with the operator's enclave.

    The client library reads some of them when it is imported: import it, and what imports it, within the block.

    Parameters
    ----------
    wanted
        Environment with the settings of the stack's graph; other variables of it do not count.

    Yields
    ------
    None
        Afterwards the environment is what it was.
    """
    before = dict(os.environ)
    chosen = graph_settings(security.with_enclave(wanted, "operator"))
    for name in graph_settings(before).keys() - chosen.keys():
        os.environ.pop(name, None)
    os.environ.update(chosen)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@contextlib.contextmanager
def own_domain(*, mock: bool, namespace: str = NAMESPACE) -> Iterator[int | None]:
    """Reserve a ROS domain that no process on this machine uses.

    Parameters
    ----------
    mock
        Whether something replaces the vehicle; a real stack takes the domain that is set.
    namespace
        Of the stack, in a domain that the user chose.

    Yields
    ------
    int | None
        The domain, free for as long as the block lasts; None (leave as it is) for a real stack, or where the user chose
        one. HindraxError comes from `require_no_stack` when a mock would join a stack of the same namespace there.
    """
    if not mock:
        yield None
        return
    chosen = ros_graph.exported_domain(os.environ)
    if chosen is not None:
        require_no_stack(chosen, namespace, environment(mock=True, domain=None))
        yield None
        return
    with free_domain() as number:
        yield number
