"""Faults of processes: a real stack on a mock vehicle, whose processes die, freeze and are impersonated."""

from __future__ import annotations

import contextlib
import math
import os
import random
import signal
import sys
import tempfile
import time
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hindrax_bringup.liveness import processes_of
from hindrax_bringup.process_state import descendants, is_stopped
from hindrax_bringup.processes import CONTROL, IDENTIFIER, RECORDER, SAFETY_MONITOR, SENSORS, THRUSTERS
from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_lock import runtime_folder, stacks
from hindrax_bringup.stack_process import StackProcess
from hindrax_control.maneuver.goal import Goal
from hindrax_core.bus_operations import Write
from hindrax_core.errors import HindraxError
from hindrax_core.events import seconds_between, to_s
from hindrax_core.signals import Navigation
from hindrax_core.topics import NAVIGATION, OPERATOR_WRENCH, THRUSTER_COMMAND, THRUSTER_STATE
from hindrax_drivers.buses.ports import open_bus
from hindrax_sim.hardware import TrueState
from hindrax_tools.faults.fault_outcome import (
    DISARMED,
    HELD,
    HOLD,
    MANEUVER,
    MODES,
    OPERATOR,
    WRENCH,
    FaultOutcome,
    Judge,
)
from hindrax_tools.mock_stack import mock_stack

if TYPE_CHECKING:
    from hindrax_operator.nodes.operator_node import Operator

DEAD_MAN, BOTH = "dead man", "thrusters and dead man"
NODE = "thrusters_node"
"""Name of the heartbeat of the thrusters' node; that of its dead man is the one of the process."""
OUTPUT = "pca9685"
STACK = "whole stack"
DIED, FROZEN, IMPERSONATED, RESTARTED, STALLED = "died", "frozen", "impersonated", "restarted", "stalled for 6 s"
ENDED = "the node ended"
STALL_S = 6.0
"""Longer than the lease of the middleware, 4 s: every participant has forgotten every other."""
SIGNALS = {DIED: signal.SIGKILL, FROZEN: signal.SIGSTOP}
LIES = {CONTROL.name: THRUSTER_COMMAND, THRUSTERS.name: THRUSTER_STATE}
"""Messages of an impersonator: full thrust without a request, and thrusters at rest."""
LIE_PERIOD_S = 0.02
RESET = Write(0x00, b"\x06")
"""Software reset of every chip on the bus (NXP PCA9685 rev. 4, section 7.6): what a brown-out does."""
ABSENT_EVERY_S, ABSENT_S = 30.0, 2.0
CLEAR_S = 3.0
"""Time from the beginning of such a fault until one may arm and fly towards the next."""
ABSENCES = tuple(f"absent:thrusters@{ABSENT_EVERY_S * number:g}+{ABSENT_S:g}" for number in range(1, 60))
"""A chip cannot be pulled out from another process: the mock does it again and again, for so long."""
SOON_S, AFTER_S, PATIENT_S = 1.0, 3.0, 180.0
"""A fault comes within this time of the first thrust and is seen for so long; then the longest wait [wall time]."""
TOLD_S = 8.0
"""Time from a fault by which somebody has named it; on a busy machine a process is back before it has said why."""
NEW_PROCESS_S = 60.0
STATES = 200
"""Room for four seconds of states, should the tool be late."""


@dataclass(frozen=True, slots=True)
class ProcessFault:
    """A row of the table: the process, what is wrong with it, and the time within which neutral is wanted."""

    who: str
    what: str
    within_s: float = math.inf
    by_mock: bool = False
    """Whether the mock does it at its own times, see `ABSENCES`; then no other row may fly with this stack."""


