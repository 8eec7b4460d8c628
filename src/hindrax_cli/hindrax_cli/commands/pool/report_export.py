"""After a run: `hindrax report` and `export`, for simulators, controllers, tables and our vehicle file."""

import argparse
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from hindrax_analysis.coefficients_file import MOCK_WORLD, SavedCoefficients, read_coefficients
from hindrax_analysis.exports import (
    fossen,
    gz,
    mujoco,
    python_model,
    samples,
    stonefish,
    stonefish_vehicle,
    tables,
    urdf,
    uuv,
    vehicle_block,
)
from hindrax_analysis.exports.export_model import (
    ExportModel,
    abort_notes,
    assumption_notes,
    export_model,
    unidentified_model,
)
from hindrax_analysis.identification.bag_identification import identify_bag, recorded_conditions, write, write_report
from hindrax_analysis.identification.record_identification import RecordSource, recorded_vehicle
from hindrax_analysis.records.own_bag import is_mock
from hindrax_analysis.report.comparison import comparison_page
from hindrax_analysis.terminal import working
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.share_files import default_vehicle
from hindrax_cli.argument_types import at_least, named_vehicle
from hindrax_cli.command import command, option
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted, print_stderr, print_whole
from hindrax_core.text.text_file import replace_text, require_place, writing
from hindrax_core.vehicle import Vehicle, load_vehicle


@command(
    "./hindrax report runs/2026-05-04_10-00-00 runs/2026-05-05_09-30-00 --out comparison.html",
    option("runs", nargs="+", type=Path, metavar="RUN", help="run folder; for a comparison also coefficients.yaml"),
    option("--earlier", nargs="+", type=Path, default=[], metavar="RUN", help="earlier runs to compare with"),
    option("--out", type=Path, metavar="FILE", help="default: report.html of the run, or comparison.html"),
)
def report(arguments: argparse.Namespace) -> int:
    """Regenerate the HTML report of a run, or compare many runs."""
    runs: list[Path] = arguments.runs
    if len(runs) == 1:
        _require_run(runs[0])
        require_place(arguments.out or RunFolder(runs[0]).report)
        with working(f"identifying over {runs[0]} again") as reached:
            out = _again(runs[0], [_saved(path) for path in arguments.earlier], arguments.out, reached)
    else:
        out = arguments.out or Path("comparison.html")
        require_place(out)
        write(out, comparison_page(_labelled([*runs, *arguments.earlier])))
    print_fitted(out)
    return 0


def _saved(path: Path, label: str = "") -> SavedCoefficients:
    file = RunFolder(path).coefficients if path.is_dir() else path
    return read_coefficients(file, label)


def _labelled(paths: list[Path]) -> list[SavedCoefficients]:
    """Runs under the shortest names that distinguish them."""
    folders = [(path if path.is_dir() else path.parent).resolve() for path in paths]
    names = [folder.name for folder in folders]
    if len(set(names)) < len(names):
        names = [f"{folder.parent.name}/{folder.name}" for folder in folders]
    if len(set(names)) < len(names):
        names = [str(path) for path in paths]
    return [_saved(path, name) for path, name in zip(paths, names, strict=True)]


def _require_run(path: Path) -> None:
    if not path.exists():
        raise UsageError(f"{path}: does not exist, wanted the folder of a run such as runs/2026-05-04_10-00-00")
    if not path.is_dir() or not RunFolder(path).bag.is_dir():
        raise UsageError(f"{path}: holds no folder `bag`, wanted the folder of a run such as runs/2026-05-04_10-00-00")


def _again(path: Path, earlier: list[SavedCoefficients], out: Path | None, reached: Callable[[str], None]) -> Path:
    folder = RunFolder(path)
    vehicle = recorded_vehicle(RecordSource(folder.bag)) or load_vehicle(default_vehicle())
    identified = identify_bag(folder.bag, vehicle, mock=is_mock(folder.bag), progress=reached)
    if folder.coefficients.is_file():  # only they contain the prediction
        identified = replace(identified, predicted=read_coefficients(folder.coefficients).conditions.predicted)
    conditions = recorded_conditions(identified, [folder.bag], [folder.bag])
    write_report(out or folder.report, identified, conditions, folder.bag, *earlier)
    return out or folder.report


