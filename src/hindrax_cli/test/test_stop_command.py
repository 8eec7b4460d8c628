"""What `hindrax stop` says of the pulses of a stack that did not obey: what the heartbeat of the dead man tells."""

import math
import os
import time
from pathlib import Path

import pytest

from hindrax_bringup.stack_lock import FOLDER, StackLock, announced
from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_cli.command_line import main
from hindrax_cli.commands.operate import up_stop as command
from hindrax_cli.commands.operate.up_stop import on_the_wire
from hindrax_drivers.nodes.thruster_settings import Settings

STACK = StackLock(4999999, mock=False, vehicle="v.yaml", folder="runs/a")


@pytest.mark.parametrize(
    ("age_s", "printed"),
    [
        (0.5, "its dead man is alive: the thrusters are neutral 0.5 s after the last command"),
        (30.0, "its dead man sends no heartbeat, so its thrusters may keep their last pulses; cut the power"),
        (math.inf, "its dead man sends no heartbeat, so its thrusters may keep their last pulses; cut the power"),
    ],
)
def test_the_heartbeat_of_the_dead_man_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, age_s: float, printed: str
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    heartbeat = tmp_path / f"{STACK.pid}-abc.beats" / "thrusters"
    heartbeat.parent.mkdir()
    heartbeat.write_text("" if math.isinf(age_s) else str(time.monotonic() - age_s))
    assert on_the_wire(STACK).startswith(printed)
    assert "cut the power" in on_the_wire(STACK)


def test_without_a_heartbeat_nothing_is_promised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    for stack in (None, STACK):
        assert on_the_wire(stack) == "whether its thrusters turn is unknown here; if they do, cut the power"


def test_nobody_else_writes_to_an_output_that_a_stack_has_in_hand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    stack = StackLock(os.getpid(), mock=False, vehicle="v.yaml", folder="runs/a")
    with announced(stack):
        assert main(["stop", "--output", "--vehicle", "v.yaml"]) == 2
    assert f"process {os.getpid()} runs" in capsys.readouterr().err


def test_a_mock_stack_does_not_keep_the_real_output_from_neutral(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    file = hindrax_file(tmp_path, ("/dev/i2c-1", "/dev/i2c-99"))
    with announced(StackLock(os.getpid(), mock=True, vehicle="v.yaml", folder="runs/a")):
        assert main(["stop", "--output", "--vehicle", str(file)]) == 1
    assert "/dev/i2c-99: neutral could not be written; cut the power" in capsys.readouterr().err


PARAMETERS = "/**/thrusters: {ros__parameters: {neutral_us: 1540.0}}"


@pytest.mark.parametrize(
    ("stop_us", "words", "wanted_us"),
    [
        (1520.0, [], 1520.0),
        (1500.0, ["--set", "thrusters.neutral_us:=1530"], 1530.0),
        (1520.0, ["--params", "PARAMETERS"], 1540.0),
        (1520.0, ["--params", "PARAMETERS", "--set", "thrusters.neutral_us:=1530"], 1530.0),
    ],
)
def test_without_a_stack_the_output_rests_where_its_node_would(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stop_us: float, words: list[str], wanted_us: float
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    file = hindrax_file(tmp_path, ("stop_us: 1500.0", f"stop_us: {stop_us}"))
    parameters = tmp_path / "tuning.yaml"
    parameters.write_text(PARAMETERS)
    written: list[Settings] = []

    def write_neutral(settings: Settings) -> int:
        written.append(settings)
        return 0

    monkeypatch.setattr(command, "write_neutral", write_neutral)
    given = [str(parameters) if word == "PARAMETERS" else word for word in words]
    assert main(["stop", "--output", "--vehicle", str(file), *given]) == 0
    assert [one.guard.neutral.thrusters for one in written] == [(wanted_us,) * 8]


def test_where_no_stack_is_announced_it_states_first_where_it_looks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def nobody(found: None, *, sim_time: bool, namespace: str) -> list[str]:
        assert "looking in the ROS graph of this terminal" in capsys.readouterr().err
        return [f"nobody answers, {found}, {sim_time}, {namespace}"]

    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setattr(command, "stop_over_ros", nobody)
    assert main(["stop"]) == 1
    assert "nobody answers, None, False, /hindrax" in capsys.readouterr().err
