"""Identification over a finished bag of this stack; results of any record in files and on the terminal."""

import contextlib
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hindrax_analysis.coefficients_file import (
    ResultConditions,
    SavedCoefficients,
    as_yaml,
    conditions_of,
    read_coefficients,
)
from hindrax_analysis.correction import what_was_corrected
from hindrax_analysis.identification.supply_at_rest import RestVolts, at_rest_volts
from hindrax_analysis.identification.verdict import REJECTED, marked, shared, show_reasons, show_verdicts
from hindrax_analysis.published import PAPER, published_of
from hindrax_analysis.records.own_bag import (
    bag_events,
    date_of,
    has_other_thrust,
    left_out,
    maneuver_record,
    seed_of,
    truth_in,
)
from hindrax_analysis.report.comparison import RunScatter
from hindrax_analysis.report.figures import Trace
from hindrax_analysis.report.run_page import RunReport, run_page
from hindrax_analysis.terminal import print_table, print_what_fits
from hindrax_bag import software_version
from hindrax_bag.read.bag_reader import bag_files, is_bag, messages
from hindrax_bag.run_folder import RunFolder
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp
from hindrax_core.text.digits import PLUS_MINUS, measured
from hindrax_core.text.refusals import Refusal
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.text.text_file import replace_text, writing
from hindrax_core.topics import ESTIMATE, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.results import MotionResult, Results, with_truth
from hindrax_ident.online.session import Outcome, Session
from hindrax_ident.tuning import Tuning

LINE, OFF_LINE = ("k_q", "k_l", "added_mass", "b"), ("k_r", "k_w")
"""Coefficients that the line of a motion has room for, and the others."""


@dataclass(frozen=True, slots=True)
class Identified:
    """Results of one record, or of several together and then of each one too."""

    outcome: Outcome
    results: Results
    mock: bool
    origin: Stamp | None = None
    """Stamp at time zero of the outcome."""
    predicted: Mapping[str, float] = field(default_factory=dict)
    """Deviation of the drag of each motion as a share of it, as a rehearsal predicted before the flight [-]."""
    traces: Mapping[str, Trace] = field(default_factory=dict)
    runs: tuple[Results, ...] = ()
    left_out: tuple[str, ...] = ()
    """Thrusters taken out of use in the record, each with its reason."""
    spreads: Mapping[str, Mapping[str, RunScatter]] = field(default_factory=dict)
    seed: int | None = None
    """Of the mock vehicle, where it flew."""

    @property
    def complete(self) -> bool:
        """Whether at least one motion was flown and every one is identifiable."""
        motions = self.results.motions
        return bool(motions) and all(one.identifiable for one in motions.values())

    def document(self, bag: Path, report: Path | None, factor: float | None, aborted: Refusal) -> dict[str, object]:
        """The JSON document of `pool-test` and `identify`.

        Parameters
        ----------
        bag, report
            Files; no report: None.
        factor : [-]
            Times real time of the flight; None: not flown.
        aborted
            Why it ended early.

        Returns
        -------
        dict[str, object]
            Plain data.
        """
        ends = {"bag": str(bag), "report": str(report) if report else None}
        out: dict[str, object] = {"thrusters_left_out": list(self.left_out)} if self.left_out else {}
        if self.seed is not None:
            out["seed"] = self.seed
        ended = {"aborted": aborted or None, "aborted_by": aborted.word}
        return {**self.results.to_json(), **ends, "real_time_factor": factor, **ended, **out}


def identify_bag(
    bag: Path,
    vehicle: Vehicle,
    *,
    mock: bool = False,
    tuning: Tuning | None = None,
    progress: Callable[[str], None] = lambda _: None,
    volts: RestVolts | None = None,
) -> Identified:
    """Run the session over a bag of this stack.

    Parameters
    ----------
    bag
        Folder.
    vehicle
        As it was flown, or as it is now believed to be.
    mock
        Whether the coefficients get the true values of the simulation.
    tuning
        Of the session; None: defaults.
    progress
        Called with a sentence about what begins.
    volts
        Supply at rest before and after it, where a person read it.

    Returns
    -------
    Identified
        Results and assessments by motion.
    """
    thrust_anew = has_other_thrust(bag, vehicle)
    how = ", thrust anew from the pulses by the thrusters and curves of this vehicle file" if thrust_anew else ""
    progress(f"reading the bag{how}")
    session = Session(vehicle, tuning, every_s=math.inf)
    origin: Stamp | None = None
    flown = bag_events(bag, vehicle, tuning, thrust_anew=thrust_anew)
    for event in at_rest_volts(flown, vehicle, volts):
        origin = event.stamp if origin is None else min(origin, event.stamp)
        session.step(event)
    outcome = session.finalize(progress)
    results = with_truth(outcome.results, truth_in(bag, vehicle)) if mock else outcome.results
    return Identified(outcome, results, mock, origin, left_out=left_out(bag), seed=seed_of(bag))


