"""Many runs: `hindrax montecarlo` (accuracy), `faults` (time to neutral) and `bench` (speed)."""

import argparse
import contextlib
import pkgutil
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias, TypeVar

from hindrax_analysis.identification.executor import add_workers, workers_of
from hindrax_analysis.identification.montecarlo import LIVE, Trial, summary, trial_of
from hindrax_analysis.identification.pool_session import MASS_GOAL
from hindrax_analysis.terminal import print_answer, print_table, print_what_fits, screen_rows
from hindrax_bringup.clone import developer_module
from hindrax_cli.argument_types import add_json, add_vehicle, at_least
from hindrax_cli.command import command, option
from hindrax_cli.commands.pool.lockstep_session import SessionTrial, session_summary, session_trial
from hindrax_control.maneuver.goal import EXCITATIONS, PLATEAUS, motions_to_fly
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.nearest import did_you_mean
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.vehicle import AXES, load_vehicle
from hindrax_ident.model import motion_model
from hindrax_sim.conditions.world_table import FORM, IDEAL, sizes_of
from hindrax_sim.flights.pool_flight import fly

TABLE_LINES = 3
"""Of a table beside its rows: title and heading."""
SHORT_LINES = 4
"""Of a dense table beside its rows: title, heading on two lines, and the sentence about what it lacks."""
Document: TypeAlias = dict[str, Any]
"""Of a command: plain data, as JSON has it."""
OneTrial = TypeVar("OneTrial", Trial, SessionTrial)


@command(
    "./hindrax montecarlo --runs 40 --dof all",
    option("--runs", type=at_least(1), default=40, metavar="N", help="default 40"),
    option("--dof", nargs="+", default=["all"], choices=[*AXES, "all"], help="default: all"),
    option("--excitation", default=PLATEAUS, choices=(PLATEAUS, *EXCITATIONS), help="default: plateaus"),
    option("--seed", type=int, default=1, help="seed of the first run; the others follow. Default 1"),
    partial(add_workers, processes=None),
    partial(add_vehicle, meaning="vehicle with its truth: file or name"),
    option("--world", default=IDEAL, help=f"effects outside the model: {FORM}. Default: {IDEAL}"),
    option("--all", action="store_true", help="every coefficient and speed, also where the screen has no room"),
    option("--session", action="store_true", help="sessions: legs, weighing, repeats; gain of each, next to the goal"),
    add_json,
)
def montecarlo(arguments: argparse.Namespace) -> int:
    """Accuracy over many runs with the mock, against the Cramer-Rao bound."""
    sizes_of(arguments.world, arguments.seed)
    vehicle = load_vehicle(arguments.vehicle)
    if vehicle.hydrodynamics is None:
        raise UsageError(f"{arguments.vehicle}: has no block `hydrodynamics`, wanted the truth to compare with")
    servable = motions_to_fly(arguments.dof, vehicle)
    print_stderr(f"{vehicle.name} {servable}")
    seeds = range(arguments.seed, arguments.seed + arguments.runs)
    how = servable.flown, arguments.excitation, arguments.vehicle, arguments.world
    if arguments.session:
        if arguments.excitation != PLATEAUS:
            raise UsageError(f"--session: found --excitation {arguments.excitation}, wanted {PLATEAUS}")
        return _sessions(arguments, servable.flown, seeds)

    def show(trials: Sequence[Trial]) -> int:
        document = summary(trials)
        if not document["cells"]:
            raise HindraxError(f"none of {len(trials)} runs gave a result: {trials[0].trouble}")
        return print_answer(document, lambda: print_montecarlo(document, whole=arguments.all), as_json=arguments.json)

    return _many("run", [partial(trial, seed, *how) for seed in seeds], arguments, show)


def _many(
    what: str,
    jobs: Sequence[Callable[[], OneTrial]],
    arguments: argparse.Namespace,
    show: Callable[[Sequence[OneTrial]], int],
) -> int:
    """Do all jobs, say of each that it is done, and show them; where they take hours, Ctrl-C shows those that are."""
    trials: list[OneTrial] = []
    try:
        for one in workers_of(arguments).run(jobs):
            trials.append(one)
            print_stderr(f"{what} {len(trials)} of {len(jobs)}: seed {one.seed} {one.trouble}")
    except KeyboardInterrupt:
        if trials:
            with contextlib.suppress(HindraxError):
                show(trials)
        raise
    return show(trials)


