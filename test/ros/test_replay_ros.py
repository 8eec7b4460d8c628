"""The real processes on the recorded wires of a reference bag: nothing but time may differ, and a change is found."""

import json
from pathlib import Path

import pytest

from hindrax_bag.read.recovery import recover
from hindrax_bringup.clone import clone_root
from hindrax_cli import command_line

pytestmark = pytest.mark.ros
BAG = clone_root() / "test" / "replay" / "bags" / "surge_estimates"


def test_processes_on_recorded_wires_give_what_was_recorded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short = recover(BAG, tmp_path / "short", keep=lambda _topic, after_s: after_s < 14.0).output
    out: Path = tmp_path / "again"
    assert command_line.main(["replay", "--ros", str(short), "--out", str(out), "--json"]) == 0
    (one,) = json.loads(capsys.readouterr().out)["bags"]
    assert one["differences"] == []
    assert one["fields_compared"] > 50_000
    made = json.loads(_info(out / "bag", capsys))
    assert made["finished"]
    assert made["topics"]["/hindrax/navigation/status"]["count"] > 100
    assert "/hindrax/raw/icm20948" in made["topics"]


def _info(bag: Path, capsys: pytest.CaptureFixture[str]) -> str:
    assert command_line.main(["bag", "info", str(bag), "--json"]) == 0
    return capsys.readouterr().out


def test_a_bag_without_wires_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = recover(BAG, tmp_path / "bare", keep=lambda topic, after_s: "raw/" not in topic and after_s < 3.0).output
    assert command_line.main(["replay", "--ros", str(bare)]) == 2
    assert "holds no wire frames" in capsys.readouterr().err
