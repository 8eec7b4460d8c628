"""Start of the tool: catches Ctrl-C before it imports anything that takes time."""

import os
import sys

from hindrax_cli import interrupt


def main() -> int:
    """Run the tool and return its exit code."""
    _open_standard_streams()
    interrupt.listen()
    _use_one_thread_for_algebra()
    from hindrax_bringup.ros_graph import without_missing_rmw  # noqa: PLC0415  # takes a tenth of a second
    from hindrax_cli.command_line import main as run  # noqa: PLC0415  # as above

    without_missing_rmw(os.environ)
    return run()


def without_ros() -> int:
    """Run the tool of the wheel, which joins no graph."""
    _open_standard_streams()
    interrupt.listen()
    _use_one_thread_for_algebra()
    from hindrax_cli.command_line import main as run  # noqa: PLC0415  # as above

    return run()


def _open_standard_streams() -> None:
    """Where the caller has closed input, output or errors (`>&-`), let them lead nowhere.

    What is opened next gets the number of a closed one: a sentence of this process or of a child would go to a device.
    """
    for name, number in (("stdin", 0), ("stdout", 1), ("stderr", 2)):
        try:
            os.fstat(number)
        except OSError:
            nowhere = os.open(os.devnull, os.O_RDWR)
            os.set_inheritable(nowhere, True)
            setattr(sys, name, os.fdopen(nowhere, "r" if number == 0 else "w", closefd=False))


def _use_one_thread_for_algebra() -> None:
    """Before numpy is imported; who has set it, has the last word.

    The matrices are small: threads would wait for each other, in loops that take four times the time of a fit.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


if __name__ == "__main__":
    sys.exit(main())
