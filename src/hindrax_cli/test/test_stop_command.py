"""What `hindrax stop` says of the pulses of a stack that did not obey: what the heartbeat of the dead man tells."""

from __future__ import annotations

import math
import os
import time
from pathlib import Path

import pytest

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack_lock import FOLDER, StackLock, announced
from hindrax_cli.commands.operate.stop import neutral_on_output, on_the_wire
from hindrax_core.errors import HindraxError, UsageError

STACK = StackLock(4999999, mock=False, vehicle="v.yaml", folder="runs/a")


@pytest.mark.parametrize(
    ("age_s", "said"),
    [
        (0.5, "its dead man lives: half a second after the last command they are neutral"),
        (30.0, "its dead man does not beat, so its thrusters may go on with their last pulses; cut the power"),
        (math.inf, "its dead man does not beat, so its thrusters may go on with their last pulses; cut the power"),
    ],
)
def test_the_heartbeat_of_the_dead_man_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, age_s: float, said: str
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    heartbeat = tmp_path / f"{STACK.pid}-abc.beats" / "thrusters"
    heartbeat.parent.mkdir()
    heartbeat.write_text("" if math.isinf(age_s) else str(time.monotonic() - age_s))
    assert on_the_wire(STACK).startswith(said)
    assert "cut the power" in on_the_wire(STACK)


def test_without_a_heartbeat_nothing_is_promised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    for stack in (None, STACK):
        assert on_the_wire(stack) == "nothing here tells whether its thrusters turn; if they do, cut the power"


def test_nobody_else_writes_to_an_output_that_a_stack_has_in_hand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    stack = StackLock(os.getpid(), mock=False, vehicle="v.yaml", folder="runs/a")
    with announced(stack), pytest.raises(UsageError, match=f"process {os.getpid()} runs"):
        neutral_on_output("v.yaml")


def test_a_mock_stack_does_not_keep_the_real_output_from_neutral(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    file = tmp_path / "v.yaml"
    file.write_text(default_vehicle().read_text().replace("/dev/i2c-1", "/dev/i2c-99"))
    with (
        announced(StackLock(os.getpid(), mock=True, vehicle="v.yaml", folder="runs/a")),
        pytest.raises(HindraxError, match="/dev/i2c-99: neutral could not be written; cut the power"),
    ):
        neutral_on_output(str(file))
