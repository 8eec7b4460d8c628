"""`benchmark score`: answers of another tool against a truth, without a record flown."""

import json
from pathlib import Path

import pytest

from hindrax_cli.command_line import main

TRUTH = {"small-pilot-1": {"drag": [[1.0, 4.0, 9.0]] * 6, "added_mass": [5.0] * 6}}
SURGE = {"surge": {"drag": [[1.0, 0.2], [4.0, 0.4], [9.0, 0.9]], "added_mass": [5.0, 0.5]}}


@pytest.mark.parametrize(("record", "answered"), [("small-pilot-1", 1 / 6), ("small-pilot-9", 0.0)])
def test_answers_of_a_record_that_is_not_there_are_told(
    record: str, answered: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "small-pilot-1.npz").touch()
    (tmp_path / "truth.json").write_text(json.dumps(TRUTH), encoding="utf-8")
    theirs = tmp_path / "theirs.json"
    theirs.write_text(json.dumps({record: SURGE}), encoding="utf-8")
    assert main(["benchmark", "score", str(tmp_path), str(theirs), "--json"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["rows"]["theirs"]["answered"] == pytest.approx(answered)
    told = f"theirs: left out, as {tmp_path} holds no such record: {record}" in printed.err
    assert told is (not answered)
