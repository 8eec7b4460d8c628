"""Result files of a run, `coefficients.yaml` and `report.html`, and their data from the bag."""

from __future__ import annotations

import contextlib
import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hindrax_analysis.coefficients_file import Conditions, conditions_of, read_coefficients
from hindrax_analysis.records.maneuver_record import maneuver_record
from hindrax_analysis.records.provenance import date_of
from hindrax_analysis.report import Trace
from hindrax_bag import software_version
from hindrax_bag.read.bag_reader import bag_files, messages
from hindrax_bag.run_folder import RunFolder
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp
from hindrax_core.text.text_file import replace_text, writing
from hindrax_core.topics import ESTIMATE, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.results import Results

CHUNK_BYTES = 1 << 20


def bag_hash(bag: Path) -> str:
    """SHA-256 over the files of a bag, in order."""
    digest = hashlib.sha256()
    for file in bag_files(bag):
        with file.open("rb") as stream:
            while data := stream.read(CHUNK_BYTES):
                digest.update(data)
    return digest.hexdigest()


def bag_conditions(bag: Path, vehicle: Vehicle, results: Results, *, mock: bool, aborted: str = "") -> Conditions:
    """Conditions of a result over one bag; `aborted` is an end that neither the bag nor its run tells yet."""
    conditions = conditions_of(vehicle, mock=mock, motions=tuple(results.motions))
    flown = maneuver_record(bag)
    conditions = replace(conditions, aborted=aborted or told_end(bag) or flown.aborted)
    conditions = replace(conditions, flown_s=flown.flown_s, blocked_s=flown.blocked_s)
    return replace(conditions, date=date_of(bag), bag=str(bag), bag_sha256=bag_hash(bag), software=software_version())


def told_end(bag: Path) -> str:
    """By what a run was aborted, as the coefficients beside its bag tell: a Ctrl-C or a refused start is in no bag."""
    run = RunFolder(bag.parent)
    if bag.name != run.bag.name or not run.coefficients.is_file():
        return ""
    with contextlib.suppress(HindraxError):  # a file of somebody else's
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
    return {motion: _trace([t for t, _ in found], [one for _, one in found]) for motion, found in rows.items()}


def _trace(times_s: list[float], estimates: list[Any]) -> Trace:
    """Stack the estimates of one motion; all have the names of the first."""
    names = tuple(estimates[-1].names)
    same = [index for index, one in enumerate(estimates) if tuple(one.names) == names]
    n = len(names)
    values = np.array([estimates[index].values for index in same]).reshape(-1, n)
    squares = np.array([estimates[index].covariance for index in same]).reshape(-1, n, n)
    stds = np.sqrt(np.maximum(0.0, np.diagonal(squares, axis1=1, axis2=2)))
    return Trace.of(names, np.array([times_s[index] for index in same]), values, stds)
