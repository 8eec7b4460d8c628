"""Tables on narrow screens, wide ones and in pipes: no name and no number is ever cut."""

import io
import math
import re
import sys

import pytest
from rich.console import Console

from hindrax_analysis import terminal
from hindrax_analysis.terminal import print_table, print_values, working
from hindrax_core.text.digits import Value
from hindrax_core.text.screen_text import UNBOUNDED, print_fitted

TOPIC = "/hindrax/navigation/a_topic_with_a_rather_long_name"
NOTE = "a sentence that may well go on for more than one line of a narrow screen"


class Screen(io.StringIO):
    """Something that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def shown(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, width: int | None) -> str:
    monkeypatch.setattr(terminal, "console", lambda: Console(width=width or UNBOUNDED, file=sys.stdout))
    rows = [(TOPIC, "k_q", "66.4801234", "10.2012345", NOTE), ("/short", "k_l", "1.25", "4.97", "")]
    print_table("Title [m/s]", ("topic", "quantity"), ("value [N]", "+-"), rows, ("note",))
    return capsys.readouterr().out


@pytest.mark.parametrize("width", [None, 160, 120, 100, 80, 60, 40])
def test_nothing_is_cut_at_any_width(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, width: int | None
) -> None:
    printed = shown(capsys, monkeypatch, width)
    for text in (TOPIC, "k_q", "66.4801234", "10.2012345", "/short", "1.25", "[m/s]", "[N]"):
        assert text in printed
    assert "…" not in printed
    assert all(word in printed for word in NOTE.split())


@pytest.mark.parametrize("width", [80, 60])
def test_a_narrow_screen_gets_every_value_behind_its_heading(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    printed = shown(capsys, monkeypatch, width)
    assert re.search(rf"^{TOPIC}  k_q$", printed, re.MULTILINE)
    assert re.search(r"^  value \[N\]: 66.4801234;  \+-: 10.2012345;", printed, re.MULTILINE)


def test_a_narrow_screen_keeps_the_unit_of_a_column_of_words(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(terminal, "console", lambda: Console(width=34, file=sys.stdout))
    row = ("T1", "+0.183  -0.135  +0.000", "-30.0 to +30.0")
    print_table("Thrusters", ("name", "forward, starboard, down [m]"), ("force [N]",), [row])
    printed = capsys.readouterr().out.splitlines()
    assert printed[1] == "T1"
    assert "forward, starboard, down [m]:" in printed[2]


def test_a_column_of_remarks_is_there_when_there_are_remarks(capsys: pytest.CaptureFixture[str]) -> None:
    for remark in ("", "disabled"):
        print_table("Thrusters", ("name",), ("force [N]", ""), [("T1", "1.00", ""), ("T2", "2.00", remark)])
        row = next(line for line in capsys.readouterr().out.splitlines() if "T2" in line)
        assert row.split("\u2502")[2:] == ([f" {remark} "] if remark else [])


def test_a_column_of_sentences_is_there_when_there_are_sentences(capsys: pytest.CaptureFixture[str]) -> None:
    for remark in ("", "slow"):
        print_table("Plan", ("motion",), ("time [s]",), [("surge", "94", remark)], ("remarks",))
        assert ("remarks" in capsys.readouterr().out) == bool(remark)


def test_names_that_are_too_long_side_by_side_stand_below_each_other(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(terminal, "console", lambda: Console(width=60, file=sys.stdout))
    print_table("", ("topic", "type"), ("messages",), [(TOPIC, "hindrax_msgs/msg/NavigationStatus", "605")])
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == [TOPIC, "hindrax_msgs/msg/NavigationStatus"]


@pytest.mark.parametrize("width", [120, 40])
def test_brackets_in_a_cell_are_text(
    width: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(terminal, "console", lambda: Console(width=width, file=sys.stdout))
    bag = "runs[pool]/monday[red]/:camera:/bag"
    print_table("bags below runs[pool]/:camera:", ("bag",), ("MB",), [(bag, "1.2")], ("",))
    printed = capsys.readouterr().out
    assert "bags below runs[pool]/:camera:" in printed
    assert bag in printed


def test_a_pipe_gets_whole_lines(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert re.search(rf"{TOPIC}.*66.4801234.*{NOTE}", shown(capsys, monkeypatch, None))


@pytest.mark.parametrize(
    ("value", "std", "texts"),
    [
        (2006.00875, 382.49, ("2006", "382")),
        (15.375, 0.23612, ("15.38", "0.24")),
        (0.0021717, 0.00039426, ("0.00217", "0.00039")),
        (-4.2621e-07, 7.6684e-08, ("-4.26e-07", "7.7e-08")),
        (1e-9, 2e-5, ("1e-09", "2.0e-05")),
        (0.5, math.nan, ("0.5", "")),
    ],
)
def test_a_table_of_values_has_the_digits_that_the_deviation_leaves(
    value: float, std: float, texts: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    print_values("Fit", [("c", Value(value, std), "N")])
    row = capsys.readouterr().out.splitlines()[-1]
    assert [cell.strip() for cell in row.split("\u2502")] == ["c", *texts, "N"]


def test_long_work_is_reported_on_a_terminal_alone(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with working("identifying over pool"):
        pass
    assert capsys.readouterr() == ("", "")
    screen = Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with working("identifying over [pool]"):
        print_fitted("a result")
    assert "identifying over [pool]" in screen.getvalue()
    assert capsys.readouterr().out == "a result\n"
