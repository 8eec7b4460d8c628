"""Contents of a bag of this stack: events by the feed of the live identifier, maneuvers, date, truth."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from mcap.records import Metadata

from hindrax_bag.metadata import DESCRIPTION
from hindrax_bag.read.bag_reader import (
    MessageDecoder,
    attached_vehicle,
    attachments,
    bag_files,
    beside_messages,
    messages,
)
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamped
from hindrax_core.messages.contents import Contents, Read
from hindrax_core.signals import BLOCKED, IdentEvent, Supply, Thrust
from hindrax_core.topics import ALLOCATION, MANEUVER, THRUSTER_HEALTH, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.results import truth_of
from hindrax_ident.records.feed import Feed, Measurement
from hindrax_ident.records.measurements import measurements
from hindrax_ident.tuning import Tuning

LATEST_S = 30.0
"""Largest delay of a message against its neighbors in a bag. At nine times real time, a process that pauses briefly is
seconds late; its thruster commands must not be dropped."""
FLOWN = ("transient", "plateau", "coast", "excite")
"""Phases that excite a motion; the others only lead there."""
ENDED = ("done", "aborted")
JOINED_S = 1.0
"""Longest time between two messages of one flight; the pilot publishes at 10 Hz."""
MOST_VOLTAGES = 1000
FIRST_YEAR = 2000
"""The mock's clock starts in 1970: before this year, the date is that of the file."""


def bag_events(
    bag: str | Path, vehicle: Vehicle, tuning: Tuning | None = None, *, thrust_anew: bool | None = None
) -> Iterator[Stamped[IdentEvent]]:
    """Events of a bag, in the order of their stamps.

    The thrust is that of the flight, or anew by the recorded pulses where this vehicle has other thrusters or curves.

    Parameters
    ----------
    bag
        Of this stack.
    vehicle
        As it is believed to be.
    tuning
        How long events wait for each other; None: defaults.
    thrust_anew
        What `has_other_thrust` says of both, where it was asked already; None: it is asked here, which reads the bag.

    Returns
    -------
    Iterator[Stamped[IdentEvent]]
        As a live session gets them.
    """
    wanted = measurements(vehicle)
    if has_other_thrust(bag, vehicle) if thrust_anew is None else thrust_anew:
        wanted |= {ALLOCATION: thrust_by(vehicle)}
    by_topic = {resolved(topic): contents for topic, contents in wanted.items()}
    return Feed(vehicle, replace(tuning or Tuning(), reorder_s=LATEST_S)).all(_measurements(bag, by_topic))


def has_other_thrust(bag: str | Path, vehicle: Vehicle) -> bool:
    """Whether the vehicle file inside of a bag gives its pulses another thrust than this one."""
    try:
        flown = attached_vehicle(bag, attachments(bag))
    except UsageError:  # none inside, or one of another version: it says nothing
        return False
    if len(flown.thrusters) != len(vehicle.thrusters):
        return False
    return [*_pushes(flown)] != [*_pushes(vehicle)]


def _pushes(vehicle: Vehicle) -> Iterator[object]:
    """What makes the wrench of pulses: arms, directions and curves; the nominal voltage of unmeasured supplies."""
    yield vehicle.supply_V
    for one in vehicle.thrusters:
        arm_m = tuple(a - b for a, b in zip(one.position_m, vehicle.center_of_mass_m, strict=True))
        yield arm_m, one.direction, one.reversed, vehicle.curves.get(one.curve)


def thrust_by(vehicle: Vehicle) -> Contents[Measurement]:
    """Thrust of an AllocationStatus by its pulses and the curves of a vehicle, at the voltage that was measured."""
    applied = lru_cache(MOST_VOLTAGES)(partial(AppliedWrench, vehicle))

    def thrust(*found: float) -> Measurement:
        *pulses_us, supply_V, measured = found
        curves = applied(round(supply_V, 2) if measured else None)
        forces_N = curves.forces_N(pulses_us)
        return Thrust(curves.wrench(forces_N), forces_N, Supply.MEASURED if measured else Supply.ASSUMED)

    return Contents(("pulses", "supply_voltage", "supply_measured"), thrust)


def _measurements(bag: str | Path, by_topic: Mapping[str, Contents[Measurement]]) -> Iterator[Stamped[Measurement]]:
    """What the messages of these topics hold, in the order of the bag; by the definitions in it."""
    readers: dict[MessageDecoder, Read[Measurement]] = {}
    for one in messages(bag, by_topic):
        if one.form not in readers:
            readers[one.form] = one.form.reader(by_topic[one.topic])
        yield readers[one.form](one.data)


