"""The tables of every command on narrow screens: what a wide screen shows is there too, and whole."""

from __future__ import annotations

import re
import sys

import pytest
from rich.console import Console

from hindrax_analysis import terminal
from hindrax_analysis.screen_text import UNBOUNDED
from hindrax_bringup.clone import clone_root
from hindrax_cli.command_line import main, modules

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
"""One that prints a table and needs neither a vehicle nor minutes, by its module, or module and word."""
ELSEWHERE = {
    "bench",
    "faults",
    "montecarlo",
    "predict",
    "status",
    "step",
    "towing",
    "forced",
    "free_decay",
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
    paths = {name: root / f"{dotted.replace('.', '/')}.py" for name, dotted in modules().items()}
    found = {name for name, path in paths.items() if prints.search(path.read_text(encoding="utf-8"))}
    assert found == {name.partition(" ")[0] for name in COMMANDS} | ELSEWHERE


@pytest.mark.parametrize("command", COMMANDS)
def test_nothing_is_cut(command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    wide = printed(COMMANDS[command], UNBOUNDED, monkeypatch, capsys)
    assert len(wide) > 10
    for width in (80, 60):
        assert not wide - printed(COMMANDS[command], width, monkeypatch, capsys), f"{width} columns"
