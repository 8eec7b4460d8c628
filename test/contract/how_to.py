"""Doing what `docs/how-to/new-sensor.md` says, word for word, in a copy of the clone."""

import re
import shutil
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "how-to" / "new-sensor.md"
TABLE = "src/hindrax_core/hindrax_core/sensor_table.py"
VEHICLE = "src/hindrax_bringup/vehicles/hindrax.yaml"
COPIED = ("src", "test/contract", "test/golden", "docs")


def copy_of_the_clone(place: Path) -> Path:
    for part in COPIED:
        shutil.copytree(ROOT / part, place / part, ignore=shutil.ignore_patterns("__pycache__", "*.mcap"))
    for file in ("pyproject.toml", "conftest.py", "test/parallel_run.py", "test/register_rig.py"):
        shutil.copy2(ROOT / file, place / file)
    return place


def contents(place: Path) -> dict[str, str]:
    files = [file for part in ("src", "test") for file in (place / part).rglob("*") if file.suffix in (".py", ".yaml")]
    return {str(file.relative_to(place)): file.read_text(encoding="utf-8") for file in files}


def blocks(page: str) -> list[tuple[str, str]]:
    """Every fenced block of the page with the path on the line before it, or nothing."""
    return re.findall(r"(?:`([\w/.]+)`\n\n)?```\w+\n(.*?)```", page, re.DOTALL)


def follow(place: Path) -> None:
    """Make the files, then put the row and the line where the page says."""
    found = blocks(PAGE.read_text(encoding="utf-8"))
    for path, text in found:
        if path:
            (place / path).parent.mkdir(parents=True, exist_ok=True)
            (place / path).write_text(text, encoding="utf-8")
    row, line = (text for path, text in found if not path and text.startswith("  "))
    insert(place / TABLE, row, before="\n)\n")
    insert(place / VEHICLE, line, before="\n\noutput:")


def insert(file: Path, text: str, before: str) -> None:
    head, mark, tail = file.read_text(encoding="utf-8").rpartition(before)
    assert mark, f"{file}: found no {before!r}"
    file.write_text(f"{head}\n{text.rstrip()}{mark}{tail}", encoding="utf-8")


def commands() -> list[str]:
    """What the page says to run."""
    found = blocks(PAGE.read_text(encoding="utf-8"))
    return next(text for path, text in found if not path and text.startswith("./hindrax")).splitlines()
