"""A vehicle that another simulator moves: the plant of the mock follows it, and no law of ours acts.

Everything else of the mock stays as it is, so the real drivers read real bytes of emulated devices, whose truth is what
the other program computes; its thrusters get the forces of the pulses that the output really has.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple, TypeVar, cast

from hindrax_core.readings import Quaternion, Vec3, Vec6
from hindrax_core.vehicle import Vehicle
from hindrax_sim.physics.plant import Influence, Plant, ThrustLoss

VectorT = TypeVar("VectorT", Vec3, Vec6)
KEPT_S = 0.5
"""Length of the track that is kept behind the time of the plant."""


class Sample(NamedTuple):
    """The other simulator's vehicle at one time [s]: place of the center of mass in the pool, attitude, velocities.

    SNAME: the pool's axes are x along its length, y to the right of that, z down from the surface; velocities
    `u v w p q r` [m/s, rad/s] are over ground, in body axes.
    """

    time_s: float
    position_m: Vec3
    attitude: Quaternion
    velocity: Vec6


class FollowedPlant(Plant):
    """State of a vehicle that is simulated elsewhere, at any time that its samples have reached.

    The first sample is at the time that the plant has then.
    """

    __slots__ = ("_samples", "_shift_s")
    confined = False

    def __init__(
        self, vehicle: Vehicle, influences: Sequence[Influence] = (), losses: Sequence[ThrustLoss] = ()
    ) -> None:
        self._samples: list[Sample] = []
        self._shift_s = 0.0
        super().__init__(vehicle, influences, losses)

    def follow(self, sample: Sample) -> None:
        """Take one more sample of another simulator.

        One of the same time is dropped: a simulator that is paused may go on saying so.

        Parameters
        ----------
        sample
            State at a time of the simulator's clock.

        Raises
        ------
        ValueError
            Where it is no state, or of an earlier time than the last one.
        """
        if not all(map(math.isfinite, (sample.time_s, *sample.position_m, *sample.attitude, *sample.velocity))):
            raise ValueError("found a state with a number that is none")
        if abs(math.hypot(*sample.attitude) - 1.0) > 0.01:
            raise ValueError(f"found an attitude of norm {math.hypot(*sample.attitude):.3f}, wanted a unit quaternion")
        if not self._samples:
            self._shift_s = self.time_s - sample.time_s
        elif sample.time_s == self._samples[-1].time_s:
            return
        elif sample.time_s < self._samples[-1].time_s:
            raise ValueError(f"found the time {sample.time_s:.3f} s after {self._samples[-1].time_s:.3f} s")
        self._samples.append(sample)
        old = bisect_right(self._samples, self.time_s - self._shift_s - KEPT_S, key=lambda one: one.time_s)
        del self._samples[: max(0, min(old, len(self._samples) - 2))]

    @property
    def followed(self) -> bool:
        """Whether there is anything to follow."""
        return bool(self._samples)

    @property
    def reached_s(self) -> float:
        """Time of the plant up to which it can be stepped [s]; that of now without samples."""
        return self._samples[-1].time_s + self._shift_s if self._samples else self.time_s

    def step(self, dt: float) -> None:
        """Take the state `dt` seconds later, between the two samples around that time; at rest without any."""
        self.time_s += dt
        if not self._samples:
            return
        at_s = self.time_s - self._shift_s
        index = min(max(1, bisect_right(self._samples, at_s, key=lambda one: one.time_s)), len(self._samples) - 1)
        before, after = self._samples[max(0, index - 1)], self._samples[index]
        span_s = after.time_s - before.time_s
        share = min(1.0, max(0.0, (at_s - before.time_s) / span_s)) if span_s > 0.0 else 1.0
        was = self.u, self.v, self.w, self.p, self.q, self.r
        self.x, self.y, self.z = _between(before.position_m, after.position_m, share)
        self._turn(before.attitude, after.attitude, share)
        self.u, self.v, self.w, self.p, self.q, self.r = now = _between(before.velocity, after.velocity, share)
        rates = [
            (b - a) / span_s if span_s > 0.0 else 0.0 for a, b in zip(before.velocity, after.velocity, strict=True)
        ]
        self.du, self.dv, self.dw, self.dp, self.dq, self.dr = rates
        covered = [0.5 * (a + b) * dt for a, b in zip(was, now, strict=True)]
        self.sx, self.sy, self.sz = self.sx + covered[0], self.sy + covered[1], self.sz + covered[2]
        self.ax, self.ay, self.az = self.ax + covered[3], self.ay + covered[4], self.az + covered[5]

    def _turn(self, before: Quaternion, after: Quaternion, share: float) -> None:
        """Attitude between two that are near each other: along the chord; q and -q are the same one."""
        side = 1.0 if sum(a * b for a, b in zip(before, after, strict=True)) >= 0.0 else -1.0
        mixed = [a + share * (side * b - a) for a, b in zip(before, after, strict=True)]
        norm = math.hypot(*mixed)
        self.qw, self.qx, self.qy, self.qz = (one / norm for one in mixed)


def _between(before: VectorT, after: VectorT, share: float) -> VectorT:
    mixed = (a + share * (b - a) for a, b in zip(before, after, strict=True))
    return cast("VectorT", tuple(mixed))
