"""How runs are named."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pytest

from hindrax_bag import run_folder


@pytest.mark.parametrize(("year", "name"), [(1970, "undated"), (2026, "2026-01-01_00-00-40")])
def test_every_boot_without_a_clock_has_a_run_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, year: int, name: str
) -> None:
    monkeypatch.setattr(run_folder, "RUNS", tmp_path)
    made = []
    for _ in range(3):
        made.append(run_folder.new_run(datetime(year, 1, 1, 0, 0, 40, tzinfo=UTC)))
        made[-1].mkdir()
    assert [path.name for path in made] == [name, f"{name}_1", f"{name}_2"]
