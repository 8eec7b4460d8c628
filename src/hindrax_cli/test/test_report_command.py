"""`report`: a comparison out of the files of several runs, and what it refuses."""

from pathlib import Path

import pytest
import yaml

from hindrax_cli.command_line import main
from hindrax_cli.commands.pool import report_export as command


def run_folder(path: Path, k_q: float) -> str:
    body = {"k_q": {"value": k_q, "std": 0.5}, "k_l": {"value": 1.0, "std": 0.1}, "identifiable": True}
    path.mkdir(parents=True)
    (path / "coefficients.yaml").write_text(yaml.safe_dump({"motions": {"surge": body}}))
    return str(path)


def test_several_runs_are_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.html"
    runs = [run_folder(tmp_path / "monday", 66.0), run_folder(tmp_path / "tuesday", 67.0)]
    assert main(["report", *runs, "--out", str(page)]) == 0
    assert capsys.readouterr().out.strip() == str(page)
    text = page.read_text()
    assert "monday" in text
    assert "66.50 \u00b1 0.50" in text


def test_runs_of_the_same_name_are_distinguished(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    runs = [run_folder(tmp_path / day / "run", 66.0) for day in ("monday", "tuesday")]
    assert main(["report", *runs, "--out", str(page)]) == 0
    assert "monday/run" in page.read_text()


@pytest.mark.parametrize(
    ("words", "code", "named"),
    [(["nowhere"], 2, "nowhere"), (["nowhere", "elsewhere"], 1, "cannot be read")],
)
def test_what_is_not_there_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], code: int, named: str
) -> None:
    assert main(["report", *(str(tmp_path / word) for word in words)]) == code
    assert named in capsys.readouterr().err


def test_a_page_that_cannot_be_written_is_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runs = [run_folder(tmp_path / "a", 66.0), run_folder(tmp_path / "b", 67.0)]
    assert main(["report", *runs, "--out", str(tmp_path / "none" / "page.html")]) == 2
    printed = capsys.readouterr().err.strip()
    assert "cannot be written" in printed
    assert "\n" not in printed


def test_one_run_is_not_identified_again_for_a_page_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "run" / "bag").mkdir(parents=True)
    monkeypatch.setattr(command, "identify_bag", lambda *_, **__: pytest.fail("it was identified first"))
    assert main(["report", str(tmp_path / "run"), "--out", str(tmp_path / "none" / "page.html")]) == 2
    (tmp_path / "run" / "report.html").mkdir()
    assert main(["report", str(tmp_path / "run")]) == 2
    printed = capsys.readouterr().err.splitlines()
    assert ["cannot be written (No such" in printed[0], "cannot be written (Is a dir" in printed[1]] == [True, True]
