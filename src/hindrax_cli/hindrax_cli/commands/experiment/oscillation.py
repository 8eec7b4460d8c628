"""Added mass and drag from what oscillates in water: `hindrax free-decay`, `forced` and `pendulum`.

Sources: COB-2023-2422 (free decay); Xu, Ma, Han 2017 (forced oscillation); Badawy, Omer 2012 (pendulum).
"""

import argparse
from typing import Literal

from hindrax_analysis.terminal import cells_of, print_answer, print_table, print_values
from hindrax_cli.argument_types import positive
from hindrax_cli.command import command, option
from hindrax_cli.experiment_command import DENSITY, add_output, read_record, record, save_plot
from hindrax_core.errors import HindraxError
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.text.screen_text import print_fitted
from hindrax_laboratory import plots
from hindrax_laboratory.forced import COLUMNS as FORCED_COLUMNS
from hindrax_laboratory.forced import MOTIONS, Coefficient, TowedModel, derivatives, run_from_columns
from hindrax_laboratory.free_decay import COLUMNS as FREE_DECAY_COLUMNS
from hindrax_laboratory.free_decay import Bench, FreeDecay
from hindrax_laboratory.free_decay import analyze as analyze_free_decay
from hindrax_laboratory.pendulum import COLUMNS as PENDULUM_COLUMNS
from hindrax_laboratory.pendulum import Pendulum, PendulumFit
from hindrax_laboratory.pendulum import analyze as analyze_pendulum


@command(
    "./hindrax free-decay heave.csv --mass 0.39 --volume 0.00056 --stiffness 1127.7 "
    "--prototype-volume 0.0153 --plot heave.png",
    record(FREE_DECAY_COLUMNS),
    option("--mass", type=positive, required=True, metavar="KG", help="oscillating dry mass [kg]"),
    option("--volume", type=positive, required=True, metavar="M3", help="displaced volume [m^3]"),
    option("--stiffness", type=positive, required=True, metavar="N_PER_M", help="all springs together [N/m]"),
    option("--stiffness-std", type=float, default=0.0, metavar="N_PER_M", help="its deviation [N/m]"),
    option("--mass-std", type=float, default=0.0, metavar="KG", help="deviation of the mass [kg]"),
    option("--amplitude", type=positive, metavar="M", help="release amplitude, where measured [m]"),
    option("--prototype-volume", type=positive, metavar="M3", help="scale to a vehicle of this volume [m^3]"),
    DENSITY,
    option("--viscosity", type=positive, default=1.01e-6, metavar="M2_PER_S", help="kinematic [m^2/s]"),
    add_output,
)
def free_decay(arguments: argparse.Namespace) -> int:
    """Added mass and damping from a free oscillation on a spring (displacement or accelerometer)."""
    columns = read_record(arguments.record, FREE_DECAY_COLUMNS, arguments.field)
    kind: Literal["displacement", "acceleration"] = "displacement" if "displacement_m" in columns else "acceleration"
    column = {"displacement": "displacement_m", "acceleration": "acceleration_mps2"}[kind]
    if column not in columns:
        lacking = "neither displacement_m nor acceleration_mps2"
        raise HindraxError(f"{arguments.record}: {lacking}; rename the signal's column")
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
    result = analyze_free_decay(columns["time_s"], columns[column], bench, kind, source=source, amplitude_m=amplitude)
    save_plot(arguments.plot, plots.free_decay, result)
    return print_answer(result, lambda: _show_free_decay(result, kind), as_json=arguments.json)


def _show_free_decay(result: FreeDecay, kind: str) -> None:
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


