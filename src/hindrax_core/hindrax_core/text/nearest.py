"""The known word that somebody may have meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Question after the known word that is nearest to an unknown one; empty when none is near."""
    near = difflib.get_close_matches(word.replace("_", "-"), list(known), n=1)
    near = near or difflib.get_close_matches(word, list(known), n=1)
    return f" (did you mean {near[0]}?)" if near else ""
