"""One thing that was looked at."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Check:
    """What was looked at, whether it is as it should be, what was found, and what to do when it is not."""

    name: str
    ok: bool
    found: str
    remedy: str = ""


def good(name: str, found: str) -> Check:
    """Make a check that went well."""
    return Check(name, ok=True, found=found)


def bad(name: str, found: str, remedy: str) -> Check:
    """Make a check that did not."""
    return Check(name, ok=False, found=found, remedy=remedy)
