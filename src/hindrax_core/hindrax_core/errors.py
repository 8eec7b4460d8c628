"""Errors that end a command, each with one sentence for the operator."""

from __future__ import annotations

INTERRUPTED = 130
"""Exit code of a command that Ctrl-C ended, as of a shell: 128 and the number of SIGINT."""


class HindraxError(Exception):
    """The command failed: one sentence that names the thing, what was found, what was wanted, and the remedy."""

    exit_code = 1


class UsageError(HindraxError):
    """Invalid use of the tool: an unknown argument, a missing file, contradictory options."""

    exit_code = 2


def cause(error: Exception) -> str:
    """Cause, without the number and the path of an OSError: the sentence names the path itself."""
    return (isinstance(error, OSError) and error.strerror) or str(error)
