"""The thrusters process: `python -m hindrax_drivers.nodes.thrusters --ros-args ...`.

It turns into the dead man at once, which starts the node as its child by the same words and `--node BEAT LIFE`.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

ARGUMENTS = "HINDRAX_THRUSTERS_ARGUMENTS"
NODE_WORD = "--node"


def main() -> int:
    """Become the dead man, or run the node for it."""
    words = sys.argv[1:]
    if words[:1] != [NODE_WORD]:
        become_dead_man(words)
    from hindrax_drivers.nodes import thrusters_node  # noqa: PLC0415  # the dead man does without ROS

    return thrusters_node.main(words[3:], beat=int(words[1]), life=int(words[2]))


def become_dead_man(words: Sequence[str]) -> NoReturn:
    """Go on as the dead man, in this very process.

    Under a new name and without arguments: whoever kills "thrusters" by name must not take the dead man along.
    """
    os.environ[ARGUMENTS] = json.dumps(words)
    os.execv(sys.executable, [sys.executable, "-m", "hindrax_drivers.nodes.deadman"])  # noqa: S606  # ourselves


if __name__ == "__main__":
    sys.exit(main())
