"""One axis of a running session: its learner, its choice of sources, and what it keeps for the end of the run."""

from __future__ import annotations

import math

import numpy as np

from hindrax_core.readings import Vec6
from hindrax_core.state import ZERO6, Estimate, Thrust
from hindrax_core.vehicle import Vehicle
from hindrax_ident.belief import Belief
from hindrax_ident.bounds import bounded
from hindrax_ident.coriolis import Masses, coriolis, doubts
from hindrax_ident.faces import face_of
from hindrax_ident.intake import DEPTH_S, NAVIGATORS, Bin, Source, mean
from hindrax_ident.learner import Learner, Verdict
from hindrax_ident.models import Model, Motion, effect, known_force, lag_s, motions_of
from hindrax_ident.record import Record, Series, Stretch, series
from hindrax_ident.tuning import Tuning

ANGLE_S = 0.5
"""One measured angle in this time is enough: their errors are slow."""
LONGEST_DIFFERENCE_S = 0.5
"""Depths further apart make no velocity."""


class AxisRun:
    """Everything about one axis. Times in seconds from the start of the session."""

    def __init__(self, vehicle: Vehicle, model: Model, belief: Belief, tuning: Tuning) -> None:
        """Make an axis that has seen nothing."""
        self.model, self.belief = model, belief
        self._vehicle, self._tuning = vehicle, tuning
        self.lag_s = lag_s(vehicle, model.axis)
        self.learner = Learner(model, self.lag_s, belief, tuning)
        self._speed_source, self._depth_source = Source(), Source()
        self._speed_bin = Bin(tuning.bin_s)
        self._position_s = ANGLE_S if model.restores else 0.0
        self._depth_bin = Bin(DEPTH_S)
        self._depth_before: tuple[float, float] | None = None
        self._velocities: dict[str, list[tuple[float, float]]] = {}
        self._positions: dict[str, list[tuple[float, float]]] = {}
        self._per_newton = tuple(effect(vehicle, thruster)[model.axis] for thruster in vehicle.thrusters)
        self._thrusts: list[tuple[float, float]] = []
        self._efforts: list[tuple[float, float]] = []
        self._knows_efforts = bool(vehicle.thrusters)
        self._knowns: list[tuple[float, float]] = []
        self._motions: list[tuple[float, ...]] = []
        self._others: tuple[float, ...] = ZERO6
        self._hydrostatic = self._carried = 0.0
        self._faces = {motion.side: face_of(model, motion) for motion in motions_of(model.axis)}

    # ---- what comes in, in the order of time

    def thrust(self, t_s: float, thrust: Thrust) -> None:
        """What the thrusters are told from this time on."""
        force = thrust.wrench[self.model.axis]
        self._thrusts.append((t_s, force))
        self._efforts.append((t_s, self._effort(thrust.forces_N)))
        self.learner.thrust(t_s, force)

    def _effort(self, forces_N: tuple[float, ...]) -> float:
        """Sum of the squares of what each thruster adds: thrusters that push against each other are unsteady too."""
        if len(forces_N) != len(self._per_newton):
            self._knows_efforts = False
            return 0.0
        return sum((share * force) ** 2 for share, force in zip(self._per_newton, forces_N, strict=True))

    def motion(self, t_s: float, nu: Vec6, masses: Masses) -> None:
        """What moves on all axes from this time on, and the masses that are believed for now (see `coriolis`)."""
        axis = self.model.axis
        others = (*nu[:axis], 0.0, *nu[axis + 1 :])
        if others == self._others:
            return
        self._others = others
        self._motions.append((t_s, *others))
        self._carried = coriolis(axis, masses.values, nu)
        self.learner.known(t_s, self._hydrostatic + self._carried)

    def velocity(self, t_s: float, v: float, source: str, refusal: str) -> list[tuple[float, Verdict]]:
        """One velocity of one source: the verdicts on the means that it completes."""
        if not math.isfinite(v) or not self._speed_source.accepts(source) or self._is_derived:
            return []
        return self._learn(self._speed_bin.add(t_s, v), source, refusal)

    @property
    def _is_derived(self) -> bool:
        """Whether the velocity of this axis is made from depth: no instrument measures it."""
        return self.model.axis == 2 and bool(self._depth_source.name) and self._speed_source.name in ("", *NAVIGATORS)

    def attitude(
        self, t_s: float, attitude_rad: tuple[float, float, float], depth_m: float, refusal: str
    ) -> list[tuple[float, Verdict]]:
        """Attitude and depth: known forces, angles, and in heave the velocity made from depth."""
        axis = self.model.axis
        roll, pitch, _ = attitude_rad
        if axis < 2 and math.isfinite(roll) and math.isfinite(pitch):
            self._hydrostatic = known_force(self._vehicle, axis, attitude_rad)
            self._knowns.append((t_s, self._hydrostatic))
            self.learner.known(t_s, self._hydrostatic + self._carried)
        if axis in (3, 4) and math.isfinite(attitude_rad[axis - 3]):
            self._place(t_s, attitude_rad[axis - 3], "attitude")
        if axis == 2 and math.isfinite(depth_m):
            return self._sink(t_s, depth_m, "navigation" if math.isfinite(roll) else "depth", refusal)
        return []

    def _place(self, t_s: float, position: float, source: str) -> None:
        self.learner.position(t_s, position)
        kept = self._positions.setdefault(source, [])
        if not kept or t_s - kept[-1][0] >= self._position_s:
            kept.append((t_s, position))

    def _sink(self, t_s: float, depth_m: float, source: str, refusal: str) -> list[tuple[float, Verdict]]:
        if not self._depth_source.accepts(source):
            return []
        self._place(t_s, depth_m, source)
        if not self._is_derived:
            return []
        points = self._depth_bin.add(t_s, depth_m)
        if not points:
            return []
        before, self._depth_before = self._depth_before, mean(points)
        if before is None or self._depth_before[0] - before[0] > LONGEST_DIFFERENCE_S:
            return []
        (earlier_s, higher_m), (later_s, lower_m) = before, self._depth_before
        at_s, v = 0.5 * (earlier_s + later_s), (lower_m - higher_m) / (later_s - earlier_s)
        return [(at_s, self.learner.velocity(at_s, v, refusal, derived=True))]

    def _learn(self, points: list[tuple[float, float]], source: str, refusal: str) -> list[tuple[float, Verdict]]:
        if not points:
            return []
        t_s, v = mean(points)
        self._velocities.setdefault(source, []).append((t_s, v))
        return [(t_s, self.learner.velocity(t_s, v, refusal))]

    # ---- what goes out

    def estimate(self, motion: Motion, verdict: Verdict) -> Estimate:
        """Estimate of one motion after a sample; bounds are respected in what is told, not in what is learned."""
        theta, covariance = self.learner.estimate()
        face = self._faces[motion.side]
        values = theta[face.rows]
        values[face.mass] -= self.model.rigid
        block = covariance[face.square]
        return Estimate(
            motion=motion.name,
            names=face.names,
            units=face.units,
            values=tuple(bounded(values, block, face.low, face.high).tolist()),
            covariance=tuple(map(tuple, block.tolist())),
            samples=self.learner.samples,
            effective_samples=self.learner.effective_samples,
            learning=verdict.learned,
            reason=verdict.reason,
            innovation=verdict.innovation * self.learner.regression.rate * float(theta[-1]),
        )

    def record(self, stretches: tuple[Stretch, ...], plateaus: tuple[Stretch, ...], masses: Masses) -> Record:
        """What was kept, with the stretches of time in which it may be used."""
        velocities = [] if self._is_derived else self._velocities.get(self._speed_source.name, [])
        velocity = series(velocities)
        moved_s, *nu = np.array(self._motions or [(0.0,) * 7]).T
        position = series(self._positions.get(self._depth_source.name or "attitude", []))
        return Record(
            velocity=velocity,
            thrust=series(self._thrusts),
            effort=series(self._efforts if self._knows_efforts else []),
            stretches=stretches,
            known=series(self._knowns),
            carried=Series(moved_s, coriolis(self.model.axis, masses.values, nu)),
            doubts=tuple(Series(moved_s, error) for error in doubts(self.model.axis, masses, nu)),
            position=position,
            lag_s=self.lag_s,
            plateaus=plateaus,
        )
