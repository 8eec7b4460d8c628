"""`hindrax tune`: gains are rehearsed, printed, and written for our nodes and for an ArduSub."""

import json
from pathlib import Path

import pytest
import yaml

from hindrax_bringup.share_files import default_vehicle
from hindrax_cli import command_line
from hindrax_cli.commands.pool import tune
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.flights.step_flight import StepOutcome


@pytest.fixture
def results(tmp_path: Path) -> Path:
    truth = load_vehicle(default_vehicle()).hydrodynamics
    assert truth is not None
    motions = {}
    for axis, mass in (("surge", 12.08), ("sway", 19.43), ("heave", 22.48), ("yaw", 0.35)):
        k_q, k_l = truth.drag(axis).of(backward=False)
        values = {"k_q": k_q, "k_l": k_l, "b": 0.0, "added_mass": mass}
        motions[axis] = {key: {"value": v, "std": 0.03 * v} for key, v in values.items()} | {"speeds": [0.2, 0.8]}
    file = tmp_path / "coefficients.yaml"
    file.write_text(yaml.safe_dump({"motions": motions}))
    return file


def test_gains_are_flown_and_settle_sooner_than_those_shipped(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["tune", str(results), "--vehicle", str(default_vehicle())]
    assert command_line.main([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["left_out"] == []
    assert found["assumed"] == ["roll", "pitch"]
    assert found["axes"]["yaw"]["sensitivity"] <= 1.7
    for step in found["rehearsal"].values():
        assert step["settled"]
        assert step["settled_s"] < step["settled_s_shipped"]


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tune, "rehearsed", lambda _gains: {})


@pytest.mark.usefixtures("at_once")
def test_files_for_our_nodes_and_for_an_ardusub(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["tune", str(results), "--vehicle", str(default_vehicle()), "--to"]
    assert command_line.main([*words, "hindrax", "--out", str(tmp_path / "gains.yaml")]) == 0
    assert "holds.heading_bandwidth_radps" in (tmp_path / "gains.yaml").read_text()
    assert command_line.main([*words, "ardusub"]) == 0
    assert "\nATC_RAT_YAW_P," in capsys.readouterr().out
    assert command_line.main([*words, "table"]) == 0
    printed = capsys.readouterr().out
    assert "and margins of the worst vehicle" in printed
    assert "roll, pitch: not identified; drag and added mass of the vehicle file" in printed
    again = next(line.split()[1:] for line in printed.splitlines() if line.startswith("  ./hindrax tune "))
    again[again.index("--out") + 1] = str(tmp_path / "again.yaml")
    assert command_line.main(again) == 0, "the line that is printed does it"
    assert (tmp_path / "again.yaml").read_text() == (tmp_path / "gains.yaml").read_text()
    assert command_line.main(["tune", str(tmp_path / "nothing.yaml")]) == 2


def test_gains_that_do_not_settle_are_not_written(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    outcome = StepOutcome(14.0, 1.0, settled=False), StepOutcome(3.2, 0.001, settled=True)
    monkeypatch.setattr(tune, "rehearsed", lambda _gains: {"90 deg": outcome})
    words = ["tune", str(results), "--vehicle", str(default_vehicle()), "--to", "hindrax", "--out"]
    assert command_line.main([*words, str(tmp_path / "gains.yaml")]) == 1
    assert "rehearsal, 90 deg: not settled with these gains, in 3.2 s as shipped" in capsys.readouterr().err
    assert not (tmp_path / "gains.yaml").exists()
