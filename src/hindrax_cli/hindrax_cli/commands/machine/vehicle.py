"""`hindrax vehicle`: make, check and show vehicle files."""

import argparse
import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from hindrax_analysis.records.autopilot_vehicle import (
    A_SIMULATOR,
    LOW_V,
    PARAMETERS,
    PULSES_us,
    logged_parameters,
    wired,
    wiring_of,
)
from hindrax_analysis.terminal import print_answer, print_table, print_what_fits
from hindrax_bringup.share_files import VEHICLE, own_vehicles, usual_vehicle, vehicle_file, vehicle_word
from hindrax_cli.argument_types import add_json
from hindrax_cli.autopilot_vehicle import asked_parameters, is_address
from hindrax_cli.command import add_words, command, option
from hindrax_cli.command_line import is_here
from hindrax_cli.health_checks import Check
from hindrax_cli.vehicle_edit import text_behind, with_autopilot, with_outputs
from hindrax_cli.vehicle_questions import BACK, Answers, ask, file_text, kept_answers
from hindrax_cli.vehicle_review import findings, picture, same_positions
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_control.maneuver.goal import largest_wrench, servable_motions
from hindrax_core.errors import UsageError
from hindrax_core.text.refusals import THRUSTERS_BY_HAND
from hindrax_core.text.screen_text import print_fitted, print_stderr, print_whole
from hindrax_core.text.text_file import replace_text, require_place, writing
from hindrax_core.vehicle import AXES, WRENCH_UNITS, Thruster, Vehicle, load_vehicle, vehicle_from_text

UPRIGHT_deg = 90.0
NO_OUTPUT = (
    "give each motor its output at the autopilot (SERVOn_FUNCTION 33 is motor 1), or make the file without --from, by "
    "ten questions"
)
"""What helps where the autopilot drives other motors than its frame has."""
SIMULATED = (
    f"note: {A_SIMULATOR}: the file describes the vehicle that it simulates; its depth is by its first barometer: "
    "fly it with `--set autopilot.barometer:=1`"
)
ANSWERS_SUFFIX = ".answers"
"""Suffix of the file of answers that have not made a vehicle file yet."""


def new(arguments: argparse.Namespace) -> int:
    """Write a vehicle file: by ten questions (an empty line accepts the answer in brackets), or by an ArduSub."""
    name = arguments.vehicle
    if not name.replace("-", "").replace("_", "").isalnum():
        raise UsageError(f"vehicle {name}: wanted letters, digits, - and _; --out names the file")
    out = arguments.out or own_vehicles() / f"{name}.yaml"
    if out.exists():
        raise UsageError(f"{out}: exists already; use another name, or remove it")
    require_place(next(folder for folder in out.absolute().parents if folder.exists()) / out.name)
    answers = out.with_suffix(ANSWERS_SUFFIX)
    text = _text_from(name, arguments.source) if arguments.source else file_text(name, _answers(answers))
    vehicle = vehicle_from_text(text, str(out))
    with writing(out, "name another place with --out"):
        out.parent.mkdir(parents=True, exist_ok=True)
        replace_text(out, text)
        answers.unlink(missing_ok=True)
    _show_checks(vehicle, out)
    word = shlex.quote(vehicle_word(out))
    next_words = [f"vehicle show {word}", *([f"pool-test --mock --vehicle {word}"] if is_here("pool-test") else [])]
    print_fitted("\n".join((f"written: {out}", *(f"  ./hindrax {words}" for words in next_words))))
    return 0


def _answers(file: Path) -> Answers:
    """The ten answers; each is kept in a file until the vehicle file is written, and is offered at the next start."""

    def keep(typed: Answers) -> None:
        with writing(file, "name another place with --out"):
            file.parent.mkdir(parents=True, exist_ok=True)
            replace_text(file, json.dumps(typed))

    earlier = kept_answers(file)
    again = f"; {len(earlier)} of an earlier start are from {file}, remove it to begin anew" if earlier else ""
    print_stderr(f"Enter accepts the answer in brackets{again}; {BACK} returns to the question before.")
    try:
        return ask(_line, _print_or_raise, earlier, keep)
    except (UsageError, KeyboardInterrupt):
        if file.exists():
            print_stderr(f"The answers so far are kept in {file}; the same command continues with them.")
        raise