@command(
    "./hindrax forced heave_0.1Hz.csv heave_0.2Hz.csv --motion heave --mass 78 --length 0.875 --plot heave.png",
    record(FORCED_COLUMNS, nargs="+"),
    option("--motion", choices=list(MOTIONS), required=True, help="driven by the mechanism"),
    option("--mass", type=positive, required=True, metavar="KG", help="mass of the model [kg]"),
    option("--length", type=positive, required=True, metavar="M", help="length, for dimensionless forms [m]"),
    option("--inertia", type=positive, metavar="KGM2", help="of the model, for pitch and yaw [kg m^2]"),
    option("--restoring", type=float, default=0.0, metavar="N_M", help="m g z_B, for pitch [N m]"),
    DENSITY,
    add_output,
)
def forced(arguments: argparse.Namespace) -> int:
    """Acceleration derivatives from forced oscillation (planar motion mechanism), Fourier and direct fit."""
    motion = MOTIONS[arguments.motion]
    inertia = {motion.name: arguments.inertia} if arguments.inertia is not None else {}
    model = TowedModel(arguments.mass, arguments.length, inertia, arguments.restoring, arguments.density)
    records = [(path, read_record(path, FORCED_COLUMNS, arguments.field)) for path in arguments.record]
    found = derivatives([run_from_columns(columns, motion, str(path)) for path, columns in records], model)
    save_plot(arguments.plot, plots.forced, found)
    document = {"motion": motion.name, "runs": len(records), "coefficients": {item.name: item for item in found}}
    return print_answer(document, lambda: _show_forced(motion.name, found), as_json=arguments.json)


def _show_forced(motion: str, found: list[Coefficient]) -> None:
    headings = ("Fourier", "std", "direct fit", "std", "apart [%]", "dimensionless")
    rows = []
    for item in found:
        cells = [text for one in (item.fourier, item.direct) for text in cells_of(one)]
        numbers = (*cells, f"{item.difference_percent:.2f}", f"{item.dimensionless:.5f}")
        rows.append((item.name, *numbers, item.unit))
    title, spare = f"Forced {motion}: force = derivative x motion", ("dimensionless", "apart [%]")
    print_table(title, ["coefficient"], headings, rows, ["unit"], spare=spare)


def _buoyancy(parser: argparse.ArgumentParser) -> None:
    buoyancy = parser.add_mutually_exclusive_group(required=True)
    buoyancy.add_argument("--buoyancy", type=float, metavar="N", help="buoyancy [N]")
    buoyancy.add_argument("--buoyancy-kgf", type=float, metavar="KGF", help="buoyancy [kgf]")


@command(
    "./hindrax pendulum surge.csv --mass 3.739 --arm 0.40 --buoyancy-kgf 2.24 --plot surge.png",
    record(PENDULUM_COLUMNS),
    option("--mass", type=positive, required=True, metavar="KG", help="dry mass [kg]"),
    option("--arm", type=positive, required=True, metavar="M", help="axis to vehicle [m]"),
    _buoyancy,
    option("--window", type=positive, metavar="S", help="smoothing polynomial [s]; default the best of four"),
    add_output,
)
def pendulum(arguments: argparse.Namespace) -> int:
    """Added mass and drag from a pendulum that comes to rest in water."""
    columns = read_record(arguments.record, PENDULUM_COLUMNS, arguments.field)
    buoyancy = arguments.buoyancy if arguments.buoyancy is not None else arguments.buoyancy_kgf * GRAVITY_mps2
    bench = Pendulum(arguments.mass, buoyancy, arguments.arm)
    fit = analyze_pendulum(columns["time_s"], columns["theta_rad"], bench, arguments.window, str(arguments.record))
    save_plot(arguments.plot, plots.pendulum, fit)
    ways = {"output_error": fit.output_error, "regression": fit.regression}
    document = {**ways, "residual_rad": fit.residual_rad, "samples": fit.samples}
    return print_answer(document, lambda: _show_pendulum(fit), as_json=arguments.json)


def _show_pendulum(fit: PendulumFit) -> None:
    for title, found in (
        ("Fit of the simulated angle", fit.output_error),
        ("Regression of the paper (17-18), on derivatives", fit.regression),
    ):
        rows: list[tuple[str, object, str]] = [
            ("added mass", found.added_mass_kg, "kg"),
            ("K_L", found.k_l, "N s/m"),
            ("K_Q", found.k_q, "N s^2/m^2"),
            ("alpha", found.alpha, "1/s^2"),
            ("beta", found.beta, "1/s"),
            ("gamma", found.gamma, ""),
        ]
        print_values(title, rows)
    print_fitted(f"{fit.samples} samples, residual {1e3 * fit.residual_rad:.3g} mrad")