FORMATS: dict[str, Callable[[ExportModel], str]] = {
    "gz": gz.write,
    "gz-plugin": lambda model: gz.write(model, added_mass="plugin"),
    "stonefish": stonefish.write,
    "stonefish-quadratic": lambda model: stonefish.write(model, "quadratic"),
    "uuv": uuv.write,
    "mujoco": mujoco.write,
    "fossen": fossen.write,
    "python": python_model.write,
    "vehicle": vehicle_block.write,
}
FOLDERS: dict[str, Callable[[ExportModel], Mapping[str, str]]] = {
    "gz": gz.folder,
    "mujoco": mujoco.folder,
    "stonefish": stonefish_vehicle.folder,
    "stonefish-quadratic": lambda model: stonefish_vehicle.folder(model, "quadratic"),
}
"""Formats of several files: a whole vehicle that opens and can be driven, where --out names a folder."""
SUFFIXES = {
    "gz-plugin": ".sdf", "uuv": ".xml", "fossen": ".yaml",
    "python": ".py", "vehicle": ".yaml",
}  # fmt: skip
TABLES: dict[str, Callable[[SavedCoefficients], str]] = {"csv": tables.write_csv, "latex": tables.write_latex}
"""They show what was identified, and want nothing that completes it."""
URDF = "urdf"
"""Needs no results: the vehicle as on `robot_description`, with `ros2_control` joints of its thrusters."""


@command(
    "./hindrax export runs/2026-05-04_10-00-00 --to gz --out model.sdf\n"
    "# a folder that opens and can be driven in MuJoCo:\n"
    "./hindrax export runs/2026-05-04_10-00-00 --to mujoco --out my_vehicle",
    option(
        "coefficients",
        type=Path,
        nargs="?",
        metavar="COEFFICIENTS",
        help="coefficients.yaml, or a run's folder; without it, --vehicle as it is",
    ),
    option("--to", choices=[*FORMATS, *TABLES, URDF], required=True, help="format"),
    option(
        "--out",
        type=Path,
        metavar="FILE_OR_FOLDER",
        help="default: stdout; gz, mujoco, stonefish: also a folder",
    ),
    option("--samples", type=at_least(1), metavar="N", help="N vehicles drawn from the uncertainty, into --out FOLDER"),
    option("--seed", type=int, default=1, metavar="S", help="of the draws; default: 1"),
    named_vehicle("vehicle; also fills in coefficients that the results lack, and marks them"),
)
def export(arguments: argparse.Namespace) -> int:
    """Coefficients for gz-sim, Stonefish, MuJoCo, Python, the vehicle file and tables; a vehicle as URDF."""
    if arguments.samples:
        return _fill_samples(arguments)
    if _wants_folder(arguments.to, arguments.out):
        return _fill_folder(arguments)
    text = _text(arguments.coefficients, arguments.to, arguments.vehicle)
    return print_or_write(text, arguments.out)


def print_or_write(text: str, out: Path | None) -> int:
    """Print a text, or write it where --out names a file; the exit code."""
    if out is None:
        print_whole(text, end="")
        return 0
    with writing(f"--out {out}", "name another place"):
        replace_text(out, text)
    print_stderr(f"written: {out}")
    return 0


def _wants_folder(to: str, out: Path | None) -> bool:
    """Whether the files of a format go into a folder: an existing one, or a name without an ending."""
    if to == "mujoco" and out is None:
        raise UsageError("--to mujoco: found no --out, wanted a folder: vehicle.xml alone has no water")
    return to in FOLDERS and out is not None and (out.is_dir() or not out.suffix)


def _fill_folder(arguments: argparse.Namespace) -> int:
    folder = arguments.out
    files = FOLDERS[arguments.to](_model_named(arguments.coefficients, arguments.to, arguments.vehicle))
    with writing(f"--out {folder}", "name another place"):
        _write_files(folder, files)
    print_stderr(f"written: {folder} ({', '.join(files)})")
    return 0


