"""Drag from what is pulled or pushed: `hindrax towing`, and `hindrax step` (Badawy, Omer 2012, figures 14 to 17)."""

import argparse
import math
from collections.abc import Mapping

import numpy as np

from hindrax_analysis.terminal import print_answer, print_table, print_values
from hindrax_cli.argument_types import positive
from hindrax_cli.command import command, option
from hindrax_cli.experiment_command import DENSITY, add_output, read_record, record, save_plot
from hindrax_core.errors import UsageError
from hindrax_ident.arrays import Array
from hindrax_laboratory import plots
from hindrax_laboratory.step import COLUMNS as STEP_COLUMNS
from hindrax_laboratory.step import PAPER_THRUSTS_N, StepPlant, tests_from_columns
from hindrax_laboratory.step import fit as fit_steps
from hindrax_laboratory.towing import COLUMNS as TOWING_COLUMNS
from hindrax_laboratory.towing import fit as fit_towing


@command(
    "./hindrax towing surge.csv --area 0.0616 --plot surge.png",
    record(TOWING_COLUMNS),
    option("--offset", action="store_true", help="fit a constant as well (net buoyancy, load cell zero)"),
    option("--area", type=positive, metavar="M2", help="reference area for C_D [m^2]"),
    DENSITY,
    add_output,
)
def towing(arguments: argparse.Namespace) -> int:
    """Linear and quadratic drag from towing points (tank or CFD)."""
    columns = read_record(arguments.record, TOWING_COLUMNS, arguments.field)
    speed, drag = columns["speed_mps"], columns["drag_N"]
    found = fit_towing(speed, drag, arguments.offset, arguments.area, arguments.density)
    save_plot(arguments.plot, plots.towing, speed, drag, found)
    rows: list[tuple[str, object, str]] = [
        ("K_Q (k_q)", found.k_q, "N s^2/m^2"),
        ("K_L (k_l)", found.k_l, "N s/m"),
        ("residual", f"{found.residual_std_N:.2g}", "N"),
    ]
    rows += [("offset b", found.b, "N")] if found.b is not None else []
    rows += [("C_D of the quadratic part", found.drag_coefficient, "")] if found.drag_coefficient is not None else []
    return print_answer(found, lambda: print_values(f"Drag from {found.samples} points", rows), as_json=arguments.json)


@command(
    "./hindrax step --mass 3.739 --added-mass 1.66 --k-l 59.4 --k-q 0.35 --thrust 5 10 15 20 25 30 --plot step.png",
    record(STEP_COLUMNS, nargs="?"),
    option("--mass", type=positive, required=True, metavar="KG", help="dry mass [kg]"),
    option("--added-mass", type=float, default=0.0, metavar="KG", help="to simulate [kg]"),
    option("--k-l", type=float, metavar="N_S_PER_M", help="linear drag, to simulate [N s/m]"),
    option("--k-q", type=float, metavar="N_S2_PER_M2", help="quadratic drag, to simulate [N s^2/m^2]"),
    option("--thrust", type=float, nargs="+", metavar="N", help="steps [N]; default 5 to 30"),
    option("--duration", type=positive, default=5.0, metavar="S", help="to simulate [s]"),
    add_output,
)
def step(arguments: argparse.Namespace) -> int:
    """Velocity and acceleration after a step of thrust: simulated, or fitted to a record."""
    return _fit(arguments) if arguments.record is not None else _simulate(arguments)


def _simulate(arguments: argparse.Namespace) -> int:
    if arguments.k_l is None or arguments.k_q is None:
        raise UsageError("no record to fit and no plant to simulate; give a CSV, or --k-l and --k-q")
    if min(arguments.k_l, arguments.k_q) < 0.0 or max(arguments.k_l, arguments.k_q) == 0.0:
        raise UsageError(f"--k-l {arguments.k_l} --k-q {arguments.k_q}: wanted none below 0 and one above")
    plant = StepPlant(arguments.mass + arguments.added_mass, arguments.k_l, arguments.k_q)
    thrusts = arguments.thrust or list(PAPER_THRUSTS_N)
    save_plot(arguments.plot, plots.step, plant, thrusts, arguments.duration)
    rows = [_response(plant, thrust, arguments.duration) for thrust in thrusts]
    return print_answer({"plant": plant, "steps": rows}, lambda: _show_steps(rows), as_json=arguments.json)


def _response(plant: StepPlant, thrust_N: float, duration_s: float) -> dict[str, float]:
    """Figures of one step: where it ends, how fast it gets there, and how it starts."""
    time = np.asarray(np.linspace(0.0, duration_s, 2001), dtype=np.float64)
    top, velocity = plant.terminal_mps(thrust_N), plant.velocity_mps(time, thrust_N)
    risen = np.flatnonzero(np.abs(velocity) >= 0.63 * abs(top))
    return {
        "thrust_N": thrust_N,
        "terminal_mps": top,
        "rise_s": float(time[risen[0]]) if risen.size and thrust_N else math.nan,
        "start_mps2": thrust_N / plant.mass_kg,
        "end_mps2": float(plant.acceleration_mps2(time, thrust_N)[-1]),
    }


def _show_steps(rows: list[dict[str, float]]) -> None:
    headings = ("thrust [N]", "terminal [m/s]", "63 % after [s]", "acceleration at start [m/s^2]", "at the end [m/s^2]")
    cells = ([f"{value:.4g}" if abs(value) > 1e-9 else "0" for value in row.values()] for row in rows)
    print_table("Steps of thrust from rest", (), headings, cells)


def _fit(arguments: argparse.Namespace) -> int:
    columns = read_record(arguments.record, STEP_COLUMNS, arguments.field)
    tests = tests_from_columns(columns["time_s"], columns["velocity_mps"], _thrust(columns, arguments))
    found = fit_steps(tests, arguments.mass)
    plant = StepPlant(found.total_mass_kg.value, found.k_l.value, found.k_q.value)
    longest = max(float(test.time_s[-1]) for test in tests)
    thrusts = sorted({test.thrust_N for test in tests})
    save_plot(arguments.plot, plots.step, plant, thrusts, longest, tests)
    rows = [
        ("added mass", found.added_mass_kg, "kg"),
        ("total mass", found.total_mass_kg, "kg"),
        ("K_L", found.k_l, "N s/m"),
        ("K_Q", found.k_q, "N s^2/m^2"),
        ("residual", f"{found.residual_std_mps:.2g}", "m/s"),
    ]
    title = f"Fit of {len(tests)} steps, {found.samples} samples"
    return print_answer(found, lambda: print_values(title, rows), as_json=arguments.json)


def _thrust(columns: Mapping[str, Array], arguments: argparse.Namespace) -> Array:
    """Thrust of each sample, (n,) [N]: the column, or one value for the whole record."""
    if "thrust_N" in columns:
        return columns["thrust_N"]
    if arguments.thrust is None or len(arguments.thrust) != 1:
        raise UsageError(f"{arguments.record}: no column thrust_N; give the one thrust of the record with --thrust")
    return np.full(columns["time_s"].size, arguments.thrust[0])