def show(
    identified: Identified, *, reported: bool = False, above: int = 0, ending: Callable[[], object] = lambda: None
) -> None:
    """Print coefficients with the true values of the mock and the paper's, reasons of what is not, then verdicts.

    All of it is one screen: where that has too few lines, first coefficients share a line, then warnings go, then
    reasons, then coefficients. What went is named, with where it is.

    Parameters
    ----------
    identified
        Results.
    reported
        Whether a report is written, which has the remarks on each motion.
    above
        Lines of this result that are on the screen already.
    ending
        Prints what comes after it on the same screen.
    """
    motions = identified.results.motions
    warnings = shared({name: one.warnings for name, one in motions.items()})
    where = "in the report" if reported else "--json shows"
    count = f"warnings ({sum(len(names) for names, _ in warnings)})"
    rejected = [one for one in motions.values() if not one.identifiable]
    known = any(one.coefficients for one in motions.values())

    def way(line: int, *, warned: bool, reasoned: bool) -> None:
        """Coefficients each on a line of its own (2), those of a motion on one (1), or none of them (0)."""
        unsaid = [*([count] if warnings and not warned else [])]
        unsaid += [f"why {REJECTED} (not identifiable)"] if rejected and not reasoned else []
        for sentence in identified.left_out:
            print_fitted(f"{sentence}: earlier results may count force that it did not give")
        if line == 1 and known:
            _show_short(motions, where, unsaid)
        else:
            if line == 2:
                _show_in_full(identified)
            if rest := [*(["coefficients"] if known and line == 0 else []), *unsaid]:
                print_fitted(f"{where}: {', '.join(rest)}")
        for names, warning in warnings if warned else []:
            print_fitted(f"{', '.join(names)}: {warning}")
        show_reasons({one.motion: one.reasons for one in rejected} if reasoned else {})
        show_verdicts(motions, identified.predicted, dense=line < 2)
        if known and (corrected := what_was_corrected(identified.results, remedy=not reported)):
            print_fitted(corrected)
        ending()

    said = not reported
    print_what_fits(
        partial(way, 2, warned=said, reasoned=True),
        partial(way, 1, warned=said, reasoned=True),
        partial(way, 1, warned=False, reasoned=True),
        partial(way, 1, warned=False, reasoned=False),
        partial(way, 0, warned=False, reasoned=False),
        above=above,
    )


def _show_short(motions: Mapping[str, MotionResult], where: str, told: Sequence[str]) -> None:
    """Print a row for each motion: what a screen of 24 lines has room for beside the verdicts of all motions."""
    names, rows = [name for name in LINE if _has(motions, name)], []
    for result in motions.values():
        numbers = (result.coefficients.get(name) for name in names)
        rows.append((marked(result), *("" if one is None else measured(*one.quoted) for one in numbers)))
    rest = [*(["truth"] if _has_truth(motions) else []), *(name for name in OFF_LINE if _has(motions, name)), *told]
    title = f"Coefficients (SI; {PLUS_MINUS}{f'; {where}: ' if rest else ''}{', '.join(rest)})"
    print_table(title, ("motion",), names, rows, spare=("added_mass", "b"), dense=True)


def _has(motions: Mapping[str, MotionResult], name: str) -> bool:
    return any(name in result.coefficients for result in motions.values())


def _has_truth(motions: Mapping[str, MotionResult]) -> bool:
    return any(one.truth is not None for result in motions.values() for one in result.coefficients.values())


def _show_in_full(identified: Identified) -> None:
    """Print a row for each coefficient, with its unit, the true value of the mock and the paper's."""
    motions = identified.results.motions
    name = identified.results.vehicle.name
    papers = (PAPER,) if any(published_of(name, motion) for motion in motions) else ()
    has_truth = _has_truth(motions)
    numbers = ("value", *(("truth",) if has_truth else ()), *papers)
    rows = []
    for motion, result in motions.items():
        published = published_of(name, motion)
        paper = published.in_our_axes if published else {}
        for key, number in result.coefficients.items():
            truth = () if not has_truth else ("" if number.truth is None else f"{number.truth:.4g}",)
            printed = f"{paper[key][0]:.2f} +- {paper[key][1]:.2f}" if key in paper else ""
            found = measured(*number.quoted)
            rows.append((marked(result), f"{key} [{number.unit}]", found, *truth, *((printed,) if papers else ())))
    if rows:
        title = f"Identified coefficients, SNAME axes ({PLUS_MINUS}, calibration, water and tether included)"
        print_table(title, ("motion", "coefficient"), numbers, rows, spare=papers, grouped=True)


