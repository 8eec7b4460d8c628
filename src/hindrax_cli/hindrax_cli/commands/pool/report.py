"""`hindrax report`: the HTML of a run again, or a comparison of many runs."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from hindrax_analysis.coefficients_file import Conditions, SavedCoefficients, read_coefficients
from hindrax_analysis.identification.bag_identification import bag_conditions, identify_bag, traces_of, write
from hindrax_analysis.identification.record_identification import RecordSource, recorded_vehicle
from hindrax_analysis.records.own_bag import is_mock
from hindrax_analysis.report import RunReport, comparison_page, run_page
from hindrax_analysis.terminal import working
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.text.text_file import require_place
from hindrax_core.vehicle import load_vehicle

NAME = "report"
HELP = "the HTML report of a run again, or a comparison of many runs"
EXAMPLE = "./hindrax report runs/2026-05-04_10-00-00 runs/2026-05-05_09-30-00 --out comparison.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Runs, and where to put the page."""
    parser.add_argument(
        "runs", nargs="+", type=Path, metavar="RUN", help="run folder; for a comparison also coefficients.yaml"
    )
    parser.add_argument(
        "--earlier", nargs="+", type=Path, default=[], metavar="RUN", help="earlier runs to show beside one"
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="default: report.html of the run, or comparison.html")


def run(arguments: argparse.Namespace) -> int:
    """One run: evaluate its bag again. Several: compare what their files say."""
    runs: list[Path] = arguments.runs
    if len(runs) == 1:
        _require_run(runs[0])
        require_place(arguments.out or RunFolder(runs[0]).report)
        with working(f"identifying over {runs[0]} again"):
            out = _again(runs[0], [_saved(path) for path in arguments.earlier], arguments.out)
    else:
        out = arguments.out or Path("comparison.html")
        require_place(out)
        write(out, comparison_page(_labelled([*runs, *arguments.earlier])))
    print_fitted(out)
    return 0


def _saved(path: Path, label: str = "") -> SavedCoefficients:
    file = RunFolder(path).coefficients if path.is_dir() else path
    return read_coefficients(file, label)


def _labelled(paths: list[Path]) -> list[SavedCoefficients]:
    """Runs under the shortest names that tell them apart."""
    folders = [(path if path.is_dir() else path.parent).resolve() for path in paths]
    names = [folder.name for folder in folders]
    if len(set(names)) < len(names):
        names = [f"{folder.parent.name}/{folder.name}" for folder in folders]
    if len(set(names)) < len(names):
        names = [str(path) for path in paths]
    return [_saved(path, name) for path, name in zip(paths, names, strict=True)]


def _with_predicted(conditions: Conditions, folder: RunFolder) -> Conditions:
    """With what only the coefficients of the run tell: what was predicted."""
    if not folder.coefficients.is_file():
        return conditions
    return replace(conditions, predicted=read_coefficients(folder.coefficients).conditions.predicted)


def _require_run(path: Path) -> None:
    if not path.is_dir() or not RunFolder(path).bag.is_dir():
        raise UsageError(f"{path}: holds no folder `bag`, wanted the folder of a run such as runs/2026-05-04_10-00-00")


def _again(path: Path, earlier: list[SavedCoefficients], out: Path | None) -> Path:
    folder = RunFolder(path)
    vehicle = recorded_vehicle(RecordSource(folder.bag)) or load_vehicle(default_vehicle())
    identified = identify_bag(folder.bag, vehicle, mock=is_mock(folder.bag))
    conditions = bag_conditions(folder.bag, vehicle, identified.results, mock=identified.mock)
    conditions = _with_predicted(conditions, folder)
    traces = traces_of(folder.bag, identified.origin)
    page = RunReport(vehicle, identified.results, identified.outcome.assessments, conditions, traces, earlier)
    write(out or folder.report, run_page(page))
    return out or folder.report
