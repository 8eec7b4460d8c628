"""CPU time and memory of the whole node stack at vehicle rates, beside an rclpy node that listens to its topics."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import psutil

from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_process import StackProcess
from hindrax_core.events import seconds_between
from hindrax_tools.benchmarks import cpu_s, family
from hindrax_tools.mock_stack import holding_depth, mock_stack, node_processes

SPAN_S = 20.0
TICK_us = 1e6 / os.sysconf("SC_CLK_TCK") / SPAN_S
"""Resolution: a process that only waits uses less."""
SUPERVISOR = "supervisor"
"""The process of the stack itself, of which all others are children: counted alone."""
LISTENER = [sys.executable, "-m", "hindrax_tools.benchmark_peers", "listen"]


def rows() -> list[dict[str, object]]:
    """One row per process and one for all: CPU time [us] in a second of a vehicle that holds its depth, memory [MB]."""
    with tempfile.TemporaryDirectory() as place, mock_stack(Path(place), MockOptions(rate=1.0)) as stack:
        spans = _measure(stack)
    peer_us, peer_MB = spans.pop("listener")
    spans["all nodes"] = sum(us for us, _ in spans.values()), sum(size for _, size in spans.values())
    peer = f"one rclpy node that listens to all topics, {peer_MB:.0f} MB"
    return [row(name, us, size_MB, peer, peer_us) for name, (us, size_MB) in spans.items()]


def row(name: str, us: float, size_MB: float, peer: str, peer_us: float) -> dict[str, object]:
    """One row of the table; a process below the resolution of the clock has no ratio."""
    return {
        "name": f"CPU of 1 s at vehicle rates: {name}, {size_MB:.0f} MB",
        "ours_us": us,
        "pss_MB": size_MB,
        "peer": peer,
        "peer_us": peer_us,
        "ratio": peer_us / us if us >= TICK_us else None,
    }


def _measure(stack: StackProcess) -> dict[str, tuple[float, float]]:
    """CPU time per second [us] and memory [MB] of each process but the mock, and of the listener in a second span."""
    with holding_depth(stack) as operator:
        found = _shares(node_processes(stack) | {SUPERVISOR: stack.pid}, operator)
        listener = subprocess.Popen(LISTENER)  # noqa: S603  # our own interpreter and module
        try:
            operator.pause(5.0)
            found |= _shares({"listener": listener.pid}, operator)
        finally:
            listener.terminate()
            listener.wait()
    return found


def _shares(pids: dict[str, int], operator: Any) -> dict[str, tuple[float, float]]:
    """CPU time [us] per second of the vehicle, which on a busy machine is longer than one of the wall; memory [MB].

    Of memory that several processes share each counts its part (proportional set size, proc(5)).
    """
    members = {name: [psutil.Process(pid)] if name == SUPERVISOR else family(pid) for name, pid in pids.items()}
    before, begin = {name: cpu_s(those) for name, those in members.items()}, operator.now()
    operator.pause(SPAN_S)
    spent = {name: cpu_s(those) - before[name] for name, those in members.items()}
    elapsed_s = seconds_between(begin, operator.now())
    pss_MB = {name: sum(one.memory_full_info().pss for one in those) / 1e6 for name, those in members.items()}
    return {name: (spent[name] / elapsed_s * 1e6, pss_MB[name]) for name in pids}
