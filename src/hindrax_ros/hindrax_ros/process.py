"""The loop of every process: one events executor, nodes, a clean end on SIGINT and SIGTERM.

The multi-threaded executor of rclpy starves timers (rclpy issue 1452) and `EventsExecutor.spin` does not return on
signals, so the loop takes turns itself (see `batched_node`).
"""

import gc
import inspect
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from types import FrameType

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from hindrax_core.errors import HindraxError, UsageError
from hindrax_ros.batched_node import BatchedNode, SpinLoop, events_executor
from hindrax_ros.heartbeat import VARIABLE, HeartbeatFile
from hindrax_ros.parameters import warn_of_unknown_parameters
from hindrax_ros.standstill import STOOD_STILL, StandstillWatch

REMAP, RENAMES = ("-r", "--remap"), ("__node:=", "__name:=")
LONGEST_END_S = 60
"""The supervisor waits for less; this is for a process that has outlived it."""


class StopSignal:
    """Set by the first SIGINT or SIGTERM. What has not ended `LONGEST_END_S` later is ended by the kernel (SIGALRM).

    A close that hangs inside of a library lets no handler of Python run, so it would be deaf to every later signal.
    """

    def __init__(self) -> None:
        self.asked = False
        self.number = 0
        """Of the signal that asked."""
        signal.signal(signal.SIGINT, self._ask)
        signal.signal(signal.SIGTERM, self._ask)

    def _ask(self, number: int, _frame: FrameType | None) -> None:
        if not self.asked:
            self.number = number
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(LONGEST_END_S)
        self.asked = True


def spin(
    make: Callable[[], Sequence[Node]],
    arguments: Sequence[str] | None = None,
    stop: StopSignal | None = None,
    *,
    renamed: str = "",
) -> int:
    """Make the nodes, spin them until a stop signal, close them.

    A node that owns something (a port, a thread, a file) offers `close()`, called before it is destroyed. An exception
    in a callback is our own mistake: nothing catches it, the process ends and its supervisor starts it again. So does
    a process that has a supervisor and stood still for too long (`standstill`).

    Parameters
    ----------
    make
        Makes the nodes; those that cannot be made with their arguments give a one-line error.
    arguments
        Of the process; None: its own.
    stop
        Signal to stop; None: SIGINT and SIGTERM.
    renamed
        The node that `-r __node:=NAME` means.

    Returns
    -------
    int
        Exit code of the process.
    """
    arguments = scoped(sys.argv if arguments is None else arguments, renamed)
    stop, heartbeat = stop or StopSignal(), HeartbeatFile(os.environ)
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    watch = StandstillWatch()
    nodes: Sequence[Node] = ()
    executor = events_executor()
    try:
        try:
            nodes = make()
            require_own_names([node.get_fully_qualified_name() for node in nodes])
        except HindraxError as error:
            print(error, file=sys.stderr, flush=True)  # noqa: T201  # for the operator, in the log of the process
            return error.exit_code
        for node in nodes:
            executor.add_node(node)
        warn_of_unknown_parameters(nodes)
        loop = SpinLoop(nodes, executor)
        _avoid_late_pauses()
        while not stop.asked:
            loop.spin_once()
            heartbeat.beat(time.monotonic())
            if (still_s := watch.stood_still_s()) and _begins_anew(still_s):
                return STOOD_STILL
    finally:
        for node in nodes:
            getattr(node, "close", lambda: None)()
        for node in nodes:
            if isinstance(node, BatchedNode):
                node.publish_queue.flush()
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
        watch.close()
    return 0


def _begins_anew(still_s: float) -> bool:
    """Whether this process is to end, after a standstill, since a supervisor starts it again; says so."""
    supervised = bool(os.environ.get(VARIABLE))
    remedy = "it begins anew" if supervised else "if others do not hear it, start it again"
    found = f"this process stood still for {still_s:.1f} s, and ROS may have lost it"
    print(f"{found}: {remedy}", file=sys.stderr, flush=True)  # noqa: T201  # for the operator, in the log of the process
    return supervised


def scoped(arguments: Sequence[str], node: str) -> list[str]:
    """Arguments of a process of which a rule without a node, `-r __node:=NAME`, renames only this one; none: all."""
    after = zip(["", *arguments], arguments, strict=False)
    return [f"{node}:{word}" if node and flag in REMAP and word.startswith(RENAMES) else word for flag, word in after]


def require_own_names(names: Sequence[str]) -> None:
    """UsageError where two nodes of a process have one name: ROS would mix up their services and parameters."""
    for name in names:
        if (count := names.count(name)) == 1:
            continue
        found = f"{count} nodes of one process have the name {name}"
        raise UsageError(f"{found}, wanted one each; say which is renamed: `-r NODE:__node:=NAME`")


def _avoid_late_pauses() -> None:
    """Do now what would interrupt the loop later, 43 ms each in the control process.

    rclpy asks where the caller is before it logs, for which Python looks up the files of all modules, once; and the
    collector of garbage need never look through what was made at the start.
    """
    here = inspect.currentframe()
    assert here is not None
    inspect.getframeinfo(here)
    gc.freeze()
