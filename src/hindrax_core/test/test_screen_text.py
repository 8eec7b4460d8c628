"""Sentences break between words on a screen, and nowhere else."""

import errno
import io
import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.text import screen_text
from hindrax_core.text.screen_text import (
    UNBOUNDED,
    fitted,
    fitted_description,
    how_to_install,
    print_fitted,
    screen_width,
)

WORDS = st.lists(st.text("abc-/.", min_size=1, max_size=12), min_size=1, max_size=40)


@given(WORDS, st.integers(20, 80))
def test_every_word_stays_in_one_piece_and_no_line_is_too_long(words: list[str], width: int) -> None:
    lines = fitted(" ".join(words), width).split("\n")
    assert " ".join(" ".join(lines).split()) == " ".join(words)
    assert all(len(line) <= width for line in lines)


def test_a_path_stays_whole_and_what_follows_hangs() -> None:
    path = "/" + "x" * 40
    assert fitted(f"  see {path} now", 20) == f"  see\n    {path}\n    now"
    assert fitted("  --seed    of the noise", 20, hang=12) == "  --seed    of the\n            noise"


def test_a_line_to_be_copied_stays_whole() -> None:
    lines = "written:\n  ./hindrax vehicle show some_name\n  export SOME_VARIABLE=/some/path/to/a/file"
    assert fitted(lines, 20) == lines


def test_a_file_gets_whole_lines(tmp_path: Path) -> None:
    text = "word " * 100
    with (tmp_path / "out").open("w") as file:
        assert screen_width(file) == UNBOUNDED
        print_fitted(text, file)
    assert (tmp_path / "out").read_text() == text + "\n"
    assert screen_width(io.StringIO()) == UNBOUNDED


class Full(io.StringIO):
    """A file on a full disk."""

    def write(self, _text: str, /) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_on_a_full_disk_what_is_reported_gets_lost_and_a_result_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The words of a stack would end it."""
    monkeypatch.setattr(sys, "stderr", Full())
    print_fitted("recorder: less than 200 MB are free", sys.stderr)
    with pytest.raises(OSError, match="No space left"):
        print_fitted("k_q 66.5", Full())


def test_a_screen_is_as_wide_as_it_states(monkeypatch: pytest.MonkeyPatch) -> None:
    mine, its = pty.openpty()
    with open(its, "w", encoding="utf-8") as screen:  # noqa: PTH123  # a descriptor
        monkeypatch.setenv("COLUMNS", "60")
        assert screen_width(screen) == 60
        print_fitted("word " * 20, screen)
        lines = os.read(mine, 4096).decode().splitlines()
    os.close(mine)
    assert len(lines) == 2
    assert all(len(line) <= 60 for line in lines)


def test_paragraphs_of_a_description_flow_and_lists_and_commands_stay() -> None:
    lines = [
        "one two three",
        "four five",
        "",
        "columns, with",
        "units:",
        "  t  time",
        "./hindrax a --b c d e f g h",
        "last",
    ]
    for width in (14, UNBOUNDED):
        assert fitted_description(lines, width).split("\n") == lines
    assert fitted_description(lines[:2], 20) == "one two three four\nfive"


def test_what_a_screen_would_obey_is_shown_as_unknown(capsys: pytest.CaptureFixture[str]) -> None:
    print_fitted("topic /a\x1b[2J\x9b1m\rb\x00\n\tc é")
    assert capsys.readouterr().out == "topic /a\ufffd[2J\ufffd1m\ufffdb\ufffd\n\tc é\n"


def test_the_wheel_is_not_told_to_set_up_a_clone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(screen_text, "FROM_WHEEL", False)
    assert how_to_install("cluster") == '`./hindrax setup --all` installs it, or pip install "hindrax[cluster]"'
    monkeypatch.setattr(screen_text, "FROM_WHEEL", True)
    assert how_to_install("cluster") == 'pip install "hindrax[cluster]"'


def test_a_muted_stream_fails_no_more_at_the_end_of_its_process() -> None:
    """What stands in a buffer is flushed again when Python ends, which makes its exit code 120."""
    ends = "import sys; from hindrax_core.text.screen_text import mute; print('x'); mute(sys.stdout) if {} else None"
    found = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "PYTHONUNBUFFERED": ""}
    with Path("/dev/full").open("w") as full:
        codes = [
            subprocess.run(
                [sys.executable, "-c", ends.format(muted)], stdout=full, stderr=full, env=found, check=False
            ).returncode
            for muted in (True, False)
        ]
    assert codes == [0, 120]