def _sessions(arguments: argparse.Namespace, motions: tuple[str, ...], seeds: range) -> int:
    """Fly sessions; print the goal beside what was reached."""

    def show(trials: Sequence[SessionTrial]) -> int:
        document = session_summary(trials)
        if not document["motions"]:
            raise HindraxError(f"none of {len(trials)} sessions gave a result: {trials[0].trouble}")
        return print_answer(document, lambda: print_sessions(document), as_json=arguments.json)

    jobs = [partial(session_trial, seed, motions, arguments.vehicle, arguments.world) for seed in seeds]
    return _many("session", jobs, arguments, show)


def print_sessions(document: Document) -> None:
    """Print one line per motion: goal, then the medians after each kind of step, and the coverage."""
    shares = {
        "goal [%]": "goal_drag",
        "first legs [%]": "drag_first",
        "supply [%]": "drag_supply",
        "weighed [%]": "drag_weighed",
        "repeated [%]": "drag",
        "9 in 10 [%]": "drag_p90",
        "mass [%]": "added_mass",
    }
    rows = [
        (one["motion"], *(f"{100 * one[key]:.1f}" for key in shares.values()), f"{one['coverage95']:.0%}", one["cause"])
        for one in document["motions"]
    ]
    title = (
        f"sessions: {document['runs']}, each {document['minutes']:.0f} min of water; calibrated std of the drag at the "
        f"highest speed (medians), wanted for the added mass {MASS_GOAL:.0%}, of the 95 % intervals covered 90 %"
    )
    print_table(
        title,
        ("motion",),
        (*shares, "covered"),
        rows,
        ("largest that is left",),
        spare=("first legs [%]", "supply [%]"),
    )
    for seed, trouble in document["troubles"].items():
        print_fitted(f"seed {seed}: {trouble}")


def trial(seed: int, motions: tuple[str, ...], excitation: str, vehicle_file: str, world: str) -> Trial:
    """Fly one pool test in lock-step and compare its results with the truth.

    Parameters
    ----------
    seed
        Of noise, excitation and world.
    motions
        In the order in which they are flown.
    excitation
        Of the goal.
    vehicle_file
        Truth, and what the stack knows.
    world
        As of `--world`.

    Returns
    -------
    Trial
        Errors of its coefficients and of the drag; why some are missing.
    """
    flight = fly(motions, seed, world, vehicle=load_vehicle(vehicle_file), excitation=excitation)
    thrust_s = flight.world.conditions.thrust_density_s
    hull = flight.truth, flight.drag_N
    return trial_of(seed, flight.outcome, *hull, trouble=flight.aborted, thrust_s=thrust_s)


def print_montecarlo(document: Document, *, whole: bool = False) -> None:
    """Print the tables; where the screen has too few lines a row for each motion, unless the `whole` is wanted."""
    tables = ("cells", "drag") if any("rmse_corrected" in row for row in document["drag"]) else ("cells",)
    lines = sum(len(document[name]) for name in (*tables, "drag")) + TABLE_LINES * (1 + len(tables))
    if not whole and lines > screen_rows():
        _print_short(document)
    else:
        _print_in_full(document)
    for seed, trouble in document["troubles"].items():
        print_fitted(f"seed {seed}: {trouble}")


def _print_short(document: Document) -> None:
    """Print a row for each motion: its coefficients, then its drag at the highest speed."""
    cells = {(one["motion"], one["coefficient"]): one for one in document["cells"]}
    motions, names = (tuple(dict.fromkeys(key[at] for key in cells)) for at in (0, 1))
    rows = []
    for motion in motions:
        found = (cells.get((motion, name)) for name in names)
        texts = ("" if one is None else f"{one['ratio']:.2f} ({one['coverage95_calibrated']:.0%})" for one in found)
        rows.append((motion, *texts))
    title = f"{document['runs']} runs: RMSE / bound (truth in the calibrated 95 % interval)"
    print_table(title, ("motion",), names, rows)
    _print_drag([row for row in document["drag"] if row["share_of_speed"] == 1.0], "highest speed")
    print_fitted("bias, RMSE, bound, other methods, drag at lower speeds: --all")


