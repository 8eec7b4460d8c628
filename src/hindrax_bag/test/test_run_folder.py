"""How runs are named, what is left of one that has no room, and which of them make room."""

import errno
import os
import shutil
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from hindrax_bag import run_folder
from hindrax_core.errors import HindraxError


@pytest.mark.parametrize(("year", "name"), [(1970, "undated"), (2026, "2026-01-01_00-00-40")])
def test_every_boot_without_a_clock_has_a_run_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, year: int, name: str
) -> None:
    monkeypatch.setattr(run_folder, "RUNS", tmp_path)
    made = []
    for _ in range(3):
        made.append(run_folder.new_run(datetime(year, 1, 1, 0, 0, 40, tzinfo=UTC)))
        made[-1].mkdir()
    assert [path.name for path in made] == [name, f"{name}_1", f"{name}_2"]


def test_only_the_oldest_finished_runs_make_room(tmp_path: Path) -> None:
    runs, elsewhere = tmp_path / "runs", tmp_path / "elsewhere"
    for age, path in enumerate((runs / "flying", runs / "old", runs / "older_name", runs / "new", elsewhere)):
        (path / "bag").mkdir(parents=True)
        (path / "bag/bag_0.mcap").write_bytes(bytes(1000))
        (path / "vehicle.yaml").touch()
        os.utime(path / "vehicle.yaml", (age, age))
    (runs / "linked").symlink_to(elsewhere)
    (runs / "notes").mkdir()
    (runs / "notes/diary.txt").write_bytes(bytes(5000))
    removed = list(run_folder.remove_oldest(runs, 2500.0, [runs / "flying"]))
    assert {path.name for path in runs.iterdir()} == {"flying", "new", "linked", "notes"}
    assert elsewhere.exists()
    assert [one.partition(":")[0] for one in removed] == [str(runs / "old"), str(runs / "older_name")]
    assert removed[-1].endswith("removed, 0.0 MB; the runs take 0.0 MB now")
    assert list(run_folder.remove_oldest(runs, 2500.0, [])) == []
    assert len(list(run_folder.remove_oldest(runs, 0.0, []))) == 2


@pytest.mark.parametrize("free", [0, 10**9])
def test_nothing_is_left_of_a_run_that_has_no_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free: int) -> None:
    def copied(_source: Path, target: Path) -> None:
        target.touch()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=free))
    monkeypatch.setattr(shutil, "copyfile", copied)
    with pytest.raises(HindraxError, match=r"is full: 0 MB are free|No space left on device"):
        run_folder.make_run_folder(str(tmp_path / "day" / "run"), tmp_path / "vehicle.yaml")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("another", [False, True])
def test_a_run_that_never_began_takes_the_folders_that_were_made_for_it_along(tmp_path: Path, *, another: bool) -> None:
    (vehicle := tmp_path / "vehicle.yaml").touch()
    folder = run_folder.make_run_folder(str(tmp_path / "new" / "runs" / "run"), vehicle)
    if another:
        (tmp_path / "new" / "runs" / "other").mkdir()
    folder.remove()
    left = {str(one.relative_to(tmp_path)) for one in tmp_path.rglob("*")}
    assert left == {"vehicle.yaml"} | ({"new", "new/runs", "new/runs/other"} if another else set())
