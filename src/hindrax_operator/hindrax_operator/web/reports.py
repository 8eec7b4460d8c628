"""Finished reports: `report.html` of the folders that lie directly in a folder of runs, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from http import HTTPStatus
from pathlib import Path

from hindrax_bag.run_folder import RunFolder
from hindrax_operator.web.access import RefusedRequest

LARGEST_bytes = 50_000_000
MOST = 200


class Reports:
    """Reports below one folder of runs. A name is looked up in the list, so no path is ever made of one."""

    def __init__(self, runs: Path) -> None:
        self.runs = runs

    def names(self) -> Sequence[str]:
        """Names of the runs with a report, the newest report first."""
        return list(self._files())

    def read(self, name: str) -> bytes:
        """Return one report as it is; Refused when there is none of this name, or it is no page of ours by its size."""
        file = self._files().get(name)
        if file is None:
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
                file = RunFolder(folder).report
                # A link out of the folder of runs is not followed.
                if file.is_file() and file.resolve() == file:
                    found.append((file.stat().st_mtime, folder.name, file))
        except OSError:  # no runs yet, or one that is being removed
            pass
        return {name: file for _, name, file in sorted(found, reverse=True)[:MOST]}
