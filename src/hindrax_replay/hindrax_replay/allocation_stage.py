"""The allocation over a bag: recorded wrenches through the guard to pulses, applied pulses to achieved wrenches.

Every command is computed from the recorded wrench and the recorded previous command, so a difference is reported once
and does not affect later commands. In a bag without wrenches or commands only the achieved wrenches are recomputed; the
wanted ones are those of the record.
"""

from collections import deque
from typing import Any

from hindrax_bag.message_comparison import ComparisonReport
from hindrax_bag.read.bag_reader import BagMessage, stamp_of
from hindrax_control.allocation.allocation_cycle import NO_COMMAND, NO_PLAN, AllocationCycle, SupplyKnobs
from hindrax_control.allocation.allocator import AllocationKnobs
from hindrax_control.allocation.wrench_guard import WrenchGuardKnobs
from hindrax_core.events import NS_PER_S, Stamp
from hindrax_core.signals import Allocation, AppliedOutput, Command
from hindrax_core.topics import ALLOCATION, BATTERY, THRUSTER_COMMAND, THRUSTER_HEALTH, THRUSTER_STATE, WRENCH, resolved
from hindrax_core.vehicle import Vehicle
from hindrax_replay.recorded_devices import Parameters, knobs_of, prefix_of
from hindrax_replay.wire_stage import ReferenceSamples, compare_lazily
from hindrax_ros.messages.convert import stamp_from_msg, wrench_from_msg
from hindrax_ros.messages.fast_serialization import (
    allocation_writer,
    applied_from_bytes,
    command_from_bytes,
    command_writer,
)
from hindrax_ros.messages.serialization import current_bytes, deserialized, message_class

WRENCH_NAME, COMMAND_NAME, STATE_NAME = map(resolved, (WRENCH, THRUSTER_COMMAND, THRUSTER_STATE))
STATUS_NAME, HEALTH_NAME, BATTERY_NAME = map(resolved, (ALLOCATION, THRUSTER_HEALTH, BATTERY))
INPUTS = frozenset({WRENCH_NAME, COMMAND_NAME, STATE_NAME, STATUS_NAME, HEALTH_NAME, BATTERY_NAME})
"""Input topics of this stage."""
LATE_NS = NS_PER_S
"""Messages of one cycle are recorded topic by topic, but never as far apart as this."""
SETTLING_NS = NS_PER_S // 4
"""Around a change of thrusters in use or supply voltage, a bag does not show which cycle used it first."""


