"""The heartbeat of a process: how often, where, and what becomes of one that nobody asked for."""

from pathlib import Path

from hindrax_ros.heartbeat import VARIABLE, Heartbeat, beaten_s


def test_it_beats_at_most_once_a_second(tmp_path: Path) -> None:
    path = tmp_path / "control"
    heartbeat = Heartbeat.of({VARIABLE: str(path)})
    assert beaten_s(path) is None
    heartbeat.beat(1234567.25)
    heartbeat.beat(1234568.0)
    assert beaten_s(path) == 1234567.25
    heartbeat.beat(1234568.25)
    assert beaten_s(path) == 1234568.25


def test_a_new_process_goes_on_in_the_file_of_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "control"
    Heartbeat(str(path)).beat(1e9)
    Heartbeat(str(path)).beat(5.0)
    assert beaten_s(path) == 5.0


def test_without_a_file_or_its_folder_it_does_nothing(tmp_path: Path) -> None:
    Heartbeat.of({}).beat(1.0)
    Heartbeat(str(tmp_path / "gone/control")).beat(1.0)
    assert list(tmp_path.iterdir()) == []
    assert beaten_s(tmp_path / "gone/control") is None
