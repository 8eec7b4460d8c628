"""`hindrax doctor`: what is wrong, and the remedy."""

import argparse
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from hindrax_analysis.terminal import console, print_answer, print_what_fits
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.network.tether import add_tether, tether_setting
from hindrax_bringup.ros_graph import full_shared_memory
from hindrax_bringup.stack import FAULT_HELP, MockOptions, Stack, environment
from hindrax_bringup.stack_lock import UP, StackLock, stacks
from hindrax_bringup.supervisor import Supervisor
from hindrax_cli.argument_types import add_json, add_tuning, add_vehicle, output_settings
from hindrax_cli.command import command, option
from hindrax_cli.commands.operate.up_stop import require_known
from hindrax_cli.health_checks import Check, machine, nodes, wires
from hindrax_cli.health_checks.pi import board
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_drivers.nodes.thruster_settings import Settings
from hindrax_operator.connection import add_sim_time, joined

LEAST_FOUND = 30
"""Characters a line in which what was found is readable beside the names."""

GAPS = 6
"""Between mark, name and what was found [characters]."""


@command(
    "# asks the devices; while the stack is up, its nodes:\n./hindrax doctor",
    option("--mock", action="store_true", help="check the mock vehicle that is up, or a temporary one"),
    option("--topside", action="store_true", help="check the vehicle from here, over the tether"),
    add_sim_time,
    add_tether,
    add_vehicle,
    option("--fault", action="append", default=[], metavar="NAME", help=FAULT_HELP),
    option("--all", action="store_true", help="every check on its line, also where the screen has no room"),
    add_json,
    add_tuning,
)
def doctor(arguments: argparse.Namespace) -> int:
    """Check buses, ports, devices, permissions, disk and time; name each problem and its remedy."""
    settings = output_settings(arguments)
    vehicle = settings.vehicle
    if arguments.topside and tether_setting() is None:
        raise UsageError("--topside: found no tether, wanted one: --tether eth0:192.168.2.2")
    checks = machine.machine(Path.cwd())
    checks += machine.tether(tether_setting())
    up = [one for one in stacks() if one.mock is arguments.mock and (one.purpose == UP or not one.mock)]
    if not arguments.mock:
        checks += machine.vehicle_machine(tether_setting()) + board()
    if full_shared_memory():
        print_stderr("nothing else can be asked: see `shared memory`")
    elif arguments.topside:
        checks += from_topside(vehicle, arguments)
    elif up:
        checks += wires.ports(vehicle, up[0].ports) + of_stack(up[0])
    elif arguments.mock:
        checks += in_mock(settings, Path(arguments.vehicle), tuple(arguments.fault))
    else:
        checks += wires.ports(vehicle, {}) + wires.devices(settings, {}, settings.clock)
    document = {"checks": [one.document() for one in checks]}
    print_answer(document, lambda: show(checks, whole=arguments.all), as_json=arguments.json)
    return 0 if all(one.ok for one in checks) else 1


def from_topside(vehicle: Vehicle, arguments: argparse.Namespace) -> list[Check]:
    """Ask the nodes of the vehicle at the other end of the tether, and compare the clocks."""
    try:
        with joined(None, sim_time=arguments.sim_time, namespace=arguments.namespace) as operator:
            return [nodes.far_clock(operator), *nodes.stack(operator, vehicle, "the vehicle over the tether")]
    except HindraxError as error:
        return [Check("stack", str(error), "see `tether`; is `./hindrax up` running there?")]


def of_stack(lock: StackLock) -> list[Check]:
    """Ask the nodes of a stack that is up; its ports are taken."""
    try:
        with joined(lock) as operator:
            return nodes.stack(operator, load_vehicle(lock.vehicle), lock.title)
    except HindraxError as error:
        return [Check("stack", str(error), "restart it")]


def in_mock(settings: Settings, vehicle_file: Path, faults: tuple[str, ...]) -> list[Check]:
    """Start the mock's devices without a stack, and ask them as real ones are asked.

    Parameters
    ----------
    settings
        Vehicle and output.
    vehicle_file
        Of the mock.
    faults
        As of `--fault`.

    Returns
    -------
    list[Check]
        Of its ports and devices.
    """
    options = MockOptions(rate=0.0, faults=faults)
    require_known(options, settings.vehicle)
    print_stderr("asking the devices of a mock vehicle")
    with tempfile.TemporaryDirectory(prefix="hindrax-") as place:
        folder = RunFolder(Path(place))
        shutil.copyfile(vehicle_file, folder.vehicle)
        with Supervisor(folder.logs, environment(mock=True, domain=None)) as supervisor:
            stack = Stack(folder, supervisor)
            stack.start_mock(options, "--no-ros")
            ports = stack.mock_facts["ports"]
            assert isinstance(ports, Mapping)
            return wires.ports(settings.vehicle, ports) + wires.devices(settings, ports, str(stack.mock_facts["clock"]))


def show(checks: Sequence[Check], *, whole: bool = False) -> None:
    """Print what was found, and for each problem its remedy: beside the name, on a narrow screen below it.

    Parameters
    ----------
    checks
        In the order of the table.
    whole
        Whether all of it is wanted. Else, where the screen has too few lines, only the names of the checks without a
        problem; then problems with the same remedy together; at last the names of these too.
    """
    wrong = [check for check in checks if not check.ok]
    fine = ", ".join(dict.fromkeys(check.name for check in checks if check.ok))
    count = f"{len(wrong)} of {len(checks)} checks found a problem" if wrong else f"all {len(checks)} checks passed"

    def way(shown: Sequence[Check], *sentences: str) -> None:
        for sentence in sentences:
            print_fitted(sentence)
        if shown:
            screen = console()
            screen.print(_found(shown, screen))
        print_fitted(count)

    short = f"ok (--all shows the findings): {fine}"
    names = f"PROBLEM (--all names the remedies): {', '.join(check.name for check in wrong)}"
    ways = (
        partial(way, checks),
        partial(way, wrong, short),
        partial(way, _together(wrong), short),
        partial(way, [], names),
    )
    print_what_fits(*(ways[:1] if whole else ways))


def _together(checks: Sequence[Check]) -> list[Check]:
    """Checks with the same finding and the same remedy as one, in the order of the first of each."""
    names: dict[tuple[str, str], list[str]] = {}
    for check in checks:
        names.setdefault((check.found, check.remedy), []).append(check.name)
    return [Check(", ".join(of), found, remedy) for (found, remedy), of in names.items()]


def _found(checks: Sequence[Check], screen: Console) -> Table:
    names = max([len(check.name) for check in checks], default=0) + len("PROBLEM")
    beside = screen.width >= names + LEAST_FOUND
    table = Table.grid(padding=(0, 2, 0, 0))
    for _ in range(3 if beside else 2):
        # A path may be longer than the screen, and is not cut.
        table.add_column(overflow="fold")
    for check in checks:
        mark = Text("ok", style="green") if check.ok else Text("PROBLEM", style="bold red")
        name, found, remedy = Text(check.name, style="bold"), Text(check.found), Text(f"-> {check.remedy}", "yellow")
        short = len(found) + len(remedy) < screen.width - names - GAPS
        found = found if check.ok else Text(" " if short else "\n").join((found, remedy))
        table.add_row(mark, *([name, found] if beside else [Group(name, found)]))
    return table
