"""Every decision has a status, and the index lists each with its title and status."""

import re
from pathlib import Path

import pytest

from hindrax_bringup.clone import clone_root

FOLDER = clone_root() / "docs" / "adr"
RECORDS = sorted(FOLDER.glob("[0-9]*.md"))
INDEX = (FOLDER / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.stem)
def test_a_decision_is_listed_with_its_number_title_and_status(record: Path) -> None:
    found = re.match(r"# (\d+)\. (.+)\n\nStatus: (\w.*)\.\n", record.read_text(encoding="utf-8"))
    assert found is not None, f"{record.name}: wanted `# NUMBER. TITLE`, an empty line, and `Status: WORDS.`"
    number, title, status = found.groups()
    assert record.name.startswith(f"{int(number):04d}-")
    assert f"| [{number}]({record.name}) | {title} | {status} |" in INDEX


def test_the_index_lists_nothing_else() -> None:
    assert re.findall(r"^\| \[\d+\]\(([^)]+)\)", INDEX, re.MULTILINE) == [record.name for record in RECORDS]
