"""CPU time and memory of the whole node stack at vehicle rates, beside an rclpy node that listens to its topics."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hindrax_bag.run_folder import make_run_folder
from hindrax_bringup.process_state import descendants
from hindrax_bringup.processes import MOCK, modules
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions, Stack, adopted, environment, own_domain
from hindrax_bringup.supervisor import Supervisor
from hindrax_core.events import seconds_between
from hindrax_tools.benchmarks import cpu_s

SPAN_S = 20.0
UP_S = 60.0
DEPTH_m = 0.8
TICK_us = 1e6 / os.sysconf("SC_CLK_TCK") / SPAN_S
"""Resolution: a fork server that only waits uses less."""
LISTENER = [sys.executable, "-m", "hindrax_tools.benchmarks.peers.listener"]


def rows() -> list[dict[str, Any]]:
    """One row per process and one for all: CPU time [us] in a second of a vehicle that holds its depth, memory [MB]."""
    with tempfile.TemporaryDirectory() as place, own_domain(mock=True) as domain:
        made = environment(mock=True, domain=domain)
        folder = make_run_folder(f"{place}/run", default_vehicle())
        with Supervisor(folder.logs, made, preload=modules(mock=True)) as supervisor, adopted(made):
            stack = Stack(folder, supervisor)
            stack.start(MockOptions(seed=1, rate=1.0), record=True)
            spans = _measure(supervisor, made)
    peer_us, peer_MB = spans.pop("listener")
    spans["all nodes"] = sum(us for us, _ in spans.values()), sum(size for _, size in spans.values())
    peer = f"one rclpy node that listens to all topics, {peer_MB:.0f} MB"
    return [
        {
            "name": f"CPU of 1 s at vehicle rates: {name}, {size_MB:.0f} MB",
            "ours_us": us,
            "pss_MB": size_MB,
            "peer": peer,
            "peer_us": peer_us,
            "ratio": peer_us / max(us, TICK_us),
        }
        for name, (us, size_MB) in spans.items()
    ]


def _measure(supervisor: Supervisor, made: dict[str, str]) -> dict[str, tuple[float, float]]:
    """CPU time per second [us] and memory [MB] of each process but the mock, and of the listener in a second span."""
    from hindrax_operator.nodes.operator_node import Operator  # noqa: PLC0415  # rclpy reads the environment as it is imported
    from hindrax_operator.nodes.orders import hold  # noqa: PLC0415  # the same

    with Operator(mock=True) as operator:
        operator.wait(lambda: operator.navigation is not None, UP_S, lambda: "navigation")
        operator.arm(seconds=UP_S)
        hold(operator, ["depth"], DEPTH_m, engaged=True)
        nodes = {name: child.handle.pid for name, child in supervisor.children.items() if name != MOCK.name}
        nodes |= {"fork server": supervisor.fork_server.pid} if supervisor.fork_server else {}
        found = _shares(nodes, operator)
        listener = subprocess.Popen(LISTENER, env=made)  # noqa: S603  # our own interpreter and module
        try:
            operator.pause(5.0)
            found |= _shares({"listener": listener.pid}, operator)
        finally:
            listener.terminate()
            listener.wait()
    return found


def _shares(pids: dict[str, int], operator: Any) -> dict[str, tuple[float, float]]:
    """CPU time [us] per second of the vehicle, which on a busy machine is longer than one of the wall; memory [MB]."""
    before, begin = {name: _cpu_s(pid) for name, pid in pids.items()}, operator.now()
    operator.pause(SPAN_S)
    spent = {name: _cpu_s(pid) - before[name] for name, pid in pids.items()}
    elapsed_s = seconds_between(begin, operator.now())
    return {name: (spent[name] / elapsed_s * 1e6, _pss_MB(pid)) for name, pid in pids.items()}


def _pss_MB(pid: int) -> float:
    """Memory of a process and its children; what several share counts in parts (proportional set size, proc(5))."""
    rollups = [Path(f"/proc/{one}/smaps_rollup").read_text() for one in (pid, *descendants(pid))]
    return sum(int(line.split()[1]) for text in rollups for line in text.splitlines() if line.startswith("Pss:")) / 1e3


def _cpu_s(pid: int) -> float:
    """CPU time of a process and its children [s]."""
    return sum(cpu_s(one) for one in (pid, *descendants(pid)))
