"""Start of the tool: catches Ctrl-C before it imports anything that takes time."""

import os
import sys
from collections.abc import Callable

try:
    from hindrax_cli import interrupt
except KeyboardInterrupt:  # nothing catches it yet
    os.write(2, b"hindrax: stopped by Ctrl-C\n")
    os._exit(130)


def main() -> int:
    """Run the tool and return its exit code."""
    _open_standard_streams()
    interrupt.listen()
    _use_one_thread_for_algebra()
    return _whole(_run, "`./hindrax setup` completes the environment")


def without_ros() -> int:
    """Run the tool of the wheel, which joins no graph."""
    _open_standard_streams()
    interrupt.listen()
    _use_one_thread_for_algebra()
    return _whole(_run_without_ros, "install hindrax again, with what it needs (`pip install --force-reinstall`)")


def _run() -> int:
    from hindrax_bringup.ros_graph import without_missing_rmw  # noqa: PLC0415  # takes a tenth of a second
    from hindrax_cli.command_line import main as run  # noqa: PLC0415  # as above

    without_missing_rmw(os.environ)
    return run()


def _run_without_ros() -> int:
    from hindrax_cli.command_line import main as run  # noqa: PLC0415  # as above

    return run()


def _whole(run: Callable[[], int], remedy: str) -> int:
    """Run the tool; a package of Python that cannot be imported is one sentence. The tool cannot say it: it needs some.

    Parameters
    ----------
    run
        Returns an exit code.
    remedy
        What completes this installation.

    Returns
    -------
    int
        Of the tool; 1 where it could not run.
    """
    try:
        return run()
    except ImportError as error:
        why = str(error).strip().partition("\n")[0]
        path = os.environ.get("PYTHONPATH", "")
        other = f"PYTHONPATH is {path}: `unset PYTHONPATH`; if that does not help, " if path else ""
        sys.stderr.write(f"hindrax: cannot be imported: {why}; {other}{remedy}\n")
        return 1


def _open_standard_streams() -> None:
    """Let input, output or errors that the caller has closed (`>&-`) lead nowhere, and the others take any letter.

    What is opened next gets the number of a closed one: a sentence of this process or of a child would go to a device.
    """
    for name, number in (("stdin", 0), ("stdout", 1), ("stderr", 2)):
        try:
            os.fstat(number)
        except OSError:
            nowhere = os.open(os.devnull, os.O_RDWR)
            os.set_inheritable(nowhere, True)
            setattr(sys, name, os.fdopen(nowhere, "r" if number == 0 else "w", closefd=False))
    for stream in (sys.stdout, sys.stderr):
        # An arrow, or the umlaut of a path, in a terminal or pipe of another encoding, as of Windows: a question mark.
        stream.reconfigure(errors="replace")  # type: ignore[union-attr]  # an io.TextIOWrapper


def _use_one_thread_for_algebra() -> None:
    """Before numpy is imported; who has set it, has the last word.

    The matrices are small: threads would wait for each other, in loops that take four times the time of a fit.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


if __name__ == "__main__":
    sys.exit(main())
