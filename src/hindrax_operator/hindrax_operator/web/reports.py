"""Runs and finished reports: `report.html` of the folders directly in a folder of runs, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from http import HTTPStatus
from pathlib import Path
from typing import Any

from hindrax_bag.run_folder import RunFolder
from hindrax_operator.web.access import RefusedRequest

LARGEST_bytes = 50_000_000
MOST = 200


class Reports:
    """Reports below one folder of runs. A name is looked up in the list, so no path is ever made of one."""

    def __init__(self, runs: Path) -> None:
        self.runs = runs

    def listed(self) -> Sequence[Mapping[str, Any]]:
        """Name of every run with a bag or a report, and whether it has the report; the newest first."""
        return [{"name": name, "report": file.is_file()} for name, file in self._files().items()]

    def read(self, name: str) -> bytes:
        """Return one report as it is; Refused when there is none of this name, or it is no page of ours by its size."""
        file = self._files().get(name)
        if file is None or not file.is_file():
            raise RefusedRequest(HTTPStatus.NOT_FOUND, f"report: none of that name in {self.runs.name}")
        try:
            with file.open("rb") as opened:
                content = opened.read(LARGEST_bytes + 1)
        except OSError as error:
            raise RefusedRequest(HTTPStatus.NOT_FOUND, f"report: cannot be read ({error.strerror})") from error
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
