"""Runs and finished reports: `report.html` of the folders directly in a folder of runs, and nothing else."""

from collections.abc import Mapping, Sequence
from http import HTTPStatus
from pathlib import Path

from hindrax_bag.run_folder import RunFolder
from hindrax_core.errors import HindraxError, cause
from hindrax_core.text.digits import measured
from hindrax_core.text.yaml_text import read_yaml
from hindrax_operator.web.access import RefusedRequest

LARGEST_bytes = 50_000_000
MOST = 200
CONTRIBUTIONS = 3
"""Rows of a budget that are shown, the largest first."""


class Reports:
    """Reports below one folder of runs. A name is looked up in the list, so no path is ever made of one."""

    def __init__(self, runs: Path) -> None:
        self.runs = runs

    def listed(self) -> Sequence[Mapping[str, object]]:
        """Name of every run with a bag or a report, and whether it has the report; the newest first.

        The newest report comes with its uncertainty budget: a line per coefficient.
        """
        found = [{"name": name, "report": file.is_file()} for name, file in self._files().items()]
        newest = next((one for one in found if one["report"]), None)
        if newest is not None:
            newest["budget"] = _budget(RunFolder(self.runs / str(newest["name"])).coefficients)
        return found

    def read(self, name: str) -> bytes:
        """Return one report; Refused when there is none of this name, or it is no page of ours by its size."""
        file = self._files().get(name)
        if file is None or not file.is_file():
            raise RefusedRequest(HTTPStatus.NOT_FOUND, f"report: none of that name in {self.runs.name}")
        try:
            with file.open("rb") as opened:
                content = opened.read(LARGEST_bytes + 1)
        except OSError as error:
            raise RefusedRequest(HTTPStatus.NOT_FOUND, f"report: cannot be read ({cause(error)})") from error
        if len(content) > LARGEST_bytes:
            raise RefusedRequest(HTTPStatus.NOT_FOUND, f"report: larger than {LARGEST_bytes // 1_000_000} MB")
        return content

    def _files(self) -> Mapping[str, Path]:
        found: list[tuple[float, str, Path]] = []
        try:
            inside = self.runs.resolve(strict=True)
            for folder in inside.iterdir():
                run = RunFolder(folder)
                newest = next((one for one in (run.report, run.bag) if one.exists()), None)
                # A link out of the folder of runs is not followed.
                if newest is not None and newest.resolve() == newest:
                    found.append((newest.stat().st_mtime, folder.name, run.report))
        except OSError:  # no runs yet, or one that is being removed
            pass
        return {name: file for _, name, file in sorted(found, reverse=True)[:MOST]}


def _budget(file: Path) -> Sequence[str]:
    """Each coefficient with its calibrated band and the largest contributions to it; none where the file has none."""
    try:
        with file.open(encoding="utf-8") as opened:
            motions = read_yaml(opened.read(LARGEST_bytes), file.name)["motions"]
        return [
            f"{motion} {name}, {measured(one['value'], one['std_calibrated'])} {one['unit']}, from {_largest(rows)}"
            for motion, body in motions.items()
            for name, rows in body["budget"].items()
            if (one := body.get(name)) is not None
        ]
    except (OSError, ValueError, LookupError, TypeError, AttributeError, HindraxError):
        return []  # of another version, damaged, or being written: its report shows more


def _largest(rows: Mapping[str, float]) -> str:
    ordered = sorted(rows.items(), key=lambda row: -row[1])[:CONTRIBUTIONS]
    return ", ".join(f"{influence} {std:.2g}" for influence, std in ordered)
