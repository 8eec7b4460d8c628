"""`hindrax predict`: what coefficients predict for records that they were not fitted to."""

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from hindrax_analysis import plots
from hindrax_analysis.coefficients_file import SavedCoefficients, read_coefficients
from hindrax_analysis.identification.executor import add_workers, workers_of
from hindrax_analysis.identification.record_identification import (
    IdentificationTask,
    RecordSource,
    axis_records,
    recorded_vehicle,
)
from hindrax_analysis.terminal import print_answer, print_table, working
from hindrax_cli.argument_types import named_vehicle, positive
from hindrax_cli.command import command, option
from hindrax_cli.commands.data.identify import add_selection, opened
from hindrax_cli.experiment_command import add_output, require_plot, save_plot
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.assess.prediction import WINDOW_S, Prediction, predict_record, predictions_joined, with_delays_of
from hindrax_ident.model.motion_model import motions_of

ABOUT = """
The model runs freely over windows of the record, from the velocity that fits the first second of each, with the
measured thrust alone. The error of the model is printed next to the errors of two trivial predictors: the vehicle
stays still, and it keeps its speed. Coefficients that were fitted to the same record prove little.
"""


def _about(parser: argparse.ArgumentParser) -> None:
    parser.description = f"{parser.description}\n{ABOUT}"


@command(
    "./hindrax predict runs/monday/coefficients.yaml runs/tuesday --window 10 --plot tuesday.png",
    _about,
    option("coefficients", type=Path, metavar="COEFFICIENTS", help="coefficients.yaml, or a run folder"),
    option("records", nargs="+", type=Path, metavar="RECORD", help="bag, run folder or CSV, as `identify`"),
    option("--window", type=positive, default=WINDOW_S, metavar="S", help="length of a window (default 10 s)"),
    named_vehicle("vehicle: its file, or its name; default: the one in the bag"),
    add_selection,
    add_workers,
    add_output,
)
def predict(arguments: argparse.Namespace) -> int:
    """Predict the motion in records that the coefficients were not fitted to."""
    file = arguments.coefficients
    require_plot(arguments.plot)
    saved = read_coefficients(file / "coefficients.yaml" if file.is_dir() else file)
    named, sources, task = opened(arguments)
    vehicle = named or _recorded(sources[0])
    fitted = saved.conditions.vehicle
    if fitted and fitted != vehicle.name:
        print_stderr(
            f"note: coefficients of {fitted}, record of {vehicle.name}: the error is that of another vehicle too"
        )
    jobs = [partial(_of_record, saved, vehicle, one, task, arguments.window) for one in sources]
    with working("predicting"):
        found, reasons = _over_all([*workers_of(arguments).run(jobs)])
    if not found:
        raise HindraxError("; ".join(reasons) or "the records hold no motion with both velocities and forces")
    save_plot(arguments.plot, plots.prediction, found)
    motions = {AXES[one.axis]: {"unit": one.unit, "windows": one.windows, **one.errors} for one in found}
    document = {"window_s": arguments.window, "motions": motions, "left_out": reasons}
    return print_answer(document, lambda: _show(found, reasons, arguments.window), as_json=arguments.json)


def _recorded(source: RecordSource) -> Vehicle:
    found = recorded_vehicle(source)
    if found is None:
        raise UsageError(f"{source.path}: holds no vehicle file; name one with --vehicle (its mass is needed)")
    return found


def _of_record(
    saved: SavedCoefficients, vehicle: Vehicle, source: RecordSource, task: IdentificationTask, window_s: float
) -> tuple[list[Prediction], list[str]]:
    """Predictions over one record, and the reason of each of its axes that has none."""
    numbers = {name: motion.coefficients for name, motion in saved.motions.items() if motion.identifiable}
    found, reasons = [], []
    for axis, record in axis_records([source], vehicle, task).items():
        if source.recording is not None:
            # Of another stack: nobody knows its delays but the fit.
            fitted = [saved.motions[one.name].quality for one in motions_of(axis) if one.name in numbers]
            record = with_delays_of(record, fitted)  # noqa: PLW2901  # the record that is predicted
        try:
            found.append(predict_record(numbers, vehicle, axis, record, window_s))
        except HindraxError as error:
            reasons.append(str(error))
    return found, reasons


def _over_all(
    by_record: Sequence[tuple[list[Prediction], list[str]]],
) -> tuple[list[Prediction], list[str]]:
    """One prediction of each axis over the windows of all records; reasons of axes without any, each once."""
    found = []
    for axis in range(len(AXES)):
        same = [one for predictions, _ in by_record for one in predictions if one.axis == axis]
        found += [predictions_joined(same)] if same else []
    predicted = {AXES[one.axis] for one in found}
    reasons = dict.fromkeys(reason for _, some in by_record for reason in some)
    return found, [one for one in reasons if one.partition(":")[0] not in predicted]


def _show(found: list[Prediction], reasons: list[str], window_s: float) -> None:
    title = f"RMS error of the prediction over {window_s:g} s"
    rows = [
        (AXES[one.axis], one.windows, *(f"{error:.3g}" for error in one.errors.values()), one.unit) for one in found
    ]
    print_table(title, ("motion",), ("windows", "model", "stays still", "keeps its speed", "unit"), rows)
    for reason in reasons:
        print_fitted(f"left out: {reason}")
