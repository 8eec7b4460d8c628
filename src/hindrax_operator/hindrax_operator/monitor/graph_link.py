"""Between a view and the ROS graph: one thread owns the operator's node, the view reads snapshots and queues orders."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from hindrax_bringup.stack_lock import StackLock, stacks
from hindrax_control.commissioning.findings import Findings
from hindrax_control.maneuver.goal import Goal
from hindrax_core.errors import HindraxError
from hindrax_core.topics import NAMESPACE
from hindrax_core.vehicle import Vehicle
from hindrax_ident.online.aim import ExperimentGoal
from hindrax_operator.commissioning_run import Report, commission_beside
from hindrax_operator.connection import joined
from hindrax_operator.snapshot import CameraFrame, OnDone, Snapshot, snapshot

if TYPE_CHECKING:
    from hindrax_operator.nodes.cameras import Cameras
    from hindrax_operator.nodes.operator_node import Operator

TURN_S = 0.02
SNAPSHOT_S = 0.1
FLY_S = 3600.0
LOST_S = 30.0
"""Silence after which the end of a maneuver is no longer awaited."""
CLOSE_S = 10.0
AGAIN_S = 1.0
LOOK_S = 1.0
"""Time between two looks at which stack is in the graph."""

Order = Callable[["Operator"], str]


class GraphLink(threading.Thread):
    """Joins a stack's graph and stays in it until `close`.

    Stop, disarm and cancel are executed at once, also while a maneuver is being flown. `present`: whether an operator
    watches; the heartbeat stands for the operator, not for the program. A stack may end and another follow in its
    graph, even a real vehicle after a mock: `title` says which it is, and such an exchange flies nothing.
    """

    def __init__(self, found: StackLock | None, *, sim_time: bool, namespace: str = NAMESPACE) -> None:
        super().__init__(name="operator's link", daemon=True)
        self.title = found.title if found else "no `./hindrax up` runs here; ROS graph of this terminal"
        self._found = self._here = found
        self._looked_s = float("-inf")
        self._join = partial(joined, found, sim_time=sim_time, namespace=namespace, tick=self._tick)
        self.present: Callable[[], bool] = lambda: True
        self._orders: queue.SimpleQueue[tuple[Order, OnDone]] = queue.SimpleQueue()
        self._urgent: queue.SimpleQueue[tuple[Order, OnDone]] = queue.SimpleQueue()
        self._urgent_running = self._waiting = False
        self._ended = threading.Event()
        self._beating = True
        self._over = threading.Event()
        self._up = threading.Event()
        self._operator: Operator | None = None
        self._cameras: Cameras | None = None
        self._last_state: object = None
        self._received_s = float("-inf")
        self._refreshed_s = 0.0
        self._snapshot = Snapshot()
        self.error: Exception | None = None

    def wait(self, seconds: float) -> None:
        """Wait until the graph is joined; raises what prevented it."""
        deadline = time.monotonic() + seconds
        while not self._up.wait(0.05) and self.is_alive() and time.monotonic() < deadline:
            pass
        if self.error is not None:
            raise self.error

    def snapshot(self) -> Snapshot:
        """Return the latest snapshot with the silence up to now, also when this thread has ended."""
        return replace(self._snapshot, silent_s=time.monotonic() - self._received_s)

    def end(self, how: str, on_done: OnDone) -> None:
        """Order one of `ENDS`."""
        self._ended.set()
        self._urgent.put((ENDS[how], on_done))

    def fly(self, goal: Goal | ExperimentGoal, on_done: OnDone) -> None:
        """Order a maneuver or an experiment; `on_done` is called when it has ended."""

        def order(operator: Operator) -> str:
            self._require_same()
            return _fly(operator, goal)

        self._orders.put((order, on_done))

    def commission(self, vehicle: Vehicle, report: Report, found: Callable[[Findings], None], on_done: OnDone) -> None:
        """Order a commissioning of the vehicle; it begins nothing more after an end of the page.

        Parameters
        ----------
        vehicle
            File to be proven; its operator arms.
        report
            Gets a sentence for each step.
        found
            Gets the findings, also of one that ended early.
        on_done
            Gets the sentence of the outcome, and whether it is good.

        Raises
        ------
        HindraxError
            Within the order, so that `on_done` is told, when the commissioning ended early.
        """
        self._ended.clear()

        def order(operator: Operator) -> str:
            self._require_same()
            findings = commission_beside(operator, vehicle, report, arm=False, over=self._ended.is_set)
            found(findings)
            if findings.ended:
                raise HindraxError(f"ended early: {findings.ended}")
            return findings.sentence

        self._orders.put((order, on_done))

    def frame(self, camera: str) -> CameraFrame | None:
        """Return the last frame of a camera of the snapshot; None before its first."""
        return self._cameras.frame(camera) if self._cameras else None

    def close(self) -> None:
        """Leave the graph; a maneuver that was ordered here is cancelled."""
        self._over.set()
        self.join(CLOSE_S)

    def run(self) -> None:
        """Stay in the graph; join it anew after a standstill, which it may not have survived."""
        try:
            while not self._over.is_set():
                try:
                    self._operator = None
                    with self._join() as operator:
                        self._serve(operator)
                except HindraxError:  # after a standstill the stack is also starting again
                    if not self._up.is_set():
                        raise
                    self._over.wait(AGAIN_S)
        except Exception as error:  # noqa: BLE001  # handed to the thread that waits, which raises it
            self.error = error

    def _serve(self, operator: Operator) -> None:
        """Spin the node, take snapshots, carry out the orders."""
        from hindrax_operator.nodes.cameras import Cameras  # noqa: PLC0415  # rclpy is loaded by now

        operator.beat(on=self._beating)
        self._operator, self._cameras = operator, Cameras(operator.node)
        self._up.set()
        while not self._over.is_set():
            operator.spin(TURN_S)
            if operator.forgotten:  # it was told within an order
                return
            if not self._orders.empty():
                self._waiting = True
                self._carry_out(operator, *self._orders.get())
                self._waiting = False

    def _tick(self) -> None:
        operator = self._operator
        if operator is None:
            return
        self._refresh(operator)
        self._beat(operator)
        if self._urgent_running:
            return
        if not self._urgent.empty():
            self._urgent_running = True
            self._carry_out(operator, *self._urgent.get())
            self._urgent_running = False
        if self._waiting and (self._over.is_set() or time.monotonic() - self._received_s > LOST_S):
            self._waiting = False  # raised once: the maneuver still has to be cancelled
            raise HindraxError("no longer waiting for the end of the maneuver; `./hindrax stop` ends it")

    def _refresh(self, operator: Operator) -> None:
        # The thrusters publish at 50 Hz in every state: without their messages the vehicle is not reachable.
        if operator.thrusters is not self._last_state:
            self._last_state, self._received_s = operator.thrusters, time.monotonic()
        if time.monotonic() - self._refreshed_s > SNAPSHOT_S:
            self._refreshed_s = time.monotonic()
            if self._cameras:
                self._cameras.update()
            # In one piece: a page that asks in between must not find the cameras gone.
            now = snapshot(operator, self._snapshot.thrusters.stops_us)
            self._snapshot = replace(now, cameras=self._cameras.names if self._cameras else ())

        if self._found is not None and time.monotonic() - self._looked_s > LOOK_S:
            self._looked_s = time.monotonic()
            self._look(self._found)

    def _look(self, found: StackLock) -> None:
        """Find the stack that is in the graph now, the newest where two are."""
        graph = found.domain, found.namespace
        self._here = next((one for one in reversed(stacks()) if (one.domain, one.namespace) == graph), None)
        self.title = f"{found.title}, ended" if self._here is None else self._here.title

    def _require_same(self) -> None:
        """HindraxError where a real vehicle has taken the place of a mock, or the other way round."""
        if self._found is not None and self._here is not None and self._here.mock is not self._found.mock:
            raise HindraxError(f"began with {self._found.title}, found {self.title}: start this view again for it")

    def _beat(self, operator: Operator) -> None:
        if self.present() is not self._beating:
            self._beating = not self._beating
            operator.beat(on=self._beating)

    def _carry_out(self, operator: Operator, order: Order, on_done: OnDone) -> None:
        try:
            on_done(order(operator), True)
        except HindraxError as error:
            on_done(str(error), False)


def _stop(operator: Operator) -> str:
    from hindrax_operator.nodes.orders import stop  # noqa: PLC0415  # rclpy is loaded by then

    failed = stop(operator)
    if failed:
        raise HindraxError("; ".join(failed))
    return "stopped and disarmed"


def _disarm(operator: Operator) -> str:
    operator.arm(arm=False)
    return "disarmed"


def _cancel(operator: Operator) -> str:
    return "the maneuver is cancelled" if operator.cancel_all() else "no maneuver was running"


ENDS: Mapping[str, Order] = {"stop": _stop, "disarm": _disarm, "cancel": _cancel}
"""Orders that are carried out at once: stop everything, disarm, cancel the maneuver."""


def _fly(operator: Operator, goal: Goal | ExperimentGoal) -> str:
    from hindrax_operator.nodes.orders import require_armed  # noqa: PLC0415  # rclpy is loaded by then

    require_armed(operator)
    aborted, reached = operator.fly(goal, FLY_S)
    if aborted:
        raise HindraxError("; ".join(filter(None, (f"the maneuver ended early, by {aborted}", reached))))
    return "; ".join(filter(None, (f"flown: {', '.join(goal.motions)}", reached)))
