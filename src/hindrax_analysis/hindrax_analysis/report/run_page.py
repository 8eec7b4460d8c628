"""Report of one run as a page of HTML."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

from hindrax_analysis.coefficients_file import MOCK_WORLD, TABULATED, ResultConditions, SavedCoefficients
from hindrax_analysis.correction import what_was_corrected
from hindrax_analysis.next_step import UNKNOWN, lacking, misread, quoted_share, shares_of_step
from hindrax_analysis.published import CITATION, PAPER, published_of
from hindrax_analysis.report.chart import figure
from hindrax_analysis.report.figures import (
    LABELS,
    METHODS,
    ROLES,
    MotionFigures,
    Trace,
    charts_of,
    comparable_methods,
    has_restoring_moment,
    pretty_unit,
)
from hindrax_analysis.report.forest import Entry, forest
from hindrax_analysis.report.html_elements import bullets, chips, decimals, definitions, number, page, plus_minus, prose
from hindrax_analysis.report.report_tables import (
    table_3,
    table_4,
    table_budget,
    table_methods,
    table_predictions,
    title_of,
    units_of,
)
from hindrax_control.commissioning.record import unproven
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.assessment import Assessment
from hindrax_ident.assess.results import MotionResult, Number, Results, truth_of
from hindrax_ident.model.motion_model import MOTIONS, axis_units

SEPARATOR = " \u00b7 "
PREDICTED = (
    '<p class="soft">RMS errors over windows of the last quarter of the motion, of several runs the last, by a model '
    "that was fitted to the rest and moves freely with the recorded thrust, next to two trivial predictors. "
    "<code>./hindrax predict</code> does the same for any other record.</p>"
)


@dataclass(frozen=True, slots=True)
class RunReport:
    """Data of a report. `assessments` by axis; `traces` (online estimates) by motion."""

    results: Results
    assessments: Mapping[int, Assessment]
    conditions: ResultConditions
    traces: Mapping[str, Trace] = field(default_factory=dict)
    earlier: Sequence[SavedCoefficients] = ()


def run_page(report: RunReport) -> str:
    """The whole page."""
    parts = [_header(report), _end(report)]
    if report.results.motions:
        parts += [_headline(report.results, report.conditions.predicted), _how_to_read(report), _tables(report)]
    parts += [_motion(report, result) for result in report.results.motions.values()]
    parts.append(_conditions(report.conditions, report.results.vehicle))
    return page(f"{report.results.vehicle.name}: hydrodynamic identification", "\n".join(parts))


def _header(report: RunReport) -> str:
    conditions, vehicle = report.conditions, report.results.vehicle
    labels: list[tuple[str, ...]] = [("mock vehicle: simulated data", "mock")] if conditions.mock else []
    labels += [(f"aborted: {_guard(conditions.aborted)}", "bad")] if conditions.aborted else []
    labels += [(f"left out: {', '.join(one.partition(':')[0] for one in conditions.left_out)}", "bad")] * bool(
        conditions.left_out
    )
    for motion, result in report.results.motions.items():
        good = result.identifiable
        verdict, kind = ("identified", "good") if good else ("not identifiable", "bad")
        labels.append((f"{title_of(motion)}: {verdict}", kind, motion))
    when = f" \u00b7 {escape(conditions.date.replace('T', ' ')[:16])} UTC" if conditions.date else ""
    return (
        f"<header><h1>Hydrodynamic identification of {escape(vehicle.name)}</h1>"
        f'<div class="soft">{vehicle.mass_kg:g} kg, {vehicle.volume_m3:g} m\u00b3{when}</div>'
        f"{chips(labels)}</header>"
    )


def _guard(aborted: str) -> str:
    """Guard that ended a flight, without its sentence: `pool_bounds`, or `start: dvl_lock` for a refused start."""
    named = re.match(r"(\w+: )+", aborted)
    return named.group().removesuffix(": ") if named else aborted


def _end(report: RunReport) -> str:
    """Reason why the flight ended early, and what was flown until then; empty for one that was flown to its end."""
    conditions = report.conditions
    rows = [f"<b>Aborted by {prose(conditions.aborted)}</b>"] if conditions.aborted else []
    rows += [
        f"<b>{prose(one)}.</b> Results before may count force that it did not give." for one in conditions.left_out
    ]
    until, blocked = _times(conditions.flown_s), _times(conditions.blocked_s)
    if conditions.aborted and until:
        rows.append(f"Flown until then: {until}. The results below are of that part only.")
    elif conditions.aborted and report.results.motions:
        rows.append("Flown until then: no part of a motion.")
    if not report.results.motions:
        rows.append("Nothing was flown: there is no data, so there are no coefficients.")
    if blocked:
        rows.append(
            f"Thrust moved nothing, as against a wall: {blocked}. That and the time before it are not in the data."
        )
    return f'<div class="warning">{"".join(f"<p>{row}</p>" for row in rows)}</div>' if rows else ""


def _times(seconds_of: Mapping[str, float]) -> str:
    return ", ".join(f"{title_of(motion)} for {seconds:.0f} s" for motion, seconds in seconds_of.items())


def _headline(results: Results, predicted: Mapping[str, float]) -> str:
    cards = []
    for motion, result in results.motions.items():
        if not result.identifiable or result.drag is None:
            continue
        speed, (force, std) = float(result.drag.speed[-1]), result.drag.quoted(-1)
        ends = result.drag.corrected and result.drag.corrected.at(-1).interval95
        shown = [number(end, decimals(force, std)) for end in ends or ()]
        interval = f"95 % within {' to '.join(shown)}; " if shown else ""
        units = [pretty_unit(unit) for unit in axis_units(MOTIONS[motion].axis)]
        precision = f": {predicted[motion]:.1%} predicted, {std / force:.1%} reached" if motion in predicted else ""
        cards.append(
            f"<div><small>{title_of(motion)}: drag at {speed:.2f} {units[0]}</small>"
            f"<b>{plus_minus(force, std)} {units[1]}</b>"
            f"<small>{interval}\u00b1: half of the 68 % interval{precision}</small></div>"
        )
    return f'<div class="headline">{"".join(cards)}</div>' if cards else ""


def _how_to_read(report: RunReport) -> str:
    mass = "(m + m<sub>a</sub>) v\u0307 = thrust \u2212 k<sub>q</sub>|v|v \u2212 k<sub>l</sub>v \u2212 b"
    rights = any(map(has_restoring_moment, report.results.motions.values()))
    righting = "; of roll and pitch also \u2212 k<sub>r</sub> sin of the angle: the restoring moment" if rights else ""
    words = (
        f"<p>Model of every motion: {mass}, in SI units and SNAME axes (x forward, y starboard, z down)"
        f"{righting}. Each value "
        "is corrected by the probable size of each influence of the uncertainty budget; \u00b1 is half of its 68 % "
        "interval, to quote for the vehicle. Below it is the result of the record alone, with its noise.</p>"
    )
    if corrected := what_was_corrected(report.results):
        words += f"<p>{prose(corrected)}.</p>"
    assumed = [one for one in report.conditions.assumptions if not one.startswith(MOCK_WORLD)]
    if assumed:
        words += f"<p>Assumptions:</p>{bullets(assumed)}"
    return words


def _tables(report: RunReport) -> str:
    text, fourth, vehicle = table_3(report.results), table_4(report.results), report.results.vehicle
    if fourth:
        straight = "C<sub>D</sub> = F / (\u00bd \u03c1 V<sup>2/3</sup> U\u00b2) and Re = U V<sup>1/3</sup> / \u03bd"
        turning = "M / (\u00bd \u03c1 L\u2075 \u03c9\u00b2) and \u03c9 L\u00b2 / \u03bd"
        text += (
            f'{fourth}<p class="soft">{straight} with V<sup>1/3</sup> = {vehicle.characteristic_length_m:.4f} '
            f"m; for turns {turning} with L = {vehicle.envelope_m[0]:g} m.</p>"
        )
    predictions = table_predictions(report.assessments)
    if predictions:
        text += f'<h2 class="minor">Prediction of the held-out part</h2>{predictions}{PREDICTED}'
    return text


# ---- one motion


def _motion(report: RunReport, result: MotionResult) -> str:
    parts = [f'<h2 id="{result.motion}">{title_of(result.motion)}</h2>', _reasons(result)]
    assessment = report.assessments.get(MOTIONS[result.motion].axis)
    if assessment is None or not result.coefficients:
        return "".join(parts)
    parts.append(_facts(result))
    figures = MotionFigures(report.results.vehicle, result, assessment, report.traces.get(result.motion))
    parts.append(f'<div class="plots">{"".join(figure(chart) for chart in charts_of(figures))}</div>')
    parts.append(f"<h3>Uncertainty budget: one standard deviation each</h3>{table_budget(result)}{_next(result)}")
    parts.append(f"<h3>Methods side by side</h3>{table_methods(result)}")
    parts.append(f'<div class="plots">{"".join(_forests(report, result))}</div>')
    return "".join(parts)


def _next(result: MotionResult) -> str:
    """Next experiment, and the deviation of the drag after it; what comes first where the drag stays unknown."""
    if wrong := misread(result):
        return f"<p>{prose(f'Best next step: {wrong}.')}</p>"
    step, shares = result.next_step, shares_of_step(result)
    if step is None or shares is None:
        return ""
    now, then = shares
    if then < UNKNOWN:
        bought = f"{quoted_share(then)} instead of {quoted_share(now)}"
        text = f"Best next step: {step.remedy}. Standard deviation of the drag at the highest speed: {bought}."
    else:
        text = (
            f"Best next step: another record of this motion. After any other the drag stays unknown: {lacking(result)}."
        )
    return f"<p>{prose(text)}</p>"


def _reasons(result: MotionResult) -> str:
    lists = (("Not identifiable from this record.", result.reasons), ("Before you use it:", result.warnings))
    return "".join(f'<div class="warning"><b>{title}</b>{bullets(those)}</div>' for title, those in lists if those)


def _facts(result: MotionResult) -> str:
    quality = result.quality
    words = [f"{result.samples} samples ({result.effective_samples:.0f} independent)"]
    if plateaus := quality.get("plateaus"):
        words.append(f"{plateaus:.0f} plateau{'s' * (plateaus != 1.0)}")
    if math.isfinite(quality.get("held_out_fit", math.nan)):
        words.append(f"{max(0.0, quality['held_out_fit']):.0%} of the held-out motion predicted")
    if "lag_s" in quality:
        words.append(f"thruster lag {quality['lag_s']:.3f} s")
    if quality.get("latency_s"):
        words.append(f"stamps late by {quality['latency_s']:.3f} s")
    return f'<p class="soft">{SEPARATOR.join(words)}</p>'


def _forests(report: RunReport, result: MotionResult) -> list[str]:
    out = []
    for name in TABULATED:
        entries = _entries(report, result, name)
        if len(entries) < 2:
            continue
        truth = result.coefficients[name].truth if name in result.coefficients else None
        caption = f"{LABELS[name]} by every method and source: thick 95 % from noise, thin 95 % with calibration"
        caption += ", dashed the truth of the mock." if truth is not None else "."
        if any(entry.number.corrected is not None for entry in entries):
            caption += " Dot and thin line are corrected, the thick line is the fit."
        out.append(forest(LABELS[name], units_of(result.motion)[name], entries, caption, truth))
    return out


def _entries(report: RunReport, result: MotionResult, name: str) -> list[Entry]:
    methods = {result.method: result.coefficients, **comparable_methods(result)}
    entries = []
    for method, numbers in methods.items():
        if name in numbers:
            role = ROLES.get(method, "model" if method == result.method else "online")
            entries.append(Entry(METHODS.get(method, method).partition(" (")[0], numbers[name], role))
    prior = truth_of(report.results.vehicle).get(result.motion, {})
    if name in prior and not report.conditions.mock:
        entries.append(Entry("vehicle file", Number(prior[name], math.nan), "prior"))
    paper = published_of(report.results.vehicle.name, result.motion)
    if paper and name in paper.in_our_axes:
        entries.append(Entry(PAPER, Number(*paper.in_our_axes[name]), "paper"))
    for saved in report.earlier:
        motion = saved.motions.get(result.motion)
        if motion is not None and name in motion.coefficients:
            label = f"{saved.label} (aborted)" if saved.conditions.aborted else saved.label
            entries.append(Entry(label, motion.coefficients[name], "earlier"))
    return entries


# ---- the end


def _conditions(of: ResultConditions, vehicle: Vehicle) -> str:
    proof = unproven(vehicle) or "commissioned"
    pairs = [
        ("vehicle", of.vehicle),
        ("vehicle file", "counts as commissioned: a mock is built by it" if of.mock else proof),
        ("mass, volume", f"{of.mass_kg:g} kg, {of.volume_m3:g} m\u00b3"),
        ("water", f"{of.density_kgpm3:g} kg/m\u00b3, \u03bd = {of.kinematic_viscosity_m2ps:g} m\u00b2/s"),
        ("data", "mock vehicle (simulated)" if of.mock else "recorded on a vehicle"),
        ("motions", ", ".join(of.motions)),
        ("date of the record", of.date),
        ("record", of.bag),
        ("SHA-256 of the record", of.bag_sha256),
        ("software", of.software),
    ]
    pairs += [(MOCK_WORLD, one.partition(": ")[2]) for one in of.assumptions if one.startswith(MOCK_WORLD)]
    sources = (
        f'<p class="soft">Drag model, coefficients and drag coefficients as in {PAPER} ({CITATION}). Standard '
        "deviations: its eq. 7 and 8, corrected for the autocorrelation of the residuals. The same numbers, with "
        "covariances, are in coefficients.yaml.</p>"
    )
    return f"<h2>Conditions</h2>{definitions(pairs)}{sources}"