class AllocationStage:
    """Guard and allocation of one vehicle, compared with the record."""

    def __init__(
        self, vehicle: Vehicle, parameters: Parameters, ledger: ComparisonReport, samples: ReferenceSamples
    ) -> None:
        self._ledger, self._samples = ledger, samples
        self._cycle = AllocationCycle(
            vehicle,
            knobs_of(AllocationKnobs, parameters, "allocator"),
            knobs_of(WrenchGuardKnobs, parameters, "allocator"),
            knobs_of(SupplyKnobs, parameters, "allocator"),
        )
        names = [thruster.name for thruster in vehicle.thrusters]
        prefix = prefix_of(parameters, "allocator")
        self._command_bytes = command_writer(len(names), prefix)
        self._status_bytes = allocation_writer(names, vehicle.supply_V, prefix)
        self._wrenches: deque[tuple[Stamp, Any]] = deque()
        self._commands: dict[int, BagMessage] = {}
        self._states: dict[tuple[int, int], list[AppliedOutput]] = {}
        """By stamp and sequence number of the command; lists, for several states may have both in common."""
        self._statuses: deque[tuple[BagMessage, Any]] = deque()
        self._newest = Stamp(0)
        self._delayed: deque[BagMessage] = deque()
        self._changes: deque[int] = deque(maxlen=16)
        """Times at which thrusters in use or supply changed."""
        self._last: Command | None = None
        self._commanded = self._finishing = False

    def feed(self, message: BagMessage) -> None:
        """Feed the next message of INPUTS; a change also affects messages recorded shortly before it."""
        if message.topic == HEALTH_NAME:
            self._changes.append(message.received)
        self._delayed.append(message)
        while self._delayed[0].received < message.received - SETTLING_NS:
            self._process(self._delayed.popleft())

    def finish(self) -> None:
        """Compare the messages that still wait for their counterparts."""
        while self._delayed:
            self._process(self._delayed.popleft())
        self._finishing = True
        self._command_all()
        self._achieve_all()

    def _process(self, message: BagMessage) -> None:
        if message.topic == WRENCH_NAME:
            wrench = message.decoded()
            stamp = stamp_from_msg(wrench.header.stamp)
            self._newest = max(self._newest, stamp)
            self._wrenches.append((stamp, wrench))
        elif message.topic == COMMAND_NAME:
            self._commanded = True
            self._commands[stamp_of(message.data)] = message
        elif message.topic == STATE_NAME:
            state = applied_from_bytes(current_bytes(message))
            self._newest = max(self._newest, state.stamp)
            self._states.setdefault((state.stamp, state.sequence), []).append(state)
        elif message.topic == STATUS_NAME:
            self._statuses.append((message, message.decoded()))
        elif message.topic == HEALTH_NAME:
            self._cycle.disable(frozenset(message.decoded().disabled))
        else:
            self._cycle.supply.update(float(message.decoded().voltage), self._cycle.now)
        self._command_all()
        self._achieve_all()

    # ---- wrench to pulses

    def _command_all(self) -> None:
        """Allocate wrenches in their order, as far as their commands exist."""
        while self._wrenches:
            stamp, wrench = self._wrenches[0]
            command = self._commands.pop(stamp, None)
            if command is None and not self._overdue(stamp):
                return
            self._wrenches.popleft()
            self._command(stamp, wrench, command)

    def _command(self, stamp: Stamp, wrench: Any, recorded: BagMessage | None) -> None:
        recorded_command = command_from_bytes(current_bytes(recorded)) if recorded else None
        known = recorded_command is not None and self._resume(recorded_command.sequence)
        supply_V = self._cycle.supply_V
        made = self._cycle.command(wrench_from_msg(wrench), wrench.header.frame_id, stamp, stamp)
        if recorded is None or recorded_command is None:
            if made is not None and self._commanded and not self._finishing:
                self._ledger.unmatched(COMMAND_NAME, stamp, "replayed, not recorded", "none", "a message")
            return
        if self._cycle.supply_V != supply_V:
            self._changes.append(recorded.received)
        self._last = recorded_command._replace(pulses_us=tuple(map(int, recorded_command.pulses_us)))
        if made is None:
            self._ledger.unmatched(COMMAND_NAME, stamp, "recorded, not replayed", "a message", "none")
        elif known and self._settled(recorded):
            data = self._command_bytes(stamp, made.sequence, made.pulses_us)
            compare_lazily(self._ledger, recorded, stamp, data)
            if self._samples.due(COMMAND_NAME, stamp):
                self._samples.keep(COMMAND_NAME, stamp, deserialized(data, message_class(THRUSTER_COMMAND.type)))

    def _resume(self, sequence: int) -> bool:
        """Continue after the recorded command before this one; False if it is not known."""
        if sequence == 1:
            self._last = NO_COMMAND
        known = self._last is not None and self._last.sequence == sequence - 1
        self._cycle.resume(self._last if known and self._last else NO_COMMAND._replace(sequence=sequence - 1))
        return known

    # ---- applied pulses to achieved wrenches

    def _achieve_all(self) -> None:
        """Process the recorded statuses in order, as far as pulses and command are known."""
        while self._statuses:
            message, status = self._statuses[0]
            stamp = stamp_of(message.data)
            states = self._states.get((stamp, status.sequence), [])
            planned = self._cycle.has_plan(status.sequence) or not self._commanded
            if not (states and planned) and not self._overdue(stamp):
                return
            self._statuses.popleft()
            if states:
                state = states.pop(0)
                if not self._cycle.has_plan(state.sequence):
                    self._cycle.keep_plan(state.sequence, _plan_of(status))
                achieved = self._cycle.achieved(state.sequence, state.pulses_us)
                if self._settled(message):
                    made = self._status_bytes(state, achieved, self._cycle.supply_V)
                    compare_lazily(self._ledger, message, state.stamp, made)
            self._states = {key: kept for key, kept in self._states.items() if kept and key[0] > stamp - LATE_NS}

    def _overdue(self, stamp: int) -> bool:
        return self._finishing or stamp < self._newest - LATE_NS

    def _settled(self, message: BagMessage) -> bool:
        return all(abs(message.received - change) > SETTLING_NS for change in self._changes)


def _plan_of(status: Any) -> Allocation:
    """Plan of a recorded AllocationStatus."""
    X, Y, Z, K, M, N = (float(value) for value in status.wanted)
    return Allocation(
        (X, Y, Z, K, M, N),
        *(NO_PLAN.achieved, NO_PLAN.shortfall, (), ()),
        saturated=tuple(map(bool, status.saturated)),
        refused=tuple(status.refused),
    )