def _print_in_full(document: Document) -> None:
    """Print refined result and the other methods, then the drag force, as found and as corrected."""
    methods = document["methods"]
    numbers = ("truth", "bias", "RMSE", "bound", "RMSE / bound", "in the 95 % interval", "in the calibrated")
    others = [f"RMSE / bound, {method}" for method in methods]
    headings = (*numbers, *others)
    rows = [(*_row(cell), *(_ratio(cells, cell) for cells in methods.values())) for cell in document["cells"]]
    title = f"{document['runs']} runs; RMSE / bound: 1 is the best that the data allow"
    print_table(
        title,
        ("motion", "coefficient"),
        headings,
        rows,
        spare=("bound", "RMSE", *others, "bias", "truth"),
        grouped=True,
    )
    low, high = document["ratio_by_chance"]
    print_fitted(f"{document['runs']} runs at the bound give {low:.2f} to {high:.2f} by chance, 95 times in 100")
    if LIVE in methods:
        print_fitted(f"the bound of {LIVE} is that of an estimate that does not know the delays of the thrust")
    _print_drag(document["drag"], "shares of the tested speed")
    corrected = [_corrected(row) for row in document["drag"] if "rmse_corrected" in row]
    if corrected:
        title = "Drag force, corrected by the probable size of each influence: relative error"
        columns = ("share", "bias [%]", "RMSE [%]", "in the 95 % interval", "width of that [%]")
        print_table(title, ("motion",), columns, corrected)


def _print_drag(rows: Sequence[Document], where: str) -> None:
    title = f"Drag force at {where}: relative error, calibrated intervals"
    shares = ("share", "bias [%]", "RMSE [%]", "in the 95 % interval", "RMSE / std")
    drag = []
    for row in rows:
        percents = (f"{100 * row[key]:.2f}" for key in ("bias", "rmse"))
        held = "" if row["coverage95_calibrated"] is None else f"{row['coverage95_calibrated']:.0%}"
        per_band = "" if row["rmse_per_band"] is None else f"{row['rmse_per_band']:.2f}"
        drag.append((row["motion"], f"{row['share_of_speed']:.0%}", *percents, held, per_band))
    print_table(title, ("motion",), shares, drag)


def _corrected(row: Document) -> tuple[str, ...]:
    bias, rmse, held, width = (row[f"{name}_corrected"] for name in ("bias", "rmse", "coverage95", "width95"))
    errors = f"{100 * bias:.2f}", f"{100 * rmse:.2f}", f"{held:.0%}", f"{100 * width:.0f}"
    return row["motion"], f"{row['share_of_speed']:.0%}", *errors


def _row(cell: Document) -> tuple[str, ...]:
    numbers = tuple(f"{cell[key]:.4g}" for key in ("truth", "bias", "rmse", "crlb"))
    held = (f"{cell[key]:.0%}" for key in ("coverage95", "coverage95_calibrated"))
    axis = motion_model.MOTIONS[cell["motion"]].axis
    unit = motion_model.coefficient_units(axis)[cell["coefficient"]]
    return (cell["motion"], f"{cell['coefficient']} [{unit}]", *numbers, f"{cell['ratio']:.2f}", *held)


def _ratio(cells: list[dict[str, object]], wanted: dict[str, object]) -> str:
    same = [one for one in cells if (one["motion"], one["coefficient"]) == (wanted["motion"], wanted["coefficient"])]
    return f"{same[0]['ratio']:.2f}" if same else ""


