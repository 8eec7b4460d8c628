"""The thrusters process: `python -m hindrax_drivers.nodes.thrusters --ros-args ...`.

It becomes the dead man at once, which starts the node as its child with the same arguments and `--node BEAT LIFE`. With
`--neutral` before them the dead man only writes neutral: for a supervisor that killed another.
"""

import json
import os
import sys

ARGUMENTS = "HINDRAX_THRUSTERS_ARGUMENTS"
NODE_WORD, NEUTRAL_WORD = "--node", "--neutral"


def main() -> int:
    """Run the node under the dead man, or replace this process by the dead man.

    Under a new name and without arguments: killing "thrusters" by name must not kill the dead man.
    """
    words = sys.argv[1:]
    if words[:1] != [NODE_WORD]:
        os.environ[ARGUMENTS] = json.dumps(words)
        os.execv(sys.executable, [sys.executable, "-m", "hindrax_drivers.nodes.deadman"])  # noqa: S606  # ourselves
    from hindrax_drivers.nodes import thrusters_node  # noqa: PLC0415  # the dead man does without ROS

    return thrusters_node.main(words[3:], beat=int(words[1]), life=int(words[2]))


if __name__ == "__main__":
    sys.exit(main())
