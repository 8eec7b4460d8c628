"""The operator's node: arm, fly, monitor, disarm. Every call has a time-out and names what it waited for."""

import contextlib
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Self, TypeAlias, TypeVar

import rclpy
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from hindrax_bringup.supervisor import deferred_signals
from hindrax_control.maneuver.goal import Goal
from hindrax_core import topics
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.signals import Estimate, Navigation
from hindrax_core.text.refusals import NOTHING, Reason, Refusal, received, state_and_reason
from hindrax_drivers.output.output_guard import WORTH_ANOTHER_TRY as ASK_AGAIN
from hindrax_drivers.output.output_guard import ArmingPhase
from hindrax_drivers.output.output_reasons import OutputReason, from_sentence
from hindrax_ident.online.aim import ExperimentGoal
from hindrax_msgs.action import FlyManeuver, RunExperiment
from hindrax_msgs.msg import (
    AllocationStatus,
    Heartbeat,
    HoldStatus,
    ManeuverStatus,
    ModelEstimate,
    MotionPlans,
    PoolPlace,
    ThrusterHealth,
    ThrusterState,
)
from hindrax_msgs.srv import Arm
from hindrax_ros.batched_node import BatchedNode, events_executor
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.messages.convert import estimate_from_msg, stamp_from_msg, stamp_to_msg
from hindrax_ros.messages.fast_serialization import navigation_from_bytes
from hindrax_ros.standstill import StandstillWatch

T = TypeVar("T")
ActionGoal: TypeAlias = FlyManeuver.Goal | RunExperiment.Goal

UP = "`./hindrax health` shows the state of its stack, `./hindrax up` starts one"
ANSWER_S = 10.0
"""For answers, and for nodes to be found: on a busy machine both take seconds."""
FLY_AGAIN = "find the cause (`./hindrax doctor`), arm and fly again"
ASKED_AT_MOST = 5
RESULT_LOST = Refusal(Reason.IDENTIFIER, "identifier: its result was lost; see whether its process is up")
WITHOUT_REASON = Refusal(Reason.UNNAMED, "maneuver: ended without a reason")
LINK_S = 0.3
"""Time for the last messages to reach their subscribers before the node is destroyed."""
FLOWN_S = 1.0
UNOBEYED_S = 0.5
"""Time without an applied command after which armed thrusters count as disobedient: the first may be on its way."""
MANEUVER_LOST_S = 10.0
"""Silence about a maneuver on a working link after which it counts as over; the pilot publishes at 10 Hz."""