def identify_run(
    folder: RunFolder,
    vehicle: Vehicle,
    *,
    mock: bool,
    aborted: str = "",
    predicted: Mapping[str, float],
    assumed: Sequence[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Identified:
    """Identify over the bag of a run and write its coefficients and its report.

    Parameters
    ----------
    folder
        Of the run.
    vehicle
        As it was flown.
    mock
        Whether it was the simulation.
    aborted
        Why the flight ended early; empty where it did not.
    predicted
        Deviation of the drag that was planned for, by motion [-].
    assumed
        Sentences on what is assumed or simulated.
    progress
        Called with a sentence about what begins.

    Returns
    -------
    Identified
        As of `identify_bag`.
    """
    identified = replace(identify_bag(folder.bag, vehicle, mock=mock, progress=progress), predicted=predicted)
    conditions = recorded_conditions(identified, [folder.bag], [folder.bag], assumed, aborted=aborted)
    progress("writing the report")
    write(folder.coefficients, as_yaml(identified.results, conditions))
    write_report(folder.report, identified, conditions, folder.bag)
    return identified


def write_report(
    file: Path, identified: Identified, conditions: ResultConditions, bag: Path | None, *earlier: SavedCoefficients
) -> None:
    """Write the report.

    Parameters
    ----------
    file
        HTML, replaced as a whole.
    identified, conditions
        Results, and how they came to be.
    bag
        Where the record is one of this stack: its online estimates are drawn. None: those of `identified`.
    *earlier
        Results to compare with.
    """
    results, traces = identified.results, traces_of(bag, identified.origin) if bag else identified.traces
    report = RunReport(results, identified.outcome.assessments, conditions, traces, earlier)
    write(file, run_page(report))


# ---- result files and what they hold of the bag


def bag_hash(bag: Path) -> str:
    """SHA-256 over the files of a bag, in order."""
    digest = hashlib.sha256()
    for file in bag_files(bag):
        with file.open("rb") as stream:
            hashlib.file_digest(stream, lambda: digest)
    return digest.hexdigest()


def recorded_conditions(
    identified: Identified, files: Sequence[Path], ours: Sequence[Path], assumed: Sequence[str] = (), aborted: str = ""
) -> ResultConditions:
    """Conditions of a result over files, of which some are bags of this stack.

    Parameters
    ----------
    identified
        Results.
    files, ours
        All of them, and the bags of this stack among them.
    assumed
        Sentences on what is assumed.
    aborted
        An end that neither a bag nor its run contains yet.

    Returns
    -------
    ResultConditions
        With the hash of every file.
    """
    results, flown = identified.results, [maneuver_record(bag) for bag in ours]
    ends = [aborted or recorded_end(bag) or one.aborted for bag, one in zip(ours, flown, strict=True)]

    def total(seconds: Sequence[Mapping[str, float]]) -> dict[str, float]:
        return {motion: sum(one.get(motion, 0.0) for one in seconds) for one in seconds for motion in one}

    return replace(
        conditions_of(results.vehicle, mock=identified.mock, motions=tuple(results.motions)),
        date=date_of(files[0]) if is_bag(files[0]) else "",
        bag=", ".join(map(str, files)),
        bag_sha256=", ".join(map(bag_hash, files)),
        software=software_version(),
        assumptions=tuple(assumed),
        left_out=identified.left_out,
        aborted="; ".join(dict.fromkeys(filter(None, ends))),
        flown_s=total([one.flown_s for one in flown]),
        blocked_s=total([one.blocked_s for one in flown]),
        predicted=identified.predicted,
        seed=identified.seed,
    )


def recorded_end(bag: Path) -> str:
    """By what a run was aborted, by the coefficients beside its bag: a Ctrl-C or a refused start is in no bag."""
    run = RunFolder(bag.parent)
    if bag.name != run.bag.name or not run.coefficients.is_file():
        return ""
    with contextlib.suppress(HindraxError):  # a foreign file
        return read_coefficients(run.coefficients).conditions.aborted
    return ""


def write(file: Path, text: str) -> None:
    """Write a file of text; HindraxError when that fails."""
    with writing(file):
        replace_text(file, text)


def traces_of(bag: Path, origin: Stamp | None) -> dict[str, Trace]:
    """Online estimates of the live identifier, per motion; times from `origin`; none without one."""
    if origin is None:
        return {}
    rows: dict[str, list[tuple[float, Any]]] = {}
    for message in messages(bag, {resolved(ESTIMATE)}):
        estimate = message.decoded()
        at_s = estimate.header.stamp.sec + 1e-9 * estimate.header.stamp.nanosec - 1e-9 * origin
        rows.setdefault(estimate.motion, []).append((at_s, estimate))
    traces = {}
    for motion, found in rows.items():
        names = tuple(found[-1][1].names)
        same = [(t, one) for t, one in found if tuple(one.names) == names]
        values = np.array([one.values for _, one in same]).reshape(-1, len(names))
        squares = np.array([one.covariance for _, one in same]).reshape(-1, len(names), len(names))
        stds = np.sqrt(np.maximum(0.0, np.diagonal(squares, axis1=1, axis2=2)))
        traces[motion] = Trace(names, np.array([t for t, _ in same]), values, stds)
    return traces
