"""The tables of a report: Table 3 and Table 4 of COB-2023-1394 for this vehicle, and the methods side by side."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hindrax_analysis.coefficients_file import TABULATED
from hindrax_analysis.published import PAPER, published_of
from hindrax_analysis.report.figures import METHODS, PREDICTORS, comparable_methods, has_restoring_moment, pretty_unit
from hindrax_analysis.report.html_elements import decimals, number, plus_minus, prose, quoted, table, two_digits
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.assessment import Assessment
from hindrax_ident.assess.results import MotionResult, Number, Results
from hindrax_ident.model.motion_model import MOTIONS, coefficient_units

HEADINGS = ("k<sub>q</sub>", "k<sub>l</sub>", "b", "added mass")
OF_SOME = {"k_r": "k<sub>r</sub>", "k_w": "k<sub>w</sub>"}
"""Coefficients that only some motions have: by a restoring moment, and in records that move across."""
CONTRIBUTIONS = (
    "Rows are of the fit without its correction. A row is the part of the uncertainty that vanishes if its influence "
    "is known. Losses have one sign and may all be large, so their rows do not add up in squares to the total."
)
SIGN_OF_B = (
    "The paper prints b of heave along the motion; here it is along the axis, so its sign is reversed for heave, up."
)
RAISED = str.maketrans("0123456789-", "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079\u207b")
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
    having = {name: [key for key, one in results.motions.items() if name in one.coefficients] for name in OF_SOME}
    titles = dict(zip(TABULATED, HEADINGS, strict=True)) | {key: OF_SOME[key] for key, some in having.items() if some}
    for motion, result in results.motions.items():
        own += [len(rows)] if result.identifiable else []
        verdict = "identified" if result.identifiable else "not identifiable"
        wanted = [name for name in titles if motion in having.get(name, results.motions)]
        cells = {name: cell(result.coefficients.get(name), "<small>not found</small>") for name in wanted}
        rows.append([title_of(motion), *(cells.get(name, "") for name in titles), verdict])
        known = [(name, one, one.truth) for name, one in result.coefficients.items()]
        truths = {name: number(true, decimals(one.value, one.std)) for name, one, true in known if true is not None}
        paper = published_of(results.vehicle.name, motion)
        printed = {name: as_printed(*pair) for name, pair in paper.in_our_axes.items()} if paper else {}
        for source, beside in (("truth of the mock", truths), (PAPER, printed)):
            if beside:
                rows.append([*map(_small, (source, *(beside.get(name, "") for name in titles))), ""])
    # Straight motions and turns have different units; the heading has those of what was flown.
    units = {name: [units_of(motion)[name] for motion in results.motions] for name in TABULATED}
    units |= {name: [units_of(motion)[name] for motion in some] for name, some in having.items()}
    heads = [f"{head} [{' or '.join(dict.fromkeys(units[name]))}]" for name, head in titles.items()]
    note = f'<p class="soft">{SIGN_OF_B}</p>' if _printed(results, "heave_up") else ""
    return _titled(TITLE_3, 3, results) + table(["motion", *heads, "verdict"], rows, own) + note


def _printed(results: Results, *motions: str) -> bool:
    """Whether the paper has one of these motions of this vehicle, and it was flown."""
    return any(motion in results.motions and published_of(results.vehicle.name, motion) for motion in motions)


def _titled(title: str, number: int, results: Results) -> str:
    """Title of a table that the paper has too, with its number there where its rows stand beside ours."""
    beside = f", next to Table {number} of {PAPER}" if _printed(results, *results.motions) else ""
    return f'<h2 class="minor">{title}{beside}</h2>'


def as_printed(value: float, std: float) -> str:
    """A published pair with the digits it was printed with, at least two of them behind the point."""
    digits = max(2, *(len(f"{one:.6f}".rstrip("0").partition(".")[2]) for one in (value, std)))
    return f"{number(value, digits)} \u00b1 {number(std, digits)}"


def _small(cell: str) -> str:
    return f"<small>{cell}</small>" if cell else ""


def cell(found: Number | None, missing: str = "") -> str:
    """A coefficient with its deviations."""
    return missing if found is None else quoted(found)


@dataclass(frozen=True, slots=True)
class Dimensionless:
    """C_D at each speed of the drag band, its standard deviations (noise; as quoted), and Re: (n,) each."""

    reynolds: Array
    drag_coefficient: Array
    std: Array
    std_calibrated: Array

    @property
    def mean(self) -> tuple[float, float, float]:
        """Mean over the speeds and the means of both standard deviations."""
        return float(np.mean(self.drag_coefficient)), float(np.mean(self.std)), float(np.mean(self.std_calibrated))


def dimensionless(vehicle: Vehicle, result: MotionResult) -> Dimensionless | None:
    """Drag force in the paper's terms.

    C_D = F / (1/2 rho V^(2/3) U^2) and Re = U V^(1/3) / nu, for turns C_D = M / (1/2 rho L^5 w^2) and Re = w L^2 / nu
    with the length of the vehicle.

    Parameters
    ----------
    vehicle
        Volume V, length L and water.
    result
        Of one motion.

    Returns
    -------
    Dimensionless | None
        None where the motion has no band of speeds.
    """
    band = result.drag
    if band is None:
        return None
    rho, nu = vehicle.water.density_kgpm3, vehicle.water.kinematic_viscosity_m2ps
    turns = MOTIONS[result.motion].axis >= 3
    length = vehicle.envelope_m[0] if turns else vehicle.characteristic_length_m
    per_force = 2.0 / (rho * length ** (5 if turns else 2) * band.speed**2)
    reynolds = band.speed * length ** (2 if turns else 1) / nu
    force, std = np.array([band.quoted(at) for at in range(len(band.speed))]).T
    parts = (reynolds, force * per_force, band.std * per_force, std * per_force)
    return Dimensionless(*map(array, parts))


def table_4(results: Results) -> str:
    """Drag coefficient and Reynolds number beside the paper's."""
    rows: list[list[str]] = []
    own: list[int] = []
    for motion, result in results.motions.items():
        found = dimensionless(results.vehicle, result)
        if found is not None:
            own += [len(rows)] if result.identifiable else []
            between = _between(float(found.reynolds[0]), float(found.reynolds[-1]))
            top = plus_minus(*(float(part[-1]) for part in (found.drag_coefficient, found.std, found.std_calibrated)))
            rows.append([title_of(motion), plus_minus(*found.mean), top, between])
            paper = published_of(results.vehicle.name, motion)
            if paper is not None:
                cells = (PAPER, as_printed(*paper.drag_coefficient), "", _between(*paper.reynolds))
                rows.append([*map(_small, cells)])
    heads = ["motion", "C<sub>D</sub>, mean over the speeds", "C<sub>D</sub> at the highest speed", "Re"]
    return _titled(TITLE_4, 4, results) + table(heads, rows, own) if rows else ""


