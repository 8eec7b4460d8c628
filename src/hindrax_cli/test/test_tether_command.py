"""`./hindrax up` with a tether, and `./hindrax health`."""

from pathlib import Path

import pytest

from hindrax_bringup.liveness import tool_liveness
from hindrax_bringup.network.tether import SETTING, Tether
from hindrax_bringup.stack_lock import FOLDER
from hindrax_bringup.stack_process import UpOptions
from hindrax_cli.command_line import main
from hindrax_cli.commands.operate import up_stop as up


@pytest.fixture(autouse=True)
def own_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path / "runtime"))
    monkeypatch.setenv(SETTING, "")


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["up"], Tether("eth0", ("192.168.2.1",))),
        (["up", "--mock"], None),
        (["up", "--mock", "--tether", "eth1"], Tether("eth1")),
        (["up", "--tether", "eth1"], Tether("eth1")),
    ],
)
def test_a_mock_keeps_to_this_machine_unless_asked_by_name(
    monkeypatch: pytest.MonkeyPatch, words: list[str], wanted: Tether | None
) -> None:
    monkeypatch.setenv(SETTING, "eth0:192.168.2.1")
    found: list[UpOptions] = []
    monkeypatch.setattr(up, "become", found.append)
    main(words)
    assert [one.tether for one in found] == [wanted]
    assert [UpOptions.from_json(one.to_json()) for one in found] == found, "what its process reads"


def test_health_is_one_sentence_and_an_exit_code(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["health"]) == 1
    assert "no stack is up here" in capsys.readouterr().err
    with tool_liveness() as beating:
        beating.beat("up", {})
        assert main(["health"]) == 0
    assert capsys.readouterr().out == "up\n"
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(FOLDER, str(tmp_path / "file/below"))
    assert main(["health"]) == 1
    assert "no stack of this user can be up here" in capsys.readouterr().err
