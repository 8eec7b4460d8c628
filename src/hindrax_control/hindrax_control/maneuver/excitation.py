"""Information-rich excitation: steps, doublets, chirps and multisines, bounded and seeded.

A signal is a function of time with values in [-1, 1]; the same seed gives the same signal. What keeps the vehicle in
its room is in `Excite`: near the edge a spring and a damper take over from the signal.
"""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from hindrax_control.maneuver.leg import LegOutput

Signal: TypeAlias = Callable[[float], float]

SINES = 9
FREE_SHARE = 0.5
"""Share of the room, about its middle, in which the signal rules alone."""
FADE = 4.0
"""Within a quarter of the way from there to the end of the room, the signal loses its outward push."""
MOST_FORCE = 1.5
"""Largest force, as a multiple of the signal's."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds of an excitation: force, rate and room about the middle; and its inertia."""

    force: float
    rate: float
    middle: float
    room: float
    inertia: float

    @property
    def slowest_Hz(self) -> float:
        """Frequency below which a swing at full rate would leave half of the room."""
        return self.rate / (math.tau * FREE_SHARE * self.room)


def signal(kind: str, seed: int, seconds: float, slowest_Hz: float) -> Signal:
    """Make one of the excitations of a goal.

    Parameters
    ----------
    kind
        steps, doublets, chirp or multisine.
    seed
        Of what is random in it.
    seconds : [s]
        Its duration.
    slowest_Hz : [Hz]
        Nothing in it is slower.

    Returns
    -------
    Signal
        A share of the largest thrust over time [-].
    """
    makers = {"steps": _steps, "doublets": _doublets, "chirp": _chirp, "multisine": _multisine}
    return makers[kind](random.Random(seed), seconds, slowest_Hz)  # noqa: S311  # a test signal, not a secret


def _steps(rng: random.Random, seconds: float, slowest_Hz: float) -> Signal:
    """Levels in random order, each followed by its opposite, so that the way covered cancels."""
    half_s = 0.3 / slowest_Hz
    pairs = max(1, round(seconds / (2.0 * half_s)))
    levels = [(index + 1) / pairs for index in range(pairs)]
    rng.shuffle(levels)
    values = [sign * level for level in levels for sign in rng.sample((1.0, -1.0), 2)]
    return lambda t: values[min(len(values) - 1, max(0, int(t / half_s)))]


def _doublets(rng: random.Random, seconds: float, slowest_Hz: float) -> Signal:
    """Doublets of random width and size, a pause of one width after each."""
    edges: list[tuple[float, float]] = []
    begin = 0.0
    while begin < seconds:
        width_s, size = rng.uniform(0.15, 0.5) / slowest_Hz, rng.uniform(0.4, 1.0) * rng.choice((-1.0, 1.0))
        edges += [(begin, size), (begin + width_s, -size), (begin + 2.0 * width_s, 0.0)]
        begin += 3.0 * width_s

    def at(t: float) -> float:
        return next((value for since, value in reversed(edges) if t >= since), 0.0)

    return at


def _chirp(rng: random.Random, seconds: float, slowest_Hz: float) -> Signal:
    """A sine whose frequency grows evenly over three octaves and a half; the seed gives its phase."""
    phase, fastest_Hz = rng.uniform(0.0, math.tau), 11.0 * slowest_Hz
    growth = (fastest_Hz - slowest_Hz) / seconds
    return lambda t: math.sin(phase + math.tau * (slowest_Hz + 0.5 * growth * t) * t)


def _multisine(rng: random.Random, seconds: float, slowest_Hz: float) -> Signal:
    """Sines an even distance apart with random phases, scaled to a peak of one."""
    sines = [(math.tau * slowest_Hz * (1.0 + 0.9 * index), rng.uniform(0.0, math.tau)) for index in range(SINES)]

    def sum_at(t: float) -> float:
        return sum(math.sin(w * t + phase) for w, phase in sines)

    samples = 40 * SINES * max(1, round(seconds * slowest_Hz))
    peak = max(abs(sum_at(seconds * index / samples)) for index in range(samples))
    return lambda t: max(-1.0, min(1.0, sum_at(t) / peak))


class Excite:
    """Drives one degree of freedom with a signal for a while, within bounds.

    Beyond the edge of its part of the room the signal may no longer push outward, a spring pulls back, and a damper
    takes the speed off: a current or an unlucky signal does not carry the vehicle away.
    """

    def __init__(self, wanted: Signal, bounds: Bounds, seconds: float) -> None:
        self.seconds = seconds
        self.ends = (bounds.middle - bounds.room, bounds.middle + bounds.room)
        self._signal, self._bounds = wanted, bounds
        self._started_s: float | None = None
        self._margin = (1.0 - FREE_SHARE) * bounds.room
        self._stiffness = MOST_FORCE * bounds.force / self._margin
        self._damping = 2.0 * math.sqrt(self._stiffness * bounds.inertia)

    def step(self, coordinate: float, rate: float, time_s: float, *, trusted: bool = True) -> LegOutput:  # noqa: ARG002
        """Drive on.

        Parameters
        ----------
        coordinate : [m, rad]
            Along the motion.
        rate : [m/s, rad/s]
            Of the coordinate.
        time_s : [s]
            Since the start of the leg.
        trusted
            Whether the rate is measured: an excitation does not ask.

        Returns
        -------
        LegOutput
            Force beyond bias and restoring [N, N m], phase, and whether the leg is over.
        """
        if self._started_s is None:
            self._started_s = time_s
        elapsed_s = time_s - self._started_s
        bounds = self._bounds
        force = bounds.force * self._signal(elapsed_s)
        off = coordinate - bounds.middle
        side, beyond = math.copysign(1.0, off), abs(off) - FREE_SHARE * bounds.room
        if beyond > 0.0:
            outward = max(0.0, force * side) * min(1.0, FADE * beyond / self._margin)
            force -= side * (outward + self._stiffness * beyond + self._damping * max(0.0, rate * side))
        most = MOST_FORCE * bounds.force
        return LegOutput(max(-most, min(most, force)), "excite", finished=elapsed_s >= self.seconds)
