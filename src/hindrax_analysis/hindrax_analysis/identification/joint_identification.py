"""All axes of records at once: recordings or bags of this stack to one joint fit."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np

from hindrax_analysis.identification.record_identification import APART_S, IdentificationTask, RecordSource
from hindrax_analysis.identification.verdict import REJECTED, show_reasons
from hindrax_analysis.records.own_bag import bag_events
from hindrax_analysis.records.recording import Recording, has_signal, tuned
from hindrax_analysis.records.wrong_thrusters import wrong_thrusters
from hindrax_analysis.terminal import print_table, print_what_fits
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamped, seconds_between
from hindrax_core.signals import Attitude, IdentEvent, Thrust, Velocity
from hindrax_core.text.digits import PLUS_MINUS, measured
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, array, largest
from hindrax_ident.assess.joint_assessment import JointResults, joint_results
from hindrax_ident.assess.objections import NO_OBJECTION, Code, Objection, objection
from hindrax_ident.assess.results import Results
from hindrax_ident.fit.joint import Delays, fit_jointly
from hindrax_ident.fit.smoothing import before_filter
from hindrax_ident.model.motion_model import MOTIONS, lag_s
from hindrax_ident.model.thrust_lag import ONE_LAG
from hindrax_ident.records.axis_record import LATER, Series
from hindrax_ident.records.six_axis_record import SixAxisRecord, six_axis_record
from hindrax_ident.tuning import LAG_SIGMA_S, STAMP_SIGMA_S, USUAL_LAG_S, USUAL_LATENCY_S, Tuning

TOGETHER = "All axes together"
"""Begin of what is told of this fit."""
STEP_S = 0.1
"""Sampling of the thrust for the number of axes at once."""
ALIKE = 1.5
"""Ratio of two time constants within which a hint of one axis is that of the filter of another."""
MOST_APART = 3.0
"""Distance of two masses of one axis from which one of them is wrong, in deviations [-]."""
SEVERAL = 1.3
"""Axes pushed at once from which they are fitted together. Legs have 1.0, pilots 1.7, whirls 2.3."""


def axes_at_once(recordings: Sequence[Recording]) -> float:
    """On how many axes a record pushes at once: 1 for one axis after the other, 6 for all of them all the time.

    Each thrust counts as a share of the largest force, or moment, of the record, less its own median: what is held,
    such as a net buoyancy, excites nothing, and an axis whose motion was not measured has nothing to fit. With p the
    squares of these shares at a time, one number for all axes that share it alike is (sum p)^2 / sum p^2, and the mean
    over time is weighted by the power: rest does not count.

    Parameters
    ----------
    recordings
        With wrenches of all axes.

    Returns
    -------
    float
        [-].
    """
    shares = []
    for one in recordings:
        t, known = one.wrench_t, np.isfinite(one.wrench)
        if len(t) < 2 or not one.measured_t:
            continue
        times = np.arange(max(float(t[0]), one.begin_s), min(float(t[-1]), one.end_s), STEP_S)
        index = np.searchsorted(t, times, side="right") - 1
        seen = [has_signal(one, axis) or (axis == 2 and len(one.attitude_t) > 0) for axis in range(6)]
        force = np.where(known & seen, one.wrench, 0.0)[index]
        shares.append(force - np.median(force, axis=0) if len(times) else force)
    joined = np.abs(np.concatenate(shares)) if shares else np.zeros((0, 6))
    if not len(joined):
        return 0.0
    top = [largest(one) for one in joined.T]
    scale = np.repeat([max(1e-12, *top[:3]), max(1e-12, *top[3:])], 3)
    power = np.minimum(1.0, joined / scale) ** 2
    total = power.sum(axis=1)
    return float(np.sum(total**2) / max(1e-300, float(np.sum(power**2))))


def wants_joint_fit(
    sources: Sequence[RecordSource], task: IdentificationTask, alone: Results | None = None
) -> tuple[bool, str]:
    """Whether the axes of recordings are pushed at once, so that one fit of all is worth its time.

    Bags of this stack have maneuvers, one axis after the other; nor is it worth it where one axis is asked for, or a
    thruster pushes another way than the vehicle file has it.

    Parameters
    ----------
    sources
        Records.
    task
        What is asked for.
    alone
        Results of the axes, one by one.

    Returns
    -------
    tuple[bool, str]
        And one sentence on how it was decided; empty where there is nothing to say.
    """
    recordings = [one.recording.between(task.span.from_s, task.span.to_s) for one in sources if one.recording]
    reasons = [reason.code for one in alone.motions.values() for reason in one.reasons] if alone else []
    if len(recordings) < len(sources) or len(task.axes) == 1 or Code.WRONG_THRUSTERS in reasons:
        return False, ""
    count = axes_at_once(recordings)
    if count < SEVERAL:
        return False, ""
    if alone and mean_found(alone):
        return False, "the velocities are means over time, which a fit of all axes together does not know: left out"
    thrusts = [one.code for result in alone.motions.values() for one in result.warnings] if alone else []
    if Code.RAMPING_THRUST in thrusts:
        return False, "the thrust ramps, which a fit of all axes together does not know: left out"
    return True, (
        f"the record pushes on about {count:.1f} axes at once (from {SEVERAL:g} on): all axes are fitted together too, "
        "with the forces that couple them; --no-joint leaves it out"
    )


def filters_found(results: Results) -> dict[int, float]:
    """Filters of the velocities that the fits of single axes have undone, or suspect.

    Here they can be undone: with the velocities of all axes, forces across act at their time again.

    Parameters
    ----------
    results
        Of all axes, one by one.

    Returns
    -------
    dict[int, float]
        Time constant by axis [s]; of an axis that shows none, that of the others by the same instrument (translations,
        turns).
    """
    seen: dict[int, float] = {}
    hinted: dict[int, float] = {}
    for motion, result in results.motions.items():
        axis, quality = MOTIONS[motion].axis, result.quality
        if time_s := quality.get("smoothing_s", quality.get("filter_doubt_s", 0.0)):
            seen[axis] = time_s
        hinted[axis] = quality.get("filter_hint_s", 0.0)
    if not seen:
        return {}
    usual = float(np.median(list(seen.values())))
    found = {axis: usual for axis, time_s in hinted.items() if usual / ALIKE < time_s < usual * ALIKE} | seen
    kinds = ([found[axis] for axis in axes if axis in found] for axes in (range(3), range(3, 6)))
    alike = [float(np.median(kind)) if kind else 0.0 for kind in kinds]
    every = {axis: found.get(axis, alike[axis // 3]) for axis in range(6)}
    return {axis: time_s for axis, time_s in every.items() if time_s > 0.0}


def lags_found(results: Results) -> tuple[float, float]:
    """By how much the lags of thrust that goes, and that turns round, are longer by the fits of single axes.

    Parameters
    ----------
    results
        Of all axes, one by one.

    Returns
    -------
    tuple[float, float]
        Medians of those that show it clearly [s]; no difference where none does.
    """
    known = [one.quality for one in results.motions.values() if LATER[0] in one.quality]
    goes_s, turns_s = (float(np.median([one[name] for one in known])) if known else 0.0 for name in LATER)
    return goes_s, turns_s


def mean_found(results: Results) -> Objection:
    """Say that velocities are means over time, where the fit of a single axis has found it; false elsewhere."""
    means = (one for result in results.motions.values() for one in result.warnings if one.code is Code.MEAN_VELOCITY)
    return next((objection(Code.JOINT_OF_MEANS, **one.numbers) for one in means), NO_OBJECTION)


def identify_jointly(
    sources: Sequence[RecordSource],
    vehicle: Vehicle,
    task: IdentificationTask,
    progress: Callable[[str], None] = lambda _: None,
    *,
    filters_s: Mapping[int, float] = MappingProxyType({}),
    later_s: tuple[float, float] = ONE_LAG,
    against: Objection = NO_OBJECTION,
) -> JointResults:
    """Fit all axes over one record, or over several pooled.

    Parameters
    ----------
    sources
        Records.
    vehicle
        With its thrusters.
    task
        Which part of the time, which tuning.
    progress
        Called with a sentence about what begins.
    filters_s
        Time constant of the filter that has smoothed the velocities of an axis [s], which is undone (`filters_found`).
    later_s
        By how much the lags of thrust that goes, and turns round, are longer [s] (`lags_found`).
    against
        What makes no motion identifiable, of what the single axes have found (`mean_found`).

    Returns
    -------
    JointResults
        Coefficients of all axes, and the terms that couple them.

    Raises
    ------
    UsageError
        Where a record cannot be fitted so.
    """
    recordings = [
        (source.recording or recording_of(bag_events(source.path, vehicle), str(source.path))).between(
            task.span.from_s, task.span.to_s
        )
        for source in sources
    ]
    recordings = [_before_filters(one, filters_s) for one in recordings]
    foreign = any(source.recording is not None for source in sources)
    tuning = tuned(recordings, task.tuning) if foreign else task.tuning
    try:
        record = replace(_pooled(recordings, tuning), later_s=later_s)
        fit = fit_jointly(record, vehicle, _delays(vehicle, tuning, foreign=foreign), _gain(vehicle, tuning), progress)
    except ValueError as error:
        raise UsageError(f"{sources[0].path}: {error}") from error
    found, miswired = joint_results(fit, vehicle), wrong_thrusters(recordings, vehicle)
    motions = dict(found.motions)
    for name, one in found.motions.items():
        if reason := miswired.get(MOTIONS[name].axis, against):
            motions[name] = replace(one, reasons=(reason,))
    return replace(found, motions=motions)


def contradicted(joint: JointResults, alone: Results) -> JointResults:
    """Results of all axes together, none of which is identified where the mass of one is another by its axis alone.

    Both have the same thrust, so its gain tells them not apart; and all masses of the one have the same delays. Of a
    pilot's record in a fluid whose drag along grows with the force across, the lag of the thrust went to zero, and all
    masses with it to three times theirs, up to 6.6 deviations off; by themselves all were right.

    Parameters
    ----------
    joint
        Of all axes.
    alone
        Of the axes, one by one.

    Returns
    -------
    JointResults
        With an objection to each motion where one is contradicted, clearest first.
    """
    found = []
    for name, one in joint.motions.items():
        own = alone.motions.get(name)
        mass = one.coefficients.get("added_mass")
        other = own.coefficients.get("added_mass") if own and own.identifiable else None
        if mass is None or other is None:
            continue
        apart = abs(mass.value - other.value) / math.hypot(mass.std_calibrated, other.std_calibrated)
        shown, beside = (measured(each.value, each.std_calibrated) for each in (mass, other))
        found.append((apart, objection(Code.OTHER_MASS_ALONE, motion=name, shown=shown, alone=beside)))
    apart, reason = max(found, key=lambda one: one[0], default=(0.0, NO_OBJECTION))
    if apart <= MOST_APART:
        return joint
    return replace(
        joint, motions={name: replace(one, reasons=(*one.reasons, reason)) for name, one in joint.motions.items()}
    )


def recording_of(events: Iterable[Stamped[IdentEvent]], source: str) -> Recording:
    """Tables of the events of a bag of this stack; times from the first event."""
    rows: dict[type, list[tuple[float, ...]]] = {Velocity: [], Thrust: [], Attitude: []}
    first = None
    for event in events:
        first = event.stamp if first is None else first
        at_s, reading = seconds_between(first, event.stamp), event.reading
        if isinstance(reading, Velocity):
            rows[Velocity].append((at_s, *reading.nu))
        elif isinstance(reading, Thrust):
            rows[Thrust].append((at_s, *reading.wrench))
        elif isinstance(reading, Attitude):
            rows[Attitude].append((at_s, *reading.attitude_rad[:2], reading.depth_m))
    v, w, a = (array(rows[kind]).reshape(-1, width) for kind, width in ((Velocity, 7), (Thrust, 7), (Attitude, 4)))
    return Recording(source, v[:, 0], v[:, 1:], w[:, 0], w[:, 1:], a[:, 0], a[:, 1:])


def _before_filters(recording: Recording, filters_s: Mapping[int, float]) -> Recording:
    """The recording with the velocities before the filters of some axes."""
    velocity = recording.velocity.copy()
    for axis, time_s in filters_s.items():
        known = np.isfinite(velocity[:, axis])
        if known.any():
            smoothed = Series(recording.velocity_t[known], velocity[known, axis])
            velocity[known, axis] = before_filter(smoothed, time_s).y
    return replace(recording, velocity=velocity)


def _pooled(recordings: Sequence[Recording], tuning: Tuning) -> SixAxisRecord:
    """All records one after the other; no stretch spans two."""
    tables: dict[str, list[Array]] = {}
    begin_s = 0.0
    for one in recordings:
        for name in ("velocity", "wrench", "attitude"):
            tables.setdefault(f"{name}_t", []).append(array(getattr(one, f"{name}_t") + begin_s))
            tables.setdefault(name, []).append(getattr(one, name))
        begin_s += one.end_s + APART_S
    v_t, v, w_t, w, a_t, a = (array(np.concatenate(parts)) for parts in tables.values())
    return six_axis_record((v_t, v), (w_t, w), (a_t, a), tuning.gap_s, tuning.thrust_age_s)


def _delays(vehicle: Vehicle, tuning: Tuning, *, foreign: bool) -> Delays:
    """Priors: as the vehicle file and the stack have them, the usual ones where they are not known."""
    known = [lag for axis in range(len(AXES)) if (lag := lag_s(vehicle, axis)) is not None]
    lag, latency = (float(np.mean(known)) if known else USUAL_LAG_S), tuning.velocity_latency_s
    if not foreign:
        return Delays((lag, 0.0, 0.0), (LAG_SIGMA_S, STAMP_SIGMA_S, tuning.timing_sigma_s))
    usual = USUAL_LATENCY_S if latency is None else latency
    return Delays((lag, usual, 0.0), (LAG_SIGMA_S, LAG_SIGMA_S, STAMP_SIGMA_S))


def _gain(vehicle: Vehicle, tuning: Tuning) -> float:
    """Standard deviation of the gain of the thrust [-]: of the wrench, of the curves, and of what the hull takes."""
    curves = [curve.gain_sigma for curve in vehicle.curves.values()] if vehicle.thrusters else []
    return float(np.hypot(tuning.wrench_gain_sigma, max(curves, default=0.0)))


def show_joint(joint: JointResults, *, asked: bool = True) -> None:
    """Print drag and added mass of each motion, and the terms that were admitted; a line a motion on a full screen.

    Parameters
    ----------
    joint
        What was found.
    asked
        Whether somebody wants this fit; else one that identifies nothing is a sentence, not the first table.
    """
    if not asked and all(one.reasons for one in joint.motions.values()):
        print_fitted(f"{TOGETHER}, no motion is identifiable; --joint shows that fit")
        return

    def in_full() -> None:
        _show_coefficients(joint)
        _show_terms(joint)
        for name, number in joint.delays.items():
            print_fitted(f"{name}: {measured(number.value, number.std_calibrated)} s")
        show_reasons({name: one.reasons for name, one in joint.motions.items()})

    print_what_fits(in_full, partial(_show_joint_short, joint))


def _show_coefficients(joint: JointResults) -> None:
    rows = []
    for name, one in joint.motions.items():
        marked = name if not one.reasons else f"{name}{REJECTED}"
        for key, number in one.coefficients.items():
            rows.append((marked, f"{key} [{number.unit}]", measured(number.value, number.std_calibrated)))
    title = f"{TOGETHER}, SNAME axes ({PLUS_MINUS}, with calibration)"
    print_table(title, ("motion", "coefficient"), ("value",), rows, grouped=True)


def _show_terms(joint: JointResults) -> None:
    terms = [
        (name, measured(one.number.value, one.number.std_calibrated), one.number.unit, f"e^{one.evidence:.0f}")
        for name, one in sorted(joint.terms.items(), key=lambda pair: -pair[1].evidence)
    ]
    if terms:
        print_table("Terms that the record needs", ("term",), ("value", "unit", "odds"), terms)


def _show_joint_short(joint: JointResults) -> None:
    """Print a row for each motion, and what is left out."""
    names = [
        key
        for key in ("k_q", "k_l", "added_mass", "b")
        if any(key in one.coefficients for one in joint.motions.values())
    ]
    rows = []
    for name, one in joint.motions.items():
        numbers = (one.coefficients.get(key) for key in names)
        cells = ("" if number is None else measured(number.value, number.std_calibrated) for number in numbers)
        rows.append((name if not one.reasons else f"{name}{REJECTED}", *cells))
    unsaid = [f"terms that the record needs ({len(joint.terms)})", "delays"]
    unsaid += [f"why {REJECTED} (not identifiable)"] if any(one.reasons for one in joint.motions.values()) else []
    print_table(f"{TOGETHER} (SI; {PLUS_MINUS})", ("motion",), names, rows, spare=("b",), dense=True)
    print_fitted(f"--json shows: {', '.join(unsaid)}")
