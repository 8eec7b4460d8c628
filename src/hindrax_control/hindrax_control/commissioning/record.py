"""The record of a commissioning, which is part of the vehicle file: of which geometry, when, and by which bag.

A file without it, or with one of another geometry, was never proven: maneuvers fly it slowly until it is.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from enum import StrEnum

from hindrax_control.commissioning.findings import Findings
from hindrax_core.text.coded import Coded, coded
from hindrax_core.vehicle import Commissioned, Vehicle

UNPROVEN_mps = 0.1
"""Largest speed of a vehicle whose file is not proven."""
DIGITS = 12


class NotProven(StrEnum):
    """Why a vehicle file is not proven; `NONE` where it is."""

    NONE = ""
    NEVER = "never"
    CHANGED = "changed"


SENTENCES: Mapping[NotProven, str] = {
    NotProven.NONE: "",
    NotProven.NEVER: "never commissioned",
    NotProven.CHANGED: "changed since it was commissioned on {date} (geometry {found}, proven {proven})",
}
"""The sentence of each code."""
REMEDY = "`./hindrax commission --write` proves it, --uncommissioned flies it as it is"


def geometry_hash(vehicle: Vehicle) -> str:
    """Hash of what a commissioning proves: thrusters with their channels, mounts of sensors, center of mass, output."""
    thrusters = [
        (one.name, one.channel, one.position_m, one.azimuth_deg, one.elevation_deg, one.reversed, one.curve)
        for one in vehicle.thrusters
    ]
    mounts = sorted((name, one.device, one.position_m, one.rotation_deg) for name, one in vehicle.sensors.items())
    text = repr((thrusters, mounts, vehicle.center_of_mass_m, vehicle.output.device))
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def proof(vehicle: Vehicle, findings: Findings, bag: str, date: str) -> Commissioned | None:
    """Record of a commissioning that proved the whole file.

    Parameters
    ----------
    vehicle, findings
        What was proven, and what was found.
    bag, date
        Of the commissioning.

    Returns
    -------
    Commissioned | None
        None of one that did not prove all, or that mends the file first.
    """
    proven = findings.complete and not findings.mends
    return Commissioned(geometry_hash(vehicle), date, bag) if proven else None


def lines_to_write(findings: Findings, record: Commissioned | None) -> list[str]:
    """Lines of YAML that a commissioning leaves for the vehicle file: what mends it, or the record of its proof."""
    mends = [mend.line for mend in findings.mends]
    kept = [] if record is None else [f"  {name}: {json.dumps(value)}" for name, value in asdict(record).items()]
    return mends or ([] if record is None else ["commissioned:", *kept])


def unproven(vehicle: Vehicle) -> Coded[NotProven]:
    """Reason why a vehicle file counts as not proven; empty when it is."""
    record = vehicle.commissioned
    if record is None:
        return coded(SENTENCES, NotProven.NEVER)
    found = geometry_hash(vehicle)
    code = NotProven.NONE if record.geometry == found else NotProven.CHANGED
    return coded(SENTENCES, code, date=record.date, found=found, proven=record.geometry)


def slow_sentence(vehicle: Vehicle) -> str:
    """One line for the operator of a vehicle that flies slowly for that reason; empty when it does not have to."""
    reason = unproven(vehicle)
    return f"vehicle file {reason}: maneuvers no faster than {UNPROVEN_mps:g} m/s; {REMEDY}" if reason else ""


def slowed(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with the speed limit of one that is not proven."""
    limits = vehicle.limits
    return replace(vehicle, limits=replace(limits, speed_mps=min(limits.speed_mps, UNPROVEN_mps)))
