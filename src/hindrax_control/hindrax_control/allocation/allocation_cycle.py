"""One cycle of the allocation: wrench in, pulses out; then the wrench that the applied pulses achieve. No ROS.

    command = cycle.command(wrench, frame, stamp, now)       # through the guard
    achieved = cycle.achieved(applied_sequence, applied_us)

The allocator node publishes both; a replay compares them with the record.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace

from hindrax_control.allocation.allocator import AllocationKnobs, Allocator, difference
from hindrax_control.allocation.applied_wrench import AppliedWrench
from hindrax_control.allocation.supply_voltage import SupplyKnobs, SupplyVoltage
from hindrax_control.allocation.wrench_guard import WrenchGuard, WrenchGuardKnobs
from hindrax_core.events import Stamp
from hindrax_core.readings import Vec6
from hindrax_core.signals import ZERO6, Allocation
from hindrax_core.vehicle import Vehicle

KEPT = 32
NO_PLAN = Allocation(ZERO6, ZERO6, ZERO6, (), (), ())


@dataclass(frozen=True, slots=True)
class PulseCommand:
    """Pulses for all thrusters [us], in the order of the vehicle file, and the sequence number of the command."""

    sequence: int
    pulses_us: tuple[int, ...]


class AllocationCycle:
    """Allocates the wrenches of one vehicle and stores the plans of its last commands.

    `supply`: the measured voltage; `supply_V`: the one in use, None for the nominal one. `refused`: why the
    last wrench was refused, or a part of it; `inexact`: count of wrenches without forces within limits.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        knobs: AllocationKnobs | None = None,
        guard: WrenchGuardKnobs | None = None,
        supply: SupplyKnobs | None = None,
    ) -> None:
        self._vehicle = vehicle
        self._allocator = Allocator(vehicle, knobs)
        self._guard = WrenchGuard(vehicle, guard)
        self._applied = AppliedWrench(vehicle)
        self.supply = SupplyVoltage(vehicle.supply_V, supply)
        self.supply_V: float | None = None
        self.now = Stamp(0)
        self.refused: tuple[str, ...] = ()
        self.inexact = 0
        self._unserved: tuple[str, ...] = ()
        self.disabled: frozenset[str] = frozenset()
        self.lost_axes: tuple[str, ...] = ()
        self._last = PulseCommand(0, ())
        self._plans: OrderedDict[int, Allocation] = OrderedDict()

    def tune(self, knobs: AllocationKnobs) -> None:
        """Use other knobs from now on."""
        self._allocator = Allocator(self._vehicle, knobs)

    def command(self, wrench: Vec6, frame: str, stamp: Stamp, now: Stamp) -> PulseCommand | None:
        """Guard and allocate a wrench [N, Nm], made at `stamp` in the axes of `frame`; None when it is refused."""
        self.now = now
        self._use_supply(self.supply.measured_V(now))
        accepted = self._guard.step(wrench, frame, stamp, now)
        self.refused = accepted.refused
        self._unserved = accepted.refused if accepted.wrench is None else ()
        if accepted.wrench is None:
            return None
        plan = self._allocator.allocate(accepted.wrench, self.disabled, self._last.pulses_us, self.supply_V)
        if accepted.refused:  # what the guard took is missing as well
            missing = difference(accepted.asked, plan.achieved)
            plan = replace(plan, wanted=accepted.asked, shortfall=missing, refused=accepted.refused + plan.refused)
        self.inexact += not plan.exact
        self._last = PulseCommand(self._last.sequence + 1, plan.pulses_us)
        self.remember(self._last.sequence, plan)
        return self._last

    def achieved(self, sequence: int, pulses_us: Sequence[float]) -> Allocation:
        """Allocation that applied pulses [us] achieve, against the plan of the command `sequence`; 0: no command."""
        plan = self._plans.get(sequence, NO_PLAN)
        forces_N = self._applied.forces_N(pulses_us)
        achieved = self._applied.wrench(forces_N)
        return replace(
            plan,
            achieved=achieved,
            shortfall=difference(plan.wanted, achieved),
            forces_N=forces_N,
            saturated=plan.saturated or (False,) * len(forces_N),
            disabled=tuple(sorted(self.disabled)),
            lost_axes=self.lost_axes,
            refused=(*self._unserved, *plan.refused),
        )

    def resume(self, command: PulseCommand) -> None:
        """Continue after a command that was sent before."""
        self._last = command

    def remember(self, sequence: int, plan: Allocation) -> None:
        """Store the plan of a command until its applied pulses are known."""
        self._plans[sequence] = plan
        if len(self._plans) > KEPT:
            self._plans.popitem(last=False)

    def knows(self, sequence: int) -> bool:
        """Whether the plan of this command is stored."""
        return sequence == 0 or sequence in self._plans

    def disable(self, names: frozenset[str]) -> None:
        """Set the thrusters out of use; unknown names are ignored."""
        self.disabled = names.intersection(self._allocator.names)
        # A vehicle that never had a thruster for an axis has not lost it, and is well.
        never = self._allocator.lost_axes(frozenset())
        self.lost_axes = tuple(axis for axis in self._allocator.lost_axes(self.disabled) if axis not in never)

    def battery(self, voltage_V: float) -> str:
        """Set the measured supply voltage; returns the reason if it is refused."""
        return self.supply.update(voltage_V, self.now)

    def _use_supply(self, supply_V: float | None) -> None:
        if supply_V != self.supply_V:
            self.supply_V = supply_V
            self._applied = AppliedWrench(self._vehicle, supply_V)
