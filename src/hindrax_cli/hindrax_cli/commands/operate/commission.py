"""`hindrax commission`: the vehicle proves in the water what its file claims."""

import argparse
import io
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import asdict, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from hindrax_analysis.terminal import print_answer, print_table, print_what_fits
from hindrax_bag.run_folder import RunFolder, make_run_folder
from hindrax_bringup.stack import MockOptions
from hindrax_cli.argument_types import add_json, add_vehicle
from hindrax_cli.command import command, option
from hindrax_cli.commands.operate.up_stop import add_mock_options, require_known
from hindrax_cli.vehicle_edit import add_write, require_editable, set_keys
from hindrax_control.commissioning.findings import MEASURED, PROVEN, TRIM, Finding, Findings, table
from hindrax_control.commissioning.picture import svg
from hindrax_control.commissioning.record import geometry_hash, proof
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import fitted, print_fitted, print_stderr, screen_width
from hindrax_core.vehicle import load_vehicle
from hindrax_operator.connection import add_stack, joined, ordered_stack

TRIMMED_IN_MOCK = "in mock the list is drawn by the seed: take another --seed, or --world pool,center_of_mass=0.001"
TITLE = "Claims of the vehicle file, and findings"
AS_CLAIMED = (PROVEN, MEASURED)
OPEN_AGAIN = "nothing showed what is open: commission it again, with room to turn and to dive"
COMMISSION_AGAIN = "the file has changed: end the stack, start it with this file, and commission it again"


@command(
    "# with a stack, disarmed and afloat mid-pool:\n"
    "./hindrax commission --write\n"
    "./hindrax commission --mock --fault thruster_reversed:T3\n"
    "./hindrax commission --mock --fault thrusters_swapped:T1-T4 --world pool --seed 3 --json",
    option("--mock", action="store_true", help="the mock vehicle, in a stack of its own"),
    option("--arm", action="store_true", help="arm it here; default: wait until its operator does"),
    add_vehicle,
    add_write,
    option(
        "--out",
        metavar="DIR",
        help="new or empty folder for the picture (in mock for the bag too); default runs/<time>",
    ),
    partial(add_mock_options, rate="0"),
    add_json,
    add_stack,
)
def commission(arguments: argparse.Namespace) -> int:
    """Prove the vehicle file in the water, in a minute or two: thrusters one by one, then sensors, depth and trim."""
    require_editable(arguments)
    of_mock = arguments.fault or arguments.world or arguments.simulator
    if (of_mock or arguments.rate is not None or arguments.seed is not None) and not arguments.mock:
        raise UsageError("--fault, --world, --simulator, --rate and --seed are for --mock only")
    findings, folder, bag = _in_mock(arguments) if arguments.mock else _beside(arguments)
    vehicle = load_vehicle(arguments.vehicle)
    picture, file = folder.path / "commissioning.svg", folder.path / "commissioning.txt"
    picture.write_text(svg(vehicle, findings), encoding="utf-8")
    kept, written = _keep(arguments, findings, bag)
    file.write_text(whole_table(findings, kept), encoding="utf-8")
    document = _document(findings) | {"bag": bag, "picture": str(picture), "written": written}
    print_answer(document, lambda: _show(findings, [*kept, f"  {picture}"], str(file)), as_json=arguments.json)
    return 0 if findings.complete else 1


def _in_mock(arguments: argparse.Namespace) -> tuple[Findings, RunFolder, str]:
    from hindrax_operator.commissioning_run import commission_mock  # noqa: PLC0415  # invalid arguments are refused before rclpy loads

    pace = 0.0 if arguments.rate is None else arguments.rate
    seed = 1 if arguments.seed is None else arguments.seed
    mock = MockOptions(seed, pace, tuple(arguments.fault), arguments.world or "ideal", simulator=arguments.simulator)
    require_known(mock, load_vehicle(arguments.vehicle))
    findings, folder = commission_mock(Path(arguments.vehicle), mock, arguments.out, print_stderr)
    return findings, folder, str(folder.bag)


