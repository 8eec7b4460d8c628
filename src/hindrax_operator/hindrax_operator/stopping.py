"""Stop stacks: neutral by the dead man of each output first, which needs no ROS; then what only ROS can cancel.

As a program, `python -m hindrax_operator.stopping DOCUMENT`, it does the second part for one stack: the client library
has one middleware per process and ends the process when that is missing, so each stack gets a process of its own.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from hindrax_bringup.process_state import descendants, running
from hindrax_bringup.stack_lock import FOLDER, StackLock, choose, stacks
from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import print_whole
from hindrax_core.topics import NAMESPACE
from hindrax_drivers.nodes.stop_request import StopAnswer, dead_men, stop_thrust
from hindrax_operator.connection import joined

OVER_ROS_S = 40.0
"""Longest time for the part over ROS: a busy machine takes seconds to load it, and three answers may be waited for."""


@dataclass(frozen=True, slots=True)
class OutputStop:
    """Answers of the dead men of one stack; none: it has none on this machine, or they take no requests."""

    answers: tuple[StopAnswer, ...]

    @property
    def neutral(self) -> bool:
        """Whether every output of the stack is known to be neutral."""
        return bool(self.answers) and all(one.neutral for one in self.answers)

    @property
    def failures(self) -> list[str]:
        """A sentence for each output that is not."""
        return [one.sentence for one in self.answers if not one.neutral]


def stop_outputs(found: Sequence[StackLock]) -> list[OutputStop]:
    """Stop every output of these stacks at the same time, by their dead men."""
    listed = dead_men()
    return _stop([[pid for pid in descendants(one.pid) if pid in listed] for one in found])


def stop_lost_outputs(found: Iterable[StackLock]) -> dict[int, OutputStop]:
    """Stop every other output of this user: of one that is not announced, or whose tool was killed; by its dead man."""
    known = {pid for one in found for pid in descendants(one.pid)}
    lost = sorted(dead_men() - known)
    ours = {one.pid for one in running() if (one.owner, one.place) == (os.getuid(), os.environ.get(FOLDER, ""))}
    pids = [pid for pid in lost if pid in ours]
    return dict(zip(pids, _stop([[pid] for pid in pids]), strict=True))


def _stop(groups: Sequence[Sequence[int]]) -> list[OutputStop]:
    with ThreadPoolExecutor(max_workers=max(1, sum(map(len, groups)))) as pool:
        asked = [[pool.submit(stop_thrust, pid) for pid in group] for group in groups]
        return [OutputStop(tuple(filter(None, (one.result() for one in group)))) for group in asked]


def stop_over_ros(found: StackLock | None, *, sim_time: bool, namespace: str = NAMESPACE) -> list[str]:
    """Disarm and cancel every maneuver over ROS, in a process of its own that has a time limit.

    Parameters
    ----------
    found
        The stack whose graph is joined; None: that of this terminal.
    sim_time
        Whether the time comes by /clock.
    namespace
        Of the nodes, where no stack is `found`.

    Returns
    -------
    list[str]
        A sentence for each thing that failed.
    """
    document = json.dumps({"stack": found and found.pid, "sim_time": sim_time, "namespace": namespace})
    words = [sys.executable, "-P", "-m", "hindrax_operator.stopping", document]
    try:
        done = subprocess.run(  # noqa: S603  # our own module
            words, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False, timeout=OVER_ROS_S
        )
    except subprocess.TimeoutExpired:
        return [f"ROS: no end within {OVER_ROS_S:.0f} s"]
    try:
        failed: list[str] = json.loads(done.stdout)
    except ValueError:
        last = (done.stderr.strip().splitlines() or ["without a word"])[-1]
        failed = [f"ROS: ended with code {done.returncode}; {last}"]
    return failed


def main() -> int:
    """Stop one stack over ROS; prints a JSON list of what failed."""
    asked = json.loads(sys.argv[1])
    try:
        found = None if asked["stack"] is None else choose(stacks(), asked["stack"])
        with joined(found, sim_time=asked["sim_time"], namespace=asked["namespace"]) as operator:
            from hindrax_operator.nodes.orders import stop  # noqa: PLC0415  # rclpy reads the environment of the stack

            failed = stop(operator)
    except HindraxError as error:
        failed = [str(error)]
    print_whole(json.dumps(failed))
    return 0


if __name__ == "__main__":
    sys.exit(main())
