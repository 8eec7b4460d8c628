"""Checks of a running stack from its /diagnostics; its ports are not touched."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from hindrax_cli.health_checks import Check
from hindrax_core.input_checks import OTHER_CLOCK_S
from hindrax_core.topics import THRUSTER_STATE
from hindrax_core.vehicle import Vehicle

if TYPE_CHECKING:
    from hindrax_operator.nodes.operator_node import Operator

LISTEN_S = 4.0
OFFSET_S = 0.2
"""A request to arm that seems a second old is refused, and a command half a second old."""
AS_IT_SAYS = "do as it says; the folder logs/ of the run has its log"
NODES = ("thrusters", "navigator", "estimator_health", "pilot", "allocator", "identifier")


class KeyValue(Protocol):
    """A pair of a DiagnosticStatus message."""

    key: str
    value: str


class Status(Protocol):
    """A DiagnosticStatus message."""

    level: bytes
    message: str

    @property
    def values(self) -> Sequence[KeyValue]:
        """Further facts, such as the rate."""
        ...


def stack(operator: Operator, vehicle: Vehicle, title: str) -> list[Check]:
    """Collect diagnostics for a while, then check every expected node.

    Parameters
    ----------
    operator
        In the graph of the stack.
    vehicle
        Whose sensors have nodes.
    title
        Of the stack.

    Returns
    -------
    list[Check]
        As of `judged`.
    """
    operator.pause(LISTEN_S)
    return judged(operator.diagnostics, (*vehicle.sensors, *NODES), title)


def far_clock(operator: Operator) -> Check:
    """Compare the vehicle's stamps, received over the link, with the clock of this machine."""
    from hindrax_core.events import seconds_between  # noqa: PLC0415  # with the next one, which needs ROS
    from hindrax_ros.graph import subscription  # noqa: PLC0415  # as above
    from hindrax_ros.messages.convert import stamp_from_msg  # noqa: PLC0415  # rclpy is loaded by then

    ages_s: list[float] = []

    def on_state(message: Any) -> None:
        ages_s.append(seconds_between(stamp_from_msg(message.header.stamp), operator.now()))

    subscription(operator.node, THRUSTER_STATE, on_state)
    operator.pause(LISTEN_S)
    return clocks(ages_s)


MOCK_CLOCK = "if it is a mock vehicle, add --sim-time here and to each command: it has its own clock"


def clocks(ages_s: Sequence[float]) -> Check:
    """Judge two clocks by how old stamps are on arrival [s]: the youngest is the offset and the least delay."""
    if not ages_s:
        remedy = "see `tether`, then `./hindrax doctor` on the vehicle"
        return Check("clocks", "no message from the vehicle", remedy)
    least, most = min(ages_s), max(ages_s)
    if abs(least) > OFFSET_S:
        which = "behind" if least > 0.0 else "ahead of"
        found = f"the vehicle's clock is {abs(least):.2f} s {which} this one"
        remedy = "synchronize the vehicle to this machine: docs/how-to/two-machines.md"
        return Check("clocks", found, MOCK_CLOCK if abs(least) > OTHER_CLOCK_S else remedy)
    return Check("clocks", f"the vehicle's stamps arrive {1e3 * least:.0f} to {1e3 * most:.0f} ms old")


def judged(diagnostics: Mapping[str, Status], wanted: Iterable[str], title: str) -> list[Check]:
    """Judge the diagnostics of a stack.

    Parameters
    ----------
    diagnostics
        Last status by name.
    wanted
        Nodes that should report.
    title
        Of the stack.

    Returns
    -------
    list[Check]
        One for the stack, one for each node.
    """
    if not diagnostics:
        return [Check("stack", f"{title}, but no node reports", "restart it; its logs say why")]
    by_name = {name.removeprefix("hindrax: "): one for name, one in diagnostics.items()}
    return [Check("stack", title), *(_node(name, by_name.get(name)) for name in wanted)]


def _node(name: str, status: Status | None) -> Check:
    if status is None:
        remedy = "its process is down; see logs/ of the run, or start the stack again"
        return Check(name, "its node sends nothing", remedy)
    values = {pair.key: pair.value for pair in status.values}
    rate = float(values.get("rate [Hz]", math.nan))
    parts = [values.get("identity", ""), status.message, "" if math.isnan(rate) else f"{rate:.1f} Hz"]
    found = ", ".join(part for part in parts if part)
    if status.level == b"\x00":
        return Check(name, found)
    trouble = values.get("last trouble", "")
    if trouble and trouble not in found:
        return Check(name, found, f"last trouble: {trouble}")
    # What measures nothing has no wires, and says itself what to do.
    return Check(name, found, AS_IT_SAYS if math.isnan(rate) else "check power, wiring and vehicle file")
