"""Who is alive: the operator at the other end of a link, the tool of a stack, its nodes and processes."""

import fcntl
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import IO

import pytest

from hindrax_bringup.liveness import (
    NOBODY,
    NODES,
    NOTIFY,
    PROCESSES_START,
    LivenessFile,
    beats,
    health_change,
    liveness_of_stacks,
    notify,
    reported_armed,
    silent,
    stacks_well,
    tool_liveness,
)
from hindrax_bringup.network.link_monitor import LinkMonitor
from hindrax_bringup.stack_lock import FOLDER
from hindrax_ros.heartbeat import VARIABLE, Memory


@pytest.fixture(autouse=True)
def own_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path / "runtime"))


def test_an_operator_is_lost_once_and_comes_back() -> None:
    watch = LinkMonitor()
    assert not watch.step(100.0), "nobody is lost who was never there"
    assert watch.status_text(100.0) == "no operator yet"
    assert watch.beat(100.0) == "link: an operator is connected"
    assert [watch.beat(at_s) for at_s in (100.5, 101.0, 101.5)] == ["", "", ""]
    assert not watch.step(103.5)
    assert watch.step(103.6)
    assert not watch.step(104.0)
    assert watch.status_text(111.5) == "no operator for 10 s"
    assert watch.beat(111.5) == "link: the operator is back after 10.0 s"
    assert not watch.step(112.0)
    assert [watch.beat(at_s) for at_s in (112.0, 112.5, 113.0)] == ["", "", ""]
    assert watch.step(115.1)


def test_a_link_that_is_not_steady_yet_is_lost_later() -> None:
    watch = LinkMonitor()
    for at_s in (100.0, 102.6, 105.2, 105.7, 106.2):  # late, late, then regular
        assert not watch.step(at_s)
        watch.beat(at_s)
    assert not watch.step(108.3), "three regular heartbeats are not steady yet"
    assert watch.step(116.3), "but silence is not endured for ever"
    for at_s in (120.0, 120.5, 121.0, 121.5):
        watch.beat(at_s)
    assert not watch.step(123.5)
    assert watch.step(123.6)


def test_the_pulse_is_felt_while_it_beats(tmp_path: Path) -> None:
    assert stacks_well(tmp_path, 0.0) == (False, NOBODY)
    with tool_liveness() as beating:
        beating.beat("up", {"pilot": ""})
        (path,) = (tmp_path / "runtime").glob("*.pulse")
        at_s = json.loads(path.read_text())["at_s"]
        assert stacks_well(path.parent, at_s + 1.0) == (True, "up")
        dead = f"process {os.getpid()}: no heartbeat for 60 s; restart it"
        assert stacks_well(path.parent, at_s + 60.0) == (False, dead)
        beating.beat("too soon", {})
        assert stacks_well(path.parent, at_s + 1.0) == (True, "up")
        beating._next_s = 0.0
        beating.beat("up", {"pilot": "", "dvl75": "silence"})
        assert stacks_well(path.parent, at_s + 1.0) == (False, "dvl75: silence")
    assert list(path.parent.glob("*.pulse")) == []


def test_a_tool_that_ctrl_z_has_stopped_is_reported_at_once(tmp_path: Path) -> None:
    words = "import sys, time; from hindrax_bringup.liveness import tool_liveness"
    beat = "tool = tool_liveness(); tool.beat('up', {}); print(flush=True); time.sleep(60)"
    child = subprocess.Popen([sys.executable, "-c", f"{words}; {beat}"], stdout=subprocess.PIPE)
    assert child.stdout is not None
    child.stdout.readline()
    try:
        assert stacks_well(tmp_path / "runtime", time.monotonic())[0]
        child.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, child.pid, os.WSTOPPED)
        well, reported = stacks_well(tmp_path / "runtime", time.monotonic())
    finally:
        child.kill()
        child.communicate()
    assert not well
    assert reported.startswith(f"process {child.pid}: stopped, as by Ctrl-Z; ")


def test_what_is_wrong_with_its_nodes_is_reported_of_a_stack_and_of_one_that_launch_started(tmp_path: Path) -> None:
    nodes = LivenessFile(tmp_path / f"{os.getpid()}{NODES}")
    nodes.beat("nodes in /rov1", {"dvl75": "silence", "pilot": ""})
    now_s = time.monotonic()
    assert liveness_of_stacks(tmp_path, now_s) == {os.getpid(): ("nodes in /rov1", "dvl75: silence")}
    tool = LivenessFile(tmp_path / f"{os.getpid()}.pulse")
    tool.beat("up", {"dvl75": "silence"})
    assert liveness_of_stacks(tmp_path, time.monotonic()) == {os.getpid(): ("up", "dvl75: silence")}
    assert "safety monitor of process" in liveness_of_stacks(tmp_path, now_s + 60.0)[os.getpid()][1]
    nodes.close()
    tool.close()
    assert liveness_of_stacks(tmp_path, now_s) == {}