def reynolds_text(reynolds: float) -> str:
    """A Reynolds number as the paper prints it: 1.1 times ten to the fifth."""
    if not reynolds > 0.0:
        return "0"
    mantissa, _, power = f"{reynolds:.1e}".partition("e")
    return f"{mantissa} \u00d7 10{str(int(power)).translate(RAISED)}"


def _between(low: float, high: float) -> str:
    """Two Reynolds numbers; a narrow screen breaks the line beside them, not within."""
    return " to ".join(f'<span class="whole">{reynolds_text(one)}</span>' for one in (low, high))


def table_predictions(assessments: Mapping[int, Assessment]) -> str:
    """RMS errors over the held-out part of each axis; empty where none was long enough."""
    checked = {axis: one.validation.prediction for axis, one in assessments.items() if one.validation}
    rows = [
        [
            AXES[axis].capitalize(),
            str(one.windows),
            *(number(error, decimals(error, math.nan)) for error in one.errors.values()),
            one.unit,
        ]
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
    units = {name: pretty_unit(unit) for name, unit in coefficient_units(MOTIONS[motion].axis).items()}
    return units | {"drag": units["b"]}


def _plain(found: Number | None) -> str:
    return "" if found is None or not math.isfinite(found.value) else plus_minus(found.value, found.std)


def table_budget(result: MotionResult) -> str:
    """Contribution of each influence to the drag at the highest speed and to each coefficient, and its remedy."""
    columns = [name for name in ("drag", *TABULATED) if name in result.budget]
    shares = {name: {row.influence: row.std for row in result.budget[name]} for name in columns}
    remedies = {row.influence: row.remedy for name in columns for row in result.budget[name]}
    wide = {name: number.std_calibrated for name, number in result.coefficients.items()}
    left = {name: number.quoted[1] for name, number in result.coefficients.items()}
    if result.drag is not None:
        wide["drag"], left["drag"] = float(result.drag.std_calibrated[-1]), result.drag.quoted(-1)[1]
    rows = []
    for influence, remedy in remedies.items():
        stds = [(shares[name].get(influence, 0.0), wide.get(name)) for name in columns]
        # Empty where it is below a twentieth of the band.
        cells = [two_digits(std) if band is None or std >= 0.05 * band else "" for std, band in stds]
        rows += [[influence, *cells, prose(remedy)]] if any(cells) else []
    heads = headings_of(result.motion)
    both = [("corrected", left)] * (left != wide) + [("calibrated", wide)]
    totals = [[name, *(two_digits(std[one]) if one in std else "" for one in columns), ""] for name, std in both]
    heading = ["influence", *(heads[name] for name in columns), "best next step"]
    shown = table(heading, [*totals, *rows], own=(0,), words=(0, len(heading) - 1))
    return f'{shown}<p class="soft">{CONTRIBUTIONS}</p>'
