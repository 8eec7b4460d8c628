"""The action `ident/run`: an experiment chooses, the pilot flies, the session learns, until nothing more is chosen.

The identifier only asks: guards, holds and braking are the pilot's. Without an identifier nothing new is chosen, and
what is flown ends in a hold.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import TypeAlias

from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.action.client import ClientGoalHandle
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future

from hindrax_core.errors import UsageError
from hindrax_core.events import to_s
from hindrax_core.input_checks import TypedOrders, order_window, untimely_goal
from hindrax_core.text.refusals import CANCELLED, NOTHING, Reason, Refusal, received
from hindrax_ident.online.aim import Aim, Choice, check_experiment, plan_text
from hindrax_ident.online.experiment import DragEstimate, Experiment
from hindrax_ident.online.session import Session
from hindrax_msgs.action import FlyManeuver, RunExperiment
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.graph import end_goal
from hindrax_ros.messages.convert import stamp_from_msg, stamp_to_msg

RUN, FLY = "ident/run", "maneuver/fly"
PLATEAUS = "plateaus"
"""Word of the pilot for the excitation whose levels may be chosen."""
ASKED_AT_MOST = 5
WATCH_S = 0.05
SILENT_S = 10.0
"""Wall time without a message of the pilot after which it counts as gone; it reports several times a second."""
BUSY = Refusal(Reason.BUSY, "start: an experiment is being run; `./hindrax stop` ends it")
PILOT_GONE = Refusal(Reason.PILOT, "pilot: does not offer maneuver/fly; start it")
NO_FEEDBACK = Refusal(
    Reason.PILOT,
    f"pilot: no feedback of the maneuver for {SILENT_S:.0f} s; see whether its process is up, and run again",
)
VERSION = Refusal(Reason.PILOT, "pilot: rejected the maneuver without a reason; it is of another version: restart it")
WITHOUT_REASON = Refusal(Reason.UNNAMED, "maneuver: ended without a reason")


Judge: TypeAlias = Callable[[Callable[[Session], Choice | None]], Choice | None]


class ExperimentServer:
    """Serves `ident/run` on a node, one goal at a time; a second one is refused.

    `judge` does what takes seconds with what was learned so far.
    """

    def __init__(self, node: BatchedNode, judge: Judge) -> None:
        self._node, self._judge = node, judge
        self._run: _Run | None = None
        self._goals = TypedOrders(order_window(mock=bool(node.get_parameter("use_sim_time").value)))
        self._fly = ActionClient(node, FlyManeuver, FLY)
        self._server = ActionServer(
            node,
            RunExperiment,
            RUN,
            lambda handle: _result(handle, NOTHING, "", {}),
            handle_accepted_callback=self._accept,
            cancel_callback=lambda _goal: CancelResponse.ACCEPT,
        )
        node.every(WATCH_S, self._watch)

    def close(self) -> None:
        """Take the actions away before the node."""
        self._server.destroy()
        self._fly.destroy()

    def _accept(self, handle: ServerGoalHandle) -> None:
        """Begin an experiment, or finish it at once: a rejection cannot carry a reason."""
        request = handle.request
        aim = Aim(request.until or None, request.minutes or None)  # 0 in a message, which has no None
        experiment = Experiment(tuple(request.motions), aim)
        refused = self._refused(request, experiment)
        if refused or request.plan:
            plan = "" if refused else plan_text(experiment.motions, experiment.aim)
            handle.execute(partial(_result, aborted=refused, ended=plan, known={}))
        else:
            self._run = _Run(handle, experiment)
            self._choose(self._run)

    def _refused(self, request: RunExperiment.Goal, experiment: Experiment) -> Refusal:
        """Return why a goal is not begun, as "guard: sentence"; nothing when it is."""
        try:
            check_experiment(experiment.motions, experiment.aim, request.on_cancel or "hold")
        except UsageError as error:
            return Refusal(Reason.GOAL, str(error))
        if request.plan:
            return NOTHING
        if self._run is not None:
            return BUSY
        if not self._fly.server_is_ready():
            return PILOT_GONE
        why = self._goals.refusal(stamp_from_msg(request.stamp), self._node.now())
        return untimely_goal(why) if why else NOTHING

    def _now_s(self) -> float:
        return to_s(self._node.now())

    def _choose(self, run: _Run) -> None:
        """Send what is chosen next to the pilot, or finish."""
        choice = self._judge(partial(run.experiment.next, now_s=self._now_s()))
        if choice is None:
            self._finish(run, NOTHING)
        else:
            run.choice, run.tries = choice, 0
            self._node.get_logger().info(f"chosen: {choice}")
            self._send(run)

    def _send(self, run: _Run) -> None:
        goal = FlyManeuver.Goal(motions=[run.choice.motion], levels=run.choice.levels, excitation=PLATEAUS)
        goal.on_cancel, goal.stamp = run.handle.request.on_cancel or "hold", stamp_to_msg(self._node.now())
        run.tries, run.maneuver, run.stopping, run.received_s = run.tries + 1, None, False, time.monotonic()
        sent = self._fly.send_goal_async(goal, feedback_callback=partial(self._on_feedback, run))
        sent.add_done_callback(partial(self._on_sent, run))

    def _on_sent(self, run: _Run, sent: Future) -> None:
        maneuver = sent.result()
        if run is not self._run:
            if maneuver.accepted:  # it was given up before the pilot answered
                maneuver.cancel_goal_async()
        elif not maneuver.accepted:
            self._finish(run, VERSION)
        else:
            run.maneuver, run.received_s = maneuver, time.monotonic()
            maneuver.get_result_async().add_done_callback(partial(self._on_flown, run))

    def _on_flown(self, run: _Run, outcome: Future) -> None:
        if run is not self._run:
            return
        flown = outcome.result().result
        aborted = received(flown.error_code, flown.aborted)
        cut = run.experiment.left_s(self._now_s()) <= 0.0 and run.stopping
        if run.handle.is_cancel_requested:
            self._finish(run, aborted or CANCELLED)
        elif aborted.reason is Reason.LATE and run.tries < ASKED_AT_MOST:
            self._send(run)
        elif flown.completed or (cut and aborted.reason is Reason.CANCELLED):
            self._choose(run)
        else:
            self._finish(run, aborted or WITHOUT_REASON)

    def _on_feedback(self, run: _Run, message: FlyManeuver.Impl.FeedbackMessage) -> None:
        if run is self._run:
            flown, run.received_s = message.feedback, time.monotonic()
            feedback = RunExperiment.Feedback(chosen=str(run.choice), motion=flown.motion, phase=flown.phase)
            feedback.progress, feedback.remaining_s = flown.progress, flown.remaining_s
            run.handle.publish_feedback(feedback)

    def _watch(self) -> None:
        """Cancel what is flown when the client asks or the time is over, once; give up a pilot that is silent."""
        run = self._run
        if run is None:
            return
        if time.monotonic() - run.received_s > SILENT_S:
            if run.maneuver is not None:
                run.maneuver.cancel_goal_async()
            self._finish(run, NO_FEEDBACK)
        elif run.maneuver is not None and not run.stopping:
            run.stopping = run.handle.is_cancel_requested or run.experiment.left_s(self._now_s()) <= 0.0
            if run.stopping:
                run.maneuver.cancel_goal_async()

    def _finish(self, run: _Run, aborted: Refusal) -> None:
        self._run = None
        known, ended = run.experiment.known, run.experiment.ended
        self._node.get_logger().info(f"experiment aborted by {aborted}" if aborted else f"experiment ended: {ended}")
        run.handle.execute(partial(_result, aborted=aborted, ended=ended, known=known))


class _Run:
    """One goal: its client, its experiment, and what is being flown for it."""

    def __init__(self, handle: ServerGoalHandle, experiment: Experiment) -> None:
        self.handle, self.experiment = handle, experiment
        self.choice = Choice("")
        self.maneuver: ClientGoalHandle | None = None
        self.tries = 0
        self.stopping = False
        self.received_s = 0.0


def _result(
    handle: ServerGoalHandle, aborted: Refusal, ended: str, known: Mapping[str, DragEstimate]
) -> RunExperiment.Result:
    """Bring the handle of a goal into its last state and return the result."""
    end_goal(handle, aborted)
    found = RunExperiment.Result(completed=not aborted, aborted=str(aborted), ended=ended, known=list(known))
    found.error_code = aborted.reason
    found.noise, found.wanted = [drag.noise for drag in known.values()], [drag.wanted for drag in known.values()]
    return found
