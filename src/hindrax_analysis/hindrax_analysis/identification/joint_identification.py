"""All axes of records at once: recordings or bags of this stack to one joint fit."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from hindrax_analysis.identification.record_identification import APART_S, IdentificationTask, RecordSource
from hindrax_analysis.identification.verdict import REJECTED
from hindrax_analysis.records.own_bag import bag_events
from hindrax_analysis.records.recording import Recording, tuned
from hindrax_analysis.terminal import print_table
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamped, seconds_between
from hindrax_core.signals import Attitude, IdentEvent, Thrust, Velocity
from hindrax_core.text.digits import PLUS_MINUS, measured
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.joint_assessment import JointResults, joint_results
from hindrax_ident.fit.joint import Delays, fit_jointly
from hindrax_ident.model.motion_model import lag_s
from hindrax_ident.records.six_axis_record import SixAxisRecord, six_axis_record
from hindrax_ident.tuning import LAG_SIGMA_S, STAMP_SIGMA_S, USUAL_LAG_S, USUAL_LATENCY_S, Tuning


def identify_jointly(
    sources: Sequence[RecordSource],
    vehicle: Vehicle,
    task: IdentificationTask,
    progress: Callable[[str], None] = lambda _: None,
) -> JointResults:
    """One fit of all axes over one record, or over several pooled. UsageError where a record cannot be fitted so."""
    recordings = [
        (source.recording or recording_of(bag_events(source.path, vehicle), str(source.path))).between(
            task.span.from_s, task.span.to_s
        )
        for source in sources
    ]
    foreign = any(source.recording is not None for source in sources)
    tuning = tuned(recordings, task.tuning) if foreign else task.tuning
    try:
        fit = fit_jointly(
            _pooled(recordings, tuning), vehicle, _delays(vehicle, tuning, foreign=foreign), _gain(vehicle, tuning),
            progress,
        )  # fmt: skip
    except ValueError as error:
        raise UsageError(f"{sources[0].path}: {error}") from error
    return joint_results(fit, vehicle)


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
    return six_axis_record((v_t, v), (w_t, w), (a_t, a), tuning.gap_s)


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


def show_joint(joint: JointResults) -> None:
    """Print drag and added mass of each motion, and the terms that were admitted."""
    rows = []
    for name, one in joint.motions.items():
        marked = name if not one.reasons else f"{name} {REJECTED}"
        for key, number in one.coefficients.items():
            rows.append((marked, f"{key} [{number.unit}]", measured(number.value, number.std_calibrated)))
    title = f"All axes together, SNAME axes ({PLUS_MINUS}, with calibration)"
    print_table(title, ("motion", "coefficient"), ("value",), rows, grouped=True)
    terms = [
        (name, measured(one.number.value, one.number.std_calibrated), one.number.unit, f"e^{one.evidence:.0f}")
        for name, one in sorted(joint.terms.items(), key=lambda pair: -pair[1].evidence)
    ]
    if terms:
        print_table("Terms that the record needs", ("term",), ("value", "unit", "odds"), terms)
    for name, number in joint.delays.items():
        print_fitted(f"{name}: {measured(number.value, number.std_calibrated)} s")
    for name, one in joint.motions.items():
        for reason in one.reasons:
            print_fitted(f"{REJECTED} {name}: not identifiable: {reason}")
