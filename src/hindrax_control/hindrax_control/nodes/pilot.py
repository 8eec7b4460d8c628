"""The pilot node: holds, maneuvers and the operator's hand, one wrench for every navigation status."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeAlias

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionServer, CancelResponse

from hindrax_control.holds import Setpoint
from hindrax_control.maneuvers import LATE, ManeuverOutput, abandoned, check_goal
from hindrax_control.nodes.pilot_messages import feedback_to_msg, goal_from_msg, holds_to_msg, maneuver_to_msg
from hindrax_control.pilot import BUSY, Flight, Pilot, PilotKnobs
from hindrax_control.stages import SENSELESS
from hindrax_control.supply import Supply
from hindrax_control.watch import Suspicion
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.readings import Vec6
from hindrax_core.state import NAN, Allocation, Estimate, Navigation
from hindrax_core.topics import (
    ESTIMATE,
    HOLD_SETPOINT,
    HOLD_STATUS,
    MANEUVER,
    OPERATOR_WRENCH,
    THRUSTER_HEALTH,
    THRUSTER_HEALTH_ORDER,
    THRUSTER_STATE,
    WRENCH,
)
from hindrax_core.vehicle import Vehicle
from hindrax_msgs.action import FlyManeuver
from hindrax_msgs.msg import ThrusterHealth, ThrusterState
from hindrax_ros.convert import FSD, estimate_from_msg, stamp_from_msg, stamp_to_msg, wrench_from_msg
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.health import Reporter, status
from hindrax_ros.parameters import knobs
from hindrax_ros.polled import PolledNode
from hindrax_ros.serialized import deserialized
from hindrax_ros.swift import applied_from_bytes, wrench_writer

Give: TypeAlias = Callable[[Vec6, str, Stamp, Stamp], None]
"""Takes a wrench, its frame, its stamp and the time."""

STATUS_EVERY = 5
FEEDBACK_EVERY = 10
REPORT_EVERY = 50
COMMAND_LIFESPAN_S = 1.0
MOCK_LIFESPAN_S = 10.0
"""On a mock's clock: at ten times real time a moment of the computer is a second of the vehicle."""
WATCH_S = 0.5
SILENT_S = 5.0
"""Silence of the navigator that ends a maneuver [ROS time]: the thrusters, told nothing, disarm by then."""
ARMED_WITHIN = 25
"""Cycles for which a goal waits for the news that the thrusters are armed."""


