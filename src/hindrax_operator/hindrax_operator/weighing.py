"""A known-weight test on a running, armed stack: it holds every axis while the operator hangs the load on and off."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

from hindrax_analysis.identification.known_weight import Hold, LoadSpan, holds_of
from hindrax_control.allocation.allocator import WEIGHED_AT
from hindrax_control.maneuver.goal import servable_motions
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.signals import IdentEvent, Thrust, Velocity
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ros.messages.convert import stamp_from_msg

if TYPE_CHECKING:
    from hindrax_operator.nodes.operator_node import Operator

SETTLE_S, HOLD_S = 30.0, 30.0
PATIENCE_S = 3600.0


def weigh_on(
    operator: Operator,
    vehicle: Vehicle,
    axis: int,
    loads: Sequence[float],
    *,
    ready: Callable[[], bool],
    ask: Callable[[float], None],
    report: Callable[[str], None],
) -> list[Hold]:
    """Hold the vehicle with one load after the other, and average the force that it takes.

    Parameters
    ----------
    operator
        Of an armed stack.
    vehicle
        Whose tilts are held too, where its thrusters serve them.
    axis
        That the loads act on, 0 (surge) to 5 (yaw).
    loads : [N, N m]
        In the order of their holds.
    ready
        Whether the load hangs.
    ask
        Asks for a load.
    report
        Gets a sentence for each step.

    Returns
    -------
    list[Hold]
        Means over `HOLD_S`, after `SETTLE_S`; one for each load.
    """
    from hindrax_operator.nodes.idle_force import idle_force_times  # noqa: PLC0415  # rclpy reads the environment first
    from hindrax_operator.nodes.orders import hold, until, while_armed  # noqa: PLC0415  # as above

    served = servable_motions(AXES, vehicle).flown
    hold(operator, ("heading", "depth", "station"), math.nan, engaged=True)
    hold(operator, [name for name in ("roll", "pitch") if name in served], 0.0, engaged=True)
    events: list[Stamped[IdentEvent]] = []

    def collect(end: Stamp, *, keep: bool) -> bool:
        """Keep what is new; whether the end is reached."""
        events.extend(one for one in _now(operator) if keep and one not in events[-4:])
        return operator.now() >= end

    spans = []
    with idle_force_times(operator, WEIGHED_AT.get(AXES[axis], 1.0), report):
        for load in loads:
            ask(load)
            # A guard that disarms while a person hangs the load is told then, and not when Enter is pressed.
            operator.wait(while_armed(operator, ready, "the weighing"), PATIENCE_S, lambda: "the load to hang")
            report(f"settling for {SETTLE_S:.0f} s")
            begin = after(operator.now(), SETTLE_S)
            until(operator, partial(collect, begin, keep=False), SETTLE_S, "the weighing")
            report(f"measuring for {HOLD_S:.0f} s: keep away from line and tether")
            span = LoadSpan(begin, after(begin, HOLD_S), load)
            until(operator, partial(collect, span.end, keep=True), HOLD_S, "the weighing")
            spans.append(span)
    return holds_of(events, axis, spans)


def _now(operator: Operator) -> Iterator[Stamped[IdentEvent]]:
    if operator.allocation is not None:
        X, Y, Z, K, M, N = (float(one) for one in operator.allocation.achieved)
        forces_N = tuple(float(one) for one in operator.allocation.forces)
        yield Stamped(stamp_from_msg(operator.allocation.header.stamp), Thrust((X, Y, Z, K, M, N), forces_N))
    if operator.navigation is not None:
        state = operator.navigation.reading
        nu = (*state.velocity_mps, *state.rate_radps)
        yield Stamped(operator.navigation.stamp, Velocity(nu, "navigation"))
