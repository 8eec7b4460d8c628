"""The known word that somebody may have meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Question after the known word that is nearest to an unknown one; empty when none is near."""
    near = difflib.get_close_matches(word.replace("_", "-"), list(known), n=1)
    near = near or difflib.get_close_matches(word, list(known), n=1)
    return f" (did you mean {near[0]}?)" if near else ""


def found_in(word: str, known: Iterable[str], others: Iterable[str] = ()) -> str:
    """What was found, and what was wanted: the nearest known word, or all of them where none is near.

    Parameters
    ----------
    word
        As it was typed.
    known
        Words that it may be, listed where none of them is near.
    others
        Words that it may be too, which the form names.

    Returns
    -------
    str
        `found 'pol' (did you mean pool?)`, or `found 'sea', wanted one of ...`.
    """
    names = list(known)
    near = did_you_mean(word, [*others, *names])
    return f"found {word!r}{near}" if near else f"found {word!r}, wanted one of {', '.join(names)}"
