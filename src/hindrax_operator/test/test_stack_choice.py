"""How commands in other terminals find a stack: exactly while the tool that started it lives."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_bringup.ros_graph import graph_settings
from hindrax_bringup.stack_lock import FOLDER, StackLock, announced, choose, runtime_folder, stacks
from hindrax_core.errors import UsageError

ONE = StackLock(11, mock=True, vehicle="v.yaml", folder="runs/a", graph={"ROS_DOMAIN_ID": "7"}, ports={"dvl75": "/p"})
OTHER = StackLock(12, mock=False, vehicle="v.yaml", folder="runs/b")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(FOLDER, str(tmp_path / "runtime"))
    return tmp_path / "runtime"


def found_elsewhere() -> list[int]:
    """What another process sees: within one process a lock does not exclude its owner."""
    words = (
        "import json; from hindrax_bringup.stack_lock import stacks; print(json.dumps([one.pid for one in stacks()]))"
    )
    environment = dict(os.environ) | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", words], env=environment, capture_output=True, check=True)
    found: list[int] = json.loads(done.stdout)
    return found


def test_a_stack_is_found_while_it_runs_and_not_after() -> None:
    with announced(ONE), announced(OTHER):
        assert found_elsewhere() == [11, 12], "the oldest first"
    assert found_elsewhere() == []


def test_everything_about_it_is_found() -> None:
    with announced(ONE):
        assert stacks() == [ONE]


def test_what_a_killed_tool_left_behind_is_not_a_stack(folder: Path) -> None:
    runtime_folder()
    (folder / "99.json").write_text(json.dumps({"pid": 99, "mock": True, "vehicle": "", "folder": ""}))
    assert stacks() == []
    assert not (folder / "99.json").exists()


def test_a_file_that_makes_no_sense_is_passed_over() -> None:
    with announced(ONE) as path:
        path.write_text("{ not json")
        assert stacks() == []


def test_the_folder_is_for_its_user_alone(folder: Path) -> None:
    assert runtime_folder() == folder
    assert folder.stat().st_mode & 0o077 == 0


def test_the_only_stack_is_meant_and_of_several_one_must_be_named() -> None:
    assert choose([], None) is None
    assert choose([ONE], None) == ONE
    assert choose([ONE, OTHER], 12) == OTHER
    with pytest.raises(UsageError, match=r"--stack PID; 11 \(mock vehicle, ROS domain 7, process 11\); 12"):
        choose([ONE, OTHER], None)
    with pytest.raises(UsageError, match="--stack 13: no such stack; 11"):
        choose([ONE], 13)
    with pytest.raises(UsageError, match="none is up"):
        choose([], 13)


def test_a_stack_that_waits_for_an_operator_goes_before_a_pool_test() -> None:
    flying = replace(OTHER, purpose="pool-test")
    assert choose([flying, ONE], None) == ONE
    assert choose([flying], None) == flying
    assert flying.title == "pool-test, vehicle, ROS domain 0, process 12"
    with pytest.raises(UsageError, match="found 2 stacks"):
        choose([flying, flying], None)


def test_of_an_environment_only_the_graph_is_kept() -> None:
    found = graph_settings({"HOME": "/root", "ROS_DOMAIN_ID": "5", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4", "RMW_X": "y"})
    assert found == {"ROS_DOMAIN_ID": "5", "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4", "RMW_X": "y"}
    assert graph_settings({})["ROS_DOMAIN_ID"] == "0"
