"""`hindrax tune`: gains with margins from an identified model, rehearsed before they are written."""

import argparse
import math
import shlex
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from hindrax_analysis.coefficients_file import read_coefficients
from hindrax_analysis.gains.gain_files import ardusub_file, ardusub_parameters, parameter_file
from hindrax_analysis.gains.hold_gains import HoldGains, hold_gains
from hindrax_analysis.terminal import print_answer, print_table, working
from hindrax_cli.argument_types import add_json, named_vehicle
from hindrax_cli.command import command, option
from hindrax_cli.commands.pool.report_export import print_or_write, results_file, vehicle_of
from hindrax_control.maneuver.goal import servable_motions
from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import print_fitted, print_whole
from hindrax_core.text.text_file import require_place
from hindrax_sim.flights.step_flight import STEPS, SetpointStep, StepOutcome, step_flight

TARGETS = ("table", "hindrax", "ardusub")
NEEDS = {"1 m along": ("surge", "heave"), "0.4 m down": ("heave",), "90 deg": ("yaw", "heave")}
"""Axes that a step of the rehearsal needs."""


@command(
    "./hindrax tune runs/2026-05-04_10-00-00 --to hindrax --out gains.yaml",
    option("coefficients", type=Path, metavar="COEFFICIENTS", help="coefficients.yaml, or a run's folder"),
    option("--to", choices=TARGETS, default="table", help="default: table"),
    option("--out", type=Path, metavar="FILE", help="default: stdout"),
    named_vehicle("vehicle; also fills in coefficients that the results lack"),
    add_json,
)
def tune(arguments: argparse.Namespace) -> int:
    """Hold gains for our stack or an ArduSub, with margins over the uncertainty; flown in simulation first."""
    if arguments.out is not None:
        require_place(arguments.out)
    file = results_file(arguments.coefficients, arguments.to)
    saved = read_coefficients(file)
    vehicle, complete = vehicle_of(saved, file, arguments.vehicle), arguments.vehicle is not None
    with working("drawing vehicles from the uncertainty, and finding gains"):
        gains = hold_gains(saved, vehicle, str(file), complete=complete)
    with working("rehearsing the gains in simulation"):
        rehearsal = rehearsed(gains)
    _require_settled(rehearsal)
    if arguments.to == "table":
        return print_answer(
            _document(gains, rehearsal), lambda: _show(gains, rehearsal, arguments.typed), as_json=arguments.json
        )
    text = (parameter_file if arguments.to == "hindrax" else ardusub_file)(gains, str(file))
    if arguments.json:
        return print_answer(_document(gains, rehearsal), lambda: None, as_json=True)
    return print_or_write(text, arguments.out)


Rehearsal = dict[str, tuple[StepOutcome, StepOutcome]]
"""By step: with these gains, with those as shipped."""


def rehearsed(gains: HoldGains) -> Rehearsal:
    """Steps in lock-step with the identified vehicle, with these gains and as shipped."""
    served = servable_motions(tuple(gains.axes), gains.vehicle).flown
    steps = [step for step in STEPS if all(axis in served for axis in NEEDS[step.name])]
    return {step.name: (_flown(gains, step), step_flight(gains.vehicle, gains.vehicle, step)) for step in steps}


def _flown(gains: HoldGains, step: SetpointStep) -> StepOutcome:
    return step_flight(gains.vehicle, gains.vehicle, step, holds=gains.holds, station=gains.station)


def _require_settled(rehearsal: Rehearsal) -> None:
    for name, (mine, shipped) in rehearsal.items():
        if not mine.settled and shipped.settled:
            raise HindraxError(
                f"rehearsal, {name}: not settled with these gains, in {shipped.settled_s:.1f} s as shipped; nothing is"
                " written: stay with the gains as shipped"
            )


def _document(gains: HoldGains, rehearsal: Rehearsal) -> dict[str, object]:
    return {
        "axes": {
            axis: {
                "bandwidth_radps": one.law.bandwidth_radps,
                "proportional": one.law.proportional,
                "derivative": one.law.derivative,
                "integral_s": one.law.integral_s,
                "reference_rate": one.rate,
                "gain_margin": one.margins.gain if math.isfinite(one.margins.gain) else None,
                "phase_margin_deg": math.degrees(one.margins.phase_rad),
                "sensitivity": one.margins.sensitivity,
            }
            for axis, one in gains.axes.items()
        },
        "left_out": list(gains.left_out),
        "assumed": list(gains.assumed),
        "holds": asdict(gains.holds),
        "station": asdict(gains.station),
        "ardusub": dict(ardusub_parameters(gains)),
        "vehicles": gains.drawn,
        "rehearsal": {
            name: {"settled_s": mine.settled_s, "settled_s_shipped": shipped.settled_s, "settled": mine.settled}
            for name, (mine, shipped) in rehearsal.items()
        },
    }


def _show(gains: HoldGains, rehearsal: Rehearsal, typed: Sequence[str]) -> None:
    """Print gains, margins and rehearsal, and the command as it was typed, for the file of the gains."""
    rows = [
        (
            axis,
            f"{one.law.bandwidth_radps:.2f}",
            f"{one.law.proportional:.3g}",
            f"{one.law.derivative:.3g}",
            f"{one.law.integral_s:.1f}",
            f"{one.rate:.2f}",
            f"{one.margins.gain:.1f}" if math.isfinite(one.margins.gain) else "any",
            f"{math.degrees(one.margins.phase_rad):.0f}",
        )
        for axis, one in gains.axes.items()
    ]
    columns = ("w [rad/s]", "K_p [N/m]", "K_d [N s/m]", "T_i [s]", "rate [m/s]", "gain", "phase [deg]")
    print_table("Gains (of turns N m and rad) and margins of the worst vehicle", ("axis",), columns, rows)
    steps = [
        (name, *(f"{one.settled_s:.1f}" if one.settled else "never" for one in pair))
        for name, pair in rehearsal.items()
    ]
    print_table("Rehearsal: settled after", ("step",), ("these gains [s]", "as shipped [s]"), steps)
    for axis in gains.left_out:
        print_fitted(f"{axis}: no thruster serves it")
    if gains.caution:
        print_fitted(gains.caution)
    print_fitted(f"The margins hold for {gains.drawn} vehicles drawn from the uncertainty of the result.")
    print_fitted("Next: the file of these gains, then `./hindrax up --params gains.yaml`")
    print_whole(f"  ./hindrax {shlex.join(typed)} --to hindrax --out gains.yaml")
