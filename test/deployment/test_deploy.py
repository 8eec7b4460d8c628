"""A deployment against a stand-in for ssh that records its commands and runs them here, below a folder."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hindrax_bringup.stack_lock import FOLDER
from hindrax_cli.command_line import main
from hindrax_cli.commands.machine import deploy
from hindrax_cli.deployment import DeploymentKind, Target, kind_of, plan
from hindrax_core.errors import HindraxError, UsageError

SSH = f"""#!{sys.executable} -SE
import json, os, subprocess, sys
words = sys.argv[1:]
with open(os.environ["CALLS"], "a") as calls:
    calls.write(json.dumps(words) + "\\n")
if os.environ.get("FAIL_AT", "nothing") in words[-1]:
    sys.exit(int(os.environ["FAIL_WITH"]))
sys.exit(subprocess.run(["sh", "-c", words[-1]]).returncode)
"""
TELLS = '#!/bin/sh\necho "$(basename "$0") $*" >>"$CALLS.there"\n'


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small clone, and a PATH on which the other machine is this one."""
    if shutil.which("git") is None:
        pytest.skip("needs git: what is deployed is a commit")
    tools, clone = tmp_path / "tools", tmp_path / "clone"
    tools.mkdir()
    for name, text in {"ssh": SSH, "sudo": TELLS, "docker": TELLS}.items():
        (tools / name).write_text(text)
        (tools / name).chmod(0o755)
    for name in ("hindrax", "docker/pi/set-up.sh", "docs/old page.md", "src/new.py"):
        (clone / name).parent.mkdir(parents=True, exist_ok=True)
        (clone / name).write_text(TELLS)
        (clone / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tools}:{os.environ['PATH']}")
    monkeypatch.setenv("CALLS", str(tmp_path / "calls"))
    monkeypatch.setenv(FOLDER, str(tmp_path / "runtime"))
    monkeypatch.setattr(deploy, "clone_root", lambda: clone)
    monkeypatch.setattr("hindrax_cli.deployment.STEADY_S", 0)
    git(clone, "init", "-q")
    commit(clone)
    return tmp_path


def git(clone: Path, *words: str) -> None:
    who = ["-c", "user.name=test", "-c", "user.email=test@hindrax.invalid"]
    subprocess.run(["git", *who, *words], cwd=clone, check=True, capture_output=True)


def commit(clone: Path) -> None:
    git(clone, "add", "--all")
    git(clone, "commit", "-q", "-m", "all of it")


def calls(place: Path) -> list[list[str]]:
    file = place / "calls"
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def done_there(place: Path) -> list[str]:
    return (place / "calls.there").read_text().splitlines()


def sent(folder: Path) -> set[str]:
    return {
        str(path.relative_to(folder))
        for path in folder.rglob("*")
        if path.is_file() and ".hindrax" not in path.parts[len(folder.parts) :]
    }


def test_a_dry_run_reaches_nobody_and_shows_every_step(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["deploy", "pi@rov", "--dry-run", "--tether", "eth0:192.168.2.1"]) == 0
    printed = capsys.readouterr().out
    assert calls(place) == []
    assert printed.count("ssh pi@rov") == len(plan(Target("pi@rov"))) == 7
    assert "git archive --format=tar HEAD | ssh pi@rov cd /opt/hindrax" in printed
    assert "sudo /opt/hindrax/docker/pi/set-up.sh --tether eth0:192.168.2.1" in printed
    assert "[7/7] wait until it is healthy" in printed