GOING_ON = (IDENTIFIER.name, SAFETY_MONITOR.name, RECORDER.name, SENSORS.name)
"""Without these it may fly on, as long as its state is right."""
ROWS = (
    *(ProcessFault(who, what) for who in GOING_ON for what in SIGNALS),
    *(ProcessFault(who, what, 0.5) for who in (CONTROL.name, THRUSTERS.name) for what in SIGNALS),
    *(ProcessFault(DEAD_MAN, what, 1.5) for what in SIGNALS),
    # Nobody is left who could write neutral: a new process must start.
    *(ProcessFault(BOTH, what, NEW_PROCESS_S) for what in SIGNALS),
    # Of two commanders none is obeyed; no controller uses the state of the thrusters.
    ProcessFault(CONTROL.name, IMPERSONATED, 0.5),
    ProcessFault(THRUSTERS.name, IMPERSONATED),
    ProcessFault(OUTPUT, RESTARTED),
    # With its hardware, as a container that is paused: a chip that goes on alone is the row of the output.
    ProcessFault(STACK, STALLED),
    # Without hardware that helps, a chip out of reach repeats its last pulses until it is there again.
    ProcessFault(OUTPUT, DIED, ABSENT_S + 1.5, by_mock=True),
)


class _SeenError(Exception):
    """What was to be seen has been seen, or the time is over."""


