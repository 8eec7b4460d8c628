"""The table of the blind benchmark: what it counts, and that a question does not hold its answer."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from hindrax_cli.command_line import main
from hindrax_cli.commands.explain import benchmark
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import array
from hindrax_laboratory.benchmark.answer import Answer, AxisAnswer
from hindrax_laboratory.benchmark.blind_benchmark import METHODS, TRUTH, answers, common, read_answers, score
from hindrax_laboratory.benchmark.foreign_plants import ForeignRecord, read, write
from hindrax_laboratory.benchmark.rivals import STEP_S, black_box, by_axis, plateaus

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


def test_medians_are_compared_over_the_axes_that_both_answered() -> None:
    """Ours answers the easy axis too, theirs the hard one too: only that of both is compared."""

    def answer(force: float, mass: float) -> AxisAnswer:
        return {"drag": [(1.0, 0.1), (2.0, 0.1), (force, 0.4)], "added_mass": (mass, 1.0)}

    ours: dict[str, Answer] = {"one": {"surge": answer(4.0, 5.0), "sway": answer(5.0, 5.0)}, "not asked": {}}
    theirs: dict[str, Answer] = {"one": {"sway": answer(6.0, 5.0), "yaw": answer(8.0, 5.0)}}
    both = common(TRUE, ours, theirs)
    assert both.axes == 1
    assert (both.ours.error, both.theirs.error) == pytest.approx((0.25, 0.5))
    assert score(TRUE, ours).error == pytest.approx(0.125)
    nothing = common(TRUE, ours, {})
    assert (nothing.axes, nothing.ours.error, nothing.theirs.error) == (0, None, None)


def test_who_refuses_everything_has_no_error() -> None:
    row = score(TRUE, {})
    assert row.answered == 0.0
    assert row.error is None


def test_plain_least_squares_answers_without_the_truth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = asked(tmp_path)
    found = answers(tmp_path, "least-squares")
    assert len(found[one.name]) == 6
    truth = {one.name: {"drag": one.drag.tolist(), "added_mass": one.added_mass.tolist()}}
    (tmp_path / TRUTH).write_text(json.dumps(truth))
    (tmp_path / "plain.json").write_text(json.dumps(found))
    assert main(["benchmark", "score", str(tmp_path), str(tmp_path / "plain.json"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["common"] == {"with": "plain", "rows": {}}, "there is no other"
    row = document["rows"]["plain"]
    assert row["answered"] == 1.0
    assert row["covered"] < 0.6, "its bands are too narrow"


def asked(folder: Path) -> ForeignRecord:
    """The question of a record, in a folder."""
    one = read(RECORDS / "small-steps-1.npz")
    hidden = np.full_like(one.drag, np.nan), np.full(6, np.nan)
    write(ForeignRecord(one.name, one.vehicle, one.recording, one.speeds, *hidden), folder)
    return one


def test_plateaus_give_a_drag_where_both_were_steady_and_no_mass() -> None:
    one = read(RECORDS / "small-steps-1.npz")
    found = by_axis(one, plateaus)
    assert 0 < len(found) < 6, "steps of 2.5 s are too short for some"
    for axis, answer in found.items():
        assert "added_mass" not in answer
        assert answer["drag"][-1][0] == pytest.approx(one.drag[AXES.index(axis)][-1], rel=0.6)


def test_a_black_box_gives_a_drag_without_deviations() -> None:
    pytest.importorskip("sysidentpy")
    t = np.arange(0.0, 120.0, STEP_S)
    thrust, v = 20.0 * np.sin(0.4 * t) * np.sin(0.05 * t + 0.3), np.zeros(len(t))
    for k in range(len(t) - 1):
        v[k + 1] = v[k] + STEP_S * (thrust[k] - 60.0 * abs(v[k]) * v[k] - 5.0 * v[k]) / 30.0
    speeds = np.array([0.2, 0.3, 0.4])
    found = black_box(array(v), array(thrust), array(np.ones((len(t), 1))), array(speeds))
    assert found is not None
    forces, deviations = zip(*found["drag"], strict=True)
    assert forces == pytest.approx((60.0 * speeds**2 + 5.0 * speeds).tolist(), rel=0.2)
    assert set(deviations) == {None}
    row = score(TRUE, {"one": {"surge": {"drag": [[1.0, None], [2.0, None], [5.0, None]]}}})
    assert (row.error, row.covered) == (0.25, None)


def test_a_rival_that_is_not_installed_is_named_and_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked(tmp_path)
    monkeypatch.setitem(sys.modules, "sysidentpy.basis_function", None)
    monkeypatch.setattr(benchmark, "METHODS", {name: METHODS[name] for name in ("plateaus", "sysidentpy")})
    assert main(["benchmark", "answer", str(tmp_path)]) == 0
    assert "left out: sysidentpy needs the package" in capsys.readouterr().err
    assert [file.name for file in tmp_path.glob("*.json")] == ["plateaus.json"]
    assert main(["benchmark", "answer", str(tmp_path), "--method", "sysidentpy"]) == 1


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("[", "is no JSON document"),
        ("[]", "wanted an object of records"),
        ('{"one": {"surf": {}}}', "wanted an axis of surge"),
        ('{"one": {"surge": {"drag": [[1.0, 0.1]]}}}', "wanted drag: three pairs"),
        ('{"one": {"surge": {"drag": [[1.0, 0.1], [2.0, 0.0], [3.0, 0.1]]}}}', "a deviation above 0"),
        ('{"one": {"surge": {"drag": [[1.0, 0.1], [NaN, 0.2], [3.0, 0.1]]}}}', "a finite force"),
        ('{"one": {"surge": {"drag": [[1.0, 0.1], [2.0, 0.2], [3.0, 0.1]], "added_mass": 5}}}', "one pair, or nothing"),
    ],
)
def test_an_answer_that_is_none_says_what_was_wanted(text: str, wanted: str, tmp_path: Path) -> None:
    (tmp_path / "theirs.json").write_text(text)
    with pytest.raises(UsageError, match=wanted):
        read_answers(tmp_path / "theirs.json")


def test_a_folder_without_records_or_truth_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["benchmark", "answer", str(tmp_path)]) == 2
    assert "benchmark make" in capsys.readouterr().err
    asked(tmp_path)
    assert main(["benchmark", "score", str(tmp_path)]) == 2
    assert TRUTH in capsys.readouterr().err
