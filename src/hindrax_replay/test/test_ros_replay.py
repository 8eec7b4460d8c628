"""Recorded wires among real processes: what counts as their end."""

import shutil
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from hindrax_bag.message_comparison import TOLERANCES, load_rules
from hindrax_bag.read.survey import Survey
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.processes import REPLAY
from hindrax_bringup.supervisor import SupervisedProcess, Supervisor
from hindrax_core.errors import HindraxError, UsageError
from hindrax_replay import ros_replay
from hindrax_replay.ros_replay import _wait, replay_ros


class EndsAtTheSecondLook:
    """A process that ends between two looks, with this code."""

    def __init__(self, code: int) -> None:
        self.code, self.looks = code, 0
        self.returncode: int | None = None

    def poll(self) -> int | None:
        self.looks += 1
        self.returncode = self.code if self.looks > 1 else None
        return self.returncode


@pytest.mark.parametrize("code", [0, 1])
def test_a_record_at_its_end_is_no_process_that_is_missing(tmp_path: Path, code: int) -> None:
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs/replay.log").write_text("no such bag\n", encoding="utf-8")
    handle = cast("Any", EndsAtTheSecondLook(code))
    wires = SupervisedProcess(REPLAY, (), handle, tmp_path / "heartbeat", time.monotonic())
    supervisor = Supervisor(tmp_path / "logs", {})
    supervisor.children["replay"] = wires
    folder = RunFolder(tmp_path)
    if code == 0:
        _wait(wires, supervisor, folder, 60.0)
        assert wires.ended, "the supervisor saw it first"
    else:
        with pytest.raises(HindraxError, match=r"the replayed wires ended; .*no such bag"):
            _wait(wires, supervisor, folder, 60.0)


def test_a_folder_that_cannot_be_made_is_reported_before_anything_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros_replay, "survey", Survey)
    monkeypatch.setattr(ros_replay, "_run", lambda *_: pytest.fail("it started"))
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match=r"file/out: cannot be written \(Not a directory\); name another folder"):
        replay_ros(tmp_path / "bag", load_rules(TOLERANCES, "ros"), out=tmp_path / "file" / "out")


def test_a_disk_without_room_keeps_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros_replay, "survey", Survey)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(total=1, free=0))
    with pytest.raises(HindraxError, match="No space left on device"):
        replay_ros(tmp_path / "bag", load_rules(TOLERANCES, "ros"), out=tmp_path / "day" / "out")
    assert list(tmp_path.iterdir()) == []
