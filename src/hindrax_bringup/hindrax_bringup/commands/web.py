"""`hindrax web`: the live view and the maneuvers in a browser."""

from __future__ import annotations

import argparse
import secrets
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from hindrax_bringup.commands._operator import add_stack, presence_of
from hindrax_bringup.up_run import asked_to_end, say
from hindrax_bringup.vehicles import default_vehicle
from hindrax_bringup.web.access import Access, hosts_of
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.vehicle import load_vehicle

if TYPE_CHECKING:
    from hindrax_bringup.monitor.link import Link
    from hindrax_bringup.web.desk import Desk

NAME = "web"
HELP = "live view in a browser: plots, the pool from above, maneuvers, finished reports"
EXAMPLE = "./hindrax web\n  ./hindrax web --read-only --address 192.168.2.2"
PORT = 8480
JOIN_S, HEAR_S = 15.0, 10.0
TURN_S = 0.1
TOKEN_bytes = 24


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where it is served, and what it may."""
    parser.add_argument(
        "--address",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="of this machine, in numbers; default 127.0.0.1, which only this machine reaches",
    )
    parser.add_argument("--port", type=int, default=PORT, help=f"default {PORT}; 0: any free one")
    parser.add_argument("--read-only", action="store_true", help="no orders from the page, for people who watch")
    parser.add_argument(
        "--runs",
        type=Path,
        default=Path("runs"),
        metavar="DIR",
        help="folder of runs whose reports are shown; default runs",
    )
    add_stack(parser)


def run(arguments: argparse.Namespace) -> int:
    """Bind, join the graph, say the address, serve until Ctrl-C."""
    if not 0 <= arguments.port < 1 << 16:
        raise UsageError(f"--port: found {arguments.port}, wanted 0 to 65535")
    access = Access(hosts_of(arguments.address), secrets.token_urlsafe(TOKEN_bytes))
    from hindrax_bringup.monitor.link import Link  # noqa: PLC0415  # help must not wait for numpy
    from hindrax_bringup.web.desk import Attendance, Desk  # noqa: PLC0415  # as above
    from hindrax_bringup.web.reports import Reports  # noqa: PLC0415  # as above
    from hindrax_bringup.web.summary import Chart  # noqa: PLC0415  # as above

    found = presence_of(arguments)
    chart = Chart(load_vehicle(Path(found.vehicle) if found else default_vehicle()))
    attendance = Attendance()
    link = Link(found, sim_time=arguments.sim_time, present=attendance.present)
    desk = Desk(link, chart, Reports(arguments.runs), attendance, read_only=arguments.read_only, say=say)
    with asked_to_end() as over:
        _serve(arguments, access, desk, link, over)
    return 0


def _serve(arguments: argparse.Namespace, access: Access, desk: Desk, link: Link, over: Callable[[], bool]) -> None:
    from hindrax_bringup.web.server import Server  # noqa: PLC0415  # only the command that serves pays for it

    server = Server(arguments.address, arguments.port, access, desk)
    link.start()
    try:
        _hear(link, over)
        threading.Thread(target=server.serve_forever, name="web", daemon=True).start()
        print(welcome(arguments.address, server.port, access.token, read_only=arguments.read_only), flush=True)
        while not over() and link.is_alive():
            time.sleep(TURN_S)
        server.close()
    finally:
        server.server_close()
        link.close()
    if link.error is not None:
        raise link.error


def _hear(link: Link, over: Callable[[], bool]) -> None:
    """Wait for the vehicle's first word; HindraxError when there is none."""
    link.wait(JOIN_S)
    deadline = time.monotonic() + HEAR_S
    while link.picture().silent_s > HEAR_S and not over():
        if time.monotonic() > deadline:
            raise HindraxError(
                f"no vehicle is heard ({link.title}); start one with `./hindrax up`, or name the tether with --tether"
            )
        time.sleep(TURN_S)


def welcome(address: str, port: int, token: str, *, read_only: bool) -> str:
    """Return where the page is. The token stands behind the #, which a browser never sends anywhere."""
    host = f"[{address}]" if ":" in address else address
    lines = [f"web: http://{host}:{port}/#{token}", "  whoever has this address may watch"]
    lines[1] += "" if read_only else ", fly while the vehicle is armed, and stop it"
    if "localhost" in hosts_of(address):
        lines.append(
            f"  from another machine: ssh -L {port}:localhost:{port} THIS_MACHINE, then the same address there"
        )
    else:
        lines.append("  it travels unencrypted: use it on a network of your own, such as the tether, or through ssh -L")
    return "\n".join([*lines, "  Ctrl-C ends it"])
