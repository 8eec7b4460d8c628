"""Dead bands: how far from the stop pulse the thrusters of a curve begin to push, all of them in a gentle turn.

    ladder = DeadBandLadder(vehicle, found)
    while (pulses := ladder.climb(share_of)) is not None: fly Goal((), pulses=pulses)
    findings = ladder.findings()

One number of the file holds for all thrusters of a curve, so those of them that turn the vehicle are asked together:
forth, back, forth. A rung is a width of the band that may be the true one: does the vehicle turn by half of what it
should, thrusters begin before it. A curve that begins with a step is asked just there. One that begins with nothing
gives half only further from the stop, and is asked there: just beyond the band, a few microseconds would look like
thrusters that stand. Rungs go further from the stop until the vehicle turns; then once between the last two. Pulses
within the band of the file cannot be asked for, so a band that is narrower than claimed is not found; it does no harm.
What is compared is the turn at a few pulses with the one at 3 N, so the inertia of the prior, which both share, takes
no part.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix
from hindrax_control.allocation.thrust_curve import thrust_curves
from hindrax_control.commissioning.findings import MEASURED, PROVEN, WRONG, Finding, Mend
from hindrax_control.commissioning.response import Prior
from hindrax_control.maneuver.goal import MOST_PULSE_N, Pulse
from hindrax_core.thrust.curves import running
from hindrax_core.vehicle import Vehicle

QUARTER_S = 0.25
STEP_us = 8.0
"""Between two rungs; a band that is wider by less is as claimed: two thrusters differ by as much."""
CLOSE_us = 4.0
YAW = 5
LEAST_TURN_radps = 0.05
"""Turn that a gyroscope shows beyond doubt in water that moves."""
MOST_TURN_radps = 0.8
LEAST_SHARE = 0.3
"""Share of the best lever about the vertical from which on a thruster is used."""
RUNS, UNSURE = 0.5, 0.25
"""Share of the expected turn from which on the thrusters run, and the deviation beyond which it says nothing."""

ShareOf: TypeAlias = Callable[[], tuple[float, float]]
"""Of the last pulses: what turned, as a share of what thrusters that run would turn, and its deviation; NaN unknown."""


@dataclass
class Rungs:
    """One curve: which of its thrusters turn the vehicle and which way, and what was seen how far from the stop."""

    name: str
    users: tuple[int, ...]
    signs: tuple[float, ...]
    band_us: float
    """Half width by the file, on its wider side; the others are half widths that were asked for."""
    next_us: float | None
    stands_us: float = 0.0
    runs_us: float | None = None
    least_us: float = 0.0
    """The first one: closer to the stop, the turn would be too small to be seen."""
    unsure: bool = False


@dataclass
class DeadBandLadder:
    """The curves of one vehicle, one after the other; `found`: effectiveness (6, n) as the pulses showed it."""

    vehicle: Vehicle
    found: Matrix
    curves: list[Rungs] = field(default_factory=list)
    _asked: Rungs | None = None

    def __post_init__(self) -> None:
        """Choose the thrusters and the first pulse of every curve."""
        self._thrust = thrust_curves(self.vehicle)
        self._inertia = float(Prior(self.vehicle).inertia[YAW])
        levers = self.found[YAW]
        most = float(np.max(np.abs(levers), initial=0.0))
        for name in dict.fromkeys(one.curve for one in self.vehicle.thrusters):
            mine = [
                index
                for index, one in enumerate(self.vehicle.thrusters)
                if one.curve == name and most and abs(levers[index]) >= LEAST_SHARE * most
            ]
            curve = self.vehicle.curves[name]
            below_us, above_us = running(curve, self.vehicle.supply_V).dead_us
            band_us = max(curve.stop_us - below_us, above_us - curve.stop_us)
            rungs = Rungs(name, tuple(mine), tuple(float(np.sign(levers[index])) for index in mine), band_us, None)
            rungs.next_us = rungs.least_us = self._first_us(rungs) if mine else 0.0
            rungs.next_us = rungs.next_us or None
            self.curves.append(rungs)

    def climb(self, share_of: ShareOf) -> tuple[Pulse, ...] | None:
        """Judge the last pulses by what they turned, and return the next ones; None when every curve is known."""
        if self._asked is not None:
            self._judge(self._asked, *share_of())
        self._asked = next((one for one in self.curves if one.next_us is not None), None)
        return self._pulses(self._asked) if self._asked is not None else None

    def _judge(self, rungs: Rungs, share: float, sigma: float) -> None:
        at_us = rungs.next_us or 0.0
        if not sigma <= UNSURE:  # nor is NaN
            rungs.unsure, rungs.next_us = True, None
            return
        if share > RUNS:
            rungs.runs_us = at_us
        else:
            rungs.stands_us = at_us
        if rungs.runs_us is None:
            further_us = at_us + STEP_us
            rungs.next_us = further_us if self._at_us(rungs, further_us) else None
        else:
            close = not rungs.stands_us or rungs.runs_us - rungs.stands_us <= CLOSE_us
            rungs.next_us = None if close else 0.5 * (rungs.stands_us + rungs.runs_us)

    def findings(self) -> Iterator[Finding]:
        """Say of every curve how far from the stop its thrusters stand, as far as it was shown."""
        for rungs in self.curves:
            claim, claimed = f"dead band of {rungs.name}", f"{rungs.band_us:g} us"
            if rungs.unsure or (rungs.runs_us is None and not rungs.stands_us):
                why = "the water turns it as much" if rungs.unsure else "its thrusters turn nothing"
                yield Finding(claim, MEASURED, claimed, f"not shown: {why}")
            elif rungs.stands_us:
                yield self._wider(rungs, claim, claimed)
            else:
                proven = rungs.least_us <= rungs.band_us + STEP_us
                beyond = "" if proven else "; closer to the stop nothing shows"
                found = f"they run at {rungs.least_us:.0f} us from the stop{beyond}"
                yield Finding(claim, PROVEN if proven else MEASURED, claimed, found)

    def _wider(self, rungs: Rungs, claim: str, claimed: str) -> Finding:
        until = f", run at {rungs.runs_us:.0f} us" if rungs.runs_us is not None else ""
        found = f"they stand at {rungs.stands_us:.0f} us from the stop{until}"
        if rungs.runs_us is None or self.vehicle.curves[rungs.name].table is not None:
            remedy = "measure the curve again, and write it into the file"
            return Finding(claim, WRONG, claimed, found, remedy=remedy)
        mend = Mend(("curves", rungs.name, "dead_band_us"), round(rungs.runs_us))
        return Finding(claim, WRONG, claimed, found, mends=(mend,))

    def _first_us(self, rungs: Rungs) -> float:
        """First half width to ask for [us]: beyond the band, and with a turn that is large enough; 0: there is none."""
        begins_us = rungs.band_us + STEP_us
        while 0.0 < self._turn_radps(rungs, self._at_us(rungs, begins_us)) < LEAST_TURN_radps:
            begins_us += 1.0
        return begins_us if self._at_us(rungs, begins_us) else 0.0

    def _at_us(self, rungs: Rungs, begins_us: float) -> float:
        """Distance of the pulse from the stop [us] at which a curve that begins there gives half of the file's.

        0: there is none, or it is beyond what is harmless.
        """
        wider_us, at_us = begins_us - rungs.band_us, begins_us
        while (turn_radps := self._turn_radps(rungs, at_us)) > 0.0:
            if self._turn_radps(rungs, at_us - wider_us) >= RUNS * turn_radps:
                return at_us
            at_us += 1.0
        return 0.0

    def _turn_radps(self, rungs: Rungs, at_us: float) -> float:
        """Turn [rad/s] of a quarter at this distance from the stop; 0 where it is beyond what is harmless."""
        forces_N = np.array(self._forces_N(rungs, at_us, 1.0))
        turn = float(abs(self.found[YAW] @ forces_N)) * QUARTER_S / self._inertia
        return turn if np.max(np.abs(forces_N)) <= MOST_PULSE_N and turn <= MOST_TURN_radps else 0.0

    def _forces_N(self, rungs: Rungs, at_us: float, way: float) -> tuple[float, ...]:
        """Forces (n,) that a pulse at this distance from the stop gives, on the side where it turns this way."""
        forces_N = [0.0] * len(self._thrust)
        for index, sign in zip(rungs.users, rungs.signs, strict=True):
            curve = self._thrust[index]
            both = (curve.force(curve.stop_us + at_us), curve.force(curve.stop_us - at_us))
            forces_N[index] = max(both) if sign * way > 0.0 else min(both)
        return tuple(forces_N)

    def _pulses(self, rungs: Rungs) -> tuple[Pulse, ...]:
        at_us = self._at_us(rungs, rungs.next_us or 0.0)
        return tuple(
            Pulse(self._forces_N(rungs, at_us, way), quarters * QUARTER_S, calm=at == 0)
            for at, (way, quarters) in enumerate(((1.0, 1), (-1.0, 2), (1.0, 1)))
        )