def test_a_stack_is_starting_until_each_of_its_devices_has_reported_once(tmp_path: Path) -> None:
    runtime, tool = tmp_path / "runtime", tool_liveness()
    tool.beat("up", PROCESSES_START)
    assert stacks_well(runtime, time.monotonic()) == (False, "starting: waiting for the processes")
    tool._next_s = 0.0
    tool.beat("up", {}, awaited=("dvl75", "ms5837"))
    assert stacks_well(runtime, time.monotonic()) == (False, "starting: waiting for dvl75, ms5837")
    nodes = LivenessFile(runtime / f"{os.getpid()}{NODES}")
    nodes.beat("nodes in /hindrax", {"dvl75": "no bottom lock", "pilot": ""})
    wrong = "starting: waiting for ms5837; dvl75: no bottom lock"
    assert stacks_well(runtime, time.monotonic()) == (False, wrong), "what is known already is said too"
    nodes._next_s = 0.0
    nodes.beat("nodes in /hindrax", {"dvl75": "", "ms5837": ""})
    now_s = time.monotonic()
    assert stacks_well(runtime, now_s) == (True, "up")
    # A safety monitor that has died has heard them all: it does not make its stack one that is starting.
    tool._next_s = now_s + 60.0
    monitor = json.loads((runtime / f"{os.getpid()}{NODES}").read_text())
    (runtime / f"{os.getpid()}{NODES}").write_text(json.dumps({**monitor, "at_s": now_s - 60.0}))
    assert "starting" not in stacks_well(runtime, now_s)[1]
    tool.close()
    nodes.close()


def test_a_heartbeat_while_somebody_looks_is_neither_removed_nor_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with tool_liveness() as tool:
        tool.beat("up", {})
        (path,) = (tmp_path / "runtime").glob("*.pulse")
        beats, lock = ["up again"], fcntl.flock

        def beating(file: IO[str], operation: int) -> None:
            if operation & fcntl.LOCK_NB and beats:
                tool._next_s = 0.0
                tool.beat(beats.pop(), {})
            lock(file, operation)

        monkeypatch.setattr(fcntl, "flock", beating)
        now_s = time.monotonic()
        assert stacks_well(path.parent, now_s) == (True, "up again")
        assert path.exists()
        assert json.loads(path.read_text())["at_s"] > now_s, "it beat after the time was read"
        after_a_boot = stacks_well(path.parent, now_s - 3600.0)[1]
        assert "no heartbeat for 3600 s" in after_a_boot


def test_a_pulse_whose_folder_has_gone_ends_nothing(tmp_path: Path) -> None:
    with tool_liveness() as beating:
        (tmp_path / "runtime").rmdir()
        beating.beat("pool-test surge: armed", {})
    assert not (tmp_path / "runtime").exists()


def test_every_process_of_every_stack_is_felt(tmp_path: Path) -> None:
    runtime = tmp_path / "runtime"
    with tool_liveness() as beating:
        beating.beat("pool-test surge in mock: armed", {"dvl75": ""})
        (path,) = runtime.glob("*.pulse")
        at_s = json.loads(path.read_text())["at_s"]
        heartbeats = runtime / f"{os.getpid()}-abc.beats"
        heartbeats.mkdir()
        for name, age_s in (("control", 0.5), ("thrusters", 2.5)):
            (heartbeats / name).write_text(str(at_s - age_s))
        assert stacks_well(runtime, at_s) == (True, "pool-test surge in mock: armed")
        (heartbeats / "sensors").write_bytes(b"")
        assert stacks_well(runtime, at_s) == (False, "sensors: no heartbeat yet")
        late = "sensors: no heartbeat yet; thrusters: no heartbeat for 5 s"
        assert stacks_well(runtime, at_s + 2.4) == (False, late)
        # What another tool, which was killed, has left behind is neither a stack nor a reason to be unwell.
        (runtime / "4999999.pulse").write_text(path.read_text())
        for name in ("sensors", "thrusters"):
            (heartbeats / name).unlink()
        assert stacks_well(runtime, at_s) == (True, "pool-test surge in mock: armed")
        assert not (runtime / "4999999.pulse").exists()
        with LivenessFile(runtime / f"{os.getppid()}.pulse") as other:
            other.beat("up", {"ping1d": "silent"})
            assert not stacks_well(runtime, at_s)[0], "one of two is well"


