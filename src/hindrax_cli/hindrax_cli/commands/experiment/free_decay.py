"""`hindrax free-decay`: added mass and damping from a free oscillation on a spring. COB-2023-2422."""

from __future__ import annotations

import argparse
from typing import Literal

from hindrax_analysis.experiments.free_decay import COLUMNS, Bench, FreeDecay, analyze
from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import print_values
from hindrax_cli.argument_types import positive
from hindrax_cli.experiment_command import add_output, add_record, read_record, save_plot
from hindrax_core.errors import HindraxError

NAME = "free-decay"
HELP = "added mass and damping from a free oscillation on a spring (displacement or accelerometer)"
EXAMPLE = (
    "./hindrax free-decay heave.csv --mass 0.39 --volume 0.00056 --stiffness 1127.7 "
    "--prototype-volume 0.0153 --plot heave.png"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The record and what is known of the bench."""
    add_record(parser, COLUMNS)
    parser.add_argument("--mass", type=positive, required=True, metavar="KG", help="oscillating dry mass [kg]")
    parser.add_argument("--volume", type=positive, required=True, metavar="M3", help="displaced volume [m^3]")
    parser.add_argument(
        "--stiffness", type=positive, required=True, metavar="N_PER_M", help="all springs together [N/m]"
    )
    parser.add_argument("--stiffness-std", type=float, default=0.0, metavar="N_PER_M", help="its deviation [N/m]")
    parser.add_argument("--mass-std", type=float, default=0.0, metavar="KG", help="deviation of the mass [kg]")
    parser.add_argument("--amplitude", type=positive, metavar="M", help="release amplitude, where measured [m]")
    parser.add_argument(
        "--prototype-volume", type=positive, metavar="M3", help="scale to a vehicle of this volume [m^3]"
    )
    parser.add_argument("--density", type=positive, default=1000.0, metavar="KG_PER_M3", help="water [kg/m^3]")
    parser.add_argument("--viscosity", type=positive, default=1.01e-6, metavar="M2_PER_S", help="kinematic [m^2/s]")
    add_output(parser)


def run(arguments: argparse.Namespace) -> int:
    """Analyze one record and print."""
    record = read_record(arguments.record, COLUMNS, arguments.field)
    kind: Literal["displacement", "acceleration"] = "displacement" if "displacement_m" in record else "acceleration"
    column = {"displacement": "displacement_m", "acceleration": "acceleration_mps2"}[kind]
    if column not in record:
        raise HindraxError(
            f"{arguments.record}: neither displacement_m nor acceleration_mps2; rename the signal's column"
        )
    bench = Bench(
        stiffness_Npm=arguments.stiffness,
        mass_kg=arguments.mass,
        volume_m3=arguments.volume,
        density_kgpm3=arguments.density,
        viscosity_m2ps=arguments.viscosity,
        prototype_volume_m3=arguments.prototype_volume,
        stiffness_std_Npm=arguments.stiffness_std,
        mass_std_kg=arguments.mass_std,
    )
    source, amplitude = str(arguments.record), arguments.amplitude
    result = analyze(record["time_s"], record[column], bench, kind, source=source, amplitude_m=amplitude)
    save_plot(arguments.plot, "free_decay", result)
    if arguments.json:
        print_json(result)
    else:
        show(result, kind)
    return 0


def show(result: FreeDecay, kind: str) -> None:
    """Print what COB-2023-2422 reports."""
    rows: list[tuple[str, object, str]] = [
        ("damped frequency w_d", result.decay.frequency_radps, "rad/s"),
        ("logarithmic decrement (3)", result.decay.decrement, ""),
        ("damping ratio zeta", result.decay.damping_ratio, ""),
        ("added mass (5)", result.added_mass_kg, "kg"),
        ("added mass, undamped formula (7)", result.added_mass_undamped_kg, "kg"),
        ("error of (7) against (5) (11)", result.error_percent, "%"),
        ("linear damping c (6)", result.damping_Nspm, "N s/m"),
        ("k_l, from the decrement over amplitude", result.linear_drag_Nspm, "N s/m"),
        ("k_q, from the decrement over amplitude", result.quadratic_drag_Ns2pm2, "N s^2/m^2"),
        ("C_M (8)", result.added_mass_coefficient, ""),
        ("amplitude", 1e3 * result.amplitude_m, "mm"),
        ("KC (9)", result.keulegan_carpenter, ""),
        ("Re", result.reynolds, ""),
        ("whole-curve fit: w_d", result.curve_fit.frequency_radps, "rad/s"),
        ("whole-curve fit: zeta", result.curve_fit.damping_ratio, ""),
    ]
    if result.prototype_added_mass_kg is not None and result.prototype_amplitude_m is not None:
        rows.append(("prototype added mass (12)", result.prototype_added_mass_kg, "kg"))
        rows.append(("prototype amplitude (10)", 1e3 * result.prototype_amplitude_m, "mm"))
    print_values(f"Free oscillation, from {kind}, {len(result.decay.swing_m)} half-swings", rows)
