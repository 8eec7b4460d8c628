"""Runs and finished reports: `report.html` of the folders directly in a folder of runs, and nothing else."""

from collections.abc import Mapping, Sequence
from http import HTTPStatus
from pathlib import Path
from typing import Any

from hindrax_bag.run_folder import RunFolder
from hindrax_core.errors import HindraxError, cause
from hindrax_core.text.digits import measured
from hindrax_core.text.yaml_text import read_yaml
from hindrax_operator.progress import units
from hindrax_operator.web.access import RefusedRequest

LARGEST_bytes = 50_000_000
MOST_REPORTS = 200


class Reports:
    """Reports below one folder of runs. A name is looked up in the list, so no path is ever made of one."""

    def __init__(self, runs: Path) -> None:
        self.runs = runs

    def listed(self) -> Sequence[Mapping[str, object]]:
        """Name of every run with a bag or a report, and whether it has the report; the newest first.

        Returns
        -------
        Sequence[Mapping[str, object]]
            `name` and `report`; the newest with a report has `motions` too, a row for each: verdict, and drag at the
            highest speed with its standard deviation.
        """
        found = [{"name": name, "report": file.is_file()} for name, file in self._files().items()]
        newest = next((one for one in found if one["report"]), None)
        if newest is not None:
            newest["motions"] = _motions(RunFolder(self.runs / str(newest["name"])).coefficients)
        return found

    def read(self, name: str) -> bytes:
        """Return one report; RefusedRequest when there is none of this name, or it is no page of ours by its size."""
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
        return {name: file for _, name, file in sorted(found, reverse=True)[:MOST_REPORTS]}


def _motions(file: Path) -> Sequence[Mapping[str, str]]:
    """Verdict and drag of each motion, as in a report's first table; none where the file has none."""
    try:
        with file.open(encoding="utf-8") as opened:
            motions = read_yaml(opened.read(LARGEST_bytes), file.name)["motions"]
        return [
            {
                "motion": motion,
                "verdict": "identified" if body["identifiable"] else "not identifiable",
                "drag": _drag(body.get("drag_force"), motion),
            }
            for motion, body in motions.items()
        ]
    except (OSError, ValueError, LookupError, TypeError, AttributeError, HindraxError):
        return []  # of another version, damaged, or being written: its report shows more


def _drag(found: Mapping[str, Any] | None, motion: str) -> str:
    """Drag at the highest speed; files of earlier versions do not have it corrected."""
    if found is None:
        return ""
    speed, force, std = (found[name][-1] for name in ("speed", "force", "std_calibrated"))
    if "corrected" in found:
        low, high = (ends[-1] for ends in found["corrected"]["interval68"])
        force, std = found["corrected"]["value"][-1], 0.5 * (high - low)
    unit, rate = units(motion)
    return f"{measured(force, std)} {unit} at {speed:.2g} {rate}"
