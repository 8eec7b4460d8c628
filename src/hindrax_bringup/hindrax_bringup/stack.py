"""A running stack: the mock on request, the onboard processes, the recorder, and their parameters."""

import contextlib
import json
import os
import select
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from hindrax_bag.metadata import try_lock
from hindrax_bag.run_folder import RunFolder, write_parameters
from hindrax_bringup.liveness import NOTIFY
from hindrax_bringup.network import security
from hindrax_bringup.network.tether import Tether, profile_file
from hindrax_bringup.node_options import NodeOptions, ParameterOverrides
from hindrax_bringup.nodes.graph_search import occupied_domains, require_no_stack
from hindrax_bringup.processes import MOCK, RECORDER, Process
from hindrax_bringup.stack_lock import StackLock, graph_settings
from hindrax_bringup.supervisor import SupervisedProcess, Supervisor, last_words
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.topics import NAMESPACE
from hindrax_ros import stack_time

MOCK_READY_S = 60.0
DOMAINS = range(1, 101)
FAULT_HELP = "mock: fault, device, start and duration [s]: garbage:dvl75@30+5; repeatable, any other name lists all"
WORLD_HELP = (
    "mock: effects outside the model: ideal, pool (all drawn from the seed), or NAME[=SIZE],... such as tether=1; "
    "any other name lists all"
)
PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"


@dataclass(frozen=True, slots=True)
class MockOptions:
    """Options of the mock vehicle: seed, upper bound of its pace (0: as fast as the stack follows), faults, world.

    `truth`: file for the log of true states and pulses.
    """

    seed: int = 1
    rate: float = 0.0
    faults: tuple[str, ...] = ()
    world: str = "ideal"
    truth: str = ""


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
        mock: MockOptions | None,
        *,
        record: bool,
        onboard: Sequence[Process] | None = None,
        without_operator: str = "",
    ) -> None:
        """Start the mock (when asked for by name), the recorder, and the onboard processes or some of them."""
        if mock is not None:
            self.start_mock(mock, "--namespace", self.tuning.namespace)
        options = NodeOptions(
            str(self.folder.vehicle),
            self.tuning,
            str(self.folder.bag) if record else "",
            self.notes,
            without_operator,
            self.mock_facts if mock is not None else None,
        )
        for sentence in options.unknown_blocks():
            print_stderr(sentence)
        words = write_parameters(self.folder.parameters, options.parameters())
        for process in options.processes if onboard is None else onboard:
            self.supervisor.start(process, [*words, *options.arguments(process)])

    def last_facts(self) -> Mapping[str, Any]:
        """End the mock and return its ground truth; empty without one."""
        child = self.supervisor.children.get(MOCK.name)
        if child is None or child.handle.stdout is None:
            return {}
        self.supervisor.close()
        lines = child.handle.stdout.read().splitlines()
        found: Mapping[str, Any] = json.loads(lines[-1]) if lines else {}
        return found

    def start_mock(self, options: MockOptions, *more: str) -> None:
        """Start the mock alone, with more words of its own; `mock_facts` then names its ports."""
        if keystore := self.supervisor.environment.get(security.KEYSTORE, ""):
            print_stderr(security.unenforced(keystore))
        words = [*more, "--vehicle", str(self.folder.vehicle), "--seed", str(options.seed), "--rate", str(options.rate)]
        words += [word for fault in options.faults for word in ("--fault", fault)]
        words += ["--world", options.world, *(["--truth", options.truth] if options.truth else [])]
        child = self.supervisor.start(MOCK, words, pipe=True)
        self.mock_facts = first_line(child, MOCK_READY_S, self.folder.logs / "mock.log")


def lock_of(stack: Stack) -> StackLock:
    """Lock-file entry of a stack that was started."""
    folder, started = stack.folder, stack.supervisor.children
    return StackLock(
        os.getpid(),
        MOCK.name in started,
        str(folder.vehicle),
        str(folder.path),
        graph_settings(stack.supervisor.environment),
        stack.mock_facts.get("ports", {}),
        purpose=stack.notes.partition(" ")[0],
        namespace=stack.tuning.namespace,
        bag=str(folder.bag) if RECORDER.name in started else "",
    )