@dataclass(frozen=True, slots=True)
class ManeuverRecord:
    """End of the last maneuver, `guard: sentence`, empty when it was not aborted.

    Of each motion the time of its excitation, and that of thrust without motion, as against a wall [s].
    """

    aborted: str = ""
    flown_s: Mapping[str, float] = field(default_factory=dict)
    blocked_s: Mapping[str, float] = field(default_factory=dict)


def maneuver_record(bag: Path) -> ManeuverRecord:
    """Read the maneuvers of a bag of ours; empty where it holds none."""
    return record_of(one.decoded() for one in messages(bag, {resolved(MANEUVER)}))


def record_of(statuses: Iterable[Any]) -> ManeuverRecord:
    """Fold ManeuverStatus messages, in their order."""
    aborted, before_s = "", 0.0
    before: tuple[dict[str, float], str] | None = None
    flown_s: dict[str, float] = {}
    blocked_s: dict[str, float] = {}
    for status in statuses:
        at_s = status.header.stamp.sec + 1e-9 * status.header.stamp.nanosec
        if before and 0.0 < at_s - before_s < JOINED_S:
            times_s, motion = before
            times_s[motion] = times_s.get(motion, 0.0) + at_s - before_s
        counts = blocked_s if status.phase == BLOCKED else flown_s if status.phase in FLOWN else None
        before, before_s = (None if counts is None else (counts, str(status.motion))), at_s
        # Some ends are recorded by no process: the tool was killed, the power failed, the disk was full.
        cut = "" if status.phase in ENDED else f"record: it ends within the maneuver ({status.motion}, {status.phase})"
        aborted = str(status.aborted) or cut
    return ManeuverRecord(aborted, flown_s, blocked_s)


def left_out(bag: Path) -> tuple[str, ...]:
    """Thrusters taken out of use in a bag of ours, each with its reason and the time since the first maneuver."""
    return left_out_of(one.decoded() for one in messages(bag, {resolved(THRUSTER_HEALTH), resolved(MANEUVER)}))


def left_out_of(statuses: Iterable[Any]) -> tuple[str, ...]:
    """Fold ThrusterHealth and ManeuverStatus messages, in their order."""
    found: dict[str, str] = {}
    begin_s: float | None = None
    for message in statuses:
        at_s = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        if begin_s is None and at_s > 0.0:
            begin_s = at_s
        for name, reason in zip(getattr(message, "disabled", ()), getattr(message, "reasons", ()), strict=False):
            since_s = max(0.0, at_s - (at_s if begin_s is None else begin_s))
            found.setdefault(str(name), f"{_reason(str(name), str(reason))}, left out from {since_s:.0f} s on")
    return tuple(found.values())


def _reason(name: str, reason: str) -> str:
    """A reason that begins with the name of its thruster; a suspicion of the vehicle does already."""
    return reason if reason.startswith(f"{name}: ") else f"{name}: {reason or 'disabled'}"


def date_of(bag: Path) -> str:
    """Time of the first message of a bag, ISO 8601 in UTC; that of its file with the mock's clock."""
    for message in messages(bag):
        recorded = datetime.fromtimestamp(message.received // 1_000_000_000, UTC)
        if recorded.year < FIRST_YEAR:
            recorded = datetime.fromtimestamp(bag_files(bag)[0].stat().st_mtime, UTC)
        return recorded.strftime("%Y-%m-%dT%H:%M:%SZ")
    return ""


def _description(bag: Path) -> Mapping[str, str]:
    """Description that the recorder put into a bag of this stack; empty for third-party bags."""
    found = (one for one in beside_messages(bag) if isinstance(one, Metadata) and one.name == DESCRIPTION)
    return next((one.metadata for one in found), {})


def is_mock(bag: Path) -> bool:
    """Whether a bag of this stack was recorded on the mock vehicle."""
    return "in mock" in _description(bag).get("notes", "")


def seed_of(bag: Path) -> int | None:
    """Seed of the mock vehicle that a pool test flew; None for any other bag."""
    found = re.search(r"in mock, seed (\d+)", _description(bag).get("notes", ""))
    return int(found.group(1)) if found else None


def truth_in(bag: Path, vehicle: Vehicle) -> dict[str, dict[str, float]]:
    """True coefficients of the hull that the mock flew, by motion; without any in the bag, of the vehicle file."""
    found: dict[str, dict[str, float]] = json.loads(_description(bag).get("truth") or "{}")
    return found or truth_of(vehicle)
