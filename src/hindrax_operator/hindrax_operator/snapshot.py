"""Values of the live view: copied from the messages once per snapshot, so that drawing needs no ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

from hindrax_control.hold.holds import HoldState
from hindrax_control.pool_bounds import GuardedPlace, PoolPosition
from hindrax_core.signals import NAN, Estimate, Navigation
from hindrax_operator.operator_view import OperatorView

if TYPE_CHECKING:
    from diagnostic_msgs.msg import DiagnosticStatus

    from hindrax_msgs.msg import AllocationStatus, HoldStatus, ManeuverStatus, PoolPlace, ThrusterState

ANGLES = ("heading", "roll", "pitch")
"""Holds whose values are angles."""
SILENT_S = 2.0
"""Without a status for this long a maneuver is over: the pilot sends ten a second."""
LEVELS = {b"\x00": "ok", b"\x01": "warning", b"\x02": "error", b"\x03": "stale"}
USUAL_STOP_us = 1500.0
"""Pulse at rest, before the thrusters have been seen at rest."""


@dataclass(frozen=True, slots=True)
class Thrusters:
    """Armed or not and why, the pulses applied, those at rest, and what they achieve [N]; names in order."""

    armed: bool = False
    state: str = "unknown"
    reason: str = "no message from the thrusters yet"
    names: tuple[str, ...] = ()
    pulses_us: tuple[float, ...] = ()
    stops_us: tuple[float, ...] = ()
    forces_N: tuple[float, ...] = ()
    saturated: tuple[bool, ...] = ()
    disabled: tuple[str, ...] = ()
    lost_axes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ManeuverView:
    """The maneuver: what is flown, how it was aborted, progress 0 to 1, force and speed along the motion."""

    motion: str
    phase: str
    aborted: str = ""
    progress: float = 0.0
    remaining_s: float = NAN
    wall_m: float = NAN
    force: float = NAN
    velocity: float = NAN


@dataclass(frozen=True, slots=True)
class NodeHealth:
    """One node: its level and text, and its rate [Hz] where it reports one."""

    level: str
    message: str
    rate_Hz: float = NAN


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything at one moment. `silent_s`: wall time since the last message of the vehicle."""

    time_s: float = NAN
    silent_s: float = math.inf
    navigation: Navigation | None = None
    thrusters: Thrusters = Thrusters()
    holds: tuple[HoldState, ...] = ()
    flight: ManeuverView | None = None
    health: Mapping[str, NodeHealth] = field(default_factory=dict)
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    cameras: tuple[str, ...] = ()
    plans: Mapping[str, str] = field(default_factory=dict)
    """Plan of the pilot for each motion, or why it cannot."""
    place: GuardedPlace | None = None
    stoppable: bool = True
    """Whether a receiver of a disarm request exists."""


@dataclass(frozen=True, slots=True)
class CameraFrame:
    """One picture of a camera as it was sent, and a number that no other has."""

    number: int
    content: bytes


OnDone: TypeAlias = Callable[[str, bool], None]
"""Outcome of an order: a sentence, and whether the order succeeded."""


def snapshot(operator: OperatorView, stops_us: tuple[float, ...] = ()) -> Snapshot:
    """Copy the last message of every topic that an operator node watches; `stops_us`: pulses at rest, where known."""
    stamped = operator.navigation
    return Snapshot(
        time_s=operator.now() / 1e9,
        navigation=stamped.reading if stamped else None,
        thrusters=_thrusters(operator.thrusters, operator.allocation, stops_us),
        holds=holds_of(operator.holds),
        flight=_flight(operator.maneuver, operator.now() / 1e9),
        health={name.removeprefix("hindrax: "): _health(one) for name, one in sorted(operator.diagnostics.items())},
        estimates={motion: one.reading for motion, one in operator.estimates.items()},
        plans=dict(zip(operator.plans.motions, operator.plans.plans, strict=False)) if operator.plans else {},
        place=place_of(operator.place),
        stoppable=operator.stoppable,
    )


def troubles(operator: OperatorView) -> dict[str, str]:
    """Problem of each node in /diagnostics, by name: empty where it is healthy."""
    found = operator.diagnostics.items()
    return {name.removeprefix("hindrax: "): str(one.message) if one.level != b"\x00" else "" for name, one in found}


def left_out(operator: OperatorView) -> list[str]:
    """Thrusters out of use, each with its reason."""
    found = operator.health
    rows = zip(found.disabled, found.reasons, strict=False) if found is not None else ()
    return [why if why.startswith(f"{name}: ") else f"{name}: {why or 'disabled'}" for name, why in rows]


def node_problems(operator: OperatorView) -> list[str]:
    """Every problem in /diagnostics, as `node: problem`."""
    return [f"{name}: {trouble}" for name, trouble in troubles(operator).items() if trouble]


def _thrusters(
    state: ThrusterState | None, allocation: AllocationStatus | None, stops_us: tuple[float, ...]
) -> Thrusters:
    if state is None:
        return Thrusters()
    pulses = tuple(float(one) for one in state.pulses)
    if not state.armed:  # only then they are at rest for sure
        stops_us = pulses
    elif len(stops_us) != len(pulses):
        stops_us = (USUAL_STOP_us,) * len(pulses)
    arming = state.armed, state.state, state.reason
    if allocation is None or len(allocation.forces) != len(pulses):
        count = len(pulses)
        names = tuple(f"T{number + 1}" for number in range(count))
        return Thrusters(*arming, names, pulses, stops_us, (NAN,) * count, (False,) * count)
    forces, names = tuple(allocation.forces), tuple(allocation.thrusters)
    out, lost = tuple(allocation.disabled), tuple(allocation.lost_axes)
    return Thrusters(*arming, names, pulses, stops_us, forces, tuple(allocation.saturated), out, lost)


def holds_of(status: HoldStatus | None) -> tuple[HoldState, ...]:
    """Content of a HoldStatus, as far as all of its lists reach; empty without one."""
    if status is None:
        return ()
    rows = zip(status.axes, status.engaged, status.setpoints, status.errors, status.notes, strict=False)
    return tuple(HoldState(*row) for row in rows)


def _flight(status: ManeuverStatus | None, now_s: float) -> ManeuverView | None:
    """The maneuver; one of which nothing came for a while has ended without a word, as after a stop."""
    if status is None:
        return None
    where = status.wall_distance, status.force, status.velocity
    silent_s = now_s - status.header.stamp.sec - 1e-9 * status.header.stamp.nanosec
    reported = status.phase in ("done", "aborted") or silent_s <= SILENT_S
    aborted = status.aborted if reported else f"silence: no status for {silent_s:.0f} s, as after a stop"
    return ManeuverView(status.motion, status.phase, aborted, status.progress, status.remaining, *where)


def place_of(message: PoolPlace | None) -> GuardedPlace | None:
    """Content of a PoolPlace, which has no velocity; None without one."""
    if message is None:
        return None
    position = PoolPosition(message.along, message.across, message.heading, NAN, NAN, message.sigma)
    walls_m = dict(zip(message.walls, message.distances, strict=False))
    return GuardedPlace(position, walls_m, message.margin, message.unplaced)


def _health(one: DiagnosticStatus) -> NodeHealth:
    rates = [pair.value for pair in one.values if pair.key == "rate [Hz]"]
    return NodeHealth(LEVELS.get(one.level, "error"), one.message, float(rates[0]) if rates else NAN)
