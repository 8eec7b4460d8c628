"""The table of the blind benchmark: what it counts, and that a question does not hold its answer."""

import json
from pathlib import Path

import numpy as np
import pytest

from hindrax_tools.blind_benchmark import TRUTH, answers, main, score
from hindrax_tools.foreign_plants import ForeignRecord, read, write

RECORDS = Path(__file__).parent / "foreign_records"
DRAG = [[1.0, 2.0, 4.0]] * 6
TRUE = {"one": {"drag": DRAG, "added_mass": [5.0] * 6}}


def test_an_answer_is_scored_in_error_coverage_and_refusals() -> None:
    surge = {"drag": [[1.0, 0.1], [2.0, 0.1], [5.0, 0.5]], "added_mass": [5.0, 1.0]}
    row = score(TRUE, {"one": {"surge": surge}})
    assert row.answered == pytest.approx(1.0 / 6.0)
    assert row.error == pytest.approx(0.25)
    assert row.band == pytest.approx(0.125)
    assert row.covered == pytest.approx(0.75)
    assert row.worst == pytest.approx(2.0)


def test_who_refuses_everything_has_no_error() -> None:
    row = score(TRUE, {})
    assert row.answered == 0.0
    assert np.isnan(row.error)


def test_plain_least_squares_answers_without_the_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = read(RECORDS / "small-steps-1.npz")
    hidden = np.full_like(one.drag, np.nan), np.full(6, np.nan)
    write(ForeignRecord(one.name, one.vehicle, one.recording, one.speeds, *hidden), tmp_path)
    found = answers(tmp_path, "least-squares")
    assert len(found[one.name]) == 6
    truth = {one.name: {"drag": one.drag.tolist(), "added_mass": one.added_mass.tolist()}}
    (tmp_path / TRUTH).write_text(json.dumps(truth))
    (tmp_path / "plain.json").write_text(json.dumps(found))
    assert main(["score", str(tmp_path), str(tmp_path / "plain.json")]) == 0
    assert "plain" in capsys.readouterr().out
    assert score(truth, found).covered < 0.6, "its bands are too narrow"