class Operator:
    """One node that sends orders and subscribes to the state; use it as a context manager.

    The last message of every watched topic is kept; `tick` (where given) is called between spins, so that the caller
    can supervise its processes and show progress.
    """

    def __init__(
        self, *, mock: bool, namespace: str = topics.NAMESPACE, tick: Callable[[], object] = lambda: None
    ) -> None:
        words = ["--ros-args", *topics.namespace_arguments(namespace, own_clock=mock)]
        rclpy.init(args=words, signal_handler_options=SignalHandlerOptions.NO)
        overrides = [Parameter("use_sim_time", Parameter.Type.BOOL, mock)]
        self.node = BatchedNode("operator", parameter_overrides=overrides)
        self._executor = events_executor()
        self._executor.add_node(self.node)
        self._tick, self._mock = tick, mock
        # Counts on from any operator before this one, also from one that has just left (milliseconds, 32 bit).
        self._sequence = time.time_ns() // 1_000_000 % (1 << 32)
        self.navigation: Stamped[Navigation] | None = None
        self.estimates: dict[str, Stamped[Estimate]] = {}
        self.thrusters: ThrusterState | None = None
        self._obeyed_at = Stamp(0)
        self.maneuver: ManeuverStatus | None = None
        self._allocation: AllocationStatus | None = None
        self._allocations: Subscription | None = None
        self.holds: HoldStatus | None = None
        self.place: PoolPlace | None = None
        self.plans: MotionPlans | None = None
        self.health: ThrusterHealth | None = None
        self.diagnostics: dict[str, DiagnosticStatus] = {}
        self._subscribe()
        self._arm = self.node.create_client(Arm, "thrusters/arm")
        self._fly = ActionClient(self.node, FlyManeuver, "maneuver/fly")
        self._run = ActionClient(self.node, RunExperiment, "ident/run")
        self._cancel = self.node.create_client(CancelGoal, "maneuver/fly/_action/cancel_goal")
        self._goal: ClientGoalHandle | None = None
        self._watch = StandstillWatch()
        self.forgotten = False
        """Whether it stood still for so long that the vehicle may not hear it any more, nor it the vehicle."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._watch.close()
        self._fly.destroy()
        self._run.destroy()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()

    def _subscribe(self) -> None:
        latest = {
            topics.MANEUVER: "maneuver",
            topics.PLACE: "place",
            topics.PLANS: "plans",
            topics.HOLD_STATUS: "holds",
            topics.THRUSTER_HEALTH: "health",
        }
        for topic, name in latest.items():
            subscription(self.node, topic, partial(setattr, self, name), queue=1)
        subscription(self.node, topics.THRUSTER_STATE, self._on_thrusters, queue=1)
        subscription(self.node, topics.NAVIGATION, self._on_navigation, raw=True, queue=1)
        subscription(self.node, topics.ESTIMATE, self._on_estimate)
        subscription(self.node, topics.DIAGNOSTICS, self._on_diagnostics)
        self._heartbeats = publisher(self.node, topics.HEARTBEAT, held=False)
        # The safety monitor measures silence in wall time, so the pace is that of the wall, not that of a mock's clock.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._heartbeat_timer = self.node.create_timer(0.5, self._send_heartbeat, clock=steady)

    def beat(self, *, on: bool) -> None:
        """Start or stop the heartbeat: it stands for the operator, not for the program."""
        if on:
            self._heartbeat_timer.reset()
        else:
            self._heartbeat_timer.cancel()

    def _send_heartbeat(self) -> None:
        now = self.now()
        if now <= 0:  # no /clock yet: an unstamped heartbeat is refused
            return
        message = Heartbeat(sequence=self.next(), source="operator")
        message.header.stamp = stamp_to_msg(now)
        self._heartbeats.publish(message)

    def _on_thrusters(self, message: ThrusterState) -> None:
        self.thrusters, stamp = message, stamp_from_msg(message.header.stamp)
        if not (message.armed and message.reason):
            self._obeyed_at = stamp

    @property
    def armed(self) -> bool:
        """Whether the thrusters are armed, by their last message."""
        return self.thrusters is not None and self.thrusters.armed

    @property
    def reason(self) -> str:
        """Reason of the thrusters for their state, by their last message; empty without one."""
        return self.thrusters.reason if self.thrusters is not None else ""

    @property
    def output(self) -> str:
        """Name of the output that drives the thrusters, by their last message; empty without one."""
        return self.thrusters.output if self.thrusters is not None else ""

    @property
    def unobeyed(self) -> str:
        """Reason why armed thrusters have followed no command for a while; empty when they do, or are not armed."""
        found = self.thrusters
        if found is None or not found.armed:
            return ""
        silent_s = seconds_between(self._obeyed_at, stamp_from_msg(found.header.stamp))
        return found.reason if silent_s > UNOBEYED_S else ""

    def _on_navigation(self, data: bytes) -> None:
        self.navigation = navigation_from_bytes(data)

    def _on_estimate(self, message: ModelEstimate) -> None:
        self.estimates[message.motion] = estimate_from_msg(message)

    @property
    def allocation(self) -> AllocationStatus | None:
        """The last allocation; subscribed on first use, since it comes at 50 Hz and few callers need it."""
        if self._allocations is None:
            keep = partial(setattr, self, "_allocation")
            self._allocations = subscription(self.node, topics.ALLOCATION, keep, queue=1)
        return self._allocation

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.diagnostics.update({one.name: one for one in message.status})

    def next(self) -> int:
        """Return the next sequence number."""
        self._sequence = (self._sequence + 1) % (1 << 32)
        return self._sequence

    def now(self) -> Stamp:
        """Time of the stack: the system's as it was at its start, or the mock's."""
        return self.node.now()

    @property
    def flying(self) -> str:
        """Motion that is being flown, empty when none is."""
        seen = self.maneuver
        if seen is None or seen.phase in ("done", "aborted"):
            return ""
        age_s = seconds_between(stamp_from_msg(seen.header.stamp), self.now())
        return seen.motion if age_s < FLOWN_S else ""

    @property
    def stoppable(self) -> bool:
        """Whether a thrusters node exists that can be asked to disarm."""
        return bool(self._arm.service_is_ready())

    def wait_for_time(self, seconds: float = ANSWER_S) -> None:
        """Wait for the clock: system time is known at once, a mock's when /clock arrives."""
        self.wait(lambda: self.now() > 0, seconds, lambda: "the clock of the mock; is its stack still up?")

    def order_stamp(self) -> Time:
        """Return the stamp of an order that is given now. An order without time is refused, so wait for the clock."""
        self.wait_for_time()
        return stamp_to_msg(self.now())

    @contextlib.contextmanager
    def sender(self, topic: topics.Topic, reader: str) -> Iterator[Callable[[object], None]]:
        """Yield a function that publishes on a topic that has a subscriber; HindraxError names the missing `reader`."""
        out = publisher(self.node, topic, held=False)
        try:
            self.wait_for_time()
            self.wait(lambda: out.get_subscription_count() > 0, ANSWER_S, lambda: f"{reader}; {UP}")
            yield out.publish
            self.pause(LINK_S)
        finally:
            self.node.destroy_publisher(out)

    @contextlib.contextmanager
    def repeating(self, period_s: float, act: Callable[[], None]) -> Iterator[None]:
        """Act now and again after each period of ROS time; never after the end.

        The executor runs what a timer has asked for before, also when the timer is gone.
        """
        acting = True

        def again() -> None:
            if acting:
                act()

        act()
        timer = self.node.create_timer(period_s, again)
        try:
            yield
        finally:
            acting = False
            self.node.destroy_timer(timer)

    def pause(self, seconds: float) -> None:
        """Spin for this much wall time."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.spin()

    def spin(self, seconds: float = 0.05) -> None:
        """Spin once: answers and timers, the last message of every topic, then the caller's tick.

        HindraxError, once, after a standstill of this process (Ctrl-Z, a laptop that was closed).
        """
        with deferred_signals():
            self._executor.spin_once(timeout_sec=seconds)
            self.node.drain()
        if still_s := self._watch.stood_still_s():
            self.forgotten = True
            raise HindraxError(
                f"this program stood still for {still_s:.0f} s, and ROS may have lost it; start it again"
            )
        self._tick()

    def wait(self, done: Callable[[], bool], seconds: float, what: Callable[[], str]) -> None:
        """Spin until `done`; HindraxError with the sentence of `what` after this much wall time."""
        deadline = time.monotonic() + seconds
        while not done():
            if time.monotonic() > deadline:
                raise HindraxError(f"waited {seconds:.0f} s for {what()}")
            self.spin()

    def awaited(self, look: Callable[[], T | None], seconds: float, what: Callable[[], str]) -> T:
        """Wait until `look` finds something, and return it; HindraxError as `wait`."""
        self.wait(lambda: look() is not None, seconds, what)
        seen = look()
        assert seen is not None, "what was found is there until the next spin"
        return seen

    def wait_for_thrusters(self) -> None:
        """Wait until the thrusters node can be asked to arm: before that, there is no stack."""
        self.wait(self._arm.service_is_ready, ANSWER_S, lambda: f"the thrusters node to offer thrusters/arm; {UP}")

    def arm(self, *, arm: bool = True, seconds: float = 30.0) -> None:
        """Arm or disarm, and wait until the thrusters report it (arming first holds neutral for the ESC's time)."""
        self.wait_for_thrusters()
        answer = self._request_arming(arm=arm)
        # In mock, time runs so fast that a busy machine is late now and then. A real vehicle is never asked again: a
        # person may have disarmed it meanwhile.
        for _ in range(ASKED_AT_MOST - 1 if self._mock else 0):
            if answer.accepted or received(answer.error_code, answer.reason).reason not in ASK_AGAIN:
                break
            answer = self._request_arming(arm=arm)
        if not answer.accepted:
            refused = received(answer.error_code, answer.reason)
            raise HindraxError(refused.within(f"the thrusters refused to {'arm' if arm else 'disarm'}: "))
        since, began = self.thrusters, False

        def ended() -> bool:
            """Whether they are as asked for, or arm no more; what they said before the answer may come after it."""
            nonlocal since, began
            since, now = since or self.thrusters, self.thrusters
            if now is None or since is None or now.armed is arm:
                return now is not None
            began = began or now.state == ArmingPhase.ARMING
            begin, last = stamp_from_msg(since.header.stamp), stamp_from_msg(now.header.stamp)
            return now.state == ArmingPhase.DISARMED and (began or seconds_between(begin, last) > FLOWN_S)

        try:
            self.wait(ended, seconds, self._thruster_state)
        except BaseException:  # Ctrl-C too
            # Arming goes on by itself: who gave up must not find them armed seconds later.
            if arm:
                with contextlib.suppress(HindraxError):
                    self._request_arming(arm=False)
            raise
        if self.armed is not arm:
            raise HindraxError(f"the thrusters stopped arming: {self.reason}")
        if arm and self.reason:
            self._require_obedience()

    def _require_obedience(self) -> None:
        """Disarm, and HindraxError, when armed thrusters go on refusing what they are commanded."""
        with contextlib.suppress(HindraxError):
            self.wait(lambda: not self.reason or bool(self.unobeyed), ANSWER_S, lambda: "a command")
        why = self.unobeyed
        if from_sentence(why).code is OutputReason.UNOBEYED:
            with contextlib.suppress(HindraxError):  # they disarm by themselves when nothing is obeyed
                self.arm(arm=False, seconds=ANSWER_S)
            raise HindraxError(f"the thrusters were armed, but {why}; disarmed again")

    def _request_arming(self, *, arm: bool) -> Arm.Response:
        stamp = self.order_stamp() if arm else stamp_to_msg(self.now())  # to disarm, no time is waited for or wanted
        request = Arm.Request(arm=arm, stamp=stamp, sequence=self.next())
        future = self._arm.call_async(request)
        self.wait(future.done, ANSWER_S, lambda: "an answer from thrusters/arm")
        return future.result()

    def _thruster_state(self) -> str:
        if self.thrusters is None:
            return "a message from the thrusters"
        return f"the thrusters, which are {state_and_reason(self.thrusters.state, self.thrusters.reason)}"

    def fly(self, goal: Goal | ExperimentGoal, seconds: float) -> tuple[Refusal, str]:
        """Fly motions to their end, or have the identifier run an experiment. Ctrl-C cancels.

        Returns why it was aborted, `NOTHING` when all was flown, and what an experiment has reached. A goal that
        arrived too late is sent again: mock time runs so fast that a busy machine is late now and then.
        """
        motions, on_cancel = list(goal.motions), goal.on_cancel
        if isinstance(goal, Goal):
            self.wait(self._fly.server_is_ready, ANSWER_S, lambda: f"the pilot to offer maneuver/fly; {UP}")
            asked = FlyManeuver.Goal(
                motions=motions,
                excitation=goal.excitation,
                levels=goal.levels,
                seed=goal.seed,
                on_cancel=on_cancel,
                pulse_forces=[force_N for pulse in goal.pulses for force_N in pulse.forces_N],
                pulse_seconds=[pulse.seconds for pulse in goal.pulses],
                pulse_calm=[pulse.calm for pulse in goal.pulses],
            )
            return self._asked(self._fly, asked, seconds)[0], ""
        self.wait(self._run.server_is_ready, ANSWER_S, lambda: f"the identifier to offer ident/run; {UP}")
        until, minutes = goal.aim.until or 0.0, goal.aim.minutes or 0.0
        experiment = RunExperiment.Goal(motions=motions, until=until, minutes=minutes, on_cancel=on_cancel)
        aborted, result = self._asked(self._run, experiment, seconds)
        if result is None:
            return aborted or RESULT_LOST, ""
        rows = zip(result.known, result.noise, result.wanted, strict=True)
        known = ", ".join(f"{motion} {100 * noise:.2g} % of {100 * wanted:.2g} %" for motion, noise, wanted in rows)
        return aborted, "; ".join(filter(None, [result.ended, known and f"noise of the drag: {known}"]))

    def _asked(self, client: ActionClient, goal: ActionGoal, seconds: float) -> tuple[Refusal, Any]:
        """Send a goal, again when it was late; returns why it was aborted, and its result where there is one."""
        aborted, result = NOTHING, None
        for _ in range(ASKED_AT_MOST):
            aborted, result = self._fly_to_its_end(client, goal, seconds)
            if aborted.reason is not Reason.LATE:
                break
        return aborted, result

    def _fly_to_its_end(self, client: ActionClient, goal: ActionGoal, seconds: float) -> tuple[Refusal, Any]:
        goal.stamp = self.order_stamp()
        self.maneuver = None
        future = client.send_goal_async(goal)
        self.wait(future.done, ANSWER_S, lambda: f"the vehicle to answer a goal; {FLY_AGAIN}")
        self._goal = future.result()
        if not self._goal.accepted:
            raise HindraxError("the vehicle rejected the goal without a reason; it is of another version: restart it")
        result = self._goal.get_result_async()
        try:
            self.wait(lambda: result.done() or self._maneuver_lost(), seconds, self._not_ended)
        except BaseException:
            with contextlib.suppress(HindraxError):  # report the first error
                self.cancel()
            raise
        self._goal = None
        if not result.done():
            return self._lost_outcome(), None
        outcome = result.result()
        if outcome.status == GoalStatus.STATUS_SUCCEEDED and outcome.result.completed:
            return NOTHING, outcome.result
        aborted = received(outcome.result.error_code, outcome.result.aborted)
        return aborted or WITHOUT_REASON, outcome.result

    def _not_ended(self) -> str:
        at = f", now at {self.maneuver.motion} {self.maneuver.phase}" if self.maneuver is not None else ""
        return f"the maneuver to end{at}; it is cancelled"

    def _lost_outcome(self) -> Refusal:
        if self.maneuver is not None and self.maneuver.phase in ("done", "aborted"):
            return received(self.maneuver.error_code, self.maneuver.aborted)
        now, found = "the thrusters are silent", self.thrusters
        if found is not None:
            now = f"the thrusters are {state_and_reason(found.state, found.reason)}"
        text = f"link: no status of the maneuver for {MANEUVER_LOST_S:.0f} s, and {now}; {FLY_AGAIN}"
        return Refusal(Reason.LINK, text)

    def _maneuver_lost(self) -> bool:
        """Whether the vehicle still publishes, but no maneuver status: the result was lost with the link."""
        if self.navigation is None or self.maneuver is None:
            return False
        now = self.now()
        silent_s = seconds_between(stamp_from_msg(self.maneuver.header.stamp), now)
        return silent_s > MANEUVER_LOST_S and seconds_between(self.navigation.stamp, now) < FLOWN_S

    def cancel(self) -> None:
        """Cancel what is being flown, if anything."""
        if self._goal is None:
            return
        future = self._goal.cancel_goal_async()
        self._goal = None
        self.wait(future.done, ANSWER_S, lambda: "the pilot to cancel")

    def cancel_all(self) -> int:
        """Cancel every goal of all clients; returns their number. Without a pilot there are none."""
        if not self._cancel.service_is_ready():
            return 0
        # A request without an id and without a stamp means all goals (action_msgs/srv/CancelGoal).
        future = self._cancel.call_async(CancelGoal.Request())
        self.wait(future.done, ANSWER_S, lambda: "the pilot to cancel")
        return len(future.result().goals_canceling)
