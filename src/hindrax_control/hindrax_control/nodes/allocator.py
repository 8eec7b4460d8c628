"""The allocator node: wrenches in, pulses out; and what the applied pulses achieve, every cycle."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import Header

from hindrax_control.allocation import AllocationKnobs, Allocator
from hindrax_control.applied import Applied
from hindrax_control.guard import CommandGuard, CommandGuardKnobs
from hindrax_control.supply import Supply, SupplyKnobs
from hindrax_core.events import Stamp
from hindrax_core.readings import Vec6
from hindrax_core.state import ZERO6, Allocation
from hindrax_core.topics import (
    ALLOCATION,
    BATTERY,
    THRUSTER_COMMAND,
    THRUSTER_HEALTH,
    THRUSTER_STATE,
)
from hindrax_core.vehicle import Vehicle
from hindrax_msgs.msg import AllocationStatus
from hindrax_ros.convert import FSD
from hindrax_ros.graph import publisher, subscription
from hindrax_ros.health import Reporter, status
from hindrax_ros.parameters import knobs
from hindrax_ros.polled import PolledNode
from hindrax_ros.swift import AllocationWriter, AppliedState, applied_from_bytes, command_writer

KEPT = 32
REPORT_S = 1.0
NO_PLAN = Allocation(ZERO6, ZERO6, ZERO6, (), (), ())


class AllocatorNode(PolledNode):
    """Serves wrenches with `thrusters/command`; `control/allocation` says what `thrusters/state` achieves.

    The pilot, in the same process, hands its wrenches to `take`; `hearers` are told what became of them. `supply` is
    the voltage as the battery sensor has it, for whoever else wants it.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__("allocator", ros_time=False)
        self._vehicle = vehicle
        self._allocator = Allocator(vehicle, knobs(self, AllocationKnobs))
        self._guard = CommandGuard(vehicle, knobs(self, CommandGuardKnobs))
        self._applied = Applied(vehicle)
        self.supply = Supply(vehicle.supply_V, knobs(self, SupplyKnobs))
        self._supply_V: float | None = None
        self._disabled: frozenset[str] = frozenset()
        self._lost: tuple[str, ...] = self._allocator.lost_axes(self._disabled)
        self._heard = Stamp(0)
        self._sequence = 0
        self._pulses: tuple[int, ...] = ()
        self._plans: OrderedDict[int, Allocation] = OrderedDict()
        self._refused: tuple[str, ...] = ()
        self._command = publisher(self, THRUSTER_COMMAND)
        self._status = publisher(self, ALLOCATION)
        self._reporter = Reporter(self)
        self._names = [thruster.name for thruster in vehicle.thrusters]
        self._status_bytes, self._command_bytes = AllocationWriter(), command_writer(len(self._names), FSD)
        self.hearers: list[Callable[[Stamp, Allocation], None]] = []
        subscription(self, THRUSTER_STATE, self._on_state, raw=True)
        subscription(self, THRUSTER_HEALTH, self._on_health)
        subscription(self, BATTERY, self._on_battery)
        self.every(REPORT_S, self._report)

    def take(self, wrench: Vec6, frame: str, stamp: Stamp, now: Stamp) -> None:
        """Serve one wrench [N, Nm]."""
        self._heard = now
        self._reckon_with(self.supply.measured_V(now))
        accepted = self._guard.step(wrench, frame, stamp, now)
        self._refused = accepted.refused
        if accepted.wrench is None:
            return
        plan = self._allocator.allocate(accepted.wrench, self._disabled, self._pulses, self._supply_V)
        self._pulses = plan.pulses_us
        self._sequence += 1
        self._plans[self._sequence] = plan
        if len(self._plans) > KEPT:
            self._plans.popitem(last=False)
        self._command.publish(self._command_bytes(stamp, self._sequence, plan.pulses_us))

    def _on_state(self, data: bytes) -> None:
        """Say what was achieved by what was applied; without a command behind it, nothing was wanted."""
        applied = applied_from_bytes(data)
        plan = self._plans.get(applied.sequence, NO_PLAN) if applied.sequence else NO_PLAN
        forces = self._applied.forces_N(applied.pulses_us)
        achieved = self._applied.wrench(forces)
        said = replace(
            plan,
            achieved=achieved,
            shortfall=_difference(plan.wanted, achieved),
            forces_N=forces,
            saturated=plan.saturated or (False,) * len(forces),
            disabled=tuple(sorted(self._disabled)),
            lost_axes=self._lost,
            refused=(*self._refused, *plan.refused),
        )
        for hear in self.hearers:
            hear(applied.stamp, said)
        self._publish(applied, said)

    def _publish(self, applied: AppliedState, said: Allocation) -> None:
        texts = (said.disabled, said.lost_axes, said.refused)
        supply_V = self._vehicle.supply_V if self._supply_V is None else self._supply_V
        data = self._status_bytes.write(
            applied.stamp,
            texts,
            lambda: AllocationStatus(
                header=Header(frame_id=FSD),
                thrusters=self._names,
                forces=said.forces_N,
                pulses=applied.pulses_us,
                saturated=said.saturated,
                disabled=said.disabled,
                lost_axes=said.lost_axes,
                refused=said.refused,
            ),
            applied.sequence,
            *(*said.wanted, *said.achieved, *said.shortfall, *said.forces_N, *applied.pulses_us, *said.saturated),
            supply_V,
            self._supply_V is not None,
        )
        self._status.publish(data)

    def _on_health(self, message: Any) -> None:
        self._disabled = frozenset(message.disabled)
        self._lost = self._allocator.lost_axes(self._disabled)

    def _on_battery(self, message: Any) -> None:
        self.supply.hear(float(message.voltage), self._heard)

    def _reckon_with(self, supply_V: float | None) -> None:
        if supply_V != self._supply_V:
            self._supply_V = supply_V
            self._applied = Applied(self._vehicle, supply_V)

    def _report(self) -> None:
        wrong = [f"axes lost: {', '.join(self._lost)}"] if self._lost else list(self._refused)
        wrong += filter(None, [self.supply.complaint(self._heard)])
        level = DiagnosticStatus.WARN if wrong else DiagnosticStatus.OK
        values = {"supply [V]": self.supply.words(self._heard), "disabled": ", ".join(sorted(self._disabled))}
        text = "; ".join(wrong) or "allocating"
        self._reporter.publish(self._heard, status("hindrax: allocator", level, text, values))


def _difference(wanted: Vec6, achieved: Vec6) -> Vec6:
    X, Y, Z, K, M, N = (one - other for one, other in zip(wanted, achieved, strict=True))
    return (X, Y, Z, K, M, N)
