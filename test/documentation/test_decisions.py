"""Every decision has a status, and the index lists each with its title and status."""

import re
from pathlib import Path

import pytest

from hindrax_bringup.clone import clone_root

ROOT = clone_root()
FOLDER = ROOT / "docs" / "adr"
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


def test_a_number_that_was_merged_is_told_where_it_is() -> None:
    went = {int(old): int(new) for old, new in re.findall(r"^\| (\d+) \| \[(\d+)\]\(", INDEX, re.MULTILINE)}
    kept = {int(record.name[:4]) for record in RECORDS}
    assert not went.keys() & kept
    assert set(went.values()) <= kept
    included = {
        (int(old), int(record.name[:4]))
        for record in RECORDS
        for status in re.findall(r"^Status: .*includes (.*)\.$", record.read_text(encoding="utf-8"), re.MULTILINE)
        for old in re.findall(r"\d+", status)
    }
    assert included == set(went.items())


def test_texts_and_code_name_records_that_exist() -> None:
    kept = {record.name[:4].lstrip("0") for record in RECORDS}
    places = ("src", "tools", "test", "docs", "firmware", "setup", "docker")
    files = [
        file for place in places for suffix in ("py", "md", "sh", "xml") for file in (ROOT / place).rglob(f"*.{suffix}")
    ]
    named = {
        (number, str(file.relative_to(ROOT)))
        for file in files
        for number in re.findall(r"\bADR\s+(\d+)\b", file.read_text(encoding="utf-8"))
    }
    assert len(named) > 20
    assert {one for one in named if one[0] not in kept} == set()