@command(
    "./hindrax faults --only sensors --seeds 1",
    option("--only", nargs="+", metavar="NAME", help="these processes and devices; any other name lists all"),
    option("--seeds", type=at_least(1), default=3, metavar="N", help="flights of each fault; default 3"),
    option("--workers", type=at_least(1), metavar="N", help="processes; default: one per core"),
    add_json,
)
def faults(arguments: argparse.Namespace) -> int:
    """Make every process and device fail in mock: time until neutral."""
    table = developer_module("faults.table")
    only = tuple(arguments.only or table.WHO)
    if strange := [name for name in only if name not in table.WHO]:
        raise UsageError(
            f"--only: found {strange[0]!r}{did_you_mean(strange[0], table.WHO)}, wanted {', '.join(table.WHO)}"
        )
    cells = table.fly(only, range(1, arguments.seeds + 1), arguments.workers)
    violated = [f"{one.who} {one.what}, {one.mode}, seed {one.seed}: {why}" for one in cells for why in one.violated]
    document = {"cells": cells, "violated": violated}
    title = f"Time to neutral, the longest of {arguments.seeds} seeds"
    print_answer(document, lambda: print_faults(title, table, cells, violated), as_json=arguments.json)
    return int(bool(violated))


def print_faults(title: str, table: Any, cells: Sequence[Any], violated: Sequence[str]) -> None:
    """Print the tables, and what must never be and was; on a screen that is too short a row for each that failed.

    Parameters
    ----------
    title
        Before that of each table.
    table
        Module of the kind of faults, with its rows and headings.
    cells
        One for each flight.
    violated
        Sentences of what must never be.
    """

    def way(show: Callable[[], None]) -> None:
        show()
        for sentence in violated:
            print_fitted(f"violated: {sentence}")

    def in_full() -> None:
        for moments, modes in table.TABLES.items():
            rows = list(table.rows(cells, modes))
            if rows:
                print_table(f"{title}{moments}", ("who", "what"), modes, rows, ("reported", "told"))

    def short() -> None:
        rows = list(table.short_rows(cells))
        print_table(f"{title}; each fault: --json", ("who",), ("faults", *table.GROUPS), rows, dense=True)

    print_what_fits(partial(way, in_full), partial(way, short))


@command(
    "./hindrax bench rls allocation",
    option("names", nargs="*", metavar="NAME", help="which; the default is all of them"),
    add_json,
)
def bench(arguments: argparse.Namespace) -> int:
    """Benchmarks, each next to a peer in the same run."""
    folder = developer_module("benchmarks").__path__
    known = sorted(module.name for module in pkgutil.iter_modules(folder) if not module.ispkg)
    wanted = arguments.names or known
    unknown = [name for name in wanted if name not in known]
    if unknown:
        raise UsageError(f"no benchmark {unknown[0]!r}{did_you_mean(unknown[0], known)}; there are {', '.join(known)}")
    rows: list[dict[str, object]] = []
    for name in wanted:
        print_stderr(f"measuring {name} ...")
        rows += developer_module(f"benchmarks.{name}").rows()
    return print_answer({"rows": rows}, lambda: print_bench(rows), as_json=arguments.json)


def print_bench(rows: list[dict[str, object]]) -> None:
    """Print a table; on a screen that is too short without the peers, and the first rows."""
    cells = [(row["name"], *(_cell(row.get(key)) for key in ("ours_us", "peer_us", "ratio", "peer"))) for row in rows]
    numbers, title = ("ours [us]", "peer [us]", "ratio"), "Medians; the ratio is peer / ours"

    def short(shown: list[tuple[object, ...]]) -> None:
        print_table(title, ("benchmark",), numbers, [row[:-1] for row in shown], dense=True)
        left = len(cells) - len(shown)
        print_fitted(f"the peers{f', and {left} more rows' if left else ''}: --json")

    print_what_fits(
        partial(print_table, title, ("benchmark",), numbers, cells, ("peer",)),
        partial(short, cells),
        partial(short, cells[: max(1, screen_rows() - SHORT_LINES)]),
    )


def _cell(value: object) -> str:
    if not isinstance(value, float):
        return "" if value is None else str(value)
    text = f"{value:.3g}"
    return f"{float(text):.0f}" if "e+" in text else text
