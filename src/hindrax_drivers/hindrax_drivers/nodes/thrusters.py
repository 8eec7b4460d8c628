"""The thrusters process: `python -m hindrax_drivers.nodes.thrusters --ros-args ...`.

It turns into the dead man at once, which starts the node as its child by the same words and `--node BEAT LIFE`. With
`--neutral` before the words the dead man only puts neutral on the wire: for a supervisor that killed another.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

ARGUMENTS = "HINDRAX_THRUSTERS_ARGUMENTS"
NODE_WORD, NEUTRAL_WORD = "--node", "--neutral"


def main() -> int:
    """Run the dead man, or the node under it."""
    words = sys.argv[1:]
    if words[:1] != [NODE_WORD]:
        become_dead_man(words)
    from hindrax_drivers.nodes import thrusters_node  # noqa: PLC0415  # the dead man does without ROS

    return thrusters_node.main(words[3:], beat=int(words[1]), life=int(words[2]))


def become_dead_man(words: Sequence[str]) -> NoReturn:
    """Replace this process by the dead man.

    Under a new name and without arguments: killing "thrusters" by name must not kill the dead man.
    """
    os.environ[ARGUMENTS] = json.dumps(words)
    os.execv(sys.executable, [sys.executable, "-m", "hindrax_drivers.nodes.deadman"])  # noqa: S606  # ourselves


if __name__ == "__main__":
    sys.exit(main())