class PilotNode(PolledNode):
    """Serves the action `maneuver/fly` and the topics of the operator; commands `control/wrench`.

    The navigator hands its states to `take`, the allocator what became of them to `hear`; `give` takes the wrenches.
    """

    def __init__(self, vehicle: Vehicle, supply: Supply, give: Give) -> None:
        super().__init__("pilot")
        self._give = give
        self._pilot = Pilot(vehicle, knobs(self, PilotKnobs))
        self._armed, self._unarmed = False, ""
        self._heard = Stamp(0)
        self._supply = supply
        self._allocation: Allocation | None = None
        self._flight: Flight | None = None
        self._flying: Any = None
        self._waiting: tuple[Any, int] | None = None
        self._setpoints: list[Setpoint] = []
        self._phase = ("", "")
        self._estimates: dict[str, Stamped[Estimate]] = {}
        self._turn = 0
        self._wrench = publisher(self, WRENCH)
        self._holds = publisher(self, HOLD_STATUS)
        self._maneuver = publisher(self, MANEUVER)
        self._reporter = Reporter(self)
        self._wrench_bytes = wrench_writer()
        subscription(self, THRUSTER_STATE, self._on_thrusters, raw=True)
        self._health = publisher(self, THRUSTER_HEALTH)
        self._list_out_of_use({}, Stamp(0))
        subscription(self, THRUSTER_HEALTH_ORDER, self._on_health_order)
        subscription(self, HOLD_SETPOINT, self._on_setpoint)
        subscription(self, OPERATOR_WRENCH, self._on_hand)
        subscription(self, ESTIMATE, self._on_estimate)
        self._server = ActionServer(
            self,
            FlyManeuver,
            "maneuver/fly",
            partial(self._conclude, ""),
            handle_accepted_callback=self._accept,
            cancel_callback=lambda _goal: CancelResponse.ACCEPT,
        )
        self.every(WATCH_S, self._watch_navigator)

    def close(self) -> None:
        """Take the action away before the node."""
        self._server.destroy()

    def _now(self) -> Stamp:
        return Stamp(self.get_clock().now().nanoseconds)

    # ---- what the vehicle says

    def _on_thrusters(self, data: bytes) -> None:
        armed = applied_from_bytes(data).armed
        if self._armed and not armed:
            self._unarmed = deserialized(data, ThrusterState).reason
        self._armed = armed

    def _on_estimate(self, message: Any) -> None:
        """Keep what is known of a motion, for who flies it."""
        self._estimates[message.motion] = estimate_from_msg(message)

    def hear(self, _: Stamp, allocation: Allocation) -> None:
        """Keep what became of the last wrench."""
        self._allocation = allocation

    def _on_health_order(self, message: Any) -> None:
        """Take a list that was made later than the one in force; who keeps lists may say an old one again."""
        stamp = stamp_from_msg(message.header.stamp)
        if stamp > self._listed_at:
            reasons = dict.fromkeys(message.disabled, "") | dict(zip(message.disabled, message.reasons, strict=False))
            self._list_out_of_use(reasons, stamp)

    def _list_out_of_use(self, reasons: dict[str, str], stamp: Stamp) -> None:
        """Put a list of thrusters in force: nobody else says which one that is."""
        self._disabled, self._listed_at = reasons, stamp
        self._pilot.disable(frozenset(reasons))
        message = ThrusterHealth(disabled=list(reasons), reasons=list(reasons.values()))
        message.header.stamp = stamp_to_msg(stamp)
        self._health.publish(message)

    def _leave_out(self, suspicion: Suspicion, stamp: Stamp) -> None:
        """Add a thruster that does not push to the list of those out of use; the operator may take it off again."""
        reasons = self._disabled | {suspicion.name: suspicion.sentence}
        self._list_out_of_use(reasons, Stamp(max(stamp, self._listed_at + 1)))
        self.get_logger().error(f"{suspicion.sentence}: it is left out")

    def take(self, stamped: Stamped[Navigation]) -> None:
        """Fly one cycle on a new state."""
        self._heard = stamped.stamp
        self._cancel_if_asked()
        battery_V = self._supply.measured_V(stamped.stamp) or NAN
        flight = self._pilot.step(
            stamped.reading,
            stamped.stamp,
            self._allocation,
            armed=self._armed,
            unarmed=self._unarmed,
            battery_V=battery_V,
        )
        self._flight = flight
        if flight.suspicion is not None:
            self._leave_out(flight.suspicion, stamped.stamp)
        self._take_setpoints()
        self._begin_waiting()
        self._give(flight.wrench, FSD, stamped.stamp, stamped.stamp)
        self._wrench.publish(self._wrench_bytes(stamped.stamp, flight.wrench))
        self._tell(flight, stamped.stamp)

    # ---- what the operator says

    def _stale(self, stamp: Stamp) -> str:
        age = seconds_between(stamp, self._now())
        most = MOCK_LIFESPAN_S if self.get_parameter("use_sim_time").value else COMMAND_LIFESPAN_S
        return "" if age <= most else f"{age:.1f} s old, wanted at most {most:.1f} s"

    def _on_setpoint(self, message: Any) -> None:
        """Keep a setpoint for the next cycle, which knows whether the thrusters are armed by now."""
        refused = self._stale(stamp_from_msg(message.header.stamp))
        if refused:
            self.get_logger().warning(f"setpoint of {message.axis} refused: {refused}")
            self._pilot.refuse(message.axis, f"hold {message.axis}: {refused}")
        else:
            self._setpoints.append(Setpoint(message.axis, message.engaged, message.value))

    def _take_setpoints(self) -> None:
        for setpoint in self._setpoints:
            refused = self._pilot.set(setpoint)
            if refused:
                self.get_logger().warning(f"setpoint refused: {refused}")
        self._setpoints.clear()

    def _on_hand(self, message: Any) -> None:
        stamp = stamp_from_msg(message.header.stamp)
        for refused in self._pilot.by_hand(wrench_from_msg(message), message.header.frame_id, stamp, self._now()):
            self.get_logger().warning(f"operator's {refused}", throttle_duration_sec=1.0)

    def _accept(self, handle: Any) -> None:
        """Keep a goal until the vehicle can begin it, or conclude it at once: a rejection could not say why.

        The goal is concluded by `handle.execute` when it is over. A coroutine that waited for that would be turned by
        the events executor without pause, for as long as the maneuver takes.
        """
        refused = self._unflyable(handle.request)
        if refused:
            handle.execute(partial(self._conclude, refused))
        else:
            self._waiting = (handle, ARMED_WITHIN)

    def _unflyable(self, request: Any) -> str:
        """Why a goal is not even kept, as "guard: sentence"; empty when it is."""
        stale = self._stale(stamp_from_msg(request.stamp))
        if stale:
            return f"{LATE}: the goal is {stale}; ask again, and set the clocks of both machines if that does not help"
        if self._waiting is not None or self._flying is not None:
            return f"start: {BUSY}"
        try:
            check_goal(goal_from_msg(request))
        except HindraxError as error:
            return str(error)
        return ""

    def _begin_waiting(self) -> None:
        """Begin a goal that waits; the news that the thrusters are armed may be a few cycles behind it."""
        if self._waiting is None:
            return
        handle, cycles = self._waiting
        self._waiting = None
        if handle.is_cancel_requested:
            handle.execute(partial(self._conclude, "cancelled: by the operator"))
            return
        if not self._armed and cycles > 0:
            self._waiting = (handle, cycles - 1)
            return
        try:
            maneuver = self._pilot.fly(goal_from_msg(handle.request))
        except HindraxError as error:
            handle.execute(partial(self._conclude, f"start: {error}"))
            return
        self._flying = handle
        self.get_logger().info(f"flying {', '.join(handle.request.motions)}: {maneuver.seconds:.0f} s planned")

    def _conclude(self, aborted: str, handle: Any) -> Any:
        """Tell the end of a goal, and why, where it is not the planned one."""
        self.get_logger().info(f"maneuver aborted by {aborted}" if aborted else "maneuver done")
        if not aborted:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        return FlyManeuver.Result(completed=not aborted, aborted=aborted)

    def _watch_navigator(self) -> None:
        """End what waits or is flown when there is no state to fly on: nothing else would."""
        silent_s = seconds_between(self._heard, self._now())
        if silent_s <= SILENT_S or (self._waiting is None and self._flying is None):
            return
        said = f"for {silent_s:.0f} s" if self._heard else "yet"
        reason = f"navigation: no state of the vehicle {said}, so the thrusters are neutral; {SENSELESS}"
        handle = self._flying if self._waiting is None else self._waiting[0]
        self._waiting = self._flying = None
        self._pilot.abandon()
        self._maneuver.publish(maneuver_to_msg(abandoned(reason), self._now()))
        handle.execute(partial(self._conclude, reason))

    def _cancel_if_asked(self) -> None:
        if self._flying is not None and self._flying.is_cancel_requested:
            self._pilot.cancel()

    # ---- what is told

    def _tell(self, flight: Flight, stamp: Stamp) -> None:
        self._turn += 1
        self._tell_maneuver(flight.maneuver, stamp)
        if self._turn % STATUS_EVERY == 0:
            self._holds.publish(holds_to_msg(flight.holds, stamp))
        if self._turn % REPORT_EVERY == 0:
            self._report(flight, stamp)

    def _tell_maneuver(self, output: ManeuverOutput | None, stamp: Stamp) -> None:
        """Every change of phase at once, otherwise ten times a second."""
        if output is None:
            return
        phase = (output.phase.motion, output.phase.phase)
        if phase != self._phase or (self._turn % STATUS_EVERY == 0 and not output.done):
            self._phase = phase
            self._maneuver.publish(maneuver_to_msg(output, stamp))
        if self._flying is None:
            return
        if output.done:
            handle, self._flying = self._flying, None
            handle.execute(partial(self._conclude, output.aborted))
        elif self._turn % FEEDBACK_EVERY == 0:
            self._flying.publish_feedback(feedback_to_msg(output, self._estimates, stamp))

    def _report(self, flight: Flight, stamp: Stamp) -> None:
        notes = (f"{state.axis} hold: {state.note}" for state in flight.holds if state.note)
        refused = [f"by hand: {flight.refused}"] if flight.refused else []
        wrong = (*flight.guards, *notes, *refused)
        level = DiagnosticStatus.WARN if wrong else DiagnosticStatus.OK
        text = "; ".join(wrong) or ("armed" if self._armed else "disarmed")
        held = ", ".join(state.axis for state in flight.holds if state.engaged)
        self._reporter.publish(stamp, status("hindrax: pilot", level, text, {"holds": held}))
