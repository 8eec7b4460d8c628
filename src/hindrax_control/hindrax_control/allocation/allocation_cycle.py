"""One cycle of the allocation: wrench in, pulses out; then the wrench that the applied pulses achieve. No ROS.

    command = cycle.command(wrench, frame, stamp, now)       # through the guard
    achieved = cycle.achieved(applied_sequence, applied_us)

The allocator node publishes both; a replay compares them with the record.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace

from hindrax_control.allocation.allocator import AllocationKnobs, Allocator, difference
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_control.allocation.wrench_guard import WrenchGuard, WrenchGuardKnobs
from hindrax_core.events import Stamp, seconds_between
from hindrax_core.knobs import knob
from hindrax_core.readings import Vec6
from hindrax_core.signals import NAN, ZERO6, Allocation, Command
from hindrax_core.text.refusals import NOTHING, Reason, Refusal, refused
from hindrax_core.vehicle import Vehicle

COMMANDS_KEPT = 32
NO_COMMAND = Command((), (), Stamp(0), 0)
NO_PLAN = Allocation(ZERO6, ZERO6, ZERO6, (), (), ())
PLAUSIBLE = (0.25, 2.0)
"""Plausible measurements, as fractions of the nominal voltage."""
DEAD_AFTER_S = 0.5
"""Time for which a supply that was measured must read less than that before it is dead: one sample may be wrong."""


@dataclass(frozen=True, slots=True)
class SupplyKnobs:
    """Validity of a measured voltage."""

    silent_s: float = knob(10.0, 0.5, 600.0, "silence after which a measured supply voltage no longer counts [s]")


class SupplyVoltage:
    """Supply voltage of one vehicle: measured while a battery sensor publishes, else `nominal_V`.

    The age of a voltage counts from its arrival, not by the clock of its sensor.
    """

    def __init__(self, nominal_V: float, knobs: SupplyKnobs | None = None) -> None:
        self._nominal_V, self._knobs = nominal_V, knobs or SupplyKnobs()
        self._last: tuple[Stamp, float] | None = None
        self._low: tuple[Stamp, Stamp, float] | None = None
        """Since when and until when a sensor that had measured a supply has measured none, and the last voltage."""

    def tune(self, knobs: SupplyKnobs) -> None:
        """Use other knobs from now on."""
        self._knobs = knobs

    def update(self, voltage_V: float, now: Stamp) -> Refusal:
        """Set the measured voltage; returns why it is refused (`IMPOSSIBLE`). Zero (an unwired sensor) is ignored."""
        low, high = (part * self._nominal_V for part in PLAUSIBLE)
        if self._last is not None and 0.0 <= voltage_V < low:
            self._low = (self._low[0] if self._low else now, now, voltage_V)
        if voltage_V == 0.0:
            return NOTHING
        if not low <= voltage_V <= high:
            return refused(Reason.IMPOSSIBLE, what="a supply of", found=voltage_V, low=low, high=high, unit=" V")
        self._last, self._low = (now, round(voltage_V, 1)), None
        return NOTHING

    def battery_V(self, now: Stamp) -> float:
        """What the operator and the guards are told: the measured voltage, that of a dead supply too, or NaN."""
        if self._low is not None:
            since, until, voltage_V = self._low
            silent_s = seconds_between(until, now)
            if seconds_between(since, until) >= DEAD_AFTER_S and silent_s <= self._knobs.silent_s:
                return voltage_V
        return self.measured_V(now) or NAN

    def measured_V(self, now: Stamp) -> float | None:
        """Measured voltage, rounded to 0.1 V; None without a recent measurement."""
        if self._last is None or seconds_between(self._last[0], now) > self._knobs.silent_s:
            return None
        return self._last[1]

    def silence_warning(self, now: Stamp) -> str:
        """Warning that the battery sensor has fallen silent; else empty."""
        if self._last is None or self.measured_V(now) is not None:
            return ""
        silent_s = seconds_between(self._last[0], now)
        return f"battery sensor silent for {silent_s:.0f} s: using {self._nominal_V:.1f} V"

    def status_text(self, now: Stamp) -> str:
        """Voltage in use and its origin, for the operator."""
        measured_V = self.measured_V(now)
        if (battery_V := self.battery_V(now)) < PLAUSIBLE[0] * self._nominal_V:
            return f"{battery_V:.1f} (measured: dead)"
        if measured_V is not None:
            return f"{measured_V:.1f} (measured)"
        why = "no battery sensor" if self._last is None else "the battery sensor is silent"
        return f"{self._nominal_V:.1f} (assumed, {why})"


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
        self.refused: tuple[Refusal, ...] = ()
        self.inexact = 0
        self._unserved: tuple[str, ...] = ()
        self.disabled: frozenset[str] = frozenset()
        self.lost_axes: tuple[str, ...] = ()
        self._last = NO_COMMAND
        self._plans: OrderedDict[int, Allocation] = OrderedDict()

    def tune(self, knobs: AllocationKnobs) -> None:
        """Use other knobs from now on."""
        self._allocator = Allocator(self._vehicle, knobs)

    def command(
        self, wrench: Vec6, frame: str, stamp: Stamp, now: Stamp, forces_N: Sequence[float] = ()
    ) -> Command | None:
        """Guard and allocate a wrench.

        Parameters
        ----------
        wrench : [N, N m]
            About the center of mass, in the axes of `frame`.
        frame
            base_link or base_link_fsd.
        stamp, now
            When it was made, and the time of the vehicle.
        forces_N : (thrusters,) [N]
            With these the thrusters get them, and the wrench is only what they should give.

        Returns
        -------
        Command | None
            Pulses with their number; None when the wrench is refused.
        """
        self.now = now
        supply_V = self.supply.measured_V(now)
        if supply_V != self.supply_V:
            self.supply_V, self._applied = supply_V, AppliedWrench(self._vehicle, supply_V)
        accepted = self._guard.step(wrench, frame, stamp, now)
        self.refused = accepted.refused
        self._unserved = accepted.refused if accepted.wrench is None else ()
        if accepted.wrench is None:
            return None
        previous = (self.disabled, self._last.pulses_us, self.supply_V)
        plan = (
            self._allocator.drive(forces_N, *previous)
            if forces_N
            else self._allocator.allocate(accepted.wrench, *previous)
        )
        if accepted.refused:  # what the guard took is missing as well
            missing = difference(accepted.asked, plan.achieved)
            plan = replace(plan, wanted=accepted.asked, shortfall=missing, refused=accepted.refused + plan.refused)
        self.inexact += not plan.exact
        self._last = Command(plan.pulses_us, (), stamp, self._last.sequence + 1)
        self.keep_plan(self._last.sequence, plan)
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

    def resume(self, command: Command) -> None:
        """Continue after a command that was sent before."""
        self._last = command

    def keep_plan(self, sequence: int, plan: Allocation) -> None:
        """Store the plan of a command until its applied pulses are known."""
        self._plans[sequence] = plan
        if len(self._plans) > COMMANDS_KEPT:
            self._plans.popitem(last=False)

    def has_plan(self, sequence: int) -> bool:
        """Whether the plan of this command is stored."""
        return sequence == 0 or sequence in self._plans

    def disable(self, names: frozenset[str]) -> None:
        """Set the thrusters out of use; unknown names are ignored."""
        self.disabled = names.intersection(self._allocator.names)
        # A vehicle that never had a thruster for an axis has not lost it, and is well.
        never = self._allocator.lost_axes(frozenset())
        self.lost_axes = tuple(axis for axis in self._allocator.lost_axes(self.disabled) if axis not in never)
