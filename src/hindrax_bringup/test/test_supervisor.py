"""Processes that end for good, freeze, or leave their output unsafe: who gets a report, and of what."""

import fcntl
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_bringup import child_process
from hindrax_bringup import supervisor as module
from hindrax_bringup.process_state import HeldProcesses, descendants, is_stopped
from hindrax_bringup.processes import Process
from hindrax_bringup.stack_lock import FOLDER
from hindrax_bringup.supervisor import PATIENCE_S, SupervisedProcess, Supervisor
from hindrax_core.errors import HindraxError
from hindrax_drivers.nodes.deadman import SHUTDOWN_S
from hindrax_ros.heartbeat import beaten_s

PATIENT_S = 30.0
LAMPS = Process("lamps", ())
UNSAFE = replace(LAMPS, last_resort=("--dark",))
BEATS = """
import os, pathlib, subprocess, sys, time
if sys.argv[1:2] == ["--dark"]:
    print("it is dark")
    sys.exit("the fuse has blown" if sys.argv[2:] == ["broken"] else 0)
def main():
    bulb = subprocess.Popen(["sleep", "600"], start_new_session=True)
    print("lit", *sys.argv[1:], flush=True)
    pathlib.Path(os.environ["HINDRAX_HEARTBEAT"]).write_text(str(time.monotonic()))
    if sys.argv[1:] == ["still"]:
        sys.exit(75)
    time.sleep(600)
if __name__ == "__main__":
    main()
"""
"""A process that beats once, with one below it in a session of its own."""


def supervisor_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, forks: bool) -> Supervisor:
    monkeypatch.setenv(FOLDER, str(tmp_path / "runtime"))
    (tmp_path / "lamps.py").write_text(BEATS)
    path = f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"
    monkeypatch.syspath_prepend(tmp_path)
    return Supervisor(tmp_path / "logs", {"PYTHONPATH": path, "PATH": os.environ["PATH"]}, forks=forks)


@pytest.fixture(params=[False, True], ids=["executed", "forked"])
def supervisor(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Supervisor]:
    """One that executes each process, and one that forks them from itself."""
    with supervisor_of(tmp_path, monkeypatch, forks=request.param) as made:
        yield made
    sys.modules.pop("lamps", None)


def start(supervisor: Supervisor, process: Process = LAMPS, arguments: Sequence[str] = ()) -> SupervisedProcess:
    child = supervisor.start(process, arguments)
    until(lambda: beaten_s(child.heartbeat) is not None)
    return child


def stop(child: SupervisedProcess) -> None:
    os.kill(child.handle.pid, signal.SIGSTOP)
    until(lambda: is_stopped(child.handle.pid))


def until(done: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENT_S
    while not done():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def reported(supervisor: Supervisor) -> list[str]:
    """Sentences of the first look that has any."""
    found: list[str] = []

    def look() -> bool:
        found.extend(supervisor.check())
        return bool(found)

    until(look)
    return found


def test_a_process_that_is_gone_for_good_is_reported_with_its_last_words(supervisor: Supervisor) -> None:
    child = supervisor.start(Process("no_such_module.lamps", (), restart=False))
    child.handle.wait(30.0)
    (printed,) = supervisor.check()
    assert re.fullmatch(r"lamps ended with code 1 and stays down; its log is \S+/lamps\.log", printed)
    wanted = r"lamps: the process has ended for good; end of its log: .*no_such_module'?\)?; look into .*, start again"
    with pytest.raises(HindraxError, match=wanted):
        supervisor.require()


def test_a_process_is_a_child_of_its_supervisor_under_its_own_name_and_ends_with_it(supervisor: Supervisor) -> None:
    child = supervisor.start(LAMPS, ["--bright"], pipe=True)
    assert child.output is not None
    assert child.output.readline() == b"lit --bright\n"
    pid = child.handle.pid
    assert os.getpgid(pid) == pid
    assert int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1]) == os.getpid()
    assert Path(f"/proc/{pid}/comm").read_text() == "lamps\n"
    (below,) = descendants(pid)
    held = HeldProcesses([below])
    supervisor.close()
    assert child.handle.returncode in {-signal.SIGINT, 1}
    until(lambda: not held._at_work())
    held.kill(0.0)
    child.output.close()


@pytest.mark.parametrize("forks", [False, True])
def test_what_was_started_ends_when_its_supervisor_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, forks: bool
) -> None:
    made = supervisor_of(tmp_path, monkeypatch, forks=forks)
    pids = tmp_path / "pids"
    if os.fork() == 0:
        try:
            pids.write_text(str(start(made.__enter__()).handle.pid))
        finally:
            os.kill(os.getpid(), signal.SIGKILL)
    os.wait()
    held = HeldProcesses(map(int, pids.read_text().split()))
    until(lambda: not held._at_work())
    held.kill(0.0)


