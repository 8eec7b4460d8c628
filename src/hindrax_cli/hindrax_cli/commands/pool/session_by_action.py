"""`hindrax pool-test --session --action`: the guided session, begun by a client of the ROS 2 action `session/run`."""

import argparse
import contextlib
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from hindrax_analysis.identification.pool_session import PoolSession
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.network.security import SESSION
from hindrax_bringup.network.tether import available_tether
from hindrax_bringup.ros_graph import DOMAIN, graph_settings, lines_to_join
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_cli.commands.pool.guided_session import check_options, goes_on, guided, opened, planned_session
from hindrax_control.maneuver.goal import Goal, check_goal
from hindrax_core.errors import INTERRUPTED, HindraxError, UsageError
from hindrax_core.text.refusals import STOPPED, Reason, Refusal, refusal_of
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.topics import NAMESPACE

if TYPE_CHECKING:
    from hindrax_operator.nodes.session_server import SessionServer

CANCELLED = Refusal(Reason.CANCELLED, "cancelled: by the client; the command of the session goes on with it")


def guide_by_action(arguments: argparse.Namespace) -> int:
    """Wait for a goal, and fly the session that it asks for.

    Parameters
    ----------
    arguments
        Of `pool-test`.

    Returns
    -------
    int
        As of `guide`; INTERRUPTED also when the client cancels.

    Raises
    ------
    UsageError
        As of `guide`, before a goal is waited for; and for `--yes` on a real vehicle.
    HindraxError
        As of `guide`; its client has the sentence too.
    """
    check_options(arguments)
    if arguments.yes and not arguments.mock:
        raise UsageError("--action: found --yes too, wanted a person at this terminal, whose Enter arms; leave it out")
    planned_session(arguments)  # what is wrong with the command is said here, not to a client later
    with served(mock=arguments.mock) as server:
        try:
            session, folder = _asked_for(arguments, server)
            code = guided(arguments, session, folder, server)
        except KeyboardInterrupt:
            server.end(CANCELLED if server.cancelled else STOPPED)
            raise
        except HindraxError as error:
            server.end(refusal_of(error))
            raise
        if code == INTERRUPTED:
            server.end(CANCELLED if server.cancelled else STOPPED)
        else:
            server.end(server.aborted, identified=code == 0)
        return code


def _asked_for(arguments: argparse.Namespace, server: "SessionServer") -> tuple[PoolSession, RunFolder]:
    """Wait for a goal that can be flown, and open its session."""
    while True:
        goal = server.goal()
        try:
            return opened(_with_goal(arguments, goal.motions, goal.repeats))
        except UsageError as error:
            print_stderr(f"refused a goal: {error}")
            why = refusal_of(error)
            server.end(why if why.reason is not Reason.UNNAMED else Refusal(Reason.GOAL, why))


def _with_goal(arguments: argparse.Namespace, motions: Sequence[str], repeats: int) -> argparse.Namespace:
    """Arguments of the command with what a goal names; UsageError for wrong ones, or a session that goes on."""
    if not motions and not repeats:
        return arguments
    if goes_on(arguments):
        found = f"motions {', '.join(motions) or 'not named'}, repeats {repeats}"
        raise UsageError(f"--session {arguments.session}: found {found}, wanted neither: it goes on as it began")
    if motions and list(motions) != ["all"]:
        check_goal(Goal(tuple(motions)))
    named = {"dof": list(motions) or arguments.dof, "repeats": repeats or arguments.repeats}
    return argparse.Namespace(**{**vars(arguments), **named})


@contextlib.contextmanager
def served(*, mock: bool) -> Iterator["SessionServer"]:
    """Serve the action in the graph of the stacks that the session will start, and say how a client joins it.

    Parameters
    ----------
    mock
        Whether they are of the mock vehicle: then they all have one domain, which is free or that of the terminal.

    Yields
    ------
    SessionServer
        Until the end of the block.
    """
    with own_domain(mock=mock) as domain:
        graph = environment(mock=mock, domain=domain, tether=None if mock else available_tether(print_stderr))
        with adopted(graph):
            from hindrax_operator.nodes.session_server import SessionServer  # noqa: PLC0415  # rclpy reads the environment as it is imported

            server = SessionServer(_interrupt)
        with server, _in_domain(domain):
            print_stderr(f"waiting for a goal of {NAMESPACE}/{SESSION}; Ctrl-C ends it. With ROS 2 tools:")
            for line in lines_to_join(os.environ, graph_settings(graph)):
                print_stderr(f"    {line}")
            yield server


def _interrupt() -> None:
    """End what the main thread does as Ctrl-C does; that itself is ignored by what a shell runs in the background."""
    signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)


@contextlib.contextmanager
def _in_domain(domain: int | None) -> Iterator[None]:
    """Have the stacks that are started meanwhile take a domain; None: as it is."""
    before = os.environ.get(DOMAIN)
    if domain is not None:
        os.environ[DOMAIN] = str(domain)
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(DOMAIN, None)
        else:
            os.environ[DOMAIN] = before
