"""How tools find the stacks that run."""

import errno
import json
from pathlib import Path
from typing import NoReturn

import pytest

from hindrax_bringup.stack_lock import FOLDER, locked, stacks


def test_no_stack_runs_while_systemd_restarts_the_service_and_its_folder_is_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(FOLDER, "/dev/null/hindrax")
    assert stacks() == []


def test_a_stack_that_ends_meanwhile_does_not_end_who_looks(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    (tmp_path / "17.json").symlink_to(tmp_path / "taken-away")
    assert stacks() == []


def test_a_file_that_finds_no_room_is_named_and_leaves_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def full(*_: object) -> NoReturn:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(json, "dump", full)
    with pytest.raises(OSError, match=r"No space left on device: .*17\.json"):
        locked(tmp_path / "17.json", {})
    assert list(tmp_path.iterdir()) == []