def test_who_has_lost_its_parent_before_it_could_say_so_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The death signal is of no use to who asks for it after the death."""
    (tmp_path / "lamps.py").write_text(BEATS)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")
    stranger = str(os.getppid())
    words = [sys.executable, "-m", child_process.__name__, stranger, "lamps"]
    done = subprocess.run(words, check=False, capture_output=True, timeout=PATIENT_S)
    assert (done.returncode, done.stdout) == (1, b"")


def test_locks_of_the_supervisor_do_not_live_on_in_what_it_forks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with supervisor_of(tmp_path, monkeypatch, forks=True) as forking, (tmp_path / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        child = start(forking)
        names = [str(one.readlink()) for one in Path(f"/proc/{child.handle.pid}/fd").iterdir()]
    assert str(tmp_path / "lock") not in names
    assert str(tmp_path / "logs" / "lamps.log") in names


def test_a_stopped_process_and_what_is_below_it_are_killed_and_it_starts_again(supervisor: Supervisor) -> None:
    child = start(supervisor)
    old, (below,) = child.handle.pid, descendants(child.handle.pid)
    held = HeldProcesses([below])
    for pid in (below, old):
        os.kill(pid, signal.SIGSTOP)
    until(lambda: is_stopped(old))
    (printed,) = reported(supervisor)
    assert printed.startswith("lamps was frozen (stopped by a signal), and killed; restarted (see ")
    assert child.handle.pid != old
    until(lambda: not held._at_work())
    held.kill(0.0)


def test_whoever_was_stopped_together_with_it_gets_time_to_continue(
    supervisor: Supervisor, monkeypatch: pytest.MonkeyPatch
) -> None:
    child = start(supervisor)
    supervisor.check()
    stop(child)
    supervisor._looked_s -= 10.0  # it was stopped too, and is continued first
    monkeypatch.setattr(module, "CONTINUED_S", 1e9)
    assert supervisor.check() == []
    os.kill(child.handle.pid, signal.SIGCONT)
    until(lambda: not is_stopped(child.handle.pid))
    monkeypatch.setattr(module, "CONTINUED_S", 0.0)
    supervisor._looked_s = 0.0
    assert supervisor.check() == []
    assert child.handle.poll() is None
    stop(child)
    assert reported(supervisor)[0].startswith("lamps was frozen (stopped by a signal), and killed")


def test_a_process_below_that_is_stopped_is_reported_once(supervisor: Supervisor) -> None:
    child = start(supervisor)
    (below,) = descendants(child.handle.pid)
    os.kill(below, signal.SIGSTOP)
    assert reported(supervisor) == [f"lamps: its process {below} is frozen"]
    supervisor._looked_s = 0.0
    assert supervisor.check() == []


def test_a_process_without_a_heartbeat_is_killed_and_one_that_has_not_begun_is_not(
    supervisor: Supervisor, monkeypatch: pytest.MonkeyPatch
) -> None:
    child = start(supervisor)
    assert supervisor.check() == []
    monkeypatch.setattr(module, "LOOK_S", 0.0)
    monkeypatch.setattr(module, "HUNG_S", 0.0)
    supervisor._awake_s = 0.0
    (printed,) = reported(supervisor)
    assert printed.startswith("lamps was frozen (no heartbeat for 0 s), and killed; restarted (see ")
    child.heartbeat.write_bytes(b"")
    assert supervisor.check() == []


def test_after_a_gap_of_its_own_it_gives_the_others_time(
    supervisor: Supervisor, monkeypatch: pytest.MonkeyPatch
) -> None:
    child = start(supervisor)
    child.heartbeat.write_text("1.0")
    monkeypatch.setattr(module, "LOOK_S", 0.0)
    assert supervisor.check() == [], "the first look comes after a gap without end"
    supervisor._awake_s = 0.0
    assert supervisor.check()[0].startswith("lamps was frozen (no heartbeat for ")


@pytest.mark.parametrize(("well_after_s", "restarts"), [(0.0, 1), (1e9, 3)])
def test_the_budget_of_restarts_refills_after_a_good_time(
    supervisor: Supervisor, monkeypatch: pytest.MonkeyPatch, well_after_s: float, restarts: int
) -> None:
    monkeypatch.setattr(module, "WELL_AFTER_S", well_after_s)
    child = start(supervisor)
    for _ in range(3):
        child.handle.kill()
        assert "restarted" in reported(supervisor)[0]
    assert child.restarts == restarts


def test_a_process_that_stood_still_begins_anew_however_often_the_machine_does(supervisor: Supervisor) -> None:
    supervisor.restarts = 1
    child = start(supervisor, arguments=["still"])
    for _ in range(3):
        (printed,) = reported(supervisor)
        assert printed.startswith("lamps stood still, and ROS may have lost it; restarted (see ")
    assert not child.ended


def test_who_receives_no_signal_is_killed_however_often_the_end_is_interrupted(
    supervisor: Supervisor, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second Ctrl-C ended the end: a process that would not go stayed behind."""
    ignore = "".join(f"    signal.signal({number:d}, signal.SIG_IGN)\n" for number in (signal.SIGINT, signal.SIGTERM))
    deaf = BEATS.replace("def main():\n", f"import signal\ndef main():\n{ignore}")
    (tmp_path / "lamps.py").write_text(deaf)
    monkeypatch.setattr(module, "PATIENCE_S", (0.5, 0.5, 2.0))
    pid = start(supervisor).handle.pid
    again = [threading.Timer(after_s, os.kill, (os.getpid(), signal.SIGINT)) for after_s in (0.2, 0.4, 0.7)]
    for one in again:
        one.start()
    supervisor.close()
    assert not Path("/proc", str(pid)).exists()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_signal_while_a_process_begins_writes_no_traceback(supervisor: Supervisor, tmp_path: Path) -> None:
    """What a process reports goes to the operator's terminal."""
    (tmp_path / "fuses.py").write_text("import signal\ndef main(): signal.raise_signal(signal.SIGINT)\n")
    child = supervisor.start(Process("fuses", ()))
    assert child.handle.wait(PATIENT_S) == -signal.SIGINT
    assert (supervisor.logs / "fuses.log").read_text() == ""


