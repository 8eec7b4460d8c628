"""The glossary explains the words that the tool prints, as it prints them."""

import re

import pytest
from documentation.pages import ROOT

from hindrax_core.signals import PHASES
from hindrax_core.vehicle import AXES
from hindrax_ident.assess.influences import INFLUENCES

TEXT = (ROOT / "docs/explanation/glossary.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (\*\*.+?\*\*.*?) \| (.+) \|$", TEXT, re.MULTILINE)
WORDS = {word for name, _ in ROWS for bold in re.findall(r"\*\*(.+?)\*\*", name) for word in bold.split(", ")}
PRINTED = {
    *("k_q", "k_l", "k_r", "k_w", "b", "added mass", "+-", "truth", "std", "samples"),  # the table of coefficients
    *("verdict", "drag at the highest speed", "held-out error", "stays still", "losses", "best next step"),  # below it
    *("stack", "disarmed", "armed", "health"),  # status
    *("fit", "corrected", "calibrated", "prior", "plateau", "budget", "scatter"),  # the report
    *("leg", "coast", "world", "seed", "session", "hold", "motion"),  # a pool test
}


def test_every_word_of_results_has_a_row() -> None:
    assert not PRINTED - WORDS


def test_every_influence_of_the_budget_has_a_row_by_the_name_that_the_report_prints() -> None:
    assert not {one.name for one in INFLUENCES} - WORDS
    listed = TEXT.partition("## Influences of the budget")[2]
    named = re.findall(r"^\| \*\*(.+?)\*\* \|", listed, re.MULTILINE)
    assert set(named) == {one.name for one in INFLUENCES}, "a row whose influence is gone"


@pytest.mark.parametrize("phase", PHASES)
def test_every_phase_of_a_maneuver_is_explained(phase: str) -> None:
    assert phase in WORDS or f"*{phase}*" in TEXT


def test_every_motion_is_named() -> None:
    (meaning,) = [text for name, text in ROWS if name == "**motion**"]
    assert all(axis in meaning for axis in AXES)
