"""Start of the tool: catches Ctrl-C before it imports anything that takes time."""

import os
import sys

from hindrax_cli import interrupt


def main() -> int:
    """Run the tool and return its exit code."""
    interrupt.listen()
    _use_one_thread_for_algebra()
    from hindrax_bringup.ros_graph import without_missing_rmw  # noqa: PLC0415  # takes a tenth of a second
    from hindrax_cli.command_line import main as run  # noqa: PLC0415  # as above

    without_missing_rmw(os.environ)
    return run()


def without_ros() -> int:
    """Run the tool of the wheel, which joins no graph."""
    interrupt.listen()
    _use_one_thread_for_algebra()
    from hindrax_cli.command_line import main as run  # noqa: PLC0415  # as above

    return run()


def _use_one_thread_for_algebra() -> None:
    """Before numpy is imported; who has set it, has the last word.

    The matrices are small: threads would wait for each other, in loops that take four times the time of a fit.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


if __name__ == "__main__":
    sys.exit(main())
