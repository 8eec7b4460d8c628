"""The tables of a report: Table 3 and Table 4 of COB-2023-1394 for this vehicle, and the methods side by side."""

from __future__ import annotations

import math
from collections.abc import Mapping

from hindrax_analysis.coefficients_file import TABULATED
from hindrax_analysis.published import PAPER, published_of
from hindrax_analysis.report.dimensionless import dimensionless, format_reynolds
from hindrax_analysis.report.figures import (
    METHODS,
    PREDICTORS,
    comparable_methods,
    has_restoring_moment,
    pretty_unit,
)
from hindrax_analysis.report.page import decimals, number, plus_minus, prose, table
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.assess.assessment import Assessment
from hindrax_ident.assess.results import MotionResult, Number, Results
from hindrax_ident.model.motion_model import MOTIONS, coefficients

HEADINGS = ("k<sub>q</sub>", "k<sub>l</sub>", "b", "added mass")
CONTRIBUTIONS = (
    "A row is what the band would lose if its influence were known. Losses act one way and may all be large at once, "
    "so their rows do not add up in squares to the band."
)
SIGN_OF_B = (
    "The paper prints b of heave along the motion; here it is along the axis, so its sign is reversed for heave, up."
)
TITLE_3, TITLE_4 = "Coefficients", "Drag coefficient and Reynolds number"

RIGHTING = "Plateaus are omitted: the mean moment of each includes the restoring moment of the vehicle."


def title_of(motion: str) -> str:
    """Title of a motion: Heave, down."""
    axis, _, side = motion.partition("_")
    return f"{axis.capitalize()}, {side}" if side else axis.capitalize()


def table_3(results: Results) -> str:
    """Coefficients with their deviations, titled; below each motion the paper's row and the mock's truth."""
    rows: list[list[str]] = []
    own: list[int] = []
    for motion, result in results.motions.items():
        own += [len(rows)] if result.identifiable else []
        rows.append([title_of(motion), *(_cell(result.coefficients.get(name)) for name in TABULATED), _verdict(result)])
        if any(one.truth is not None for one in result.coefficients.values()):
            rows.append(["<small>truth of the mock</small>", *_truths(result), ""])
        paper = published_of(results.vehicle.name, motion)
        if paper is not None:
            pairs = paper.in_our_axes
            printed = [as_printed(*pairs[name]) if name in pairs else "" for name in TABULATED]
            rows.append(["<small>COB-2023-1394</small>", *map(_small, printed), ""])
    # Straight motions and turns have different units; the heading has those of what was flown.
    units = [units_of(motion) for motion in results.motions]
    heads = [
        f"{head} [{' or '.join(dict.fromkeys(one[name] for one in units))}]"
        for name, head in zip(TABULATED, HEADINGS, strict=True)
    ]
    note = f'<p class="soft">{SIGN_OF_B}</p>' if _printed(results, "heave_up") else ""
    return _titled(TITLE_3, 3, results) + table(["motion", *heads, "verdict"], rows, own) + note


def _printed(results: Results, *motions: str) -> bool:
    """Whether the paper has one of these motions of this vehicle, and it was flown."""
    return any(motion in results.motions and published_of(results.vehicle.name, motion) for motion in motions)


def _titled(title: str, number: int, results: Results) -> str:
    """Title of a table that the paper has too, with its number there where its rows stand beside ours."""
    beside = f", beside Table {number} of {PAPER}" if _printed(results, *results.motions) else ""
    return f"<h3>{title}{beside}</h3>"


def as_printed(value: float, std: float) -> str:
    """A published pair with the digits it was printed with, at least two of them behind the point."""
    digits = max(2, *(len(f"{one:.6f}".rstrip("0").partition(".")[2]) for one in (value, std)))
    return f"{number(value, digits)} \u00b1 {number(std, digits)}"


def _small(cell: str) -> str:
    return f"<small>{cell}</small>" if cell else ""


def _cell(found: Number | None) -> str:
    return "<small>not found</small>" if found is None else plus_minus(found.value, found.std, found.std_calibrated)


def _truths(result: MotionResult) -> list[str]:
    cells = []
    for name in TABULATED:
        found = result.coefficients.get(name)
        known = found is not None and found.truth is not None
        cells.append(f"<small>{number(found.truth, decimals(found.value, found.std))}</small>" if known else "")  # type: ignore[union-attr, arg-type]  # known says both
    return cells


def _verdict(result: MotionResult) -> str:
    return "identified" if result.identifiable else "not identifiable"


