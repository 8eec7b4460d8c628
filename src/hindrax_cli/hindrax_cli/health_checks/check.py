"""One check, of the doctor or of a vehicle file."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Check:
    """Name of the check, whether it passed, what was found, and the remedy."""

    name: str
    ok: bool
    found: str
    remedy: str = ""


def good(name: str, found: str) -> Check:
    """Make a passed check."""
    return Check(name, ok=True, found=found)


def bad(name: str, found: str, remedy: str) -> Check:
    """Make a failed check."""
    return Check(name, ok=False, found=found, remedy=remedy)


def judged(name: str, found: str, remedy: str = "") -> Check:
    """Make a check that has passed where there is nothing to be done."""
    return Check(name, not remedy, found, remedy)