def first_line(child: SupervisedProcess, seconds: float, log: Path) -> Mapping[str, Any]:
    """Read the one line of JSON that the mock prints when its devices are up."""
    pipe: IO[bytes] | None = child.handle.stdout
    assert pipe is not None
    if select.select([pipe], (), (), seconds)[0]:
        if line := pipe.readline():
            found: Mapping[str, Any] = json.loads(line)
            return found
        if child.handle.wait(seconds) == UsageError.exit_code:
            raise UsageError(f"the mock vehicle refused; {last_words(log)}")
    raise HindraxError(f"the mock vehicle did not come up; {last_words(log)}")


def environment(*, mock: bool, domain: int | None, tether: Tether | None = None) -> dict[str, str]:
    """Environment of the processes: this machine only, unless the user has a profile; in mock a domain of its own.

    Where a tether is named the graph reaches over it, and nowhere else. Where a keystore is named (a real vehicle on a
    ROS installation), every process proves who it is.

    The profile replaces the discovery range: with LOCALHOST the middleware would bring shared memory back in, where
    every killed process slows all later ones down.
    """
    made = dict(os.environ)
    made.setdefault("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp")
    made["PYTHONUNBUFFERED"] = "1"
    made.pop(NOTIFY, None)  # only the tool itself notifies the service manager
    made.pop(stack_time.VARIABLE, None)
    if domain is not None:
        made["ROS_DOMAIN_ID"] = str(domain)
    if mock or tether is not None or PROFILE not in made:
        made[PROFILE] = str(profile_file(tether))
        made["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SYSTEM_DEFAULT"
    return made if mock else made | security.settings(made.get(security.KEYSTORE, ""), made)


def environment_beside(stack: StackLock) -> dict[str, str]:
    """Environment of a command that joins a stack here: its graph, and no keystore where the stack is a mock."""
    return environment(mock=stack.mock, domain=None) | dict(stack.graph)


def stack_environment(*, mock: bool, domain: int | None, tether: Tether | None = None) -> dict[str, str]:
    """Environment of the processes of a stack that starts now; a real one has its own time from now on."""
    made = environment(mock=mock, domain=domain, tether=tether)
    return made if mock else made | {stack_time.VARIABLE: str(stack_time.epoch_ns())}


@contextlib.contextmanager
def adopted(wanted: Mapping[str, str]) -> Iterator[None]:
    """Use the ROS settings of a stack in this process, with the operator's enclave, before its node is made."""
    before = dict(os.environ)
    os.environ.update(graph_settings(security.with_enclave(wanted, "operator")))
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@contextlib.contextmanager
def own_domain(*, mock: bool, namespace: str = NAMESPACE) -> Iterator[int | None]:
    """A ROS domain that no process on this machine uses; None (leave as it is) where the user chose one.

    HindraxError when a mock would join a stack of the same namespace in the domain that the user chose.
    """
    if not mock:
        yield None
        return
    if chosen := os.environ.get("ROS_DOMAIN_ID", ""):
        if chosen.isdecimal():  # the client library refuses anything else
            require_no_stack(int(chosen), namespace, environment(mock=True, domain=None))
        yield None
        return
    folder = Path(f"/tmp/hindrax-domains-{os.getuid()}")  # noqa: S108  # only empty lock files, per user
    folder.mkdir(mode=0o700, exist_ok=True)
    for number in DOMAINS:
        with (folder / str(number)).open("w") as lock:
            # Processes of a killed tool live on without its lock, and other users have locks of their own.
            if try_lock(lock) and number not in occupied_domains():
                yield number
                return
    raise HindraxError(
        f"ROS domains {DOMAINS[0]} to {DOMAINS[-1]}: found all in use, wanted a free one; wait for a mock run to end"
    )