def _text_from(name: str, source: str) -> str:
    """Vehicle file by the parameters of an ArduSub, in a log or at an address; hull and curves of a BlueROV2.

    Of ArduPilot's simulator it is the one that this simulates, with hull, curves and sensors of its own.
    """
    live = is_address(source) and not Path(source).is_file()
    if live:
        parameters: Mapping[str, float] = asked_parameters(source, PARAMETERS)
    elif Path(source).is_file():
        parameters = logged_parameters([Path(source)])
    else:
        raise UsageError(f"--from {source}: cannot be read, there is no such file")
    wiring = wiring_of(parameters)
    if wiring is None or not wiring.kind:
        found = f"FRAME_CONFIG {wiring.frame}" if wiring else "no FRAME_CONFIG"
        remedy = THRUSTERS_BY_HAND if wiring else "without --from ten questions make the file"
        raise UsageError(
            f"--from {source}: found {found}, wanted an ArduSub with the frame 1 (vectored) or 2 (vectored 6DOF),"
            f" or a log of one that holds its parameters, as every .bin does; {remedy}"
        )
    text = text_behind(wiring)
    wired(vehicle_from_text(text, wiring.kind), wiring, NO_OUTPUT)
    low_us, high_us = (round(parameters.get(one, usual)) for one, usual in PULSES_us.items())
    hull = f"as of a {wiring.kind} when sold: weigh yours as it flies, and correct mass_kg and volume_m3"
    head = (
        f"# Frame, outputs and senses of the thrusters by {source if live else Path(source).name}; hull, water and\n"
        f"# curves are {'those of the simulator, which it is by its SIM_ parameters' if wiring.simulated else hull}.\n"
    )
    if (low_us, high_us) != tuple(PULSES_us.values()):
        head += f"# The autopilot gives pulses from {low_us} to {high_us} us only (MOT_PWM_MIN and MOT_PWM_MAX).\n"
    if wiring.simulated:
        print_stderr(SIMULATED)
    text = with_outputs(text, name, wiring.motors)
    return head + with_autopilot(text, source if live else "", parameters.get(LOW_V, 0.0))


def _line(prompt: str) -> str:
    print_fitted(prompt, sys.stderr, end=" ")
    line = sys.stdin.readline()
    if not (line and sys.stdin.isatty()):  # a terminal has echoed the line and its end
        print_stderr(line.strip())
    return line


def _print_or_raise(error: UsageError) -> None:
    """Print the error at a terminal and ask again; a script that answers wrongly ends."""
    if not sys.stdin.isatty():
        raise error
    print_stderr(error)


def check(arguments: argparse.Namespace) -> int:
    """Check whether a vehicle file can fly, and what looks wrong in it; exit 1 if anything needs a change."""
    file = vehicle_file(arguments.vehicle)
    vehicle = load_vehicle(file)
    found = findings(vehicle)
    document = {"checks": [one.document() for one in found]}
    print_answer(document, lambda: _show_checks(vehicle, file), as_json=arguments.json)
    return 0 if all(one.ok for one in found) else 1


def _print_title(vehicle: Vehicle, file: Path) -> None:
    """Print the vehicle's name, and its file on a line of its own: a path is as long as it is, and is copied whole."""
    print_fitted(vehicle.name)
    print_whole(f"  {file}")


def _show_checks(vehicle: Vehicle, file: Path) -> None:
    """Print what was found; where the screen has too few lines, what needs nothing by its name."""
    found = findings(vehicle)
    to_do = [one for one in found if one.remedy]
    fine = ", ".join(one.name for one in found if not one.remedy)

    def way(shown: Sequence[Check], *sentences: str) -> None:
        _print_title(vehicle, file)
        print_table("", ["check"], [], [(one.name, one.found, one.remedy) for one in shown], ["found", "to do"])
        for sentence in sentences:
            print_fitted(sentence)

    print_what_fits(partial(way, found), partial(way, to_do, f"nothing to do (--json shows the findings): {fine}"))


