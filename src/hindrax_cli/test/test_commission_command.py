"""`hindrax commission`: it judges a vehicle that is there, and no other."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from hindrax_analysis import terminal
from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_cli.command_line import main
from hindrax_cli.commands.operate import commission
from hindrax_control.commissioning.findings import OPEN, PROVEN, TRIM, WRONG, Finding, Findings
from hindrax_core.errors import HindraxError
from hindrax_operator import commissioning_run


def silent(_: object, limit_s: float, what: Callable[[], str]) -> None:
    raise HindraxError(f"waited {limit_s:.0f} s for {what()}")


@contextmanager
def nobody(*_: object, **__: object) -> Iterator[SimpleNamespace]:
    yield SimpleNamespace(awaited=silent, thrusters=None)


def test_without_a_stack_no_claim_is_judged(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(commission, "joined", nobody)
    monkeypatch.setattr(commission, "ordered_stack", lambda _: None)
    monkeypatch.setattr(commissioning_run, "commission_beside", lambda *_, **__: pytest.fail("judged"))
    assert main(["commission"]) == 1
    captured = capsys.readouterr()
    assert "the thrusters; `./hindrax health` shows the state of its stack" in " ".join(captured.err.split())
    assert captured.out == ""


@pytest.mark.parametrize(("world", "hinted"), [("pool", True), ("center_of_mass=0.006", False)])
def test_who_cannot_trim_a_drawn_list_is_told_what_to_draw_instead(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, world: str, hinted: bool
) -> None:
    lists = Findings((Finding(TRIM, WRONG, "level", "roll -27.6, pitch -0.1 deg", remedy="trim it"),), "it lists")
    monkeypatch.setattr(commission, "_in_mock", lambda _: (lists, SimpleNamespace(path=tmp_path), ""))
    assert main(["commission", "--mock", "--world", world]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert ("another --seed, or --world pool,center_of_mass=0.001" in said) is hinted
    assert "trim it" in said


def test_what_is_in_doubt_comes_first_and_the_folder_has_the_whole_table(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    thrusters = tuple(Finding(f"T{at}", PROVEN, f"channel {at}", "pushes as claimed, 84 %") for at in range(1, 20))
    found = Findings((*thrusters, Finding("ms5837 direction", OPEN, "deeper is more", "the vehicle was not dived")))
    monkeypatch.setattr(commission, "_in_mock", lambda _: (found, SimpleNamespace(path=tmp_path), ""))
    monkeypatch.setattr(terminal, "screen_rows", lambda: 23)
    assert main(["commission", "--mock", "--write", "--json", "--vehicle", str(hindrax_file(tmp_path))]) == 1
    assert json.loads(capsys.readouterr().out)["written"] is False, "advice is nothing that was written"
    assert main(["commission", "--mock"]) == 1
    printed = capsys.readouterr().out
    assert printed.startswith("open: ms5837 direction\n")
    assert "channel 7" not in printed
    assert "as claimed, or measured: T1, T2, " in printed
    assert "commission it again, with room to turn and to dive" in printed
    (named,) = (line for line in printed.splitlines() if line.startswith("the whole table: "))
    assert Path(named.partition(": ")[2]) == tmp_path / "commissioning.txt"
    whole = (tmp_path / "commissioning.txt").read_text(encoding="utf-8")
    assert [
        words for words in ("channel 7", "pushes as claimed", "the vehicle was not dived") if words not in whole
    ] == []


def test_what_ended_early_is_not_called_proven() -> None:
    proven = Finding("T1", PROVEN, "channel 0", "pushes as claimed")
    assert Findings((proven,)).sentence == "everything is proven"
    assert Findings((proven,), "it tilted").sentence == "it ended early"
