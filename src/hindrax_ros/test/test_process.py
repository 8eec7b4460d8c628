"""What a process has behind it when its loop begins; on loopback, in a domain apart."""

import gc
import inspect
import os
import re
import signal
import subprocess
import sys

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

from hindrax_core.errors import UsageError
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.process import require_own_names, scoped, spin


class Curious(BatchedNode):
    """Looks around in its first turn, then asks to stop."""

    def __init__(self) -> None:
        super().__init__("curious")
        self.found: list[tuple[bool, bool]] = []

    def drain(self) -> None:
        """Note whether modules have been looked up, and whether the collector passes over what is there."""
        self.found.append((bool(inspect.modulesbyfile), gc.get_freeze_count() > 0))
        os.kill(os.getpid(), signal.SIGTERM)


def test_what_is_slow_once_is_done_before_the_first_turn(monkeypatch: pytest.MonkeyPatch, ros_domain: int) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    monkeypatch.setattr(inspect, "modulesbyfile", {})
    monkeypatch.setattr(inspect, "_filesbymodname", {})
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    made: list[Curious] = []

    def make() -> list[Curious]:
        made.append(Curious())
        return made

    try:
        assert spin(make, ["curious"]) == 0
    finally:
        signal.alarm(0)
        gc.unfreeze()
        for number, handler in kept.items():
            signal.signal(number, handler)
    assert made[0].found == [(True, True)]


HANGING = """
import ctypes, os, signal
from hindrax_ros import process

process.LONGEST_END_S = 1
stop = process.StopSignal()
os.kill(os.getpid(), signal.SIGINT)
assert stop.asked
os.kill(os.getpid(), signal.SIGTERM)
ctypes.PyDLL(None).sigsuspend((ctypes.c_ulong * 16)(1 << (signal.SIGTERM - 1)))
"""


def test_an_end_that_hangs_inside_of_a_library_is_ended_by_the_kernel() -> None:
    """It waits with the interpreter's lock held, as a destructor does that waits for what never comes."""
    ended = subprocess.run([sys.executable, "-c", HANGING], timeout=60.0, check=False)
    assert ended.returncode == -signal.SIGALRM


def test_a_new_name_without_a_node_renames_the_one_that_the_process_is_about() -> None:
    words = [
        "pilot",
        "--ros-args",
        "-r",
        "__node:=mine",
        "--remap",
        "__name:=other",
        "-p",
        "a:=__node:=b",
        "-r",
        "x:=y",
    ]
    found = scoped(words, "pilot")
    assert found == [*words[:3], "pilot:__node:=mine", "--remap", "pilot:__name:=other", *words[6:]]
    assert scoped(words, "") == words


def test_nodes_of_one_name_are_refused_with_the_remedy() -> None:
    require_own_names(["/hindrax/pilot", "/hindrax/navigator", "/pilot"])
    wanted = (
        "2 nodes of one process have the name /a/mine, wanted one each; say which is renamed: `-r NODE:__node:=NAME`"
    )
    with pytest.raises(UsageError, match=re.escape(wanted)):
        require_own_names(["/a/mine", "/a/mine", "/b/mine"])
