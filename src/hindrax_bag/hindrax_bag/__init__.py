"""MCAP bags: record, recover, read, replay, compare."""

from __future__ import annotations

import subprocess
from pathlib import Path

__version__ = "0.2.0"
PATIENCE_S = 10.0


def software_version() -> str:
    """Version of the package, with `git describe` of the clone if there is one."""
    here = Path(__file__).resolve().parent
    words = ["git", "-C", str(here), "describe", "--always", "--dirty", "--tags"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE_S, check=False)  # noqa: S603  # fixed words
    except (OSError, subprocess.TimeoutExpired):
        return f"hindrax {__version__}"
    return f"hindrax {__version__} ({done.stdout.strip()})" if done.returncode == 0 else f"hindrax {__version__}"
