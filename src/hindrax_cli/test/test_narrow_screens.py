"""The tables of every command on narrow screens: what a wide screen shows is there too, and whole."""

import re
import shlex
import subprocess
import sys

import pytest
from rich.console import Console

from hindrax_analysis import terminal
from hindrax_bringup.clone import clone_root
from hindrax_cli import command_line
from hindrax_cli.command import MODULES
from hindrax_cli.command_line import load, main, parser_of, print_overview
from hindrax_cli.commands.machine import doctor
from hindrax_cli.health_checks import Check
from hindrax_core.text import screen_text
from hindrax_core.text.screen_text import COMMAND, UNBOUNDED
from hindrax_tools.reference.commands import words_of

BAGS = clone_root() / "test" / "replay" / "bags"
COMMANDS = {
    "allocate": "allocate --wrench 14 0 2 0 0 0.5 --disable T3",
    "estimate": "estimate --vehicle hindrax",
    "vehicle": "vehicle show hindrax",
    "papers": "papers",
    "bag": f"bag info {BAGS / 'surge_estimates'}",
    "bag list": f"bag list {BAGS}",
    "identify": f"identify {BAGS / 'surge'}",
}
"""One that prints a table and needs neither a vehicle nor minutes, by its name, or name and word."""
ELSEWHERE = {
    "bench",
    "faults",
    "montecarlo",
    "predict",
    "status",
    "step",
    "towing",
    "forced",
    "free-decay",
    "bollard",
    "pendulum",
    "weigh",
}
"""They print with the same two functions, but need minutes, a stack or a record that their own tests make."""
HEADINGS = ("\u250f", "\u2503", "\u2521")
FRAME = re.compile("[\u2500-\u257f;]")


def printed(words: str, width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> set[str]:
    """Words that are printed, without headings: names stand there without theirs where a row has lines of its own."""
    monkeypatch.setattr(terminal, "console", lambda: Console(width=width, file=sys.stdout))
    main(words.split())
    said = capsys.readouterr().out
    assert "\u2026" not in said
    lines = [line for line in said.splitlines() if not line.startswith(HEADINGS)]
    return {word for line in lines for word in FRAME.sub(" ", line).split()}


def test_every_command_that_prints_tables_is_here() -> None:
    prints = re.compile(r"\b(print_table\(|print_values\(|show\(found)")
    root = clone_root() / "src" / "hindrax_cli"
    paths = {dotted: root / f"{dotted.replace('.', '/')}.py" for dotted in MODULES.values()}
    found = {dotted for dotted, path in paths.items() if prints.search(path.read_text(encoding="utf-8"))}
    assert found == {MODULES[name.partition(" ")[0]] for name in (*COMMANDS, *ELSEWHERE)}


@pytest.mark.parametrize("name", MODULES)
def test_the_help_of_a_command_breaks_between_words(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    # argparse keeps options that exclude each other on one line.
    lines = [line for line in parser_of(load(name)).format_help().splitlines() if " | " not in line]
    assert not [line for line in lines if len(line) > 60 and " " in line.strip() and not COMMAND.search(line)]


@pytest.mark.parametrize("name", MODULES)
def test_the_help_of_a_command_keeps_its_words_whole(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    wide = parser_of(load(name)).format_help().split()
    monkeypatch.setenv("COLUMNS", "60")
    assert parser_of(load(name)).format_help().split() == wide


@pytest.mark.parametrize("name", MODULES)
def test_an_example_can_be_pasted(name: str) -> None:
    """Into any shell: one without remarks after a command takes it, and the command takes its words."""
    parser = parser_of(load(name))
    for one in (parser, *words_of(parser)):
        example = (one.epilog or "").removeprefix("example:\n")
        lines = [line for line in example.splitlines() if not line.startswith("  # ")]
        assert lines
        assert all(line.startswith("  ") and len(line) <= 60 for line in example.splitlines() if line not in lines)
        for line in lines:
            assert subprocess.run(["bash", "-n", "-c", line], check=False).returncode == 0, line
            tool, command, *words = shlex.split(line.split(" || ")[0].strip().removeprefix("sudo "))
            if tool != "ros2":
                assert (tool, command) == ("./hindrax", name)
                parser.parse_args(words)


def test_the_overview_breaks_between_words(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for module in (command_line, screen_text):
        monkeypatch.setattr(module, "screen_width", lambda _: 60)
    print_overview()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > len(MODULES)
    assert not [line for line in lines if len(line) > 60]


@pytest.mark.parametrize("command", COMMANDS)
def test_nothing_is_cut(command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    wide = printed(COMMANDS[command], UNBOUNDED, monkeypatch, capsys)
    assert len(wide) > 10
    for width in (80, 60):
        assert not wide - printed(COMMANDS[command], width, monkeypatch, capsys), f"{width} columns"


def test_a_title_that_is_longer_than_the_screen_breaks_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(terminal, "console", lambda: Console(width=40, file=sys.stdout))
    table = terminal.make_table("Drag force at shares of the tested speed", ["motion"], ["a long heading of a number"])
    table.add_row("surge", "1.234")
    terminal.print_table(table)
    assert all(len(line) <= 40 for line in capsys.readouterr().out.splitlines())
    wide = terminal.make_table("Drag force at shares of the tested speed: relative error", ["motion"], ["x" * 30])
    wide.add_row("surge", "1.234")
    terminal.print_table(wide)
    assert capsys.readouterr().out.splitlines()[:2] == ["Drag force at shares of the tested", "  speed: relative error"]


@pytest.mark.parametrize("width", [200, 80, 60, 40])
def test_the_doctor_cuts_nothing(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(doctor, "console", lambda: Console(width=width, file=sys.stdout))
    port, sentence = "mock:/tmp/hindrax-v7u9iiwn/of/some/length/i2c", "check cable and power; " * 4
    doctor.show(
        [Check("ros", "ROS 2 jazzy"), Check(port, "socket"), Check("dvl75", f"none at {port}", sentence.strip())]
    )
    said = capsys.readouterr().out
    assert "\u2026" not in said
    bare = "".join(said.split())
    for words in (port, f"noneat{port}", "".join(f"-> {sentence}".split())):
        assert words in bare
    assert all(len(line) <= width for line in said.splitlines()[:-1])
