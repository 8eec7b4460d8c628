"""Prints what a vehicle needs of a lock file: no tests, no peers, no benchmarks. Any Python 3.9 runs it.

    python vehicle_lock.py wheels.lock

uv notes below each package who asks for it; kept is what ros.in or runtime.in leads to.
"""

import re
import sys
from pathlib import Path

ROOTS = {"ros.in", "runtime.in"}


def vehicle_lock(text: str) -> str:
    """Return the blocks of a lock that something of ROOTS needs, in their order."""
    blocks = {block.partition("==")[0]: block for block in re.split(r"\n(?=[a-z])", text.strip())}
    asked_by = {
        name: set(re.findall(r"^    #(?: via)? +(?:-r )?(\S+)$", block, re.MULTILINE)) for name, block in blocks.items()
    }
    kept = set(ROOTS)
    while found := {name for name, askers in asked_by.items() if askers & kept} - kept:
        kept |= found
    return "".join(f"{block}\n" for name, block in blocks.items() if name in kept)


if __name__ == "__main__":
    sys.stdout.write(vehicle_lock(Path(sys.argv[1]).read_text(encoding="utf-8")))
