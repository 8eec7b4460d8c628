"""The pilot node: holds, maneuvers and the operator's wrench make one wrench for every navigation status."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.subscription import Subscription
from std_msgs.msg import Bool

from hindrax_control.allocation.allocation_cycle import SupplyVoltage
from hindrax_control.allocation.thrust_curve import check_pulses
from hindrax_control.allocation.thruster_fault_detector import SuspectedFault
from hindrax_control.commissioning.record import slow_sentence, slowed
from hindrax_control.hold.holds import HOLDS, Setpoint
from hindrax_control.maneuver.goal import BUSY, Goal, no_state, thrusters_disarmed
from hindrax_control.maneuver.maneuver import Maneuver, ManeuverOutput, abandoned
from hindrax_control.maneuver.maneuver_guards import AUTO, SLOW
from hindrax_control.maneuver.pulses import PulseManeuver
from hindrax_control.navigation.estimator_health import ExternalOdometry
from hindrax_control.nodes import pilot_messages
from hindrax_control.nodes.estimator_health_node import EstimatorHealthNode
from hindrax_control.pilot import SAFETY_GROUPS, Pilot, PilotKnobs, PilotOutput
from hindrax_control.sensors import altimeters
from hindrax_core import topics
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.input_checks import SinglePublisher, TypedOrders, names_of_others, order_window, untimely_goal
from hindrax_core.messages.contents import Read
from hindrax_core.readings import BottomTrack, Echo, Reading, Vec6
from hindrax_core.rotation import FSD, foreign_frame
from hindrax_core.signals import NEVER, Allocation, AppliedOutput, Estimate, Navigation
from hindrax_core.text.refusals import (
    CANCELLED,
    NOTHING,
    Reason,
    Refusal,
    refusal_of,
    refused,
    unreadable,
)
from hindrax_core.vehicle import Vehicle
from hindrax_msgs.action import FlyManeuver
from hindrax_msgs.msg import AllocationStatus, HoldSetpoint, ModelEstimate, ThrusterHealth, ThrusterState
from hindrax_msgs.srv import Recentre
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.diagnostics import DiagnosticsPublisher
from hindrax_ros.graph import publisher, publishers_of, subscription
from hindrax_ros.messages.convert import estimate_from_msg, header, odometry_from_msg, stamp_from_msg, wrench_from_msg
from hindrax_ros.messages.fast_serialization import applied_from_bytes, wrench_writer
from hindrax_ros.messages.reading_fields import reader
from hindrax_ros.messages.serialization import deserialized
from hindrax_ros.parameters import CLOCK, SAFETY, frame_prefix, knobs

SendWrench: TypeAlias = Callable[[Vec6, str, Stamp, Stamp], object]
"""Called with a wrench, its frame, its stamp and the time."""
SendForces: TypeAlias = Callable[[Vec6, tuple[float, ...], Stamp], object]
"""Called with a wrench, the forces of the thrusters that should give it, and the stamp of both."""
ELSEWHERE = Refusal(
    Reason.ELSEWHERE,
    "start: the allocator runs in another process, and pulses of single thrusters need it in the pilot's",
)

STATUS_EVERY = 5
PLACE_EVERY = 10
FEEDBACK_EVERY = 10
REPORT_EVERY = 50
CHECK_S = 0.5
SILENT_S = 5.0
"""Silence of the navigator that ends a maneuver [ROS time]: thrusters without commands have disarmed by then."""
UNOBEYED_S = 0.5
"""Time without an applied command after which armed thrusters count as disobedient: the first may be on its way."""
STATELESS_S = 1.5
"""Silence of the navigator that is reported: longer than between two reports of the cycles."""
GOAL, RECENTRE = "maneuver/fly", "maneuver/recentre"
RESTARTED = "the vehicle was armed before this pilot began, and may have moved"
UNTIMED = 16
"""Lists of thrusters out of use that are kept until the time is known."""
ARMED_WITHIN = 25
"""Cycles for which a goal waits: the message that the thrusters are armed may be on its way."""


@dataclass(slots=True)
class ActiveGoal:
    """A goal, the handle of its client, and the maneuver flown for it; None while the goal waits."""

    handle: ServerGoalHandle
    goal: Goal
    maneuver: Maneuver | PulseManeuver | None = None
    patience: int = ARMED_WITHIN


class PilotNode(BatchedNode):
    """Serves the action `maneuver/fly`, `maneuver/recentre` and the topics of the operator; commands `control/wrench`.

    It flies on the one publisher of `navigation/odometry`. A navigator of the same process calls `on_navigation`
    instead and is `navigator`; `confirm_position` resets its position uncertainty. An allocator calls `on_allocation`,
    each cycle calls `send_wrench`, or `send_forces` for pulses of single thrusters. `health` checks every state before
    it is used.
    """

    def __init__(self, vehicle: Vehicle, supply: SupplyVoltage, send_wrench: SendWrench = lambda *_: None) -> None:
        super().__init__("pilot")
        self.send_wrench = send_wrench
        self.send_forces: SendForces | None = None
        self.health: EstimatorHealthNode | None = None
        self.navigator = ""
        self.confirm_position: Callable[[], None] = lambda: None
        self._odometry, self._source = ExternalOdometry(vehicle), SinglePublisher()
        self._ranges = [topics.carriers(vehicle, "altitude")[name] for name in altimeters(vehicle)[:1]]
        self._altimeter: Subscription | None = None
        self._leak_probes, self._dry_looks = len(vehicle.measuring("leak")), 0
        fixed = dict.fromkeys(SAFETY_GROUPS, SAFETY)
        tuned, mock = knobs(self, PilotKnobs, self._tune, fixed=fixed), bool(self.get_parameter(CLOCK).value)
        self._pilot = Pilot(self._as_proven(vehicle, tuned.guards.unproven, mock=mock), tuned)
        self._armed, self._unarmed, self._thrusters_known = False, "", False
        # First reason of thrusters that were disarmed since the last cycle: without navigation others follow it.
        self._disarmed_by, self._disarmed_at, self._obeyed_at, self._unobeyed = "", NEVER, Stamp(0), ""
        self._supply = supply
        self._allocation: Allocation | None = None
        self._names = frozenset(one.name for one in vehicle.thrusters)
        self._goal: ActiveGoal | None = None
        self._window = order_window(mock=mock)
        self._goals, self._places = TypedOrders(self._window), TypedOrders(self._window)
        self._suspects: dict[str, str] = {}
        self._untimed: list[ThrusterHealth] = []
        self._setpoints: list[Setpoint] = []
        self._phase = ("", "")
        self._estimates: dict[str, Stamped[Estimate]] = {}
        self._turn, self._last_state, self._looked_s = 0, Stamp(0), time.monotonic()
        self._wrench = publisher(self, topics.WRENCH)
        self._holds = publisher(self, topics.HOLD_STATUS)
        self._maneuver = publisher(self, topics.MANEUVER)
        self._place = publisher(self, topics.PLACE)
        self._plans, self._planned = publisher(self, topics.PLANS), False
        self._reporter = DiagnosticsPublisher(self)
        self._refuse = self._reporter.refuse
        self._prefix = frame_prefix(self)
        self._wrench_bytes = wrench_writer(self._prefix)
        subscription(self, topics.THRUSTER_STATE, self._on_thrusters, raw=True)
        self._health = publisher(self, topics.THRUSTER_HEALTH)
        self._publish_disabled({}, Stamp(0))
        subscription(self, topics.THRUSTER_HEALTH_ORDER, self._on_health_order)
        subscription(self, topics.HOLD_SETPOINT, self._on_setpoint)
        subscription(self, topics.OPERATOR_WRENCH, self._on_operator_wrench)
        subscription(self, topics.ESTIMATE, self._on_estimate)
        subscription(self, topics.ALLOCATION, self._on_allocation_message)
        subscription(self, topics.LEAK, self._on_leak)
        self.lead = subscription(self, topics.ODOMETRY, self._on_odometry, queue=topics.ODOMETRY.quality.depth)
        self.create_service(Recentre, RECENTRE, self._on_recentre)
        self._server = ActionServer(
            self,
            FlyManeuver,
            GOAL,
            lambda handle: pilot_messages.result_of(NOTHING, handle),
            handle_accepted_callback=self._accept,
            cancel_callback=lambda _goal: CancelResponse.ACCEPT,
        )
        self.every(CHECK_S, self._check_navigator)
        self.every(CHECK_S, self._publish_plans)

    def _as_proven(self, vehicle: Vehicle, unproven: str, *, mock: bool) -> Vehicle:
        """Return the vehicle with the speed limit that its file has earned; a mock is built by its file."""
        why = slow_sentence(vehicle) if unproven == SLOW or (unproven == AUTO and not mock) else ""
        if why:
            self.get_logger().warning(why)
        return slowed(vehicle) if why else vehicle

    def _tune(self, tuned: PilotKnobs) -> None:
        self._pilot.tune(tuned)
        self._planned = False

    def close(self) -> None:
        """Take the action away before the node."""
        self._server.destroy()

    def drain(self) -> None:
        """Take what waits; then judge the lists that came before the time was known, in the order of their coming."""
        super().drain()
        if self._untimed and self.now() > 0:
            messages, self._untimed = self._untimed, []
            for message in messages:
                self._on_health_order(message)

    # ---- from the vehicle

    def _on_thrusters(self, data: bytes) -> None:
        try:
            applied = applied_from_bytes(data)
            check_pulses(applied.pulses_us, len(self._names))
        except ValueError as error:
            self._refuse(topics.THRUSTER_STATE, unreadable(error))
            return
        if not self._thrusters_known and applied.armings:
            self._pilot.lose_place(RESTARTED)
        self._thrusters_known = True
        if not applied.armed:
            self._unarmed = deserialized(data, ThrusterState).reason
            if self._armed:
                self._disarmed_by, self._disarmed_at = self._unarmed, self.now()
        self._judge_obedience(applied, data)
        self._armed = applied.armed
        if self.health is not None:
            self.health.on_thrusters(applied, data)

    def _judge_obedience(self, applied: AppliedOutput, data: bytes) -> None:
        """Keep the reason why an armed output has applied no command for a while."""
        if not applied.armed or applied.sequence:
            self._obeyed_at, self._unobeyed = self.now(), ""
        elif seconds_between(self._obeyed_at, self.now()) > UNOBEYED_S:
            self._unobeyed = deserialized(data, ThrusterState).reason

    def _on_estimate(self, message: ModelEstimate) -> None:
        """Keep the estimate of a motion, for the feedback of its maneuver."""
        refused = pilot_messages.estimate_refusal(message)
        if refused:
            self._refuse(topics.ESTIMATE, refused)
        else:
            self._estimates[message.motion] = estimate_from_msg(message)

    def on_allocation(self, _: Stamp, allocation: Allocation) -> None:
        """Keep the allocation of the last wrench."""
        self._allocation = allocation
        if self.health is not None:
            self.health.on_allocation(allocation)

    def _on_allocation_message(self, message: AllocationStatus) -> None:
        """Keep what an allocator elsewhere reports of the last wrench, and the supply that it measured."""
        try:
            self.on_allocation(Stamp(0), pilot_messages.allocation_from_msg(message, len(self._names)))
        except ValueError as error:
            self._refuse(topics.ALLOCATION, unreadable(error))
            return
        if message.supply_measured:
            self._supply.update(message.supply_voltage, self.now())

    def _on_leak(self, message: Bool) -> None:
        """Keep whether there is water in the hull. Several probes share the topic: all must be dry to be so."""
        self._dry_looks = 0 if message.data else self._dry_looks + 1
        if message.data or self._leak_probes < 2 or self._dry_looks >= 2 * self._leak_probes:
            self._pilot.water_in_hull = bool(message.data)

    def _on_range(self, topic: topics.Topic, read: Read[Reading], data: bytes) -> None:
        """Keep the altimeter's range, which no odometry holds."""
        try:
            found = read(data)
        except ValueError as error:
            self._refuse(topic, unreadable(error))
            return
        reading = found.reading
        if isinstance(reading, Echo):
            self._odometry.range(found.stamp, reading.range_m)
        elif isinstance(reading, BottomTrack) and reading.altitude_m is not None:
            self._odometry.range(found.stamp, reading.altitude_m)

    def _on_odometry(self, message: Odometry) -> None:
        """Fly one cycle on the odometry of the one who publishes it."""
        if self._altimeter is None and self._ranges:
            topic = self._ranges[0]
            self._altimeter = subscription(self, topic, partial(self._on_range, topic, reader(topic)), raw=True)
        refused = self._source.judge(publishers_of(self, topics.ODOMETRY), armed=self._armed)
        state: Stamped[Navigation] | None = None
        breaks = self._odometry.breaks
        if not refused:
            try:
                state, refused = self._odometry.step(
                    odometry_from_msg(message, self._prefix), self._source.gid, self.now()
                )
            except ValueError as error:
                refused = unreadable(error)
        if refused:
            self._refuse(topics.ODOMETRY, refused)
        if self._odometry.breaks != breaks:
            self._pilot.begin_anew()
        if state is not None:
            self.on_navigation(state)

    def _on_health_order(self, message: ThrusterHealth) -> None:
        """Take a list that was made later than the one in force; a sender may repeat an old one.

        The safety monitor's list comes at the start, on a mock maybe before the first time: such a list is judged as
        soon as the time is known.
        """
        stamp, now = stamp_from_msg(message.header.stamp), self.now()
        if now <= 0:
            self._untimed = [*self._untimed, message][-UNTIMED:]
            return
        # A list may be stamped right behind the one in force, whatever the clock did since that one was made.
        wrong_stamp = self._window.of_lists.judge(stamp, Stamp(max(now, self._listed_at)))
        if wrong_stamp is not None:
            self._refuse(topics.THRUSTER_HEALTH_ORDER, wrong_stamp.refusal.within("the list is "))
        elif stamp > self._listed_at:
            reasons = dict.fromkeys(message.disabled, "") | dict(zip(message.disabled, message.reasons, strict=False))
            self._publish_disabled(self._known(reasons), stamp)

    def _known(self, reasons: dict[str, str]) -> dict[str, str]:
        """Drop and refuse names that are no thruster of this vehicle."""
        unknown = sorted(reasons.keys() - self._names)
        if unknown:
            wanted = ", ".join(sorted(self._names))
            why = refused(Reason.UNKNOWN_NAME, what="thruster", name=unknown[0][:40], known=wanted)
            self._refuse(topics.THRUSTER_HEALTH_ORDER, why)
        return {name: reason for name, reason in reasons.items() if name in self._names}

    def _publish_disabled(self, reasons: dict[str, str], stamp: Stamp) -> None:
        """Put a list of thrusters out of use in force and publish it; only the pilot does."""
        self._disabled, self._listed_at = reasons, stamp
        self._pilot.disable(frozenset(reasons))
        self._planned = False
        names, why = list(reasons), list(reasons.values())
        self._health.publish(ThrusterHealth(header=header(stamp), disabled=names, reasons=why))

    def _disable_suspect(self, suspect: SuspectedFault, stamp: Stamp) -> None:
        """Add a suspected thruster to the list of those out of use; the operator may enable it again."""
        reasons = self._disabled | {suspect.name: suspect.sentence}
        self._publish_disabled(reasons, Stamp(max(stamp, self._listed_at + 1)))
        self._suspects[suspect.name] = suspect.sentence
        self.get_logger().error(f"{suspect.sentence}: it is left out")

    def on_navigation(self, stamped: Stamped[Navigation]) -> None:
        """Fly one cycle on a new state."""
        if self.health is not None:
            self.health.on_navigation(stamped)
        self._last_state = stamped.stamp
        goal = self._goal
        if goal is not None and goal.maneuver is not None and goal.handle.is_cancel_requested:
            goal.maneuver.cancel()
        battery_V = self._supply.battery_V(stamped.stamp)
        state, armed = (stamped.reading, stamped.stamp, self._allocation), self._armed
        unarmed, disobeying = self._disarmed_by or self._unarmed, self._unobeyed
        self._disarmed_by = ""
        output = self._pilot.step(*state, armed=armed, unarmed=unarmed, disobeying=disobeying, battery_V=battery_V)
        if output.suspected_fault is not None:
            self._disable_suspect(output.suspected_fault, stamped.stamp)
        self._apply_setpoints()
        if output.forces_N and self.send_forces is not None:
            self.send_forces(output.wrench, output.forces_N, stamped.stamp)
        else:
            self.send_wrench(output.wrench, FSD, stamped.stamp, stamped.stamp)
        self._wrench.publish(self._wrench_bytes(stamped.stamp, output.wrench))
        self._publish_status(output, stamped.stamp)
        self._follow_goal(stamped.stamp)

    # ---- from the operator

    def _on_setpoint(self, message: HoldSetpoint) -> None:
        """Keep a setpoint for the next cycle, which knows whether the thrusters are armed by now."""
        wrong_stamp = self._window.judge(stamp_from_msg(message.header.stamp), self.now())
        if message.axis not in HOLDS:
            known = ", ".join(HOLDS)
            self._refuse(
                topics.HOLD_SETPOINT, refused(Reason.UNKNOWN_NAME, what="hold", name=message.axis[:40], known=known)
            )
        elif wrong_stamp is not None:
            why = wrong_stamp.refusal.within(f"hold {message.axis}: ")
            self._refuse(topics.HOLD_SETPOINT, why)
            self._pilot.refuse(message.axis, why)
        else:
            self._setpoints.append(Setpoint(message.axis, message.engaged, message.value))

    def _apply_setpoints(self) -> None:
        for setpoint in self._setpoints:
            why = self._pilot.set(setpoint)
            if why:
                self._refuse(topics.HOLD_SETPOINT, why)
        self._setpoints.clear()

    def _on_operator_wrench(self, message: WrenchStamped) -> None:
        stamp = stamp_from_msg(message.header.stamp)
        wrench, frame = wrench_from_msg(message), message.header.frame_id
        if foreign := foreign_frame(frame, self._prefix):
            self._refuse(topics.OPERATOR_WRENCH, foreign)
            return
        for why in self._pilot.set_operator_wrench(wrench, frame, stamp, self.now()):
            self._refuse(topics.OPERATOR_WRENCH, why)

    def _on_recentre(self, request: Recentre.Request, response: Recentre.Response) -> Recentre.Response:
        """Restart dead reckoning at the position given by the operator."""
        why = self._places.refusal(stamp_from_msg(request.stamp), self.now())
        why = why or self._pilot.recentre(*pilot_messages.place_from_msg(request))
        if why:
            self._reporter.refusals.add(RECENTRE, why)
        else:
            self.confirm_position()
        response.accepted, response.reason, response.error_code = not why, str(why), why.reason
        return response

    def _accept(self, handle: ServerGoalHandle) -> None:
        """Keep a goal until the vehicle can begin it, or finish it at once: a rejection cannot carry a reason."""
        why = self._unflyable(handle.request)
        if why:
            self._reporter.refusals.add(GOAL, why)
            self._finish_goal(ActiveGoal(handle, Goal(())), why)
        else:
            self._goal = ActiveGoal(handle, self._goal_of(handle.request))

    def _goal_of(self, request: FlyManeuver.Goal) -> Goal:
        return pilot_messages.goal_from_msg(request, len(self._names))

    def _unflyable(self, request: FlyManeuver.Goal) -> Refusal:
        """Return why a goal is not even kept, as "guard: sentence"; nothing when it is."""
        # What it asks for comes first: a goal that is typed again with the stamp named to it can be flown.
        try:
            goal = self._goal_of(request)
            self._pilot.check(goal)
        except HindraxError as error:
            return refusal_of(error)
        if goal.pulses and self.send_forces is None:
            return ELSEWHERE
        if self._goal is not None:
            return BUSY.within("start: ")
        why = self._goals.refusal(stamp_from_msg(request.stamp), self.now())
        return untimely_goal(why) if why else NOTHING

    def _follow_goal(self, stamp: Stamp) -> None:
        """Begin the goal that waits, or send its client the state of this cycle."""
        goal = self._goal
        if goal is None:
            return
        if goal.maneuver is None:
            self._begin(goal)
        elif (last := goal.maneuver.last) is not None and last.done:
            self._finish_goal(goal, last.aborted)
        elif last is not None and self._turn % FEEDBACK_EVERY == 0:
            goal.handle.publish_feedback(pilot_messages.feedback_to_msg(last, self._estimates, stamp))

    def _begin(self, goal: ActiveGoal) -> None:
        if goal.handle.is_cancel_requested:
            self._finish_goal(goal, CANCELLED)
            return
        goal.patience -= 1
        if not self._armed and goal.patience >= 0:
            return
        try:
            goal.maneuver = self._pilot.fly(goal.goal)
        except HindraxError as error:
            self._finish_goal(goal, refusal_of(error).within("start: "))
            return
        what = ", ".join(goal.goal.motions) or f"{len(goal.goal.pulses)} pulses"
        self.get_logger().info(f"flying {what}: {goal.maneuver.seconds:.0f} s planned")

    def _finish_goal(self, goal: ActiveGoal, aborted: Refusal) -> None:
        """Send the result of a goal, with the reason if it was aborted; the next goal may come.

        A goal is executed when it is over: a coroutine that waits would keep the events executor busy for the whole
        maneuver.
        """
        if goal is self._goal:
            self._goal = None
        self.get_logger().info(f"maneuver aborted by {aborted}" if aborted else "maneuver done")
        goal.handle.execute(partial(pilot_messages.result_of, aborted))

    def _check_navigator(self) -> None:
        """Report a silent navigator, and abort a waiting or flown goal: no cycle would do it."""
        silent_s, now_s = seconds_between(self._last_state, self.now()), time.monotonic()
        stood_still_s, self._looked_s = now_s - self._looked_s, now_s
        if self._last_state and silent_s > STATELESS_S:
            # Reports come with the cycles; without a state there are none, and the last one would stand for ever.
            self._reporter.report(
                self.now(), [f"no state of the vehicle for {silent_s:.0f} s: nothing is held"], "", {}
            )
        if silent_s <= SILENT_S or self._goal is None:
            return
        lost = no_state(silent_s if self._last_state else None, stood_still_s, SILENT_S)
        if self._disarmed_by and seconds_between(self._last_state, self._disarmed_at) <= STATELESS_S:
            lost = thrusters_disarmed(self._disarmed_by)  # not for want of commands: what took both had a name there
        self._pilot.abandon()
        self._maneuver.publish(pilot_messages.maneuver_to_msg(abandoned(lost), self.now()))
        self._finish_goal(self._goal, lost)

    # ---- published

    def _publish_plans(self) -> None:
        """Replan after a change of parameters or thrusters; not in flight, since it takes half a cycle."""
        if self._planned or self._goal is not None:
            return
        self._planned = True
        self._plans.publish(pilot_messages.plans_to_msg(self._pilot.plans(), self.now()))

    def _publish_status(self, output: PilotOutput, stamp: Stamp) -> None:
        self._turn += 1
        self._publish_maneuver(output.maneuver, stamp)
        if self._turn % STATUS_EVERY == 0:
            self._holds.publish(pilot_messages.holds_to_msg(output.holds, stamp))
        if self._turn % PLACE_EVERY == 0 and (found := self._pilot.guarded_place()) is not None:
            self._place.publish(pilot_messages.place_to_msg(found, stamp))
        if self._turn % REPORT_EVERY == 0:
            self._report(output, stamp)

    def _publish_maneuver(self, output: ManeuverOutput | None, stamp: Stamp) -> None:
        """Publish every change of phase at once, otherwise at 10 Hz."""
        if output is None:
            return
        phase = (output.phase.motion, output.phase.phase)
        if phase != self._phase or (self._turn % STATUS_EVERY == 0 and not output.done):
            self._phase = phase
            self._maneuver.publish(pilot_messages.maneuver_to_msg(output, stamp))

    def _report(self, output: PilotOutput, stamp: Stamp) -> None:
        notes = (f"{state.axis} hold: {state.note}" for state in output.holds if state.note)
        refused = [f"by hand: {output.refused}"] if output.refused else []
        others = names_of_others(publishers_of(self, topics.ODOMETRY), self.navigator) if self.navigator else ""
        ignored = [f"ignored: {others}, because {self.navigator} navigates"] if others else []
        out = (f"left out: {sentence}" for name, sentence in self._suspects.items() if name in self._disabled)
        wrong = (*out, *output.guards, *notes, *refused, *ignored)
        held = ", ".join(state.axis for state in output.holds if state.engaged)
        values = {"holds": held, "state from": self.navigator or self._source.name}
        self._reporter.report(stamp, wrong, "armed" if self._armed else "disarmed", values)