class FaultyStack:
    """A stack in mock whose processes are harmed, with its operator; made by `faulty_stack`."""

    def __init__(self, stack: StackProcess) -> None:
        self.stack = stack
        self.operator: Operator
        truth = stack.folder.path / TRUTH
        truth.touch()  # the mock is only starting
        self._log, self._cut = truth.open(encoding="ascii"), ""
        self.last: TrueState | None = None
        self._start_s = math.nan
        self.estimates: dict[float, Navigation] = {}
        """Every state of the vehicle since the cell began, by its time: a busy tool may be late, its judgement not."""
        self.said: list[str] = []
        """What the terminal of the stack has shown."""
        self._tick: Callable[[Sequence[TrueState]], None] = lambda _: None

    def tick(self) -> None:
        """See whether the stack is up, and what the mock has written."""
        self.said += self.stack.check()
        self._tick(self._read())

    def on_navigation(self, message: bytes) -> None:
        """Keep a state."""
        from hindrax_ros.messages.fast_serialization import navigation_from_bytes  # noqa: PLC0415  # as the operator's

        state = navigation_from_bytes(message)
        self.estimates[to_s(state.stamp)] = state.reading

    def _read(self) -> list[TrueState]:
        *lines, self._cut = (self._cut + self._log.read()).split("\n")
        found = [TrueState.parse(line) for line in lines]
        self.last = found[-1] if found else self.last
        if found and math.isnan(self._start_s):
            self._start_s = found[0].now_s
        return found

    def since_absence_s(self, now_s: float) -> float:
        """Time of the mock since it last began to do what it does at its own times."""
        return (now_s - self._start_s) % ABSENT_EVERY_S if now_s - self._start_s >= ABSENT_EVERY_S else math.inf

    @property
    def _now_s(self) -> float:
        self._read()
        return self.last.now_s if self.last else -math.inf

    @property
    def neutral(self) -> bool:
        """Whether neutral is on the wires now."""
        self._read()
        return self.last is not None and self.last.neutral

    def pids(self, who: str) -> list[int]:
        """Processes of a name; the thrusters node is the child of its dead man."""
        if who == BOTH:
            return self.pids(THRUSTERS.name) + self.pids(DEAD_MAN)
        found = processes_of(runtime_folder(), self.stack.pid)
        beating = {THRUSTERS.name: NODE, DEAD_MAN: THRUSTERS.name}.get(who, who)
        return [found[beating]] if beating in found else []

    @property
    def port(self) -> str:
        """Port of the thruster output."""
        (entry,) = (one for one in stacks() if one.pid == self.stack.pid)
        return entry.ports["thrusters"]

    @contextlib.contextmanager
    def harmed(self, who: str, what: str) -> Iterator[Callable[[], bool]]:
        """Kill, freeze or lie until the end of the context; yields whether all are at work that should be."""
        operator = self.operator
        if what == IMPERSONATED:
            with (
                operator.sender(LIES[who], who) as send,
                operator.repeating(LIE_PERIOD_S, lambda: send(self._false_message(who))),
            ):
                yield lambda: True
            with contextlib.suppress(HindraxError):  # a new sole commander is accepted once it was disarmed
                operator.arm(arm=False, seconds=PATIENT_S)
            return
        if who == STACK:
            self._stall()
            yield lambda: not operator.unobeyed and self._is_fresh()
            return
        if who == OUTPUT:
            if what == RESTARTED:
                open_bus(self.port, "fault").transfer(RESET)
            yield lambda: True
            return
        old = self.pids(who)
        for pid in old:
            with contextlib.suppress(ProcessLookupError):  # it died by itself; then it must come back all the same
                os.kill(pid, SIGNALS[what])

        def whole() -> bool:
            new = self.pids(who)
            return bool(new) and not set(new) & set(old) and not any(map(is_stopped, new)) and self._is_fresh()

        yield whole

    def _is_fresh(self) -> bool:
        state = self.operator.navigation
        return state is not None and seconds_between(state.stamp, self.operator.now()) < 1.0

    def _stall(self) -> None:
        """Stop every process of the stack and go on later, in the order of their making."""
        pids = [self.stack.pid, *descendants(self.stack.pid)]
        for number in (signal.SIGSTOP, signal.SIGCONT):
            for pid in pids:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, number)
            if number == signal.SIGSTOP:
                time.sleep(STALL_S)

    def _false_message(self, who: str) -> object:
        from hindrax_msgs.msg import ThrusterCommand, ThrusterState  # noqa: PLC0415  # as the operator's
        from hindrax_ros.messages.convert import stamp_to_msg  # noqa: PLC0415

        operator = self.operator
        count = len(operator.thrusters.pulses) if operator.thrusters is not None else 0
        message: ThrusterCommand | ThrusterState
        if who == CONTROL.name:
            message = ThrusterCommand(pulses=[1900.0] * count, sequence=operator.next())
        else:
            message = ThrusterState(armed=True, state="armed", pulses=[1500.0] * count, output="pca9685")
        message.header.stamp = stamp_to_msg(operator.now())
        return message

    def wait(self, done: Callable[[], bool], what: str) -> None:
        """Spin until it is so."""
        self.operator.wait(done, PATIENT_S, lambda: what)

    def prepare(self, mode: str) -> None:
        """Arm, or disarm, when state and thrusters are there again; HindraxError when it cannot be armed."""
        from hindrax_ros.messages.convert import stamp_from_msg  # noqa: PLC0415  # rclpy reads the environment first

        operator, since = self.operator, self.operator.now()

        def output_is_there() -> bool:
            """Before, its last message may be that of a node that has ended meanwhile, armed."""
            return operator.thrusters is not None and stamp_from_msg(operator.thrusters.header.stamp) > since

        self.wait(lambda: operator.navigation is not None and operator.navigation.stamp > since, "navigation")
        self.wait(output_is_there, "the thrusters")
        if mode == DISARMED and operator.armed:
            operator.arm(arm=False, seconds=PATIENT_S)
        deadline_s = time.monotonic() + PATIENT_S
        while mode != DISARMED and not operator.armed:
            with contextlib.suppress(HindraxError):  # the state is not accepted for a second after a restart
                operator.arm(seconds=5.0)
            if time.monotonic() > deadline_s:
                raise HindraxError(f"could not be armed: {operator.reason}")

    def fly(self, mode: str, seed: int, tick: Callable[[Sequence[TrueState]], None]) -> None:
        """Fly in one mode until the tick ends it. What is refused is asked for again: a busy machine is late."""
        self._tick = tick
        try:
            while True:
                with contextlib.suppress(HindraxError):
                    self._fly(mode, seed)
                self.operator.pause(1.0)
        except _SeenError:
            pass
        finally:
            self._tick = lambda _: None

    def _fly(self, mode: str, seed: int) -> None:
        # rclpy reads the environment as it is imported.
        from hindrax_operator.nodes.orders import hold, recentre  # noqa: PLC0415
        from hindrax_ros.messages.convert import wrench_to_msg  # noqa: PLC0415

        operator = self.operator
        if mode == MANEUVER and self.last is not None:
            # What an operator does before the first flight after a restart of the state.
            recentre(operator, *self.last.place_m, self.last.attitude_rad[2])
            operator.fly(Goal(("surge",), seed=seed, on_cancel="neutral"), PATIENT_S)
        elif mode == HOLD:
            for axis, value in HELD:
                hold(operator, [axis], value, engaged=True)
        elif mode == OPERATOR:
            with (
                operator.sender(OPERATOR_WRENCH, "the pilot") as send,
                operator.repeating(0.1, lambda: send(wrench_to_msg(operator.now(), WRENCH))),
            ):
                operator.pause(PATIENT_S)

    def cell(self, row: ProcessFault, mode: str, seed: int) -> FaultOutcome:
        """Fly, harm, and judge. A cell that misses its deadline reports what is missing."""
        self.estimates.clear()
        self.wait(lambda: bool(self._read()), "the mock")
        if row.by_mock:  # what it does now must not come before there is thrust
            self.wait(lambda: CLEAR_S < self.since_absence_s(self._now_s) < CLEAR_S + ABSENT_S, "the mock's fault")
        assert self.last is not None
        seen = _Seen(self, row, mode, random.Random(f"{row} {mode} {seed}").uniform(0.0, SOON_S))  # noqa: S311  # no secret
        try:
            self.prepare(mode)
            with seen.harm:
                self.fly(mode, seed, seen.tick)
        except HindraxError as error:
            seen.lost = seen.lost or str(error)
        return seen.cell(seed, self.last)


