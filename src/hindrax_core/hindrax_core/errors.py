"""The two ways a command can end badly, each with one sentence for the operator."""

from __future__ import annotations


class HindraxError(Exception):
    """The work failed: one sentence that names the thing, what was found, what was wanted, and the remedy."""

    exit_code = 1


class UsageError(HindraxError):
    """The tool was used wrongly: an unknown word, a missing file, a contradiction between options."""

    exit_code = 2
