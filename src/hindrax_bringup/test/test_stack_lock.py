"""How tools find the stacks that run."""

from pathlib import Path

import pytest

from hindrax_bringup.stack_lock import FOLDER, stacks


def test_no_stack_runs_while_systemd_restarts_the_service_and_its_folder_is_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(FOLDER, "/dev/null/hindrax")
    assert stacks() == []


def test_a_stack_that_ends_meanwhile_does_not_end_who_looks(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    (tmp_path / "17.json").symlink_to(tmp_path / "taken-away")
    assert stacks() == []
