"""From a wrench to forces and pulses: exact where it can be had, by stated priority where it cannot.

Policy for a wrench out of reach: the axes of the first priority (default: heave, roll, pitch, yaw) keep the direction
of their common part and lose magnitude only as far as they must; then the next (surge, sway) keep theirs and take what
is left. See `bounded_allocation.py` for how that part is found. A failed thruster is a column taken out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np

from hindrax_control.allocation.bounded_allocation import AttainableSet
from hindrax_control.allocation.deadband_bias import ROUNDING_N, DeadbandBias, Interval
from hindrax_control.allocation.effectiveness import Matrix, ThrusterLayout, checked_effectiveness
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_control.allocation.wrench_guard import finite_axes
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.knobs import knob
from hindrax_core.readings import Vec6, vec6
from hindrax_core.signals import ZERO6, Allocation
from hindrax_core.vehicle import AXES, Vehicle

LARGEST_WRENCH = 1e12
"""No vehicle reaches this wrench [N, N m]; beyond it squares would overflow."""

KEPT_LAYOUTS = 32

WEIGHED_AT = {"yaw": 2.0}
"""Idle force at which an axis is weighed, in that of flight: against a moment as small as a person can hang, thrusters
go on idling against each other, and one of each pair would come near its dead band (ADR 35)."""
NO_FORCES = "wrench: found no forces within limits, wanted its largest part; check the thrust curves"


@dataclass(frozen=True, slots=True)
class AllocationKnobs:
    """Priorities and idle forces of the allocator."""

    priority: tuple[int, int, int, int, int, int] = knob(
        (2, 2, 1, 1, 1, 1), 1, 2, "order in which axes are served when not all can be, 1 first [-]"
    )
    idle_bias_N: float = knob(2.0, 0.0, 20.0, "force that idle thrusters hold against each other, 0: none [N]")
    hop_N: float = knob(1.0, 0.0, 20.0, "gain for which this force moves to another interval [N]")
    dead_band_margin_us: float = knob(2.0, 0.0, 50.0, "distance kept from the dead band [us]")


class _ThrusterSet:
    """The thrusters in use at one supply voltage, and the forces that they share a wrench into.

    Lists are by thruster of the vehicle file, and those of a pattern by thruster in use.
    """

    def __init__(
        self, vehicle: Vehicle, B: Matrix, knobs: AllocationKnobs, disabled: frozenset[str], supply_V: float
    ) -> None:
        names = [thruster.name for thruster in vehicle.thrusters]
        used = tuple(index for index, name in enumerate(names) if name not in disabled)
        self.layout = layout = ThrusterLayout(B, used, knobs.priority)
        self.true = thrust_curves(vehicle, supply_V)
        """Curves without changes: force by pulse."""
        self.running = thrust_curves(vehicle, supply_V, knobs.dead_band_margin_us)
        """Curves with the dead band widened by the margin: they choose the pulse."""
        limits = [curve.range_N for curve in self.true]
        self.inside_N = [(least + ROUNDING_N, most - ROUNDING_N) for least, most in limits]
        """Between these a force stands at no limit."""
        mine = [limits[i] for i in used]
        gaps = [self.running[i].gap_N if knobs.idle_bias_N > 0.0 else (0.0, 0.0) for i in used]
        self.spreads = [DeadbandBias(one, mine, gaps, knobs.idle_bias_N, knobs.hop_N) for one in layout.patterns]
        self.unchecked = _unchecked(layout, mine)
        """Thrusters in use, with their limits, that the spreads do not keep within them."""
        self.attainable = AttainableSet(layout, mine)
        self.disabled = tuple(name for name in names if name in disabled)
        self.unknown = tuple(f"{name}: no such thruster" for name in sorted(disabled - set(names)))
        """A sentence for each disabled thruster that does not exist."""

    def forces(self, wrench: Vec6, previous_us: Sequence[float]) -> tuple[list[float], bool]:
        """Forces of all thrusters [N], and whether they give the largest part of the wrench that can be had."""
        everything = [0.0] * len(self.true)
        if wrench == ZERO6 or not self.layout.used:
            return everything, True
        forces, exact = self._used_forces(wrench, previous_us)
        for index, force in zip(self.layout.used, forces, strict=True):
            everything[index] = force
        return everything, exact

    def _used_forces(self, wrench: Vec6, previous_us: Sequence[float]) -> tuple[list[float], bool]:
        """Forces of the thrusters in use: as the wrench has them, else its largest part; patterns that overlap last."""
        forces: list[float] = self.layout.pseudo_inverse.dot(wrench).tolist()
        if self._spread(forces, previous_us):
            return forces, True
        least = self.attainable.forces(wrench)
        forces = least.copy()
        if self._spread(forces, previous_us):
            return forces, True
        # One pattern may have taken the room that another one needs.
        fitted, exact = self.attainable.fitted(least)
        forces = fitted.copy()
        return (forces, exact) if self._spread(forces, previous_us) else (fitted, exact)

    def _spread(self, forces: list[float], previous_us: Sequence[float]) -> bool:
        """Add patterns without wrench so that every force is within limits and, where possible, out of its gap."""
        for spread in self.spreads:
            if not spread.add_preferred(forces) and not spread.add_nearest(
                forces, self._size_before(spread, previous_us)
            ):
                return False
        for index, least, most in self.unchecked:  # noqa: SIM110  # a generator costs more than most sets have thrusters
            if not least <= forces[index] <= most:
                return False
        return True

    def _size_before(self, spread: DeadbandBias, previous_us: Sequence[float]) -> float:
        if not previous_us:
            return spread.preferred_N
        return spread.pattern.size_in([self.true[i].force(previous_us[i]) for i in self.layout.used])


def _unchecked(mine: ThrusterLayout, limits_N: Sequence[Interval]) -> tuple[tuple[int, float, float], ...]:
    """Thrusters that are in no pattern, or in more than one: a later pattern may push them out again."""
    turns = [index for pattern in mine.patterns for index, _ in pattern.shares]
    return tuple(
        (index, least - ROUNDING_N, most + ROUNDING_N)
        for index, (least, most) in enumerate(limits_N)
        if turns.count(index) != 1
    )


class Allocator:
    """Allocates wrenches about the center of mass (X Y Z K M N, SNAME) to the thrusters of one vehicle.

    The same arguments always give the same answer; layouts are worked out when first needed and kept.
    """

    def __init__(self, vehicle: Vehicle, knobs: AllocationKnobs | None = None) -> None:
        self.vehicle = vehicle
        self.knobs = knobs or AllocationKnobs()
        self.B = checked_effectiveness(vehicle)
        self.names = tuple(thruster.name for thruster in vehicle.thrusters)
        self._none_us = (0.0,) * len(self.names)
        self._kept = lru_cache(KEPT_LAYOUTS)(partial(_ThrusterSet, vehicle, self.B, self.knobs))
        self._enabled(frozenset(), vehicle.supply_V)  # not in the first cycle

    def allocate(
        self,
        wrench: Vec6,
        disabled: frozenset[str] = frozenset(),
        previous_us: Sequence[float] = (),
        supply_V: float | None = None,
    ) -> Allocation:
        """Return the integer pulses for a wrench, and what they really give.

        Parameters
        ----------
        wrench : (6,) [N, N m]
            About the center of mass, SNAME axes. An axis that is not finite is refused and counts as zero; the others
            are served. A wrench of exactly zero stops every thruster.
        disabled
            Names of thrusters that must stand still.
        previous_us : (n,) [us]
            Pulses sent before, in the order of the vehicle file; they steady thrusters near their dead band.
        supply_V : [V]
            Measured voltage; None for the nominal one.

        Returns
        -------
        Allocation
            Forces, pulses, the wrench achieved, and what falls short of the one asked for, with the reason.
        """
        accepted, refused = bounded_axes(wrench)
        enabled = self._enabled(disabled, self.vehicle.supply_V if supply_V is None else supply_V)
        forces, exact = enabled.forces(accepted, previous_us)
        return self._plan(enabled, accepted, forces, previous_us, refused=refused, exact=exact)

    def drive(
        self,
        forces_N: Sequence[float],
        disabled: frozenset[str] = frozenset(),
        previous_us: Sequence[float] = (),
        supply_V: float | None = None,
    ) -> Allocation:
        """Return the integer pulses for given forces of the thrusters, and the wrench that they should give.

        Parameters
        ----------
        forces_N : (n,) [N]
            In the order of the vehicle file. One that is not finite, or of a disabled thruster, is zero.
        disabled, previous_us, supply_V
            As in `allocate`.

        Returns
        -------
        Allocation
            As of `allocate`.
        """
        enabled = self._enabled(disabled, self.vehicle.supply_V if supply_V is None else supply_V)
        named = zip(self.names, forces_N, strict=True)
        forces = [force_N if math.isfinite(force_N) and name not in disabled else 0.0 for name, force_N in named]
        return self._plan(enabled, vec6(self.B.dot(forces).tolist()), forces, previous_us)

    def _plan(
        self,
        enabled: _ThrusterSet,
        accepted: Vec6,
        forces: Sequence[float],
        previous_us: Sequence[float],
        *,
        refused: tuple[str, ...] = (),
        exact: bool = True,
    ) -> Allocation:
        pulses = tuple(
            [
                round(curve.pulse(force, before))
                for curve, force, before in zip(enabled.running, forces, previous_us or self._none_us, strict=True)
            ]
        )
        applied = tuple([curve.force(pulse) for curve, pulse in zip(enabled.true, pulses, strict=True)])
        achieved = vec6(self.B.dot(applied).tolist())
        return Allocation(
            wanted=accepted,
            achieved=achieved,
            shortfall=difference(accepted, achieved),
            forces_N=applied,
            pulses_us=pulses,
            saturated=tuple(
                [not least < force < most for force, (least, most) in zip(forces, enabled.inside_N, strict=True)]
            ),
            disabled=enabled.disabled,
            lost_axes=enabled.layout.lost_axes,
            refused=refused + enabled.unknown + (() if exact else (NO_FORCES,)),
            exact=exact,
        )

    def forces(self, wrench: Vec6, disabled: frozenset[str] = frozenset()) -> tuple[float, ...]:
        """Forces for a finite wrench at the nominal supply, before pulses are rounded: for planning and tests.

        Parameters
        ----------
        wrench : (6,) [N, N m]
            About the center of mass, SNAME axes.
        disabled
            Names of thrusters that must stand still.

        Returns
        -------
        tuple[float, ...]
            (n,) [N] in the order of the vehicle file.

        Raises
        ------
        HindraxError
            Where the solver finds none.
        """
        forces, exact = self._enabled(disabled, self.vehicle.supply_V).forces(wrench, ())
        if not exact:
            raise HindraxError(f"{wrench}: {NO_FORCES}")
        return tuple(forces)

    def reach(self, axis: str, sign: float, disabled: frozenset[str] = frozenset()) -> float:
        """Largest wrench along one axis alone.

        Parameters
        ----------
        axis
            Its name, SNAME.
        sign
            +1 or -1: the direction.
        disabled
            Names of thrusters that must stand still.

        Returns
        -------
        float
            Its size [N, N m], never negative.
        """
        index = AXES.index(axis)
        wanted = vec6(sign * LARGEST_WRENCH if one == index else 0.0 for one in range(6))
        given = self.B @ np.array(self.forces(wanted, disabled))
        return abs(float(given[index]))

    def lost_axes(self, disabled: frozenset[str]) -> tuple[str, ...]:
        """Axes that cannot be served without the disabled thrusters."""
        return self._enabled(disabled, self.vehicle.supply_V).layout.lost_axes

    def _enabled(self, disabled: frozenset[str], supply_V: float) -> _ThrusterSet:
        if not (math.isfinite(supply_V) and supply_V > 0.0):
            raise UsageError(f"supply voltage: found {supply_V:g} V, wanted more than zero")
        return self._kept(disabled, round(supply_V, 1))


def bounded_axes(wrench: Vec6) -> tuple[Vec6, tuple[str, ...]]:
    """As `finite_axes`, with the rest within `LARGEST`."""
    if math.isfinite(sum(wrench)) and max(wrench) < LARGEST_WRENCH and min(wrench) > -LARGEST_WRENCH:
        return wrench, ()
    finite, refused = finite_axes(wrench)
    return vec6(max(-LARGEST_WRENCH, min(LARGEST_WRENCH, value)) for value in finite), refused


def difference(wanted: Vec6, achieved: Vec6) -> Vec6:
    """First wrench less the second."""
    a, b, c, d, e, f = wanted
    A, B, C, D, E, F = achieved
    return (a - A, b - B, c - C, d - D, e - E, f - F)
