"""CPU time of the whole node stack at vehicle rates, beside a plain rclpy node that only subscribes to its topics."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hindrax_bag.run_folder import make_run_folder
from hindrax_bringup.processes import MOCK
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions, Stack, adopted, environment, own_domain
from hindrax_bringup.supervisor import Supervisor

SPAN_S = 20.0
UP_S = 60.0
DEPTH_m = 0.8
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
LISTENER = [sys.executable, "-m", "hindrax_tools.benchmarks.peers.listener"]


def rows() -> list[dict[str, Any]]:
    """One row per process and one for all: CPU time [us] in a second of a vehicle that holds its depth."""
    with tempfile.TemporaryDirectory() as place, own_domain(mock=True) as domain:
        made = environment(mock=True, domain=domain)
        folder = make_run_folder(f"{place}/run", default_vehicle())
        with Supervisor(folder.logs, made) as supervisor, adopted(made):
            stack = Stack(folder, supervisor)
            stack.start(MockOptions(seed=1, rate=1.0), record=True)
            spans = _measure(supervisor, made)
    peer_us = spans.pop("listener")
    spans["all nodes"] = sum(spans.values())
    peer = "one rclpy node that listens to all topics"
    named = [(f"CPU of 1 s at vehicle rates: {name}", us) for name, us in spans.items()]
    return [
        {"name": name, "ours_us": us, "peer": peer, "peer_us": peer_us, "ratio": peer_us / us} for name, us in named
    ]


def _measure(supervisor: Supervisor, made: dict[str, str]) -> dict[str, float]:
    """CPU time per second [us] of each process but the mock, and of the listener, which comes in for a second span."""
    from hindrax_operator.nodes.operator_node import Operator  # noqa: PLC0415  # rclpy reads the environment as it is imported
    from hindrax_operator.nodes.orders import hold  # noqa: PLC0415  # the same

    with Operator(mock=True) as operator:
        operator.wait(lambda: operator.navigation is not None, UP_S, lambda: "navigation")
        operator.arm(seconds=UP_S)
        hold(operator, ["depth"], DEPTH_m, engaged=True)
        nodes = {name: child.handle.pid for name, child in supervisor.children.items() if name != MOCK.name}
        found = _shares(nodes)
        listener = subprocess.Popen(LISTENER, env=made)  # noqa: S603  # our own interpreter and module
        try:
            operator.pause(5.0)
            found |= _shares({"listener": listener.pid})
        finally:
            listener.terminate()
            listener.wait()
    return found


def _shares(pids: dict[str, int]) -> dict[str, float]:
    """CPU time per second [us] over one span."""
    before = {name: _ticks(pid) for name, pid in pids.items()}
    begin = time.monotonic()
    time.sleep(SPAN_S)
    elapsed = time.monotonic() - begin
    return {name: (_ticks(pid) - before[name]) / TICKS_PER_S / elapsed * 1e6 for name, pid in pids.items()}


def _ticks(pid: int) -> int:
    """User and system time of a process and its children."""
    return sum(sum(map(int, _stat(one)[11:13])) for one in _family(pid))


def _family(pid: int) -> Iterator[int]:
    yield pid
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in (task / "children").read_text().split():
            yield from _family(int(child))


def _stat(pid: int) -> Sequence[str]:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