def _beside(arguments: argparse.Namespace) -> tuple[Findings, RunFolder, str]:
    from hindrax_operator.commissioning_run import commission_beside  # noqa: PLC0415  # as above
    from hindrax_operator.nodes.orders import awaited_thrusters  # noqa: PLC0415  # as above

    found = ordered_stack(arguments)
    vehicle = load_vehicle(arguments.vehicle)
    if found is not None and geometry_hash(load_vehicle(found.vehicle)) != geometry_hash(vehicle):
        raise UsageError(
            f"--vehicle {arguments.vehicle}: the stack flies another file ({found.vehicle}); name that one"
        )
    with joined(found, sim_time=arguments.sim_time, namespace=arguments.namespace) as operator:
        awaited_thrusters(operator)  # without a stack, silence would count against every sensor
        findings = commission_beside(operator, vehicle, print_stderr, arm=arguments.arm)
    folder = make_run_folder(arguments.out, Path(arguments.vehicle))
    return findings, folder, found.bag if found is not None else ""


def _keep(arguments: argparse.Namespace, findings: Findings, bag: str) -> tuple[list[str], bool]:
    """Write what mends the file, or the record of its proof; returns what was done or can be, and whether it was."""
    file, written = Path(arguments.vehicle), bool(arguments.write)
    if findings.mends:
        lines = [f"  {mend.line}" for mend in findings.mends]
        if not written:
            return ["these lines mend the file; --write puts them into it:", *lines], False
        set_keys(file, [(mend.keys, mend.value) for mend in findings.mends])
        return [f"written to {file}:", *lines, COMMISSION_AGAIN], True
    if arguments.world == "pool" and any(row.claim == TRIM for row in findings.wrong):
        return [TRIMMED_IN_MOCK], False
    record = proof(load_vehicle(file), findings, bag, datetime.now(UTC).date().isoformat())
    if record is None:
        return [OPEN_AGAIN] if findings.open and not (findings.wrong or findings.ended) else [], False
    if not written:
        return ["--write puts the record of it into the file"], False
    set_keys(file, [(("commissioned",), asdict(record))])
    return [f"the record stands in {file}"], True


def _document(findings: Findings) -> dict[str, object]:
    """Findings for JSON."""
    rows = [asdict(replace(row, mends=())) | {"mends": [mend.line for mend in row.mends]} for row in findings.rows]
    return {"findings": rows, "ended": findings.ended, "complete": findings.complete, "wrenches": findings.wrenches}


def _show(findings: Findings, kept: Sequence[str], file: str) -> None:
    """Print what is wrong or open, and what to do; where the screen has too few lines, the rest by its names.

    `file`: that of the whole table.
    """
    ended = f"ended early: {findings.ended}" if findings.ended else ""
    if ended:
        print_stderr(ended)
    doubtful = [row for row in findings.rows if row.verdict not in AS_CLAIMED]
    fine = ", ".join(row.claim for row in findings.rows if row.verdict in AS_CLAIMED)
    rest = f"as claimed, or measured: {fine}" if fine else ""

    def way(rows: Sequence[Finding], *more: str, claims: bool = True) -> None:
        print_fitted(findings.sentence)
        if rows:
            _print_rows(rows, claims=claims)
        for line in filter(None, (*more, *kept)):
            print_fitted(line)

    print_what_fits(
        partial(way, findings.rows, claims=bool(doubtful)),  # of what is as claimed the file says the rest
        partial(way, doubtful, rest, f"the whole table: {file}"),
        partial(way, doubtful, f"the whole table: {file}", claims=False),
        partial(way, [], f"all findings: {file}"),
        above=len(fitted(ended, screen_width(sys.stderr)).splitlines()),
    )


def _print_rows(rows: Sequence[Finding], *, claims: bool) -> None:
    """Print findings as a table; `claims`: whether with the claims of the file."""
    cells = table(Findings(tuple(rows)))
    if claims:
        print_table(TITLE, ["verdict", "claim", "claimed"], [], cells, ["found"])
    else:
        print_table(TITLE, ["verdict", "claim"], [], [(*names, found) for *names, _, found in cells], ["found"])


def whole_table(findings: Findings, kept: Sequence[str]) -> str:
    """All that was found, as wide as it is, for the folder of the run."""
    with redirect_stdout(io.StringIO()) as text:
        _print_rows(findings.rows, claims=True)
        for line in filter(None, (f"ended early: {findings.ended}" if findings.ended else "", *kept)):
            print_fitted(line)
    return text.getvalue()
