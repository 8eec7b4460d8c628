"""`hindrax allocate` as a user calls it: the JSON document, the table, and what is refused."""

import json
from typing import Any

import pytest

from hindrax_cli.command_line import main


def document(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    assert main(["allocate", "--json", *words]) == 0
    return json.loads(capsys.readouterr().out)


def test_json_has_the_fixed_shape(capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, "--wrench", "5", "0", "-10", "0", "0", "-1e-3")
    assert list(found["forces"]) == list(found["pulses"]) == [f"T{number}" for number in range(1, 9)]
    assert all(isinstance(pulse, int) for pulse in found["pulses"].values())
    assert found["achieved"] == pytest.approx([5.0, 0.0, -10.0, 0.0, 0.0, 0.0], abs=0.07)
    assert found["shortfall"] == pytest.approx([0.0] * 6, abs=0.07)
    assert found["saturated"] == found["lost_axes"] == found["refused"] == []


def test_failed_thruster_stands_still(capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, "--wrench", "10", "0", "0", "0", "0", "0", "--disable", "T3")
    assert found["forces"]["T3"] == 0.0
    assert found["pulses"]["T3"] == 1500
    assert found["achieved"][0] == pytest.approx(10.0, abs=0.7)


def test_more_than_there_is_saturates(capsys: pytest.CaptureFixture[str]) -> None:
    found = document(capsys, "--wrench", "0", "0", "-500", "0", "0", "0")
    assert found["saturated"] == ["T5", "T6", "T7", "T8"]


@pytest.mark.parametrize("words", [["T3", "T4"], ["T3,T4"], ["T3", "--disable", "T4"]])
def test_several_thrusters_are_left_out_however_they_are_listed(
    capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    found = document(capsys, "--wrench", *"500000", "--disable", *words)
    assert (found["disabled"], found["lost_axes"]) == (["T3", "T4"], ["sway"])


def test_table_names_thrusters_and_axes(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["allocate", "--wrench", "100", "0", "0", "0", "0", "0", "--disable", "T1,T2"]) == 0
    out = capsys.readouterr().out
    assert "disabled" in out
    assert "at its limit" in out
    assert "surge X" in out
