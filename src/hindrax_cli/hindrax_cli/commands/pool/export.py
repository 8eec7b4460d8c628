"""`hindrax export`: identified coefficients for simulators, controllers, tables and our own vehicle file."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from hindrax_analysis.exports import gz, python_model, stonefish, tables, uuv, vehicle_block
from hindrax_analysis.exports.export_model import ExportModel, export_model
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.share_files import default_vehicle
from hindrax_cli.argument_types import add_vehicle
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_core.yaml_text import read_yaml

NAME = "export"
HELP = "coefficients for gz-sim, Stonefish, uuv_simulator, Python, the vehicle file, CSV or LaTeX"
EXAMPLE = "./hindrax export runs/2026-05-04_10-00-00 --to gz --out model.sdf"

FORMATS: dict[str, Callable[[ExportModel], str]] = {
    "gz": gz.write,
    "gz-plugin": lambda model: gz.write(model, added_mass="plugin"),
    "stonefish": stonefish.write,
    "stonefish-quadratic": lambda model: stonefish.write(model, "quadratic"),
    "uuv": uuv.write,
    "python": python_model.write,
    "vehicle": vehicle_block.write,
    "csv": tables.write_csv,
    "latex": tables.write_latex,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The results, the format, and where to put it."""
    parser.add_argument("coefficients", type=Path, metavar="COEFFICIENTS", help="coefficients.yaml, or a run's folder")
    parser.add_argument("--to", choices=list(FORMATS), required=True, help="format")
    parser.add_argument("--out", type=Path, metavar="FILE", help="default: stdout")
    add_vehicle(parser, "vehicle; also fills in what the results lack, and says so", default=False)


def run(arguments: argparse.Namespace) -> int:
    """Read, convert, write; notes on what was assumed go to stderr too."""
    path: Path = arguments.coefficients
    file = RunFolder(path).coefficients if path.is_dir() else path
    document = _read(file)
    vehicle = load_vehicle(arguments.vehicle) if arguments.vehicle else _vehicle_beside(file)
    stranger = _unknown_format(document, vehicle)
    if stranger and not arguments.vehicle:
        raise UsageError(f"{file}: {stranger}; name the vehicle file with --vehicle")
    if stranger:
        print(f"note: {stranger}", file=sys.stderr)
    model = export_model(document, vehicle, str(file), complete=arguments.vehicle is not None)
    for note in model.notes:
        print(f"note: {note}", file=sys.stderr)
    text = FORMATS[arguments.to](model)
    if arguments.out is None:
        print(text, end="")
        return 0
    try:
        arguments.out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"--out {arguments.out}: cannot be written ({error})") from error
    print(f"written: {arguments.out}", file=sys.stderr)
    return 0


def _unknown_format(document: object, vehicle: Vehicle) -> str:
    """What is wrong where the results are of another vehicle than the file that is to complete them; else empty."""
    conditions = document.get("conditions") if isinstance(document, dict) else None
    name = conditions.get("vehicle") if isinstance(conditions, dict) else None
    return (
        f"the results are of {name}, the vehicle file is of {vehicle.name}" if name not in (None, vehicle.name) else ""
    )


def _read(file: Path) -> object:
    try:
        return read_yaml(file.read_text(encoding="utf-8"), str(file))
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{file}: cannot be read ({error})") from error


def _vehicle_beside(file: Path) -> Vehicle:
    """Return the vehicle of the run the results lie in, or the Hindrax itself."""
    recorded = RunFolder(file.parent).vehicle
    return load_vehicle(recorded if recorded.is_file() else default_vehicle())
