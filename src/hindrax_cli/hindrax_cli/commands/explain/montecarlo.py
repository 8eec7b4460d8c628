"""`hindrax montecarlo`: many pool tests in lock-step with the mock, their errors against the Cramer-Rao bound."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from typing import Any

from hindrax_analysis.identification.executor import run_all
from hindrax_analysis.identification.montecarlo import Trial, summary, trial_of
from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import make_table, print_table
from hindrax_cli.argument_types import add_json, add_vehicle
from hindrax_control.maneuver.goal import EXCITATIONS, PLATEAUS, motions_to_fly
from hindrax_control.maneuver.plan import MOTIONS
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.conditions.world_table import FORM, IDEAL, sizes_of
from hindrax_sim.flights.pool_flight import fly

NAME = "montecarlo"
HELP = "accuracy over many runs with the mock, against the Cramer-Rao bound"
EXAMPLE = "./hindrax montecarlo --runs 40 --dof all"


@dataclass(frozen=True, slots=True)
class Job:
    """One pool test: everything that it depends on."""

    seed: int
    motions: tuple[str, ...]
    excitation: str
    vehicle_file: str
    world: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """How many runs, of what, and where they are computed."""
    parser.add_argument("--runs", type=int, default=40, metavar="N", help="default 40")
    parser.add_argument("--dof", nargs="+", default=["all"], choices=[*MOTIONS, "all"], help="default: all")
    parser.add_argument("--excitation", default=PLATEAUS, choices=(PLATEAUS, *EXCITATIONS), help="default: plateaus")
    parser.add_argument("--seed", type=int, default=1, help="seed of the first run; the others follow. Default 1")
    parser.add_argument("--cluster", default="", metavar="ADDRESS", help="compute on this Dask cluster")
    parser.add_argument("--workers", type=int, default=0, metavar="N", help="local processes; default: one per core")
    add_vehicle(parser, "vehicle with its truth: file or name")
    parser.add_argument("--world", default=IDEAL, help=f"what the model does not know: {FORM}. Default: {IDEAL}")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Fly all, compare, print; 1 when no run gave a result."""
    if arguments.runs < 1:
        raise UsageError(f"--runs: found {arguments.runs}, wanted 1 or more")
    sizes_of(arguments.world, arguments.seed)
    vehicle = load_vehicle(arguments.vehicle)
    if vehicle.hydrodynamics is None:
        raise UsageError(f"{arguments.vehicle}: has no block `hydrodynamics`, wanted the truth to compare with")
    servable = motions_to_fly(arguments.dof, vehicle)
    print_fitted(f"{vehicle.name} {servable}", sys.stderr)
    seeds = range(arguments.seed, arguments.seed + arguments.runs)
    jobs = [Job(seed, servable.flown, arguments.excitation, arguments.vehicle, arguments.world) for seed in seeds]
    trials: list[Trial] = []
    for one in run_all(trial, jobs, cluster=arguments.cluster, workers=arguments.workers):
        trials.append(one)
        print_fitted(f"run {len(trials)} of {len(jobs)}: seed {one.seed} {one.trouble}", sys.stderr)
    document = summary(trials)
    if not document["cells"]:
        raise HindraxError(f"none of {len(trials)} runs gave a result: {trials[0].trouble}")
    if arguments.json:
        print_json(document)
    else:
        show(document)
    return 0


def trial(job: Job) -> Trial:
    """Fly one pool test in lock-step and compare its results with the truth."""
    flight = fly(job.motions, job.seed, job.world, vehicle=load_vehicle(job.vehicle_file), excitation=job.excitation)
    thrust_s = flight.world.conditions.thrust_density_s
    hull = flight.truth, flight.drag_N
    return trial_of(job.seed, flight.outcome, *hull, trouble=flight.aborted, thrust_s=thrust_s)


def show(document: dict[str, Any]) -> None:
    """Print the tables: refined result and the other methods, then the drag force."""
    methods = list(document["methods"])
    numbers = ("truth", "bias", "RMSE", "bound", "RMSE / bound", "in the 95 % band", "in the calibrated")
    table = make_table(
        f"{document['runs']} runs; RMSE / bound: 1 is the limit of what can be known",
        ("motion", "coefficient"),
        (*numbers, *(f"RMSE / bound, {method}" for method in methods)),
    )
    for cell in document["cells"]:
        table.add_row(*_row(cell), *(_ratio(document["methods"][method], cell) for method in methods))
    print_table(table)
    low, high = document["ratio_by_chance"]
    print_fitted(f"{document['runs']} runs at the bound give {low:.2f} to {high:.2f} by chance, 95 times in 100")
    title = "Drag force at shares of the tested speed: relative error, percent"
    drag = make_table(title, ("motion",), ("share", "bias", "RMSE", "in the calibrated 95 % band", "RMSE / band"))
    for row in document["drag"]:
        percents = (f"{100 * row[key]:.2f}" for key in ("bias", "rmse"))
        held = "" if row["coverage95_calibrated"] is None else f"{row['coverage95_calibrated']:.0%}"
        per_band = "" if row["rmse_per_band"] is None else f"{row['rmse_per_band']:.2f}"
        drag.add_row(row["motion"], f"{row['share_of_speed']:.0%}", *percents, held, per_band)
    print_table(drag)
    for seed, trouble in document["troubles"].items():
        print_fitted(f"seed {seed}: {trouble}")


def _row(cell: dict[str, Any]) -> tuple[str, ...]:
    numbers = tuple(f"{cell[key]:.4g}" for key in ("truth", "bias", "rmse", "crlb"))
    held = (f"{cell[key]:.0%}" for key in ("coverage95", "coverage95_calibrated"))
    return (cell["motion"], cell["coefficient"], *numbers, f"{cell['ratio']:.2f}", *held)


def _ratio(cells: list[dict[str, Any]], wanted: dict[str, Any]) -> str:
    same = [one for one in cells if (one["motion"], one["coefficient"]) == (wanted["motion"], wanted["coefficient"])]
    return f"{same[0]['ratio']:.2f}" if same else ""
