"""`hindrax weigh` as an operator uses it: in mock, from a record, into the vehicle file."""

import argparse
import json
import math
import os
import select
import sys
from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis.identification.known_weight import Hold, Weighing
from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_cli.command_line import main
from hindrax_cli.commands.experiment import weigh
from hindrax_core.errors import HindraxError
from hindrax_core.vehicle import AxisGain, load_vehicle
from hindrax_ident.model.motion_model import model_of
from hindrax_ident.online.session import Session
from hindrax_ident.remedies import WEIGH_THRUST
from hindrax_ident.testing.synthetic_runs import DVL, back_and_forth, events, fly
from hindrax_sim.flights import weighing_flight

SURGE = np.array([66.48, 1.25, 0.0, 27.3])
COMMENT = "# Poses are not published"


@pytest.fixture
def vehicle_file(tmp_path: Path) -> Path:
    return hindrax_file(tmp_path)


def test_in_mock_it_finds_what_the_thrusters_lack_and_keeps_it(
    vehicle_file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(weigh, "SHARES", (0.0, 1.0))
    monkeypatch.setattr(weighing_flight, "SETTLE_S", 20.0)
    monkeypatch.setattr(weighing_flight, "RAMP_per_s", 0.5)
    monkeypatch.setattr(weighing_flight, "HOLD_S", 5.0)
    words = ["weigh", "surge", "--mock", "--world", "thrust_gain=-0.05", "--load", "8", "--one-way"]
    assert main([*words, "--vehicle", str(vehicle_file), "--write", "--json"]) == 0
    gain = json.loads(capsys.readouterr().out)["weighing"]["gain"]
    assert abs(gain["negative"] - 0.95) < 3.0 * gain["sigma"]
    assert gain["sigma"] < 0.05
    assert gain["positive"] is None
    kept = load_vehicle(vehicle_file).thrust_gain["surge"]
    assert kept.of(-10.0) == pytest.approx(gain["negative"], rel=1e-4)
    assert kept.of(10.0) == 1.0
    assert COMMENT in vehicle_file.read_text(encoding="utf-8")


def test_a_load_at_which_a_guard_disarms_is_named_with_what_the_guard_found(
    vehicle_file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It said that in neither direction the thrust had carried 30 % of the load, and to look for walls."""
    monkeypatch.setattr(weigh, "SHARES", (0.0, 1.0))
    monkeypatch.setattr(weighing_flight, "SETTLE_S", 15.0)
    assert main(["weigh", "yaw", "--mock", "--load", "40", "--one-way", "--vehicle", str(vehicle_file)]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert "hindrax weigh: yaw: disarmed " in said
    assert "of the load, wanted all loads held; take a smaller load (divergence: it does not turn as " in said


def test_only_an_enter_after_the_question_states_that_a_load_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    keyboard, terminal = os.openpty()
    with os.fdopen(terminal, encoding="utf-8") as typed:
        monkeypatch.setattr(sys, "stdin", typed)
        os.write(keyboard, b"\n\n")
        select.select([typed], [], [], 10.0)
        weigh.forget_what_was_typed()
        assert not weigh.entered()
        os.write(keyboard, b"\n")
        select.select([typed], [], [], 10.0)
        assert weigh.entered()
    os.close(keyboard)


def test_an_input_that_has_ended_is_not_an_operator(monkeypatch: pytest.MonkeyPatch) -> None:
    with Path("/dev/null").open(encoding="utf-8") as nobody:
        monkeypatch.setattr(sys, "stdin", nobody)
        with pytest.raises(HindraxError, match="the input has ended, wanted Enter for each step"):
            weigh.entered()


def test_a_weighing_that_is_worth_nothing_is_not_kept(
    vehicle_file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    before, still = vehicle_file.read_text(encoding="utf-8"), np.zeros(100)
    # Of 15 N it carries all, then half.
    thrusts = enumerate(((0.0, 0.0), (15.0, -15.0), (-15.0, 15.0), (15.0, -7.0), (-15.0, 8.0)))
    holds = [Hold(load, 50.0 * index, 50.0, still + thrust, still) for index, (load, thrust) in thrusts]
    monkeypatch.setattr(weigh, "_holds", lambda *_: holds)
    words = ["weigh", "surge", "--mock", "--vehicle", str(vehicle_file), "--write"]
    assert main(words) == 1
    said = capsys.readouterr()
    assert "surge: the holds contradict each other by" in " ".join(said.out.split())
    assert "warning" not in said.err
    assert main([*words, "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert (document["written"], "check line and pulley" in document["refused"]) == (False, True)
    assert vehicle_file.read_text(encoding="utf-8") == before


def test_each_axis_is_kept_beside_the_others_and_a_second_weighing_takes_the_place_of_the_first(
    vehicle_file: Path,
) -> None:
    before = vehicle_file.read_text(encoding="utf-8")
    words = argparse.Namespace(vehicle=str(vehicle_file), write=True)
    for axis, value in (("surge", 0.93), ("heave", 0.97), ("surge", 0.94)):
        gain = AxisGain(load=15.0, sigma=0.004, sigma_difference=0.01, positive=value, negative=value)
        kept = weigh._keep(words, load_vehicle(vehicle_file), Weighing(axis, gain, {}, 0.0, 1.0))
        assert kept == f"written to thrust_gain.{axis} of {vehicle_file}"
    found = load_vehicle(vehicle_file).thrust_gain
    assert {axis: gain.positive for axis, gain in found.items()} == {"surge": 0.94, "heave": 0.97}
    after = vehicle_file.read_text(encoding="utf-8").splitlines()
    assert [line for line in after if "thrust_gain" not in line] == before.splitlines()


def test_the_next_result_over_the_same_record_knows_of_a_weighing_that_was_written(vehicle_file: Path) -> None:
    """A step counts by what it leaves in a file: the deviation falls, and it is not the next step again."""
    before = load_vehicle(vehicle_file)
    flight = fly(model_of(before, 0), SURGE, back_and_forth((3.0, 8.0, 14.0), 8.0, 96.0), 0.15)
    flown = list(events(flight, 0, "surge", DVL, np.random.default_rng(1), plateau_s=4.0))
    gain = AxisGain(load=10.0, sigma=0.004, positive=1.0, negative=1.0)
    words = argparse.Namespace(vehicle=str(vehicle_file), write=True)
    weigh._keep(words, before, Weighing("surge", gain, {}, 0.0, 1.0))
    stds, by_weighing = [], []
    for vehicle in (before, load_vehicle(vehicle_file)):
        session = Session(vehicle)
        for event in flown:
            session.step(event)
        result = session.finalize().results.motions["surge"]
        assert result.drag is not None
        stds.append(result.drag.quoted(-1)[1])
        by_weighing.append(math.hypot(*(row.std for row in result.budget["drag"] if row.remedy == WEIGH_THRUST)))
    assert stds[1] < 0.95 * stds[0]
    assert by_weighing[1] < 0.5 * by_weighing[0]


@pytest.mark.parametrize(("axis", "unit"), [("surge", "N"), ("yaw", "N m")])
def test_a_gain_is_reported_with_its_deviation_and_the_load_with_its_unit(
    axis: str, unit: str, capsys: pytest.CaptureFixture[str]
) -> None:
    gain = AxisGain(load=15.0, sigma=0.0061192, sigma_difference=0.01294, positive=0.92169, negative=None)
    weigh.show(Weighing(axis, gain, {"alignment": 0.0006}, 0.0, 0.5), "not saved")
    rows = [[cell.strip() for cell in line.split("\u2502")] for line in capsys.readouterr().out.splitlines()]
    assert ["positive", "0.9217", "0.0061", "-"] in rows
    assert ["weighed up to", "15", "", unit] in rows