def test_the_last_commit_arrives_and_is_started(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = place / "opt/hindrax"
    folder.mkdir(parents=True)
    assert main(["deploy", "pi@rov", "--with", "native", "--folder", str(folder)]) == 0, capsys.readouterr().err
    assert sent(folder) == {"hindrax", "docker/pi/set-up.sh", "docs/old page.md", "src/new.py"}
    assert done_there(place)[:2] == [f"sudo {folder}/docker/pi/set-up.sh", "hindrax setup --vehicle"]
    assert done_there(place)[2] == "sudo systemctl restart hindrax"
    assert done_there(place)[3] == f"sudo -u hindrax HINDRAX_RUNTIME_DIR=/run/hindrax {folder}/hindrax health"
    assert all(words[-2] == "pi@rov" for words in calls(place))


def test_a_second_one_removes_what_is_gone_and_keeps_what_was_made_there(place: Path) -> None:
    folder, clone = place / "opt/hindrax", place / "clone"
    folder.mkdir(parents=True)
    words = ["deploy", "pi@rov", "--with", "native", "--no-system", "--folder", str(folder)]
    assert main(words) == 0
    for name in ("runs/today/bag.mcap", "ros_ws/build/complete", "notes of mine.txt"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("kept")
    (clone / "docs/old page.md").unlink()
    (clone / "docs/new page.md").write_text("")
    commit(clone)
    (clone / "src/new.py").write_text("not committed")
    assert main(words) == 0
    kept = {"runs/today/bag.mcap", "ros_ws/build/complete", "notes of mine.txt"}
    assert sent(folder) == {"hindrax", "docker/pi/set-up.sh", "docs/new page.md", "src/new.py"} | kept
    assert (folder / "src/new.py").read_text() == TELLS
    assert done_there(place) == ["hindrax setup --vehicle", "hindrax setup --vehicle"]


def test_a_machine_without_a_clock_does_not_complain_of_every_file(
    place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("GIT_COMMITTER_DATE", "2099-01-01T00:00:00Z")
    (place / "clone/src/new.py").write_text("later")
    commit(place / "clone")
    folder = place / "opt/hindrax"
    folder.mkdir(parents=True)
    assert main(["deploy", "pi@rov", "--no-system", "--folder", str(folder)]) == 0
    assert "in the future" not in capfd.readouterr().err


def test_the_wait_for_health_ends_by_the_clock_and_states_what_was_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hindrax_cli.deployment.HEALTHY_S", 1)
    script = plan(Target("rov"))[-1].script.replace("sudo -u hindrax", "env").replace("sudo ", "echo ")
    script = script.replace("/opt/hindrax/hindrax", "/bin/false no device;")
    done = subprocess.run(["sh", "-c", f"set -e\n{script}"], capture_output=True, timeout=30, check=False)
    assert done.returncode == 1


def test_a_stack_whose_sensors_report_seconds_later_is_not_healthy_yet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a machine without devices a deployment ended well: no sensor had had its time to fail."""
    monkeypatch.setattr("hindrax_cli.deployment.HEALTHY_S", 4)
    monkeypatch.setattr("hindrax_cli.deployment.STEADY_S", 3)
    (tmp_path / "health").write_text(
        '#!/bin/sh\n[ ! -e "$0.asked" ] && touch "$0.asked" || { echo no sensor; exit 1; }\n'
    )
    (tmp_path / "health").chmod(0o755)
    script = plan(Target("rov"))[-1].script.replace("sudo -u hindrax", "env").replace("sudo ", "echo ")
    script = script.replace("/opt/hindrax/hindrax health", str(tmp_path / "health"))
    words = ["sh", "-c", f"set -e\n{script}"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=30, check=False)
    assert (done.returncode, done.stderr) == (1, "no sensor\n")
    (tmp_path / "health").write_text("#!/bin/sh\necho up\n")
    assert subprocess.run(words, capture_output=True, text=True, timeout=30, check=True).stdout == "up\n"


def test_what_is_not_committed_is_reported(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (place / "clone/src/new.py").write_text("changed")
    assert main(["deploy", "pi@rov", "--dry-run"]) == 0
    assert "1 changed files are not committed, so they are not sent" in capsys.readouterr().err


def test_an_interrupted_one_is_made_good_by_the_next(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, clone = place / "opt/hindrax", place / "clone"
    folder.mkdir(parents=True)
    words = ["deploy", "pi@rov", "--with", "native", "--no-system", "--folder", str(folder)]
    assert main(words) == 0
    (clone / "docs/old page.md").unlink()
    commit(clone)
    monkeypatch.setenv("FAIL_AT", "tar -x")
    monkeypatch.setenv("FAIL_WITH", "2")
    assert main(words) == 1
    monkeypatch.delenv("FAIL_AT")
    assert main(words) == 0
    assert sent(folder) == {"hindrax", "docker/pi/set-up.sh", "src/new.py"}


@pytest.mark.parametrize(
    ("step", "code", "wanted"),
    [
        ("uname", "255", "look: ssh does not reach pi@rov; try `ssh pi@rov` in a terminal"),
        ("tar -x", "2", "the files of the last commit: failed on pi@rov with code 2; is its disk full?"),
        ("hindrax setup", "1", "set up environment and workspace (the first time takes minutes): failed on pi@rov"),
    ],
)
@pytest.mark.usefixtures("place")
def test_a_step_that_fails_is_named_and_ends_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], step: str, code: str, wanted: str
) -> None:
    monkeypatch.setenv("FAIL_AT", step)
    monkeypatch.setenv("FAIL_WITH", code)
    place = Path(os.environ["CALLS"]).parent
    folder = place / "opt/hindrax"
    folder.mkdir(parents=True)
    assert main(["deploy", "pi@rov", "--folder", str(folder)]) == 1
    assert wanted in capsys.readouterr().err
    assert step in calls(place)[-1][-1]


def test_a_folder_that_cannot_be_entered_deletes_nothing_elsewhere(place: Path) -> None:
    bystander = place / "bystander"
    bystander.mkdir()
    (bystander / "src.txt").write_text("")
    target = Target("pi@rov", str(place / "nowhere"))
    step = plan(target)[1]
    done = subprocess.run(
        ["sh", "-c", f"set -e\n{step.script}"], cwd=bystander, input=b"", capture_output=True, check=False
    )
    assert done.returncode != 0
    assert (bystander / "src.txt").exists()


def test_without_git_or_ssh_it_states_what_to_install(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(shutil, "which", lambda tool: None if tool == "ssh" else tool)
    assert main(["deploy", "pi@rov"]) == 1
    assert "found no ssh here; sudo apt install openssh-client" in capsys.readouterr().err
    monkeypatch.undo()
    monkeypatch.setattr(deploy, "clone_root", lambda: place)
    assert main(["deploy", "pi@rov"]) == 1
    assert "is no git clone" in capsys.readouterr().err


def test_the_kind_follows_from_what_is_there() -> None:
    assert kind_of("rov", "Linux aarch64\nros\n/usr/bin/docker") is DeploymentKind.NATIVE
    assert kind_of("rov", "Linux aarch64\n/usr/bin/docker") is DeploymentKind.CONTAINER
    assert kind_of("rov", "Linux x86_64") is DeploymentKind.NATIVE
    with pytest.raises(HindraxError, match="install ROS 2 Jazzy"):
        kind_of("rov", "Linux aarch64")


def test_a_container_is_built_started_and_asked() -> None:
    scripts = [step.script for step in plan(Target("rov", kind=DeploymentKind.CONTAINER, tether="eth0:192.168.2.1"))]
    assert scripts[3] == "sudo /opt/hindrax/docker/pi/set-up.sh --container --tether eth0:192.168.2.1"
    assert scripts[4].endswith("compose.yaml build")
    assert scripts[5].endswith("up --detach")
    assert "exec -T hindrax /opt/hindrax/hindrax health" in scripts[6]


@pytest.mark.parametrize(
    ("host", "folder"), [("-oProxyCommand=x", "/opt/h"), ("", "/opt/h"), ("rov", "/opt/h;rm"), ("rov", "h")]
)
def test_words_that_ssh_would_misread_are_refused(host: str, folder: str) -> None:
    with pytest.raises(UsageError, match="wanted"):
        Target(host, folder)


@pytest.mark.parametrize("kind", list(DeploymentKind))
def test_every_script_is_a_script(kind: DeploymentKind) -> None:
    for step in plan(Target("rov", kind=kind)):
        subprocess.run(["sh", "-n"], input=step.script.encode(), check=True)