@pytest.mark.parametrize(
    ("main", "code", "written"),
    [
        ("return 3", 3, ""),
        ("sys.exit(2)", 2, ""),
        ("sys.exit()", 0, ""),
        ("raise KeyError(7)", 1, "KeyError: 7"),
    ],
)
def test_a_process_ends_with_the_code_of_its_main(
    supervisor: Supervisor, tmp_path: Path, main: str, code: int, written: str
) -> None:
    (tmp_path / "fuses.py").write_text(f"import sys\ndef main(): {main}\n")
    assert supervisor.start(Process("fuses", ())).handle.wait(PATIENT_S) == code
    assert (supervisor.logs / "fuses.log").read_text().endswith(f"{written}\n" if written else "")
    sys.modules.pop("fuses", None)


def test_an_output_that_was_not_left_safe_is_made_safe_in_its_place(
    supervisor: Supervisor, capsys: pytest.CaptureFixture[str]
) -> None:
    stop(start(supervisor, UNSAFE))
    supervisor.close()
    assert capsys.readouterr().err == "lamps had to be killed; it is dark\n"


def test_an_output_that_cannot_be_made_safe_is_reported_with_what_else_went_wrong(supervisor: Supervisor) -> None:
    def fly() -> None:
        with supervisor:
            stop(start(supervisor, UNSAFE, ["broken"]))
            raise HindraxError("the tether has another address")

    unsafe = r"lamps: neutral could not be written \(the fuse has blown\); cut the power"
    with pytest.raises(HindraxError, match=f"the tether has another address; {unsafe}"):
        fly()


def test_a_process_starts_again_though_the_folder_of_heartbeats_has_gone(supervisor: Supervisor) -> None:
    child = start(supervisor)
    shutil.rmtree(child.heartbeat.parent)
    child.handle.kill()
    assert "restarted" in reported(supervisor)[0]


def test_what_killed_tools_left_behind_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    (tmp_path / "4999999-abc.beats").mkdir()
    with Supervisor(tmp_path / "logs", {}):
        assert [path.name.partition("-")[0] for path in tmp_path.glob("*.beats")] == [str(os.getpid())]
    assert list(tmp_path.glob("*.beats")) == []


def test_who_is_not_there_neither_stands_still_nor_has_children() -> None:
    assert not is_stopped(os.getpid())
    assert not is_stopped(4999999)
    assert descendants(4999999) == []
    HeldProcesses([4999999]).kill(0.0)


def test_the_dead_man_kills_a_child_before_the_supervisor_loses_patience_with_him() -> None:
    assert PATIENCE_S[0] > SHUTDOWN_S
