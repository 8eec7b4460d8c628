"""`hindrax export`: identified coefficients for simulators, controllers, tables and our own vehicle file."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

from hindrax_analysis.coefficients_file import SavedCoefficients, read_coefficients
from hindrax_analysis.exports import gz, python_model, stonefish, tables, uuv, vehicle_block
from hindrax_analysis.exports.export_model import ExportModel, export_model
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.share_files import default_vehicle
from hindrax_cli.argument_types import add_vehicle
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted, print_whole
from hindrax_core.text.text_file import writing
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ros.messages.frames import urdf_of

NAME = "export"
HELP = "coefficients for gz-sim, Stonefish, uuv_simulator, Python, the vehicle file, CSV or LaTeX; a vehicle as URDF"
EXAMPLE = "./hindrax export runs/2026-05-04_10-00-00 --to gz --out model.sdf"

FORMATS: dict[str, Callable[[ExportModel], str]] = {
    "gz": gz.write,
    "gz-plugin": lambda model: gz.write(model, added_mass="plugin"),
    "stonefish": stonefish.write,
    "stonefish-quadratic": lambda model: stonefish.write(model, "quadratic"),
    "uuv": uuv.write,
    "python": python_model.write,
    "vehicle": vehicle_block.write,
}
TABLES: dict[str, Callable[[tables.ResultTable], str]] = {"csv": tables.write_csv, "latex": tables.write_latex}
"""They show what was identified, and want nothing that completes it."""
URDF = "urdf"
"""Needs no results: the vehicle as on `robot_description`."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The results, the format, and where to put it."""
    parser.add_argument(
        "coefficients",
        type=Path,
        nargs="?",
        metavar="COEFFICIENTS",
        help="coefficients.yaml, or a run's folder; not needed for urdf",
    )
    parser.add_argument("--to", choices=[*FORMATS, *TABLES, URDF], required=True, help="format")
    parser.add_argument("--out", type=Path, metavar="FILE", help="default: stdout")
    add_vehicle(parser, "vehicle; also fills in what the results lack, and says so", default=False)


def run(arguments: argparse.Namespace) -> int:
    """Read, convert, write; notes on what was assumed go to stderr too."""
    text = _text(arguments.coefficients, arguments.to, arguments.vehicle)
    if arguments.out is None:
        print_whole(text, end="")
        return 0
    with writing(f"--out {arguments.out}", "name another place", UsageError):
        arguments.out.write_text(text, encoding="utf-8")
    print_fitted(f"written: {arguments.out}", sys.stderr)
    return 0


def _text(path: Path | None, to: str, named: str | None) -> str:
    if path is None and to != URDF:
        raise UsageError(f"--to {to}: found no results, wanted a coefficients.yaml or a run's folder")
    file = RunFolder(path).coefficients if path is not None and path.is_dir() else path
    if file is None or (to == URDF and named):
        return urdf_of(load_vehicle(named or default_vehicle()))
    if to == URDF:
        return urdf_of(_vehicle_beside(file))
    saved = _results(file)
    if to in TABLES:
        table = tables.result_table(saved, str(file))
        _note(table.notes)
        return TABLES[to](table)
    return FORMATS[to](_model(saved, file, named))


def _results(file: Path) -> SavedCoefficients:
    if not file.is_file():
        raise UsageError(f"{file}: cannot be read, there is no such file")
    return read_coefficients(file)


def _note(notes: Iterable[str]) -> None:
    for note in notes:
        print_fitted(f"note: {note}", sys.stderr)


def _model(saved: SavedCoefficients, file: Path, named: str | None) -> ExportModel:
    """Results, completed by the vehicle file that is named or lies beside them; says what was assumed."""
    vehicle = load_vehicle(named) if named else _vehicle_beside(file)
    stranger = _of_another(saved.conditions.vehicle, vehicle)
    if stranger and not named:
        raise UsageError(f"{file}: {stranger}; name the vehicle file with --vehicle")
    if stranger:
        _note([stranger])
    model = export_model(saved, vehicle, str(file), complete=named is not None)
    _note(model.notes)
    return model


def _of_another(name: str, vehicle: Vehicle) -> str:
    """What is wrong where the results are of another vehicle than the file that is to complete them; else empty."""
    return f"the results are of {name}, the vehicle file is of {vehicle.name}" if name not in ("", vehicle.name) else ""


def _vehicle_beside(file: Path) -> Vehicle:
    """Return the vehicle of the run the results lie in, or the Hindrax itself."""
    recorded = RunFolder(file.parent).vehicle
    return load_vehicle(recorded if recorded.is_file() else default_vehicle())