def test_the_service_manager_is_reported(tmp_path: Path) -> None:
    address = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(address)
        notify("READY=1", {NOTIFY: address})
        assert manager.recv(100) == b"READY=1"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:  # one without a file: systemd writes @ for NUL
        manager.bind(f"\0hindrax-{os.getpid()}@host")
        notify("READY=1", {NOTIFY: f"@hindrax-{os.getpid()}@host"})
        manager.setblocking(False)
        assert manager.recv(100) == b"READY=1"
    notify("READY=1", {NOTIFY: address})  # nobody listens any more: no harm
    notify("READY=1", {})


def test_a_link_is_there_until_it_is_lost() -> None:
    watch = LinkMonitor()
    assert (watch.lost, watch.silent_s(100.0), watch.status_text(100.0)) == (False, 0.0, "no operator yet")
    for at_s in (100.0, 100.5, 101.0, 101.5):
        watch.beat(at_s)
    assert not watch.step(103.5)
    assert watch.status_text(103.5) == "an operator is connected"
    assert watch.silent_s(103.5) == 2.0
    assert watch.step(103.6)
    assert watch.status_text(103.6) == "no operator for 2 s"


def test_a_link_that_was_lost_must_be_steady_anew() -> None:
    watch = LinkMonitor()
    for at_s in (100.0, 100.5, 101.0, 101.5, 102.0):
        watch.beat(at_s)
    assert watch.step(105.0)
    for at_s in (105.0, 105.5, 106.0):
        watch.beat(at_s)
    assert not watch.step(116.0), "three"
    watch.beat(106.5)
    assert watch.step(108.6), "four"


def test_it_beats_once_a_second_and_shows_the_service_manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    address, now_s = str(tmp_path / "notify@host"), [0.5]
    monkeypatch.setenv(NOTIFY, address)
    monkeypatch.setattr(time, "monotonic", lambda: now_s[0])
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager, tool_liveness() as made:
        manager.bind(address)
        manager.setblocking(False)
        for now_s[0], status in ((0.5, "starting"), (1.4, "too soon"), (1.5, "up"), (2.6, "down")):
            made.beat(status, {})
        reported = [manager.recv(100).decode() for _ in range(3)]
        with pytest.raises(BlockingIOError):
            manager.recv(100)
    assert reported == [f"WATCHDOG=1\nSTATUS={status}" for status in ("starting", "up", "down")]


def test_a_tool_states_that_it_is_ready(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(NOTIFY, str(tmp_path / "notify"))
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.setblocking(False)
        with tool_liveness():
            assert manager.recv(100) == b"READY=1"


def test_where_the_lines_are_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "monotonic", lambda: 100.0)
    tool, nodes = LivenessFile(tmp_path / "7.pulse"), LivenessFile(tmp_path / f"7{NODES}")
    tool.beat("up", {})
    nodes.beat("nodes", {})
    dead = "process 7: no heartbeat for {} s; restart it"
    for now_s, well in ((100.0, True), (105.0, True), (105.6, False), (99.0, True), (94.0, False)):
        found = liveness_of_stacks(tmp_path, now_s)[7]
        age = f"{abs(now_s - 100.0):.0f}"
        assert found == (("up", "") if well else ("", f"{dead.format(age)}; safety monitor of {dead.format(age)}"))
    assert not reported_armed(tmp_path, 7), "unless it says so"
    monkeypatch.setattr(time, "monotonic", lambda: 101.0)
    nodes.beat("nodes", {}, armed=True)
    for now_s, armed in ((101.0, True), (104.0, True), (104.1, False)):
        monkeypatch.setattr(time, "monotonic", lambda now_s=now_s: now_s)
        assert reported_armed(tmp_path, 7) is armed
    (tmp_path / "7-stack.beats").mkdir()
    (tmp_path / "7-stack.beats/control").write_text("97.0")
    Memory({VARIABLE: str(tmp_path / "7-stack.beats/control")}).write((1.0,))
    assert beats(tmp_path, 7, 100.0) == {"control": 3.0}
    assert silent(beats(tmp_path, 7, 100.0)) == []
    assert silent(beats(tmp_path, 7, 100.1)) == ["control: no heartbeat for 3 s"]


@pytest.mark.parametrize(
    ("before", "now", "reported"),
    [
        (None, "", "dvl75: ok"),
        ("silence", "", "dvl75: ok"),
        ("", "", ""),
        ("", "no reading for 1.5 s", "dvl75: no reading for 1.5 s"),
        (None, "no reading for 1.5 s", "dvl75: no reading for 1.5 s"),
        ("no reading for 1.5 s", "no reading for +2-4 s", ""),
        ("no reading for 1.5 s", "no readings for 1.5 s", "dvl75: no readings for 1.5 s"),
        ("1.5", "a1", "dvl75: a1"),
    ],
)
def test_only_words_are_news(before: str | None, now: str, reported: str) -> None:
    assert health_change("dvl75", before, now) == reported