def table_4(vehicle: Vehicle, results: Results) -> str:
    """Drag coefficient and Reynolds number beside the paper's."""
    rows: list[list[str]] = []
    own: list[int] = []
    for motion, result in results.motions.items():
        found = dimensionless(vehicle, result)
        if found is not None:
            own += [len(rows)] if result.identifiable else []
            low, high = float(found.reynolds[0]), float(found.reynolds[-1])
            top = plus_minus(*(float(part[-1]) for part in (found.drag_coefficient, found.std, found.std_calibrated)))
            rows.append([title_of(motion), plus_minus(*found.mean), top, _range(low, high)])
            paper = published_of(vehicle.name, motion)
            if paper is not None:
                cells = [as_printed(*paper.drag_coefficient), "", _range(*paper.reynolds)]
                rows.append(["<small>COB-2023-1394</small>", *map(_small, cells)])
    heads = ["motion", "C<sub>D</sub>, mean over the speeds", "C<sub>D</sub> at the highest speed", "Re"]
    return _titled(TITLE_4, 4, results) + table(heads, rows, own) if rows else ""


def _range(low: float, high: float) -> str:
    return f"{format_reynolds(low)} to {format_reynolds(high)}"


def table_predictions(assessments: Mapping[int, Assessment]) -> str:
    """RMS errors over the held-out part of each axis; empty where none was long enough."""
    checked = {axis: one.validation.prediction for axis, one in assessments.items() if one.validation}
    rows = [
        [AXES[axis].capitalize(), str(one.windows), *(f"{error:.3g}" for error in one.errors.values()), one.unit]
        for axis, one in checked.items()
    ]
    return table(["axis", "windows", *PREDICTORS, "unit"], rows) if rows else ""


def table_methods(result: MotionResult) -> str:
    """The methods over the same record."""
    methods: Mapping[str, Mapping[str, Number]] = {result.method: result.coefficients, **comparable_methods(result)}
    heads = [headings_of(result.motion)[name] for name in TABULATED]
    rows = [
        [METHODS.get(name, name), *(_plain(found.get(key)) for key in TABULATED)] for name, found in methods.items()
    ]
    note = f'<p class="soft">{RIGHTING}</p>' if has_restoring_moment(result) else ""
    return table(["method", *heads], rows, own=(0,)) + note


def headings_of(motion: str) -> dict[str, str]:
    """Heading with its unit of each coefficient of a motion, and of the drag at its highest speed."""
    heads = dict(zip(TABULATED, HEADINGS, strict=True)) | {"drag": "drag at the highest speed"}
    units = units_of(motion)
    return {name: f"{head} [{units[name]}]" for name, head in heads.items()}


def units_of(motion: str) -> dict[str, str]:
    """Unit of each coefficient of a motion, and of its drag: a force or a moment, as net buoyancy is."""
    units = {name: pretty_unit(one.unit) for name, one in coefficients(MOTIONS[motion].axis).items()}
    return units | {"drag": units["b"]}


def _plain(found: Number | None) -> str:
    return "" if found is None or not math.isfinite(found.value) else plus_minus(found.value, found.std)


def table_budget(result: MotionResult) -> str:
    """What each influence contributes to the drag at the highest speed and to each coefficient, and its remedy."""
    columns = [name for name in ("drag", *TABULATED) if name in result.budget]
    shares = {name: {row.influence: row.std for row in result.budget[name]} for name in columns}
    remedies = {row.influence: row.remedy for name in columns for row in result.budget[name]}
    wide = {name: number.std_calibrated for name, number in result.coefficients.items()}
    if result.drag is not None:
        wide["drag"] = float(result.drag.std_calibrated[-1])
    rows = [
        [
            influence,
            *(_contribution(shares[name].get(influence, 0.0), wide.get(name)) for name in columns),
            prose(remedy),
        ]
        for influence, remedy in remedies.items()
    ]
    heads = headings_of(result.motion)
    total = ["calibrated band", *(_digits(wide.get(name)) for name in columns), ""]
    heading = ["influence", *(heads[name] for name in columns), "what would shrink it"]
    return table(heading, [total, *rows], own=(0,)) + f'<p class="soft">{CONTRIBUTIONS}</p>'


def _contribution(std: float, band: float | None) -> str:
    """A contribution with two digits; empty where it is below a twentieth of the band."""
    return _digits(std) if band is None or std >= 0.05 * band else ""


def _digits(std: float | None) -> str:
    return "" if std is None else f"{std:.2g}"
