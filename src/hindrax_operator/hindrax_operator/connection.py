"""How the operator's commands find a running stack and join its ROS graph."""

from __future__ import annotations

import argparse
import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING

from hindrax_bringup.network.tether import add_tether, tether_setting, wait_for_address
from hindrax_bringup.ros_graph import DOMAIN
from hindrax_bringup.stack import adopted, environment, environment_beside
from hindrax_bringup.stack_lock import StackLock, choose, require_meant, stacks
from hindrax_core.stack_time import StackTime
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.topics import NAMESPACE, namespace_fault

if TYPE_CHECKING:
    from hindrax_operator.nodes.operator_node import Operator

TETHER_S = 10.0
FOLLOW_S = 1.0


def add_stack(parser: argparse.ArgumentParser) -> None:
    """Declare the option for the stack; default: the only one that runs, else the ROS graph of this terminal."""
    parser.add_argument("--stack", type=int, metavar="PID", help="which stack, when several run (as `up` prints it)")
    parser.add_argument(
        "--namespace", type=namespace, default=NAMESPACE, metavar="/NAME", help=f"which vehicle; default {NAMESPACE}"
    )
    add_sim_time(parser)
    add_tether(parser)


def namespace(text: str) -> str:
    """Argument type: the namespace of a vehicle."""
    if wrong := namespace_fault(text):
        raise argparse.ArgumentTypeError(wrong)
    return text


def add_sim_time(parser: argparse.ArgumentParser) -> None:
    """Declare the option for the clock of a mock that is not announced on this machine."""
    parser.add_argument(
        "--sim-time", action="store_true", help="use /clock; only for a stack that `up` did not start here"
    )


def chosen_stack(arguments: argparse.Namespace) -> StackLock | None:
    """Pick the stack that is meant, None when none is announced."""
    found = stacks()
    if arguments.namespace != NAMESPACE:
        found = [one for one in found if one.namespace == arguments.namespace]
    return choose(found, arguments.stack)


@contextlib.contextmanager
def joined(
    found: StackLock | None,
    *,
    sim_time: bool = False,
    namespace: str = NAMESPACE,
    tick: Callable[[], None] = lambda: None,
    beating: bool = True,
) -> Iterator[Operator]:
    """Yield an operator in the graph of a stack, with its time known.

    Parameters
    ----------
    found
        The stack; None: the graph of this terminal.
    sim_time
        Whether the time comes by /clock though no mock of ours is `found`.
    namespace
        Of the nodes, where no stack is `found`.
    tick
        Called between the operator's spins.
    beating
        Whether it sends the heartbeat of an operator.

    Yields
    ------
    Operator
        It follows a stack that restarts because the wall clock was set.
    """
    here = _graph_of_this_terminal() if found is None else environment_beside(found)
    with adopted(here):
        from hindrax_operator.nodes.operator_node import Operator  # noqa: PLC0415  # rclpy reads the environment first

        due_s = 0.0

        def keep_time() -> None:
            """Follow a stack that has restarted because the wall clock was set."""
            nonlocal due_s
            if found is not None and time.monotonic() >= due_s:
                due_s = time.monotonic() + FOLLOW_S
                now = next((one for one in stacks() if one.pid == found.pid), found)
                operator.node.stack_time = StackTime.of(now.graph)
            tick()

        mock = sim_time or (found is not None and found.mock)
        with Operator(mock=mock, namespace=namespace if found is None else found.namespace, tick=keep_time) as operator:
            operator.beat(on=beating)
            operator.wait_for_time()
            yield operator


def _graph_of_this_terminal() -> dict[str, str]:
    tether = tether_setting()
    if tether is not None:
        wait_for_address(tether, TETHER_S, lambda: False, print_stderr)
    return environment(mock=False, domain=None, tether=tether)


def find_stack(arguments: argparse.Namespace) -> StackLock | None:
    """Pick the stack; when none is announced, print where it is searched."""
    found = chosen_stack(arguments)
    if found is None:
        _report_search()
    return found


def _report_search() -> None:
    tether = tether_setting()
    where = f"over the tether {tether.interface}" if tether else "in the ROS graph of this terminal"
    print_stderr(f"no `./hindrax up` runs here; looking {where}")


def meant_stack(arguments: argparse.Namespace) -> StackLock | None:
    """Pick the stack of an order; UsageError where this terminal, by its domain or its clone, may mean another one."""
    found = chosen_stack(arguments)
    if found is not None and arguments.stack is None:
        require_meant(found, os.environ)
    return found


def ordered_stack(arguments: argparse.Namespace) -> StackLock | None:
    """Pick the stack that an order is for, and print which vehicle that is, before anything else."""
    found = meant_stack(arguments)
    announce_target(found, arguments)
    return found


def announce_target(found: StackLock | None, arguments: argparse.Namespace) -> None:
    """Print which vehicle a command is for; when none is announced, also where it is searched."""
    if found is not None:
        text = found.whole_title
    else:
        _report_search()
        kind = "mock" if arguments.sim_time else "mock or real unknown here"
        text = f"vehicle in {arguments.namespace} ({kind}), {_terminal_graph(environment(mock=False, domain=None))}"
    print_stderr(f"vehicle: {text}")


def _terminal_graph(made: Mapping[str, str]) -> str:
    """The graph of this terminal: its domain, and the tether where one is named."""
    tether = tether_setting()
    over = f", over the tether {tether.interface}" if tether else ", this machine"
    return f"ROS domain {made.get(DOMAIN, '0')}{over}"


@contextlib.contextmanager
def operator_of(arguments: argparse.Namespace, *, moves: bool = True) -> Iterator[Operator]:
    """Yield an operator in the graph selected by the arguments of a command, and print which vehicle it is.

    Parameters
    ----------
    arguments
        With `stack`, `sim_time` and `namespace`.
    moves
        Whether the command may make a thruster turn, so that nothing but the meant vehicle will do.

    Yields
    ------
    Operator
        With its time known; as of `joined`.
    """
    found = meant_stack(arguments) if moves else chosen_stack(arguments)
    announce_target(found, arguments)
    with joined(found, sim_time=arguments.sim_time, namespace=arguments.namespace) as operator:
        yield operator
