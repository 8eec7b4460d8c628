"""A process that stood still says so, once; one that is only slow does not."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from hindrax_ros import standstill
from hindrax_ros.heartbeat import VARIABLE
from hindrax_ros.standstill import LONGEST_STANDSTILL_S, STOOD_STILL, StandstillWatch

PATIENCE_S = 20.0


def watched(times_s: list[float], monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Standstills found by a watch that sees these times, then the last one."""
    monkeypatch.setattr(standstill, "LOOK_S", 0.001)
    seen: Iterator[float] = iter(times_s)
    last: list[float] = []

    def now_s() -> float:
        last[:] = [next(seen, *last)]
        return last[0]

    watch, end_s = StandstillWatch(now_s), time.monotonic() + PATIENCE_S
    while last[:1] != times_s[-1:] and time.monotonic() < end_s:
        time.sleep(0.001)
    time.sleep(0.01)
    watch.close()
    return [found for found in (watch.stood_still_s() for _ in range(3)) if found]


def test_a_standstill_is_told_once_and_a_short_one_not_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    assert watched([0.0, 0.5, 8.501, 9.0], monkeypatch) == [pytest.approx(8.0)]
    assert watched([0.0, LONGEST_STANDSTILL_S - 0.1, 2 * LONGEST_STANDSTILL_S - 0.2], monkeypatch) == []


STOPPED = """
from hindrax_ros import standstill
standstill.LONGEST_STANDSTILL_S, standstill.LOOK_S = 0.3, 0.05
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.process import spin

class Speaking(BatchedNode):
    spoken = False

    def drain(self):
        if not self.spoken:
            self.spoken = True
            print("turns", flush=True)

    def close(self):
        print("closed", flush=True)

exit(spin(lambda: [Speaking("speaking")], ["speaking"]))
"""


@pytest.mark.parametrize("supervised", [True, False])
def test_a_process_that_stood_still_ends_in_order_where_somebody_starts_it_again(
    monkeypatch: pytest.MonkeyPatch, ros_domain: int, tmp_path: object, *, supervised: bool
) -> None:
    pytest.importorskip("rclpy", reason="needs the ROS environment")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    monkeypatch.setenv(VARIABLE, f"{tmp_path}/speaking" if supervised else "")
    with subprocess.Popen(
        [sys.executable, "-c", STOPPED], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == "turns\n"
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(1.0)
        os.kill(process.pid, signal.SIGCONT)
        said = process.stderr.readline()
        if not supervised:
            assert said.endswith("if others do not hear it, start it again\n")
            process.send_signal(signal.SIGTERM)
        else:
            assert said.endswith("and ROS may have lost it: it begins anew\n")
        assert said.startswith("this process stood still for ")
        assert process.wait(PATIENCE_S) == (STOOD_STILL if supervised else 0)
        assert process.stdout.read() == "closed\n"
