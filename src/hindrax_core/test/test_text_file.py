"""Files of text: whole or as they were, and the question beforehand."""

import contextlib
import errno
import os
import resource
import shutil
import stat
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.text_file import nothing_left, replace_text, require_place, writing


@contextlib.contextmanager
def no_room() -> Iterator[None]:
    """No file may grow beyond 100 bytes, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_file_is_written_and_keeps_its_mode_and_the_link_to_it(tmp_path: Path) -> None:
    file, link = tmp_path / "file.yaml", tmp_path / "link.yaml"
    replace_text(file, "first")
    assert stat.S_IMODE(file.stat().st_mode) == 0o666 & ~_umask()
    file.chmod(0o640)
    link.symlink_to(file)
    replace_text(link, "second \u00b1")
    assert file.read_text(encoding="utf-8") == "second \u00b1"
    assert link.is_symlink()
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    assert sorted(tmp_path.iterdir()) == [file, link]


def test_without_room_the_file_is_as_it_was(tmp_path: Path) -> None:
    file = tmp_path / "vehicle.yaml"
    file.write_text("mass_kg: 11.4")
    with no_room(), pytest.raises(OSError, match="File too large"):
        replace_text(file, "x" * 1000)
    assert file.read_text() == "mass_kg: 11.4"
    assert list(tmp_path.iterdir()) == [file]


def test_where_nothing_can_be_made_beside_it_the_file_itself_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = Path.open

    def closed(file: Path, mode: str = "r", **options: Any) -> Any:
        if not file.exists():
            raise PermissionError(errno.EACCES, "Permission denied")
        return opened(file, mode, **options)

    file = tmp_path / "vehicle.yaml"
    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", closed)
        with pytest.raises(PermissionError):
            replace_text(file, "first")
        opened(file, "x").close()
        replace_text(file, "second")
    assert file.read_text() == "second"


def test_a_pipe_gets_the_text(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    require_place(pipe)
    replace_text(pipe, "text")
    assert os.read(reader, 100) == b"text"
    os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_place_is_tried_without_a_trace(tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    require_place(file)
    assert not list(tmp_path.iterdir())
    file.write_text("before")
    require_place(file)
    assert file.read_text() == "before"


@pytest.mark.parametrize(("name", "why"), [("", "Is a directory"), ("none/page.html", "No such file or directory")])
def test_a_place_that_takes_no_file_is_reported(tmp_path: Path, name: str, why: str) -> None:
    with pytest.raises(HindraxError, match=rf"{name}: cannot be written \({why}\); make room or name another place"):
        require_place(tmp_path / name)


@pytest.mark.parametrize(
    ("number", "kind"),
    [
        (errno.EACCES, UsageError),
        (errno.EROFS, UsageError),
        (errno.ENOTDIR, UsageError),
        (errno.ENOSPC, HindraxError),
        (errno.EIO, HindraxError),
        (errno.EFBIG, HindraxError),
    ],
)
def test_a_wrong_place_is_wrong_use_and_a_full_or_broken_disk_is_not(number: int, kind: type[HindraxError]) -> None:
    with pytest.raises(HindraxError) as raised, writing("a.html"):
        raise OSError(number, "why")
    assert type(raised.value) is kind


def test_a_full_disk_is_reported_beforehand_and_one_that_shows_no_size_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for total, free, refused in ((10**9, 999_999, True), (10**9, 10**6, False), (0, 0, False)):
        monkeypatch.setattr(
            shutil, "disk_usage", lambda _, sizes=(total, free): SimpleNamespace(total=sizes[0], free=sizes[1])
        )
        with pytest.raises(HindraxError, match="No space left on device") if refused else contextlib.nullcontext():
            require_place(tmp_path / "report.html")
        assert not list(tmp_path.iterdir())


def interrupted(file: Path, failure: type[BaseException]) -> None:
    with nothing_left(file):
        file.write_text("half")
        raise failure


@pytest.mark.parametrize("failure", [OSError, KeyboardInterrupt])
def test_nothing_is_left_of_a_file_that_was_not_finished(tmp_path: Path, failure: type[BaseException]) -> None:
    fresh, old = tmp_path / "fresh.png", tmp_path / "old.png"
    old.write_text("before")
    for file in (fresh, old):
        with pytest.raises(failure):
            interrupted(file, failure)
    assert list(tmp_path.iterdir()) == [old]
    with nothing_left(fresh):
        fresh.write_text("whole")
    assert fresh.read_text() == "whole"


def test_of_the_folders_that_were_made_only_those_that_hold_something_are_left(tmp_path: Path) -> None:
    file = tmp_path / "made/used/empty/file"

    def filled() -> None:
        file.parent.mkdir(parents=True)
        (tmp_path / "made/used/log").touch()
        raise OSError("full")

    with pytest.raises(OSError, match="full"), nothing_left(file):
        filled()
    assert [one.name for one in sorted(tmp_path.rglob("*"))] == ["made", "used", "log"]


def _umask() -> int:
    found = os.umask(0)
    os.umask(found)
    return found
