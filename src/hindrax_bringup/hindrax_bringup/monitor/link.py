"""Between a view and the graph: one thread owns the operator's node, the view reads pictures and leaves orders."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from hindrax_bringup.commands._operator import joined
from hindrax_bringup.monitor.watched import Picture, picture
from hindrax_bringup.presence import Presence
from hindrax_control.maneuvers import Goal
from hindrax_core.errors import HindraxError

if TYPE_CHECKING:
    from hindrax_bringup.nodes.operator import Operator

TURN_S = 0.02
PICTURE_S = 0.1
FLY_S = 3600.0
LOST_S = 30.0
"""Silence after which a maneuver's end is waited for no longer."""
CLOSE_S = 10.0

Tell = Callable[[str, bool], None]
Order = Callable[["Operator"], str]


class Link(threading.Thread):
    """Joins a stack's graph and stays in it until `close`; use it as a `Vehicle` of a view.

    What ends something (stop, disarm, cancel) is done at once, also while a maneuver is waited for. `present` says
    whether anybody looks: the heartbeat is the person's, not the program's.
    """

    def __init__(self, found: Presence | None, *, sim_time: bool, present: Callable[[], bool] = lambda: True) -> None:
        super().__init__(name="operator's link", daemon=True)
        self.title = found.title if found else "ROS graph of this terminal"
        self._found, self._sim_time, self._present = found, sim_time, present
        self._orders: queue.SimpleQueue[tuple[Order, Tell]] = queue.SimpleQueue()
        self._urgent: queue.SimpleQueue[tuple[Order, Tell]] = queue.SimpleQueue()
        self._hurrying = self._waiting = False
        self._beating = True
        self._over = threading.Event()
        self._up = threading.Event()
        self._operator: Operator | None = None
        self._heard: object = None
        self._heard_s = float("-inf")
        self._drawn_s = 0.0
        self._picture = Picture()
        self.error: Exception | None = None

    def wait(self, seconds: float) -> None:
        """Wait until the graph is joined; raises what prevented it."""
        deadline = time.monotonic() + seconds
        while not self._up.wait(0.05) and self.is_alive() and time.monotonic() < deadline:
            pass
        if self.error is not None:
            raise self.error

    def picture(self) -> Picture:
        """Return the latest picture, with the silence as it is now: also when this thread has ended."""
        return replace(self._picture, silent_s=time.monotonic() - self._heard_s)

    def stop(self, tell: Tell) -> None:
        """Order a stop."""
        self._urgent.put((_stop, tell))

    def disarm(self, tell: Tell) -> None:
        """Order to disarm."""
        self._urgent.put((_disarm, tell))

    def cancel(self, tell: Tell) -> None:
        """Order to end what is being flown."""
        self._urgent.put((_cancel, tell))

    def fly(self, goal: Goal, tell: Tell) -> None:
        """Order a maneuver; told when it has ended."""
        self._orders.put((lambda operator: _fly(operator, goal), tell))

    def close(self) -> None:
        """Leave the graph; a maneuver that was ordered here is cancelled."""
        self._over.set()
        self.join(CLOSE_S)

    def run(self) -> None:
        """Turn the node, draw pictures, do what was ordered."""
        try:
            with joined(self._found, sim_time=self._sim_time, tick=self._tick) as operator:
                self._operator = operator
                self._up.set()
                while not self._over.is_set():
                    operator.spin(TURN_S)
                    if not self._orders.empty():
                        self._waiting = True
                        self._obey(operator, *self._orders.get())
                        self._waiting = False
        except Exception as error:  # noqa: BLE001  # handed to the thread that waits, which raises it
            self.error = error

    def _tick(self) -> None:
        operator = self._operator
        if operator is None:
            return
        self._look(operator)
        self._beat(operator)
        if self._hurrying:
            return
        if not self._urgent.empty():
            self._hurrying = True
            self._obey(operator, *self._urgent.get())
            self._hurrying = False
        if self._waiting and (self._over.is_set() or time.monotonic() - self._heard_s > LOST_S):
            self._waiting = False  # said once: what is waited for still has to be cancelled
            raise HindraxError("the end of the maneuver is not waited for any longer; `./hindrax stop` ends it")

    def _look(self, operator: Operator) -> None:
        # The thrusters speak fifty times a second whatever happens: their silence is the vehicle's.
        if operator.thrusters is not self._heard:
            self._heard, self._heard_s = operator.thrusters, time.monotonic()
        if time.monotonic() - self._drawn_s > PICTURE_S:
            self._drawn_s = time.monotonic()
            self._picture = picture(operator)

    def _beat(self, operator: Operator) -> None:
        if self._present() is not self._beating:
            self._beating = not self._beating
            operator.beat(on=self._beating)

    def _obey(self, operator: Operator, order: Order, tell: Tell) -> None:
        try:
            tell(order(operator), True)
        except HindraxError as error:
            tell(str(error), False)


def _stop(operator: Operator) -> str:
    from hindrax_bringup.nodes.orders import stop  # noqa: PLC0415  # rclpy is loaded by then

    failed = stop(operator)
    if failed:
        raise HindraxError("; ".join(failed))
    return "stopped and disarmed"


def _disarm(operator: Operator) -> str:
    operator.arm(arm=False)
    return "disarmed"


def _cancel(operator: Operator) -> str:
    return "the maneuver is cancelled" if operator.cancel_all() else "nothing was being flown"


def _fly(operator: Operator, goal: Goal) -> str:
    from hindrax_bringup.nodes.orders import require_armed  # noqa: PLC0415  # rclpy is loaded by then

    require_armed(operator)
    aborted = operator.fly(
        list(goal.motions), excitation=goal.excitation, seed=goal.seed, on_cancel=goal.on_cancel, seconds=FLY_S
    )
    if aborted:
        raise HindraxError(f"the maneuver ended early, by {aborted}")
    return f"flown: {', '.join(goal.motions)}"
