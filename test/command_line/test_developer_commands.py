"""Commands that need the clone: `./hindrax test` and `./hindrax faults`."""

import subprocess
import sys
from types import SimpleNamespace

import pytest

from hindrax_cli import command_line


def test_a_part_that_nobody_knows_is_wrong_use(capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.main(["faults", "--only", "dvl"]) == 2
    assert "found 'dvl' (did you mean dvl75?), wanted identifier, " in capsys.readouterr().err


@pytest.mark.parametrize("words", [["-k", "dvl75"], ["test/golden", "-k", "dvl75"], ["-x", "--", "-q"]])
def test_options_of_pytest_reach_pytest(monkeypatch: pytest.MonkeyPatch, words: list[str]) -> None:
    called: list[list[str]] = []

    def started(command: list[str], **_: object) -> SimpleNamespace:
        called.append(command)
        return SimpleNamespace(wait=lambda: 0)

    monkeypatch.setattr(subprocess, "Popen", started)
    assert command_line.main(["test", *words]) == 0
    assert called == [[sys.executable, "-m", "pytest", *words]]