def _fill_samples(arguments: argparse.Namespace) -> int:
    """A table of the draws, and one model each where the format has models."""
    to, out, count = arguments.to, arguments.out, arguments.samples
    if to in (*TABLES, URDF) and to != "csv":
        raise UsageError(f"--samples: found --to {to}, wanted csv or a format of models, {', '.join(FORMATS)}")
    if out is None or out.is_file():
        raise UsageError("--samples: found no --out FOLDER, wanted one for the table and the models")
    file = results_file(arguments.coefficients, to)
    saved = read_coefficients(file)
    table = samples.sample_table(saved, count, seed=arguments.seed)
    with writing(f"--out {out}", "name another place"):
        _write_files(out, {"samples.csv": table})
        for index, model in enumerate(_drawn(saved, file, arguments) if to != "csv" else (), start=1):
            files = FOLDERS[to](model) if to in FOLDERS else {f"model{SUFFIXES[to]}": FORMATS[to](model)}
            _write_files(out / f"{index:0{len(str(count))}d}", files)
    print_stderr(f"written: {out} (samples.csv{f', {count} models' if to != 'csv' else ''})")
    return 0


def _write_files(folder: Path, files: Mapping[str, str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        replace_text(folder / name, text)


def _drawn(saved: SavedCoefficients, file: Path, arguments: argparse.Namespace) -> Iterable[ExportModel]:
    vehicle, complete = vehicle_of(saved, file, arguments.vehicle), arguments.vehicle is not None
    return samples.sampled_models(saved, vehicle, str(file), arguments.samples, seed=arguments.seed, complete=complete)


def results_file(path: Path | None, to: str) -> Path:
    """File of results that is named, or lies in the folder that is; UsageError where there is none."""
    if path is None:
        raise UsageError(f"--to {to}: found no results, wanted a coefficients.yaml, a run's folder, or --vehicle")
    file = RunFolder(path).coefficients if path.is_dir() else path
    if not file.is_file():
        raise UsageError(f"{file}: cannot be read, there is no such file")
    return file


def _text(path: Path | None, to: str, named: str | None) -> str:
    if to == URDF:
        if named or path is None:
            return urdf.write(load_vehicle(named or default_vehicle()))
        if path.is_dir() and RunFolder(path).vehicle.is_file():
            return urdf.write(load_vehicle(RunFolder(path).vehicle))
        file = results_file(path, to)
        return urdf.write(vehicle_of(read_coefficients(file), file, None))
    if to in TABLES:
        file = results_file(path, to)
        saved = read_coefficients(file)
        table = tables.result_table(saved, str(file))
        _note([*abort_notes(saved), *assumption_notes(saved)])
        return TABLES[to](table)
    return FORMATS[to](_model_named(path, to, named))


SIMULATED = f"assumed: {MOCK_WORLD}"
"""Start of a note of ten lines, which the exported file has and a terminal does without."""


def _note(notes: Iterable[str]) -> None:
    for note in notes:
        if not note.startswith(SIMULATED):
            print_stderr(f"note: {note}")


def _model_named(path: Path | None, to: str, named: str | None) -> ExportModel:
    """Model of results; without any, that of the named vehicle file, whose numbers nobody has identified."""
    if path is None and named:
        model = unidentified_model(load_vehicle(named), named)
        _note(model.notes)
        return model
    file = results_file(path, to)
    return _model(read_coefficients(file), file, named)


def _model(saved: SavedCoefficients, file: Path, named: str | None) -> ExportModel:
    """Results, completed by the vehicle file that is given or beside them; prints its assumptions."""
    vehicle = vehicle_of(saved, file, named)
    model = export_model(saved, vehicle, str(file), complete=named is not None)
    _note(model.notes)
    return model


def vehicle_of(saved: SavedCoefficients, file: Path, named: str | None) -> Vehicle:
    """Vehicle of some results.

    Parameters
    ----------
    saved
        Results, with the name of their vehicle.
    file
        Of the results; the vehicle file of their run lies beside it.
    named
        File that was named; None: that of the run.

    Returns
    -------
    Vehicle
        The named one even of another name, with a note.

    Raises
    ------
    UsageError
        Where the file beside the results is that of another vehicle.
    """
    vehicle = load_vehicle(named) if named else _vehicle_beside(file)
    of = saved.conditions.vehicle
    if of in ("", vehicle.name):
        return vehicle
    stranger = f"the results are of {of}, the vehicle file is of {vehicle.name}"
    if not named:
        raise UsageError(f"{file}: {stranger}; name the vehicle file with --vehicle")
    _note([stranger])
    return vehicle


def _vehicle_beside(file: Path) -> Vehicle:
    """Return the vehicle of the run the results lie in, or the Hindrax itself."""
    recorded = RunFolder(file.parent).vehicle
    return load_vehicle(recorded if recorded.is_file() else default_vehicle())
