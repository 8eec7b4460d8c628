"""A stack that is kept up: processes looked after, presence announced, until a signal ends it."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hindrax_bag.read.completion import begin_completion, unfinished_files
from hindrax_bag.run_folder import RUNS, RunFolder, make_run_folder
from hindrax_bringup.liveness import STARTING, LivenessFile, pulse
from hindrax_bringup.processes import MOCK, ONBOARD, THRUSTERS
from hindrax_bringup.stack import MockOptions, Stack, adopted, environment, own_domain, presence_of
from hindrax_bringup.stack_lock import StackLock, announced
from hindrax_bringup.supervisor import Supervisor, last_words
from hindrax_bringup.tether import FOREVER_S, Tether, address_of, wait_for_address
from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import load_vehicle

VITAL = (MOCK.name, THRUSTERS.name)
"""Without these nothing is left to operate; without another one the rest still serves."""
TURN_S = 0.1
STAY = "stay"


@dataclass(frozen=True, slots=True)
class UpOptions:
    """Which vehicle, whether the mock's, what is kept, and who else may join over which tether."""

    vehicle_file: Path
    mock: MockOptions | None
    record: bool
    out: str | None
    tether: Tether | None = None
    without_operator: str = STAY


def run_up(options: UpOptions) -> int:
    """Start everything, say how to reach it, look after it; 0 when a signal ended it."""
    vehicle = load_vehicle(options.vehicle_file)
    mock = options.mock is not None
    with asked_to_end() as over, own_domain(mock=mock) as domain, pulse() as beating:
        # A vehicle with a full disk can be flown; its recorder says that it waits for room.
        folder = make_run_folder(options.out, options.vehicle_file, wanted_bytes=0)
        address = awaited(options.tether, over, beating)
        if over():
            return 0
        made = environment(mock=mock, domain=domain, tether=options.tether)
        complete_earlier(RUNS)
        with Supervisor(folder.logs, made) as supervisor:
            beating.beat("up", STARTING)
            stack = Stack(folder, vehicle, supervisor, "up in mock" if mock else "up")
            stack.start(options.mock, record=options.record)
            presence = presence_of(stack, made)
            with announced(presence), adopted(made, "safety_monitor"):
                print(startup_text(presence, folder, record=options.record), flush=True)
                _look_after(supervisor, over, options, address, beating)
            report("ending; the thrusters go neutral and disarm")
        report("ended; neutral is on the wire")
    return 0


def complete_earlier(runs: Path) -> subprocess.Popen[bytes] | None:
    """Complete in the background what a power cut or a kill left unfinished in the bags of earlier runs."""
    files = unfinished_files(runs)
    for bag in sorted({file.parent for file in files}):
        report(f"{bag}: was left unfinished; it is completed in the background")
    return begin_completion(files)


def awaited(tether: Tether | None, over: Callable[[], bool], beating: LivenessFile) -> str:
    """Wait for the tether, however long that takes; returns its address, empty without one."""
    if tether is None:
        return ""

    def beat_until_over() -> bool:
        waiting = f"waiting for the tether {tether.interface}"
        beating.beat(waiting, {"tether": waiting})
        return over()

    return wait_for_address(tether, FOREVER_S, beat_until_over, report)


def _look_after(
    supervisor: Supervisor, over: Callable[[], bool], options: UpOptions, address: str, beating: LivenessFile
) -> None:
    from hindrax_bringup.nodes.safety_monitor import SafetyMonitor  # noqa: PLC0415  # rclpy reads the environment as it is imported

    told: dict[str, str] = {}
    without_operator = options.without_operator if options.tether else STAY
    with SafetyMonitor(mock=options.mock is not None, without_operator=without_operator) as monitor:
        while not over():
            monitor.spin(TURN_S)
            for sentence in (*supervisor.check(), *health_changes(told, monitor.troubles), *monitor.new_messages()):
                report(sentence)
            _require_same(options.tether, address)
            beating.beat("up", monitor.troubles)
            told = dict(monitor.troubles)
            lost = [name for name in VITAL if name in supervisor.children and supervisor.children[name].ended]
            if lost:
                words = last_words(supervisor.logs / f"{lost[0]}.log")
                raise HindraxError(f"{lost[0]}: the process is gone for good; {words}; look into {supervisor.logs}")


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


def health_changes(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Return what has changed in the health of the nodes, one sentence for each; numbers alone are no news."""
    found = []
    for name, trouble in now.items():
        old = before.get(name)
        if trouble and _words(trouble) != _words(old or ""):
            found.append(f"{name}: {trouble}")
        elif not trouble and old != "":
            found.append(f"{name}: well")
    return found


def _words(text: str) -> str:
    return "".join(letter for letter in text if not (letter.isdigit() or letter in ".-+"))


@contextlib.contextmanager
def asked_to_end() -> Iterator[Callable[[], bool]]:
    """Only note SIGINT and SIGTERM, however often they come; yields the question whether one has come."""
    asked = threading.Event()
    before: dict[int, Any] = {
        number: signal.signal(number, lambda _number, _frame: asked.set()) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield asked.is_set
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def report(sentence: str) -> None:
    """One line to the operator; stdout is for what scripts may want."""
    print(sentence, file=sys.stderr, flush=True)


def startup_text(presence: StackLock, folder: RunFolder, *, record: bool) -> str:
    """Return how to reach the stack."""
    settings = " ".join(f"{key}={value}" for key, value in sorted(presence.graph.items()) if _shown(key))
    lines = [
        f"up: {presence.title}",
        "  from any terminal: ./hindrax monitor | web | arm | hold | wrench | disarm | stop",
        f"  with ROS 2 tools:  export {settings}",
        f"  processes:         {', '.join(process.name for process in ONBOARD)}; logs in {folder.logs}",
    ]
    lines += [f"  bag:               {folder.bag}"] if record else []
    return "\n".join([*lines, "  Ctrl-C ends it"])


def _shown(key: str) -> bool:
    wanted = ("ROS_DOMAIN_ID", "RMW_IMPLEMENTATION", "ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE")
    return key in wanted
