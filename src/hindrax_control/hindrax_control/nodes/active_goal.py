"""One goal of an action client, from its acceptance to its result: its client, its maneuver, its feedback."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from hindrax_control.maneuver.maneuver import Maneuver, ManeuverOutput
from hindrax_control.nodes.pilot_messages import feedback_to_msg, goal_from_msg
from hindrax_core.events import Stamp, Stamped
from hindrax_core.signals import Estimate
from hindrax_msgs.action import FlyManeuver
from hindrax_ros.graph import end_goal

ARMED_WITHIN = 25
"""Cycles for which a goal waits for the message that the thrusters are armed."""


class ActiveGoal:
    """Holds the handle of the client and the maneuver flown for it together, so that they cannot be mixed up.

    `maneuver` is None while the goal waits.
    """

    def __init__(self, handle: Any) -> None:
        self._handle = handle
        self.goal = goal_from_msg(handle.request)
        self.maneuver: Maneuver | None = None
        self._patience = ARMED_WITHIN

    @property
    def cancelled(self) -> bool:
        """Whether the client wants it to end."""
        return bool(self._handle.is_cancel_requested)

    def waits(self, *, armed: bool) -> bool:
        """Whether the goal waits for another cycle: the message that the thrusters are armed may be on its way."""
        self._patience -= 1
        return not armed and self._patience >= 0

    def cancel_if_asked(self) -> None:
        """Cancel the maneuver if its client asked for that."""
        if self.maneuver is not None and self.cancelled:
            self.maneuver.cancel()

    @property
    def last(self) -> ManeuverOutput | None:
        """Last output of its own maneuver; None before the first."""
        return None if self.maneuver is None else self.maneuver.last

    def publish_feedback(self, estimates: Mapping[str, Stamped[Estimate]], stamp: Stamp) -> None:
        """Publish feedback, if there is an output yet."""
        if self.last is not None:
            self._handle.publish_feedback(feedback_to_msg(self.last, estimates, stamp))

    def finish(self, aborted: str) -> None:
        """Send the result, once: `aborted` says why it ended, empty when all was flown.

        A goal is executed when it is over. A coroutine that waits would keep the events executor busy for the whole
        maneuver.
        """
        self._handle.execute(partial(result_of, aborted))


def result_of(aborted: str, handle: Any) -> Any:
    """Bring the handle of a goal into its last state and return the result."""
    end_goal(handle, aborted)
    return FlyManeuver.Result(completed=not aborted, aborted=aborted)
