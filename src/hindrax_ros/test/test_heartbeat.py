"""The heartbeat of a process: how often, where, and what becomes of one that nobody asked for."""

from pathlib import Path

import pytest

from hindrax_ros.heartbeat import MEMORY, VARIABLE, HeartbeatFile, Memory, beaten_s


def test_it_beats_at_most_once_a_second(tmp_path: Path) -> None:
    path = tmp_path / "control"
    heartbeat = HeartbeatFile({VARIABLE: str(path)})
    assert beaten_s(path) is None
    heartbeat.beat(1234567.25)
    heartbeat.beat(1234568.0)
    assert beaten_s(path) == 1234567.25
    heartbeat.beat(1234568.25)
    assert beaten_s(path) == 1234568.25


def test_a_new_process_goes_on_in_the_file_of_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "control"
    HeartbeatFile({VARIABLE: str(path)}).beat(1e9)
    HeartbeatFile({VARIABLE: str(path)}).beat(5.0)
    assert beaten_s(path) == 5.0


def test_without_a_file_or_its_folder_it_does_nothing(tmp_path: Path) -> None:
    HeartbeatFile({}).beat(1.0)
    HeartbeatFile({VARIABLE: str(tmp_path / "gone/control")}).beat(1.0)
    assert list(tmp_path.iterdir()) == []
    assert beaten_s(tmp_path / "gone/control") is None


def test_a_process_leaves_numbers_to_its_successor(tmp_path: Path) -> None:
    named = {VARIABLE: str(tmp_path / "control")}
    assert Memory(named).recall(2) is None
    Memory(named).write((0.1, -2e-9))
    assert Memory(named).recall(2) == (0.1, -2e-9)
    Memory(named).write((0.3, 0.4))
    assert Memory(named).recall(2) == (0.3, 0.4)
    assert Memory(named).recall(3) is None, "another version of the process left it"
    assert Memory({VARIABLE: str(tmp_path / "sensors")}).recall(2) is None


@pytest.mark.parametrize("left", ["", "0.1", "0.1 nan", "0.1 inf", "0.1 x", "0.1 0.2 0.3", "\xe9 1"])
def test_what_cannot_be_meant_is_not_recalled(left: str, tmp_path: Path) -> None:
    (tmp_path / f"control{MEMORY}").write_text(left, encoding="utf-8")
    assert Memory({VARIABLE: str(tmp_path / "control")}).recall(2) is None


def test_without_a_supervisor_nothing_is_left(tmp_path: Path) -> None:
    Memory({}).write((1.0,))
    assert Memory({}).recall(1) is None
    Memory({VARIABLE: str(tmp_path / "gone/control")}).write((1.0,))
    assert list(tmp_path.iterdir()) == []
