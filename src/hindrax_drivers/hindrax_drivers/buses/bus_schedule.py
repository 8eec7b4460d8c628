"""Many programs on one bus, interleaved at their pauses. Pure: the host supplies time and transfers.

A device that waits 9 ms for a conversion does not keep the bus: its program sleeps in a heap of wake-ups while others
run. A program is never cut between two pauses. Cycles begin at multiples of their period, so that those of several
devices, and pauses with slack, need one wake-up of the host.
"""

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

from hindrax_core.bus_operations import DeviceError, Pause, Program, Transaction, advance, no_tap
from hindrax_core.driver_interface import Identity, RegisterDevice, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, after, seconds_between, stamp_from_s
from hindrax_core.readings import Reading
from hindrax_drivers.buses.clock import EPOCH, LAST_STAMP

BusOutput: TypeAlias = Stamped[Reading] | Rejected | Identity | Trouble
Result: TypeAlias = tuple[str, Sequence[BusOutput]]
Transfer: TypeAlias = Callable[[Transaction], bytes]
Tap: TypeAlias = Callable[[str, Stamp, Transaction, bytes], None]
"""Called for every successful transaction: device, time, transaction, bytes read."""

BACK_OFF_S = (0.0, 0.1, 0.2, 0.4, 0.8, 1.0)


@dataclass(slots=True)
class _Task:
    """Configuration and cycles of one device."""

    name: str
    device: RegisterDevice
    program: Program[object] | None = None
    configured: bool = False
    planned: Stamp = EPOCH
    failures: int = 0


_Wake: TypeAlias = tuple[Stamp, int, Stamp, _Task]
"""Due time, serial number, the latest time, and the task."""


class BusSchedule:
    """Runs the cycles of the devices on one bus, each at its period.

    A device whose program raises DeviceError is configured again after 0, 0.1, 0.2 ... 1 s, and reports a Trouble.
    """

    def __init__(self, tap: Tap = no_tap) -> None:
        self._tap = tap
        self._heap: list[_Wake] = []
        self._devices: dict[str, _Task] = {}
        self._pausing: list[tuple[_Task, Pause]] = []
        self._serial = 0
        self._last = EPOCH

    def add(self, name: str, device: RegisterDevice, start: Stamp = EPOCH) -> None:
        """Add a device.

        Parameters
        ----------
        name
            Of the device.
        device
            Its programs.
        start
            When it is configured; it cycles from then on.

        Raises
        ------
        ValueError
            For a name that is there already, and a period that is not above 0.
        """
        if name in self._devices:
            raise ValueError(f"{name}: is in the schedule already")
        if not device.period_s > 0.0:
            raise ValueError(f"{name}: found a period of {device.period_s} s, wanted more than 0 s")
        task = self._devices[name] = _Task(name, device)
        self._push(task, start)

    def ready(self, name: str) -> bool:
        """Whether a device has been configured and has not failed since."""
        return name in self._devices and self._devices[name].configured

    def next_due(self, now: Stamp) -> Stamp:
        """Find when to run again; with nothing due yet, slack is used up.

        Parameters
        ----------
        now
            Pauses of the last turn count from it.

        Returns
        -------
        Stamp
            For `run_next`; LAST_STAMP without devices.
        """
        self._update_clock(now)
        if not self._heap:
            return LAST_STAMP
        first = self._heap[0][0]
        return first if first <= now else min(latest for _, _, latest, _ in self._heap)

    def step(self, now: Stamp, transfer: Transfer) -> list[Result]:
        """Run all that is due at `now`, for hosts whose transfers take no time (lock-step)."""
        results: list[Result] = []
        while self.next_due(now) <= now:
            results += self.run_next(now, transfer)
        return results

    def run_next(self, now: Stamp, transfer: Transfer) -> list[Result]:
        """Run the most urgent program that is due at `now`, up to its next pause, for hosts on a real bus."""
        if self.next_due(now) > now:
            return []
        *_, task = heapq.heappop(self._heap)
        try:
            if task.program is None:
                if seconds_between(task.planned, now) > task.device.period_s:  # missed cycles are not made up for
                    task.planned = _cycle_start(now, task.device.period_s)
                task.program = task.device.cycle(now) if task.configured else task.device.configure()
            pause = advance(task.program, transfer, partial(self._tap, task.name, now))
        except StopIteration as stop:
            return self._finished(task, stop.value, now)
        except DeviceError as error:
            return self._failed(task, error, now)
        self._pausing.append((task, pause))
        return []

    def _update_clock(self, now: Stamp) -> None:
        """Shift the schedule when the clock was set back, and start the pauses of the last turn."""
        if now < self._last:
            back = self._last - now
            self._heap = [(Stamp(due - back), n, Stamp(last - back), task) for due, n, last, task in self._heap]
            for task in self._devices.values():
                task.planned = Stamp(task.planned - back)
        self._last = now
        for task, pause in self._pausing:
            self._push(task, after(now, pause.seconds), pause.slack_s)
        self._pausing.clear()

    def _push(self, task: _Task, due: Stamp, slack_s: float = 0.0) -> None:
        self._serial += 1
        heapq.heappush(self._heap, (due, self._serial, after(due, slack_s), task))

    def _finished(self, task: _Task, value: Any, now: Stamp) -> list[Result]:
        task.program = None
        if not task.configured:
            task.configured, task.planned = True, _cycle_start(now, task.device.period_s)
            self._push(task, now)
            return [(task.name, (value,))]
        task.failures = 0
        task.planned = after(task.planned, task.device.period_s)
        self._push(task, max(task.planned, now))
        return [(task.name, value)] if value else []

    def _failed(self, task: _Task, error: DeviceError, now: Stamp) -> list[Result]:
        task.program = None
        wait_s = BACK_OFF_S[min(task.failures, len(BACK_OFF_S) - 1)]
        task.failures += 1
        task.configured = False
        self._push(task, after(now, wait_s))
        when = f"in {wait_s:g} s" if wait_s else "at once"
        return [(task.name, (Trouble(now, f"{task.name}: {error}; configured anew {when}"),))]


def _cycle_start(now: Stamp, period_s: float) -> Stamp:
    """Return the last multiple of a period, counted from the epoch."""
    return Stamp(now - now % stamp_from_s(period_s))