def show(arguments: argparse.Namespace) -> int:
    """The thrusters seen from above, their poses and forces, and the largest wrench of each axis."""
    file = vehicle_file(arguments.vehicle)
    vehicle = load_vehicle(file)
    reach = largest_wrench(vehicle)
    reasons = dict(servable_motions(AXES, vehicle).left_out) if vehicle.thrusters else {}
    thrusters = [
        {"name": one.name, "position_m": one.position_m, "direction": one.direction} for one in vehicle.thrusters
    ]
    document = {"vehicle": vehicle.name, "thrusters": thrusters, "largest_wrench": reach, "not_served": reasons}
    return print_answer(document, lambda: _show(vehicle, file, reach, reasons), as_json=arguments.json)


def _show(vehicle: Vehicle, file: Path, reach: dict[str, float], reasons: dict[str, str]) -> None:
    _print_title(vehicle, file)
    print_whole(picture(vehicle))
    if not vehicle.thrusters:
        print_fitted("no thrusters: enough to identify from a record, not to fly")
        return
    for sentence in same_positions(vehicle):
        print_fitted(f"position_m: {sentence}; measure each")
    rows: list[tuple[str, ...]] = []
    for one, curve in zip(vehicle.thrusters, thrust_curves(vehicle), strict=True):
        low, high = curve.range_N
        position = "  ".join(f"{at:+.3f}" for at in one.position_m)
        rows.append((one.name, position, _pointing(one), f"{low:.1f} to {high:+.1f}"))
    print_table("", ["thruster"], ["forward, starboard, down [m]", "points to [deg]", "force [N]"], rows)
    units = zip(reach.items(), WRENCH_UNITS, strict=True)
    print_fitted(f"largest alone: {', '.join(f'{axis} {most:.1f} {unit}' for (axis, most), unit in units if most)}")
    for reason in dict.fromkeys(reasons.values()):
        print_fitted(f"{', '.join(axis for axis in reasons if reasons[axis] == reason)}: {reason}")


def _pointing(thruster: Thruster) -> str:
    if abs(thruster.elevation_deg) == UPRIGHT_deg:
        return "up" if thruster.elevation_deg > 0.0 else "down"
    return f"{thruster.azimuth_deg:g}" + (f", {thruster.elevation_deg:+g} up" if thruster.elevation_deg != 0.0 else "")


def _usual(parser: argparse.ArgumentParser) -> None:
    """Name that may be left out; the environment is read when the command runs."""
    which = f"its name, or its file; default: {VEHICLE}, or hindrax"
    parser.add_argument("vehicle", nargs="?", default=usual_vehicle(), metavar="NAME", help=which)


WORDS = {
    "new": command(
        "./hindrax vehicle new myrov\n./hindrax vehicle new myrov --from dive.bin\n"
        "./hindrax vehicle new myrov --from udpin:0.0.0.0:14550",
        option("vehicle", metavar="NAME", help="its name, or its file"),
        option("--out", type=Path, metavar="FILE", help="default: NAME.yaml in ~/.config/hindrax"),
        option(
            "--from",
            dest="source",
            default="",
            metavar="LOG|ADDRESS",
            help="by the parameters of an ArduSub: in its .bin or .tlog, or live at udpin:ADDRESS:PORT, "
            "udpout:HOST:PORT, tcp:HOST:PORT or a port",
        ),
    )(new),
    "check": command("./hindrax vehicle check myrov", _usual, add_json)(check),
    "show": command("./hindrax vehicle show myrov", _usual, add_json)(show),
}


@command("./hindrax vehicle new myrov", partial(add_words, words=WORDS))
def vehicle(arguments: argparse.Namespace) -> int:
    """Create a vehicle file from ten questions, check one, show its thrusters."""
    return WORDS[arguments.word].run(arguments)
