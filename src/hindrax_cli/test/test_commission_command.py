"""`hindrax commission`: it judges a vehicle that is there, and no other."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace

import pytest

from hindrax_cli.command_line import main
from hindrax_cli.commands.operate import commission
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
    assert "the thrusters; `./hindrax up` starts the stack" in " ".join(captured.err.split())
    assert captured.out == ""
