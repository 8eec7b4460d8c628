"""The live view of a vehicle: `hindrax monitor` in a terminal, `hindrax web` in a browser, with the maneuvers."""

from __future__ import annotations

import argparse
import secrets
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from hindrax_bringup.share_files import usual_vehicle, vehicle_file
from hindrax_bringup.stack_lock import runtime_folder
from hindrax_bringup.stack_runner import asked_to_end
from hindrax_cli.argument_types import within
from hindrax_cli.command import command, option
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_fitted, print_stderr, print_whole
from hindrax_core.text.text_file import replace_text, writing
from hindrax_core.vehicle import AXES, load_vehicle
from hindrax_operator.connection import add_stack, chosen_stack, find_stack, ordered_stack
from hindrax_operator.web.access import granted, is_loopback

if TYPE_CHECKING:
    from hindrax_operator.monitor.graph_link import GraphLink

PORT = 8480
JOIN_S, VEHICLE_S = 15.0, 10.0
TURN_S = 0.1
TOKEN_bytes = 24


@command("./hindrax monitor", add_stack)
def monitor(arguments: argparse.Namespace) -> int:
    """Live view in the terminal (also over ssh); keys to stop and disarm."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):  # where textual reads keys, and where it draws
        raise UsageError("found no terminal to draw on, wanted one; over ssh use `ssh -t`")
    from hindrax_operator.monitor.app import Monitor  # noqa: PLC0415  # textual takes long to load
    from hindrax_operator.monitor.graph_link import GraphLink  # noqa: PLC0415  # as above

    link = GraphLink(chosen_stack(arguments), sim_time=arguments.sim_time, namespace=arguments.namespace)
    link.start()
    try:
        link.wait(JOIN_S)
        return Monitor(link).run() or 0
    finally:
        link.close()


@command(
    "./hindrax web\n./hindrax web --read-only --address 192.168.2.2",
    option(
        "--address",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="numeric address of this machine; default 127.0.0.1, reachable from this machine only",
    ),
    option(
        "--host",
        action="append",
        default=[],
        metavar="NAME",
        help="only name by which browsers may call it, beside addresses in numbers (may be repeated); with it "
        "--address may be 0.0.0.0, as in a container",
    ),
    option("--port", type=within(int, 0, 65535), default=PORT, help=f"default {PORT}; 0: any free one"),
    option("--read-only", action="store_true", help="no commands from the page, for spectators"),
    option("--new-token", action="store_true", help="a new address; earlier ones stop working"),
    option(
        "--runs",
        type=Path,
        default=Path("runs"),
        metavar="DIR",
        help="folder of runs whose reports are shown; default runs",
    ),
    add_stack,
)
def web(arguments: argparse.Namespace) -> int:
    """Live view in a browser: plots, the pool from above, maneuvers, finished reports."""
    read_only = arguments.read_only
    shown = arguments.host[0] if arguments.host else arguments.address
    token = kept_token(read_only=read_only, new=arguments.new_token)
    access = granted(arguments.address, arguments.host, token)
    from hindrax_control.maneuver.goal import flyable_motions  # noqa: PLC0415  # help must not wait for numpy
    from hindrax_operator.monitor.graph_link import GraphLink  # noqa: PLC0415  # as above
    from hindrax_operator.web.http_server import Server  # noqa: PLC0415  # as above
    from hindrax_operator.web.page_controller import PageController  # noqa: PLC0415  # as above
    from hindrax_operator.web.reports import Reports  # noqa: PLC0415  # as above

    found = find_stack(arguments) if read_only else ordered_stack(arguments)
    vehicle = load_vehicle(Path(found.vehicle) if found else vehicle_file(usual_vehicle()))
    link = GraphLink(found, sim_time=arguments.sim_time, namespace=arguments.namespace)
    controller = PageController(link, vehicle, Reports(arguments.runs), read_only=read_only, log=print_stderr)
    with asked_to_end() as over:
        server = Server(arguments.address, arguments.port, access, controller)
        link.start()
        try:
            _wait_for_vehicle(link, over)
            server.start()
            print_stderr(f"{vehicle.name} {flyable_motions(AXES, vehicle)}")
            print_fitted(startup_text(shown, server.port, access.token, read_only=read_only))
            if sys.stdout.isatty() and "localhost" not in access.hosts:
                print_whole(qr_code(page_url(shown, server.port, access.token)))
            while not over() and link.is_alive():
                if not server.is_alive():
                    raise HindraxError(
                        "the server of the page has ended, by a software defect; restart `./hindrax web`"
                    )
                time.sleep(TURN_S)
        finally:
            server.close()
            link.close()
        if link.error is not None:
            raise link.error
    return 0


def kept_token(*, read_only: bool, new: bool = False) -> str:
    """Return this user's token: the same after a restart, so that open pages stay valid.

    Parameters
    ----------
    read_only
        Whether it is that of a page that only shows.
    new
        Whether to make another one, so that addresses that were given away no longer open the page.

    Returns
    -------
    str
        Kept in the runtime folder, readable by this user only.
    """
    file = runtime_folder() / ("web.watch.token" if read_only else "web.token")
    file.touch(mode=0o600)
    kept = "" if new else file.read_text(encoding="ascii")
    if kept:
        return kept
    token = secrets.token_urlsafe(TOKEN_bytes)
    with writing(file, "make room there and run again"):
        replace_text(file, token)
    return token


def _wait_for_vehicle(link: GraphLink, over: Callable[[], bool]) -> None:
    """Wait for the first message of the vehicle; HindraxError when there is none."""
    link.wait(JOIN_S)
    deadline = time.monotonic() + VEHICLE_S
    while link.snapshot().silent_s > VEHICLE_S and not over():
        if time.monotonic() > deadline:
            raise HindraxError(
                f"no vehicle found ({link.title}); start one with `./hindrax up`, or name the tether with --tether"
            )
        time.sleep(TURN_S)


def page_url(address: str, port: int, token: str) -> str:
    """Return the address of the page with the token, as a browser takes it.

    Parameters
    ----------
    address, port
        Which the server listens at; IPv6 gets its brackets.
    token
        Stands behind the #, which a browser never sends anywhere.

    Returns
    -------
    str
        http://ADDRESS:PORT/#TOKEN.
    """
    return f"http://{f'[{address}]' if ':' in address else address}:{port}/#{token}"


def qr_code(text: str) -> str:
    """Return a QR code for a terminal: black on white whatever its colors are, two rows of modules per line."""
    import segno  # noqa: PLC0415  # only an address for a phone needs it

    rows = [list(row) for row in segno.make(text, error="m", micro=False).matrix_iter(border=4)]
    pairs = zip(rows[::2], [*rows[1::2], [0] * len(rows[0])], strict=False)
    lines = ["".join(" \u2584\u2580\u2588"[2 * top + low] for top, low in zip(*pair, strict=True)) for pair in pairs]
    return "\n".join(f"  \x1b[38;5;16;48;5;231m{line}\x1b[0m" for line in lines)


def startup_text(address: str, port: int, token: str, *, read_only: bool) -> str:
    """Return where the page is, and how to see it from another machine.

    Parameters
    ----------
    address, port, token
        As of `page_url`.
    read_only
        Whether it only shows.

    Returns
    -------
    str
        Lines.
    """
    lines = [f"web: {page_url(address, port, token)}", "  anyone with this address may watch"]
    lines[1] += "" if read_only else ", fly while the vehicle is armed, and stop it"
    if is_loopback(address):
        lines.append(
            f"  from another machine: ssh -L {port}:localhost:{port} THIS_MACHINE, then the same address there"
        )
    else:
        lines.append("  it travels unencrypted: use it on a network of your own, such as the tether, or through ssh -L")
    return "\n".join([*lines, "  Ctrl-C ends it"])
