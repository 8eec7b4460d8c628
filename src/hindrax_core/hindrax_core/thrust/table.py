"""Thrust as a table: forces measured at the same pulses and at one or several supply voltages.

Between pulses and between voltages it is linear, so force and pulse are exact inverses of each other and thrust that
rises in every row rises at every voltage between them.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from hindrax_core.knobs import fact, knob


@dataclass(frozen=True, slots=True)
class Polyline:
    """One direction of a table at one voltage: two knots or more, pulses [us] that rise, forces [N] that do or fall."""

    pulse_us: tuple[float, ...]
    forces_N: tuple[float, ...]

    @property
    def from_us(self) -> float:
        """Lower end of validity [us]."""
        return self.pulse_us[0]

    @property
    def to_us(self) -> float:
        """Upper end of validity [us]."""
        return self.pulse_us[-1]

    def force_N(self, pulse_us: float) -> float:
        """Force [N] of a pulse between the ends."""
        return _between(self.pulse_us, self.forces_N, pulse_us)

    def inverse(self) -> Callable[[float], float]:
        """Pulse [us] of a force [N], exactly; that of the end for a force beyond it."""
        falls = self.forces_N[0] > self.forces_N[-1]  # of a thruster that turns the other way round
        pulses, forces = (self.pulse_us[::-1], self.forces_N[::-1]) if falls else (self.pulse_us, self.forces_N)
        least, most = forces[0], forces[-1]

        def solve(force_N: float) -> float:
            if force_N <= least:
                return pulses[0]
            return pulses[-1] if force_N >= most else _between(forces, pulses, force_N)

        return solve

    def scaled(self, gain: float) -> "Polyline":
        """The same with every force multiplied by a gain, which is positive."""
        return Polyline(self.pulse_us, tuple(gain * force for force in self.forces_N))

    def reflected(self, stop_us: float) -> "Polyline":
        """The same with its pulses reflected about the stop: G(P) = F(2 stop - P)."""
        return Polyline(tuple(2.0 * stop_us - pulse for pulse in reversed(self.pulse_us)), self.forces_N[::-1])

    def cut(self, from_us: float, to_us: float) -> "Polyline":
        """The part between two pulses, or the end that is nearest where no part is."""
        low, high = max(from_us, self.from_us), min(to_us, self.to_us)
        inside = [pulse for pulse in self.pulse_us if low < pulse < high]
        pulses = (low, *inside, high)
        return Polyline(pulses, tuple(self.force_N(pulse) for pulse in pulses))


def _between(at: Sequence[float], values: Sequence[float], x: float) -> float:
    """Value at x on the straight line between the knots about it."""
    index = min(max(bisect_right(at, x), 1), len(at) - 1)
    before, after = at[index - 1], at[index]
    part = (x - before) / (after - before)
    return (1.0 - part) * values[index - 1] + part * values[index]  # at a knot exactly the knot


@dataclass(frozen=True, slots=True)
class ThrustTable:
    """Forces at rising pulses, a row for each of the rising supply voltages; zeros are the dead band."""

    pulse_us: tuple[float, ...] = fact(500.0, 2500.0, "pulses of the knots, rising [us]")
    supply_V: tuple[float, ...] = fact(5.0, 60.0, "supply voltages of the rows, rising [V]")
    force_N: tuple[tuple[float, ...], ...] = fact(
        -1e5, 1e5, "a row of forces for each voltage, a force for each pulse [N]"
    )
    sigma_N: float = knob(0.0, 0.0, 1e4, "standard deviation of all forces of one direction together [N]")

    def __post_init__(self) -> None:
        """Check the shape; `problems` checks the thrust."""
        for name, axis, least in (("pulse_us", self.pulse_us, 4), ("supply_V", self.supply_V, 1)):
            if len(axis) < least or any(a >= b for a, b in pairwise(axis)):
                raise ValueError(f"{name}: found {list(axis)}, wanted {least} or more numbers that rise")
        if len(self.force_N) != len(self.supply_V):
            raise ValueError(
                f"force_N: found {len(self.force_N)} rows, wanted one for each of {len(self.supply_V)} voltages"
            )
        for volts, row in zip(self.supply_V, self.force_N, strict=True):
            if len(row) != len(self.pulse_us):
                raise ValueError(f"force_N at {volts:g} V: found {len(row)} forces, wanted {len(self.pulse_us)}")

    def nearest_V(self, volts: float) -> float:
        """The voltage [V] within those of the table that is nearest to one."""
        return min(max(volts, self.supply_V[0]), self.supply_V[-1])

    def row_at(self, volts: float, exponent: float) -> tuple[float, ...]:
        """Forces at the pulses of the table at a voltage: (n,) [N]. Beyond the voltages of the table by a power."""
        inside_V = self.nearest_V(volts)
        gain = 1.0 if inside_V == volts else math.pow(volts / inside_V, exponent)
        index = min(max(bisect_left(self.supply_V, inside_V), 1), len(self.supply_V) - 1)
        if index < 1:
            return tuple(gain * force for force in self.force_N[0])
        below, above = self.supply_V[index - 1], self.supply_V[index]
        part = (inside_V - below) / (above - below)
        rows = zip(self.force_N[index - 1], self.force_N[index], strict=True)
        return tuple(gain * ((1.0 - part) * low + part * high) for low, high in rows)

    def at(self, volts: float, stop_us: float, exponent: float) -> tuple[Polyline, Polyline, tuple[float, float]]:
        """The curve at one voltage. A flat end, where the speed controller gives no more, is left out.

        Parameters
        ----------
        volts
            Supply [V].
        stop_us
            Pulse at which the thruster stands [us].
        exponent
            Of the voltage, by which forces change beyond the voltages of the table [-].

        Returns
        -------
        tuple[Polyline, Polyline, tuple[float, float]]
            Negative and positive direction, and the ends of the dead band between them [us].
        """
        row = self.row_at(volts, exponent)
        knots = list(zip(self.pulse_us, row, strict=True))
        negative = _without_flat([(pulse, force) for pulse, force in knots if force < 0.0])
        positive = _without_flat([(pulse, force) for pulse, force in knots if force > 0.0][::-1])[::-1]
        still = [stop_us, *(pulse for pulse, force in knots if force == 0.0)]
        return _line(negative), _line(positive), (min(still), max(still))

    def problems(self, stop_us: float) -> list[str]:
        """Reasons why the table holds no thrust curve, one sentence each; empty when it does."""
        return [
            text
            for volts, row in zip(self.supply_V, self.force_N, strict=True)
            for text in self._of(volts, row, stop_us)
        ]

    def _of(self, volts: float, row: Sequence[float], stop_us: float) -> list[str]:
        knots = list(zip(self.pulse_us, row, strict=True))
        wrong = [
            f"table at {volts:g} V gives {force:.4g} N at {pulse:g} us, wanted {wanted}"
            for pulse, force in knots
            for wanted in [_wanted(pulse - stop_us, force)]
            if wanted
        ]
        wrong += [
            f"table at {volts:g} V gives nothing at {pulse:g} us, and thrust nearer to the stop pulse"
            for pulse, force in knots
            if force == 0.0
            and any(push and 0.0 < (at - stop_us) / (pulse - stop_us) < 1.0 for at, push in knots if pulse != stop_us)
        ]
        for name, part in (
            ("negative", _without_flat([one for one in knots if one[1] < 0.0])),
            ("positive", _without_flat([one for one in knots if one[1] > 0.0][::-1])[::-1]),
        ):
            if len(part) < 2:
                wrong.append(f"table at {volts:g} V has {len(part)} {name} forces that rise, wanted two or more")
            wrong += [
                f"table at {volts:g} V does not rise from {a:g} to {b:g} us ({low:.4g} to {high:.4g} N), "
                "wanted thrust that grows with the pulse"
                for (a, low), (b, high) in pairwise(part)
                if low >= high
            ]
        return wrong


def _wanted(offset_us: float, force_N: float) -> str:
    if offset_us == 0.0:
        return "none at the stop pulse" if force_N else ""
    return (
        ("none or a negative force" if offset_us < 0.0 else "none or a positive force")
        if offset_us * force_N < 0.0
        else ""
    )


def _without_flat(knots: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Knots from the end of full thrust inwards, without those before the last of equal force."""
    while len(knots) > 1 and knots[0][1] == knots[1][1]:
        knots = knots[1:]
    return knots


def _line(knots: Sequence[tuple[float, float]]) -> Polyline:
    return Polyline(tuple(pulse for pulse, _ in knots), tuple(force for _, force in knots))
