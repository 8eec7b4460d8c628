"""`hindrax status`: the stacks that run on this machine."""

import argparse
import time
from dataclasses import asdict, dataclass
from functools import partial

from hindrax_analysis.terminal import print_answer, print_table, print_what_fits, working
from hindrax_bringup.liveness import NOBODY, liveness_of_stacks
from hindrax_bringup.network.tether import tether_setting
from hindrax_bringup.stack_lock import StackLock, runtime_place, stacks, vehicle_name
from hindrax_cli.argument_types import add_json
from hindrax_cli.command import command
from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import print_fitted

THRUSTERS_S, DIAGNOSTICS_S = 3.0, 1.5
"""Longest wait for the state of the thrusters, and time in which every node reports once."""
WELL = "ok"
UNKNOWN, ILL = "unknown", "below"
"""Of the thrusters of a stack that does not answer; of a health that is told below the table."""


@dataclass(slots=True)
class StackStatus:
    """One row; `stack` is the number that `--stack` takes."""

    stack: int
    what: str
    vehicle: str = ""
    domain: str = ""
    thrusters: str = ""
    age_s: float | None = None
    health: str = WELL
    bag: str = ""


@command("./hindrax status", add_json)
def status(arguments: argparse.Namespace) -> int:
    """Every stack on this machine: what it does, domain, armed or not, age, health, bag."""
    now_s = time.monotonic()
    alive, found = liveness_of_stacks(runtime_place(), now_s), stacks()
    with working("asking the stacks"):
        rows = [_status(one, alive.get(one.pid), now_s) for one in found]
    known = {one.pid for one in found}
    rows += [StackStatus(pid, what, health=wrong or WELL) for pid, (what, wrong) in alive.items() if pid not in known]
    return print_answer(
        {"stacks": rows}, lambda: _show(rows) if rows else print_fitted(_nobody()), as_json=arguments.json
    )


def _nobody() -> str:
    """Sentence for no stack on this machine, which may be the other end of a tether."""
    tether = tether_setting()
    if tether is None:
        return NOBODY
    return f"no stack is up here; `./hindrax monitor` shows the vehicle over the tether {tether.interface}"


def _status(stack: StackLock, alive: tuple[str, str] | None, now_s: float) -> StackStatus:
    """State of a stack from lock file, liveness file and graph."""
    doing, wrong = alive or ("", "")
    what, _, thrusters = doing.rpartition(": ")
    age_s = round(now_s - stack.started_s, 1)
    fields = _vehicle(stack), stack.domain, thrusters if what else "", age_s, wrong or WELL, stack.bag
    made = StackStatus(stack.pid, what or stack.purpose, *fields)
    if stack.waits_for_operator:
        _ask(stack, made)
    return made


def _vehicle(stack: StackLock) -> str:
    name = vehicle_name(stack.vehicle)
    return f"{name} (mock)" if stack.mock else name


def _ask(stack: StackLock, made: StackStatus) -> None:
    """Fill in what only the graph of a stack shows, without an operator heartbeat."""
    from hindrax_operator.connection import joined  # noqa: PLC0415  # rclpy is loaded only where it is needed
    from hindrax_operator.snapshot import node_problems  # noqa: PLC0415  # as above

    made.thrusters = UNKNOWN
    try:
        with joined(stack, beating=False) as operator:
            found = operator.awaited(lambda: operator.thrusters, THRUSTERS_S, lambda: "the state of the thrusters")
            made.thrusters = found.state
            if made.health == WELL:
                operator.pause(DIAGNOSTICS_S)
                made.health = "; ".join(node_problems(operator)) or WELL
    except HindraxError as error:
        made.health = str(error) if made.health == WELL else made.health


def _show(rows: list[StackStatus]) -> None:
    headings = ["stack", "command", "vehicle", "ROS domain", "thrusters", "age [s]"]
    wrong = [one for one in rows if one.health != WELL]
    short = [
        {"age_s": "" if one.age_s is None else f"{one.age_s:.0f}", "health": WELL if one.health == WELL else ILL}
        for one in rows
    ]
    cells = [list((asdict(one) | shown).values()) for one, shown in zip(rows, short, strict=True)]

    def way(*, whole: bool) -> None:
        print_table("", headings[:3], headings[3:], cells, ["health", "bag"], spare=["age [s]", "bag"])
        for one in wrong:
            print_fitted(f"{one.stack}: {one.health if whole else one.health.partition('; ')[0]}")
        if wrong and not whole:
            print_fitted("(no room here for the rest; --json has it)")

    print_what_fits(partial(way, whole=True), partial(way, whole=False))
