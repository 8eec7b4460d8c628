"""Another machine, reached by ssh: one connection for all steps, so that a password is asked for once."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from hindrax_bringup.stack_lock import runtime_folder
from hindrax_cli.deployment.steps import LOOK, Step
from hindrax_core.errors import HindraxError

NO_CONNECTION = 255
"""Exit code of ssh's own errors (ssh(1))."""


def ssh(host: str, script: str) -> list[str]:
    """Words that run a script on another machine; it ends at the first line that fails."""
    shared = [f"ControlPath={runtime_folder()}/ssh-%C", "ControlMaster=auto", "ControlPersist=60", "ConnectTimeout=15"]
    options = [word for one in shared for word in ("-o", one)]
    terminal = ["-t"] if sys.stdin.isatty() and "sudo " in script else []
    return ["ssh", *options, *terminal, host, f"set -e\n{script}"]


def looked(host: str) -> str:
    """Answer of a machine to LOOK. HindraxError when it does not answer."""
    done = subprocess.run(ssh(host, LOOK), stdout=subprocess.PIPE, text=True, check=False)  # noqa: S603  # the user's own host
    _require(done.returncode, host, Step("look", LOOK))
    return done.stdout.strip()


def run(host: str, step: Step, clone: Path) -> None:
    """Run one step to its end; HindraxError says which failed and what to do."""
    feeder = _started(step.feed, clone)
    try:
        source = feeder.stdout if feeder else subprocess.DEVNULL if not sys.stdin.isatty() else None
        code = subprocess.run(ssh(host, step.script), stdin=source, check=False).returncode  # noqa: S603  # as above
    finally:
        if feeder and feeder.stdout:
            feeder.stdout.close()
    if feeder and feeder.wait() and not code:
        raise HindraxError(f"{step.title}: {' '.join(step.feed)} ended with code {feeder.returncode}")
    _require(code, host, step)


def _started(words: tuple[str, ...], clone: Path) -> subprocess.Popen[bytes] | None:
    return subprocess.Popen(words, cwd=clone, stdout=subprocess.PIPE) if words else None  # noqa: S603  # our own words


def _require(code: int, host: str, step: Step) -> None:
    if code == NO_CONNECTION:
        raise HindraxError(f"{step.title}: ssh does not reach {host}; try `ssh {host}` by hand")
    if code:
        raise HindraxError(f"{step.title}: failed on {host} with code {code}; {step.remedy}")


def outline(step: Step, host: str, say: Callable[[str], None]) -> None:
    """Describe what a step would run, without the options of the connection."""
    lines = step.script.splitlines()
    feed = f"{' '.join(step.feed)} | " if step.feed else ""
    say(f"  {feed}ssh {host} {lines[0]}")
    for line in lines[1:]:
        say(f"      {line}")
