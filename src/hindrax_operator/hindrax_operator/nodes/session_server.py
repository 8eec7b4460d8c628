"""The action `session/run`: a client begins the guided session of this process, sees where it stands, and answers.

The main thread flies it. This node is turned by a thread and has a context of its own, since each flight of the session
begins and ends the context of its operator. A client asks; what arms is confirmed in the terminal (ADR 18).
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Self

import rclpy
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.context import Context
from rclpy.signals import SignalHandlerOptions

from hindrax_analysis.identification.pool_session import PoolSession, drag_goal, next_sentence
from hindrax_bringup.network.security import ANSWER, SESSION
from hindrax_core.text.refusals import NOTHING, Reason, Refusal
from hindrax_msgs.action import RunSession
from hindrax_msgs.srv import AnswerQuestion
from hindrax_operator.session_question import answer, asked
from hindrax_ros.batched_node import BatchedNode, events_executor
from hindrax_ros.graph import end_goal

TURN_S, FEEDBACK_S = 0.1, 1.0
ENDED_S, FETCHED_S = 10.0, 1.0
"""Longest wait for the thread to end a goal, and time for its client to fetch the result before the process ends."""
BUSY = Refusal(Reason.BUSY, "busy: a goal has begun this session, which has one; cancel that, or wait for its end")
NO_QUESTION = Refusal(Reason.LATE, "late: nothing is asked; see `question` of the feedback")
ARMS = Refusal(Reason.TERMINAL, "terminal: this answer arms the thrusters; press Enter in the terminal of the session")


class SessionServer:
    """Serves one session; use it as a context manager. All but its callbacks are called by the main thread.

    Parameters
    ----------
    interrupt
        Ends what the main thread does, as Ctrl-C does: called when the client cancels.
    """

    def __init__(self, interrupt: Callable[[], None]) -> None:
        self._interrupt = interrupt
        self._context = Context()
        rclpy.init(args=[], context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = BatchedNode("session", context=self._context, ros_time=False)
        self._executor = events_executor(self._context)
        self._executor.add_node(self._node)
        self._server = ActionServer(
            self._node,
            RunSession,
            SESSION,
            partial(_result, aborted=BUSY),
            handle_accepted_callback=self._accept,
            cancel_callback=lambda _goal: CancelResponse.ACCEPT,
        )
        self._node.create_service(AnswerQuestion, ANSWER, self._answer)
        self._node.every(FEEDBACK_S, self._send_feedback)
        self._goals: SimpleQueue[RunSession.Goal] = SimpleQueue()
        self._lock = threading.Lock()
        self._handle: ServerGoalHandle | None = None
        self._session: PoolSession | None = None
        self._folder = Path()
        self._ending: Callable[[], None] | None = None
        self._over = threading.Event()
        self.cancelled = False
        """Whether the client has cancelled the goal."""
        self._thread = threading.Thread(target=self._turn, name="session", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._server.destroy()
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    # ---- called by the main thread

    def goal(self) -> RunSession.Goal:
        """Wait for a goal."""
        return self._goals.get()

    def show(self, session: PoolSession, folder: Path) -> None:
        """Give clients the session as it stands."""
        self._session, self._folder = session, folder

    @property
    def aborted(self) -> Refusal:
        """Which legs of the session were aborted, and why; nothing when none were."""
        return NOTHING if self._session is None else self._session.aborted

    def end(self, aborted: Refusal, *, identified: bool = False) -> None:
        """End the goal at hand, if any, and give its client time for the result; another may come after it.

        Parameters
        ----------
        aborted
            What ended it; `NOTHING` when every step was done.
        identified
            Whether every motion is identified.
        """
        with self._lock:  # from here on a cancel interrupts nothing
            handle, self._handle = self._handle, None
        if handle is None:
            return
        ended = threading.Event()

        def result(handle: ServerGoalHandle) -> RunSession.Result:
            ended.set()
            return _result(handle, aborted, self._session, self._folder, identified=identified)

        self._ending = partial(handle.execute, result)
        ended.wait(ENDED_S)
        self._over.wait(FETCHED_S)

    # ---- in the thread

    def _turn(self) -> None:
        while not self._over.is_set():
            self._executor.spin_once(timeout_sec=TURN_S)
            self._node.drain()
            self._node.publish_queue.flush()
            with self._lock:
                handle = self._handle
                if handle is not None and handle.is_cancel_requested and not self.cancelled:
                    self.cancelled = True
                    self._interrupt()
            ending, self._ending = self._ending, None
            if ending is not None:
                ending()

    def _accept(self, handle: ServerGoalHandle) -> None:
        """Take a goal, or end it at once: a rejection cannot carry a reason."""
        with self._lock:
            busy = self._handle is not None
            if not busy:
                self._handle = handle
        if busy:
            handle.execute(partial(_result, aborted=BUSY))
        else:
            self._goals.put(handle.request)

    def _answer(self, request: AnswerQuestion.Request, response: AnswerQuestion.Response) -> AnswerQuestion.Response:
        refused = self._refused_answer(request.question)
        response.accepted, response.reason, response.error_code = not refused, str(refused), refused.reason
        return response

    def _refused_answer(self, number: int) -> Refusal:
        """Why an answer does not count; nothing when it is given."""
        question = None if self._session is None else asked(self._folder)
        if question is None:
            return NO_QUESTION
        if question.number != number:
            return Refusal(Reason.LATE, f"late: found an answer to question {number}, wanted one to {question.number}")
        if question.arms:
            return ARMS
        return NOTHING if answer(self._folder, number) else NO_QUESTION

    def _send_feedback(self) -> None:
        handle, session = self._handle, self._session
        if handle is None or session is None:
            return
        question = asked(self._folder)
        step, *left = session.left or ("",)
        feedback = RunSession.Feedback(step=step, left=left, steps=[one.name for one in session.done])
        feedback.motions, feedback.drag, feedback.goals = _reached(session)
        if question is not None:
            feedback.question, feedback.asked, feedback.arms = question
        handle.publish_feedback(feedback)


def _reached(session: PoolSession) -> tuple[list[str], list[float], list[float]]:
    """Motions of the last estimate, deviation of the drag of each and its goal, as shares of it."""
    reached = session.reached
    return list(reached), [one.drag for one in reached.values()], [drag_goal(motion) for motion in reached]


def _result(
    handle: ServerGoalHandle,
    aborted: Refusal,
    session: PoolSession | None = None,
    folder: Path | None = None,
    *,
    identified: bool = False,
) -> RunSession.Result:
    """Bring the handle of a goal into its last state and return the result."""
    end_goal(handle, aborted)
    found = RunSession.Result(completed=not aborted, identified=identified, aborted=str(aborted))
    found.error_code = aborted.reason
    if session is not None:
        found.folder = str(folder)
        found.steps, found.remarks = [one.name for one in session.done], [one.remark for one in session.done]
        found.motions, found.drag, found.goals = _reached(session)
        found.next = next_sentence(session) if session.reached else ""
    return found