class _Seen:
    """What is seen of one fault: harms when there is thrust, and ends when all is up again."""

    def __init__(self, stack: FaultyStack, row: ProcessFault, mode: str, wait_s: float) -> None:
        self._stack, self._row, self._mode, self._wait_s = stack, row, mode, wait_s
        self._deadline_s = time.monotonic() + 2.0 * PATIENT_S
        self._thrust_since_s: float | None = None
        self._harmed_s = math.inf
        self._whole: Callable[[], bool] = lambda: False
        self._true: list[TrueState] = []
        self._said = len(stack.said)
        self.harm = contextlib.ExitStack()
        self.lost = self._reason = ""

    def tick(self, lines: Sequence[TrueState]) -> None:
        """Take notice of the mock's new lines."""
        operator = self._stack.operator
        if self._harmed_s < math.inf:
            self._true += lines
            self._reason = "" if operator.armed else operator.reason
            since_s = self._true[-1].now_s - self._harmed_s if self._true else 0.0
            if since_s > AFTER_S and self._ended() and (since_s > TOLD_S or not self._hidden()):
                raise _SeenError
        elif any(map(self._flew_long_enough, lines)):
            self._said = len(self._stack.said)
            self._whole = self.harm.enter_context(self._stack.harmed(self._row.who, self._row.what))
            assert self._stack.last is not None
            self._stack.neutral  # noqa: B018  # reads up to now
            self._harmed_s, self._true = self._stack.last.now_s, [self._stack.last]
        if time.monotonic() > self._deadline_s:
            harmed = self._harmed_s < math.inf
            self.lost = "it did not come back" if harmed else "no thrust before the fault: nothing is shown"
            raise _SeenError

    def _flew_long_enough(self, one: TrueState) -> bool:
        if one.neutral and self._mode != DISARMED:
            self._thrust_since_s = None
            return False
        self._thrust_since_s = one.now_s if self._thrust_since_s is None else self._thrust_since_s
        if self._row.by_mock:
            return self._stack.since_absence_s(one.now_s) < ABSENT_S
        return one.now_s - self._thrust_since_s >= self._wait_s

    def _ended(self) -> bool:
        """Whether all is at work again, and disarmed where that is wanted."""
        return self._whole() and (self._row.within_s == math.inf or not self._stack.operator.armed)

    def _hidden(self) -> bool:
        """Whether a process was killed or stopped by a signal, and neither terminal nor output has named it so far."""
        named = self._stack.said[self._said :] or ENDED in self._reason
        return self._row.what in SIGNALS and not (self._row.by_mock or named)

    def cell(self, seed: int, last: TrueState) -> FaultOutcome:
        """The judgement: each true state beside the state that was estimated then."""
        judge, estimates = Judge(self._true[0] if self._true else last), self._stack.estimates
        stamps = sorted(estimates)
        for true in self._true[1:]:
            at = bisect_right(stamps, true.now_s)
            judge.observe(true, estimates[stamps[at - 1]] if at else None)
        maneuver = self._stack.operator.maneuver
        aborted = maneuver.aborted if self._mode == MANEUVER and maneuver is not None else ""
        row, why = self._row, "" if self._mode == DISARMED else self._reason or aborted
        armed = row.who in (*GOING_ON, STACK) and self._mode != DISARMED and not why
        said = self._stack.said[self._said :]
        told = ("terminal",) * bool(said or why) + ("exit 1",) * bool(aborted)
        # A process that a signal killed or stopped is named on the terminal of its stack, or by the output itself.
        hidden = self._hidden() and not self.lost
        return judge.cell(
            row.who,
            row.what,
            self._mode,
            seed,
            why,
            within_s=row.within_s,
            lost=self.lost,
            armed=armed,
            told=told,
            unsaid=(f"no terminal says that {row.who} {row.what}",) * hidden,
        )


