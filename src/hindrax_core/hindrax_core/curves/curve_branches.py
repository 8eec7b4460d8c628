"""Thrust curves of the vehicle file and the check of their validity.

COB-2023-1394 eq. 1: F = c4 P^3 + c3 P^2 + c2 P + c1 with one cubic per direction.
"""

import math
from dataclasses import dataclass, replace

from hindrax_core.curves import cubic
from hindrax_core.knobs import fact, knob


@dataclass(frozen=True, slots=True)
class Branch:
    """One direction of a thrust curve: F = c4 P^3 + c3 P^2 + c2 P + c1, F in N, P in us. COB-2023-1394 eq. 1."""

    c: tuple[float, float, float, float] = fact(meaning="c1, c2, c3, c4 [N, N/us, N/us^2, N/us^3]")
    from_us: float = fact(500.0, 2500.0, "lower end of validity [us]")
    to_us: float = fact(500.0, 2500.0, "upper end of validity [us]")
    sigma: tuple[float, float, float, float] | None = knob(None, meaning="standard deviations of c, where known")

    def force_N(self, pulse_us: float) -> float:
        """Value of the cubic (Horner); no check of validity."""
        return cubic.value(self.c, pulse_us)


@dataclass(frozen=True, slots=True)
class Curve:
    """Thrust of one kind of thruster against the pulse at one supply voltage.

    Where a branch begins outside the dead band, thrust rises evenly from nothing at the band to the branch's weakest.

    `positive: null` in the file means the mirror image of the negative branch about the stop pulse: an assumption,
    and marked as one. Thrust is scaled by (V / supply_V) ** supply_exponent; the default is what the published bollard
    data of a comparable thruster show at full command from 10 to 20 V (Blue Robotics T200, 2019: 28.7 to 65.9 N).
    """

    negative: Branch
    positive: Branch | None = knob(None, meaning="positive branch; null: the mirror image of the negative one")
    stop_us: float = knob(1500.0, 1000.0, 2000.0, "pulse at rest, with which the output begins and ends too [us]")
    dead_band_us: float = knob(25.0, 0.0, 200.0, "half width of the band about the stop pulse without thrust [us]")
    supply_V: float = knob(14.8, 5.0, 60.0, "supply voltage at which the curve holds [V]")
    supply_exponent: float = knob(1.2, 0.0, 3.0, "power of the supply voltage with which thrust grows [-]")
    gain_sigma: float = knob(0.02, 0.0, 0.5, "standard deviation of the gain of the whole curve [-]")
    source: str = knob("", meaning="where the curve comes from")


def scaled(branch: Branch, gain: float) -> Branch:
    """Return the branch with every force multiplied by a gain."""
    c1, c2, c3, c4 = branch.c
    return replace(branch, c=(gain * c1, gain * c2, gain * c3, gain * c4))


def reflected(branch: Branch, stop_us: float) -> Branch:
    """Return the branch with its pulses reflected about the stop: G(P) = F(2 stop - P), multiplied out."""
    c3, c4 = branch.c[2:]
    a = 2.0 * stop_us
    c = (cubic.value(branch.c, a), -cubic.slope(branch.c, a), 3.0 * c4 * a + c3, -c4)
    return replace(branch, c=c, from_us=a - branch.to_us, to_us=a - branch.from_us)


def running_branches(curve: Curve) -> tuple[Branch, Branch]:
    """Negative and positive branch, cut where the dead band begins; a missing positive one is the mirror image."""
    negative = curve.negative
    positive = curve.positive or scaled(reflected(negative, curve.stop_us), -1.0)
    below = min(negative.to_us, curve.stop_us - curve.dead_band_us)
    above = max(positive.from_us, curve.stop_us + curve.dead_band_us)
    return replace(negative, to_us=below), replace(positive, from_us=above)


def problems_of(curve: Curve) -> list[str]:
    """Reasons why a curve is not a valid thrust curve, one sentence each; empty when it is valid."""
    negative, positive = running_branches(curve)
    found = [f"negative branch {text}" for text in _branch_problems(negative, -1.0)]
    found += [f"positive branch {text}" for text in _branch_problems(positive, 1.0)]
    return found


def _branch_problems(branch: Branch, sign: float) -> list[str]:
    if not all(math.isfinite(number) for number in (*branch.c, branch.from_us, branch.to_us)):
        return [f"has coefficients {branch.c}, wanted finite numbers"]
    if branch.from_us >= branch.to_us:
        return [f"runs from {branch.from_us:g} to {branch.to_us:g} us outside the dead band, wanted a rising range"]
    wanted = "positive" if sign > 0.0 else "negative"
    ends = ((pulse_us, branch.force_N(pulse_us)) for pulse_us in (branch.from_us, branch.to_us))
    wrong = [f"gives {force:.4g} N at {at:g} us, wanted a {wanted} force" for at, force in ends if force * sign < 0.0]
    low, high = branch.from_us, branch.to_us
    turns = [f"{point:.1f}" for point in cubic.stationary_points(branch.c) if low < point < high]
    if turns:
        return [f"is not monotone: it turns at {' and '.join(turns)} us, within {low:g} to {high:g} us", *wrong]
    if branch.force_N(low) >= branch.force_N(high):
        return [f"does not rise from {low:g} to {high:g} us, wanted thrust that grows with the pulse", *wrong]
    return wrong
