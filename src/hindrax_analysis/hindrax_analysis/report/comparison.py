"""The comparison of many runs: a table and a forest plot of each coefficient of each motion."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from hindrax_analysis.coefficients_file import TABULATED, SavedCoefficients
from hindrax_analysis.published import CITATION, PAPER, Published, published_of
from hindrax_analysis.report.chart import Role
from hindrax_analysis.report.figures import LABELS
from hindrax_analysis.report.forest import Entry, forest
from hindrax_analysis.report.html_elements import chips, page, plus_minus, prose, table, two_digits
from hindrax_analysis.report.report_tables import cell, headings_of, title_of, units_of
from hindrax_ident.assess.results import MotionResult, Number
from hindrax_ident.model.motion_model import MOTIONS


@dataclass(frozen=True, slots=True)
class RunScatter:
    """Several runs of one coefficient: weighted mean, its deviations, and the scatter between runs.

    Random effects: what differs from run to run has the deviation `between`, estimated beside those of the runs
    (DerSimonian and Laird 1986). An uninformative run weighs little. `std_calibrated` adds the uncertainty of the
    calibration, which is common to all runs, so averaging does not reduce it. `ratio`: root mean square of the runs'
    distances from their mean in their own deviations; 1 is expected where nothing differs.
    """

    mean: float
    std: float
    std_calibrated: float
    scatter: float
    between: float
    ratio: float
    runs: int


def pool_runs(numbers: Sequence[Number]) -> RunScatter | None:
    """Pool independent runs; None for fewer than two with a deviation."""
    known = [one for one in numbers if math.isfinite(one.std) and one.std > 0.0 and math.isfinite(one.value)]
    if len(known) < 2:
        return None
    values, weights = np.array([one.value for one in known]), np.array([one.std**-2 for one in known])
    freedom, total = len(known) - 1, float(weights.sum())
    power = float(np.sum(weights * (values - np.average(values, weights=weights)) ** 2))
    variance = max(0.0, (power - freedom) / (total - float(weights @ weights) / total))
    weights = 1.0 / (1.0 / weights + variance)
    std = float(weights.sum()) ** -0.5
    calibrated = [one for one in known if math.isfinite(one.std_calibrated)]
    added = [math.sqrt(max(0.0, one.std_calibrated**2 - one.std**2)) for one in calibrated]
    return RunScatter(
        mean=float(np.average(values, weights=weights)),
        std=std,
        std_calibrated=math.hypot(std, sum(added) / len(added) if added else math.nan),
        scatter=float(np.std(values, ddof=1)),
        between=math.sqrt(variance),
        ratio=math.sqrt(power / freedom),
        runs=len(known),
    )


def comparison_page(runs: Sequence[SavedCoefficients]) -> str:
    """The whole page; motions in the order of the paper's tables."""
    flown = [motion for motion in MOTIONS if any(motion in run.motions for run in runs)]
    parts = [_header(runs), _runs(runs), *(_motion(motion, runs) for motion in flown)]
    if any(_published(motion, runs) for motion in flown):
        parts.append(f'<p class="soft">{PAPER}: {CITATION}.</p>')
    return page(f"Comparison of {len(runs)} runs", "\n".join(parts))


def _header(runs: Sequence[SavedCoefficients]) -> str:
    names = sorted({run.conditions.vehicle for run in runs if run.conditions.vehicle})
    mocks = [run.conditions.mock for run in runs]
    which = "all" if all(mocks) else "some"
    labels = [(f"{which} runs are of the mock vehicle", "mock")] if any(mocks) else []
    if len(names) > 1:
        labels.append((f"different vehicles: {', '.join(names)}", "bad"))
    aborted = sum(bool(run.conditions.aborted) for run in runs)
    if aborted:
        labels.append((f"aborted: {aborted} of {len(runs)} runs", "bad"))
    return (
        f"<header><h1>Comparison of {len(runs)} runs</h1>"
        f'<div class="soft">{escape(", ".join(names))}</div>{chips(labels)}</header>'
    )


def _runs(runs: Sequence[SavedCoefficients]) -> str:
    rows = []
    for run in runs:
        of = run.conditions
        kind = ("mock" if of.mock else "vehicle") + (f", aborted by {of.aborted}" if of.aborted else "")
        texts = (run.label, of.vehicle, of.date[:16].replace("T", " "), kind, of.software)
        rows.append([prose(text) for text in texts])
    return table(["run", "vehicle", "date", "data", "software"], rows, words=range(5))


def _published(motion: str, runs: Sequence[SavedCoefficients]) -> Published | None:
    vehicles = {run.conditions.vehicle for run in runs}
    return published_of(vehicles.pop(), motion) if len(vehicles) == 1 else None


def _motion(motion: str, runs: Sequence[SavedCoefficients]) -> str:
    own = [(run.label, run.motions[motion]) for run in runs if motion in run.motions]
    paper = _published(motion, runs)
    pooled = {}
    for name in TABULATED:
        identified = [found.coefficients[name] for _, found in own if name in found.coefficients and found.identifiable]
        pooled[name] = pool_runs(identified)
    plots = [_forest(motion, paper, name, own, pooled[name]) for name in TABULATED]
    drawn = f'<div class="plots">{"".join(plots)}</div>'
    return f'<h2 id="{motion}">{title_of(motion)}</h2>{_table(motion, own, pooled)}{drawn}'


def _table(motion: str, own: Sequence[tuple[str, MotionResult]], pooled: Mapping[str, RunScatter | None]) -> str:
    heads, rows = headings_of(motion), []
    for label, found in own:
        cells = [cell(found.coefficients.get(name)) for name in TABULATED]
        rows.append([escape(label), *cells, "identified" if found.identifiable else "not identifiable"])
    marked = []
    if len(own) > 1:
        marked = [len(rows)]
        means, spread = [], []
        for one in pooled.values():
            means.append("" if one is None else plus_minus(one.mean, one.std, one.std_calibrated))
            spread.append(
                "" if one is None else f"{two_digits(one.scatter)} <small>({one.ratio:.1f} \u00d7 as stated)</small>"
            )
        rows.append(["all, weighted", *means, ""])
        rows.append(["scatter of the runs", *spread, ""])
    return table(["run", *(heads[name] for name in TABULATED), "verdict"], rows, marked)


def _forest(
    motion: str, paper: Published | None, name: str, own: Sequence[tuple[str, MotionResult]], pooled: RunScatter | None
) -> str:
    """Plot of a coefficient of every run; empty where none has it."""
    entries, truths = [], set()
    for label, found in own:
        if name in found.coefficients:
            number, identifiable = found.coefficients[name], found.identifiable
            role: Role = "model" if identifiable else "earlier"
            entries.append(Entry(label, number, role, not identifiable))
            truths |= {number.truth} - {None}
    if not entries:
        return ""
    if pooled is not None:
        entries.append(Entry("all, weighted", Number(pooled.mean, pooled.std, pooled.std_calibrated), "online"))
    if paper and name in paper.in_our_axes:
        entries.append(Entry(PAPER, Number(*paper.in_our_axes[name]), "paper"))
    truth = truths.pop() if len(truths) == 1 else None
    words = [f"{LABELS[name]} of every run: thick 95 % from noise, thin 95 % with calibration"]
    if not all(found.identifiable for _, found in own):
        words.append("gray: not identifiable, not in the mean, an arrow if outside the frame")
    words += ["dashed: the truth of the mock"] if truth is not None else []
    return forest(LABELS[name], units_of(motion)[name], entries, f"{'; '.join(words)}.", truth)