TRUTH = "truth.log"


@contextlib.contextmanager
def faulty_stack(
    folder: Path, seed: int, *, record: bool = True, faults: tuple[str, ...] = (), waits: bool = True
) -> Iterator[FaultyStack]:
    """A mock vehicle, its stack and its operator; all of it ends with the context.

    `waits`: whether the clock waits for a stack that is late, which hides what the lateness does.
    """
    mock = MockOptions(seed=seed, rate=1.0, faults=faults, truth=str(folder / "run" / TRUTH), waits=waits)
    settings = ("thrusters.arming_s:=1.0",)
    # Many faults are no process that dies again and again.
    with mock_stack(folder, mock, record=record, settings=settings, restarts=sys.maxsize) as stack:
        from hindrax_operator.nodes.operator_node import Operator  # noqa: PLC0415  # rclpy reads the environment
        from hindrax_ros.graph import subscription  # noqa: PLC0415

        faulty = FaultyStack(stack)
        with Operator(mock=True, tick=faulty.tick) as operator:
            faulty.operator = operator
            subscription(operator.node, NAVIGATION, faulty.on_navigation, raw=True, queue=STATES)
            faulty.wait(lambda: operator.navigation is not None and operator.thrusters is not None, "the stack")
            yield faulty


def fly(rows: Sequence[ProcessFault], seed: int) -> Iterator[FaultOutcome]:
    """Fly all cells of some rows, all `by_mock` or none, with one seed, mode by mode.

    A stack serves them until one loses it. Rows without which it flies on come first: one flight serves them all.
    """
    left = [(row, mode) for mode in MODES for row in rows]
    faults = ABSENCES if any(row.by_mock for row in rows) else ()
    while left:
        with (
            tempfile.TemporaryDirectory() as folder,
            faulty_stack(Path(folder), seed, faults=faults, waits=False) as stack,
        ):
            lost = False
            while left and not lost:
                cell = stack.cell(*left.pop(0), seed)
                lost = bool(cell.violated)
                yield cell
