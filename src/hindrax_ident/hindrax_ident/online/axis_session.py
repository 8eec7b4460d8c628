"""One axis of a running session: its estimator, its choice of sources, and its record for the final fit."""

import math
from operator import mul

import numpy as np

from hindrax_core.readings import Vec6
from hindrax_core.signals import NAN, ZERO6, Estimate, Supply, Thrust
from hindrax_core.text.coded import Coded
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.model.coriolis import Masses, coriolis, coriolis_errors
from hindrax_ident.model.model_parameters import Prior, bounded, reported_parameters
from hindrax_ident.model.motion_model import (
    Model,
    Motion,
    areas_across,
    known_force,
    lag_s,
    motions_of,
    speed_across,
    unit_wrench,
    weights_across,
)
from hindrax_ident.online.axis_estimator import AxisEstimator
from hindrax_ident.online.cross_forces import CrossForces
from hindrax_ident.online.sample_verdict import LEARNED, NotLearned, SampleVerdict, not_learned
from hindrax_ident.records.axis_record import (
    NO_FORCES,
    Record,
    Samples,
    Series,
    Stretch,
    ThrusterForces,
    between_samples,
    series,
)
from hindrax_ident.records.binning import DEPTH_S, NAVIGATORS, SONAR, WAY_S, Bin, SourceSelector, mean
from hindrax_ident.records.driven import RunningDrive
from hindrax_ident.tuning import USUAL_LAG_S, USUAL_LATENCY_S, Tuning

ANGLE_S = 0.5
"""Interval at which measured angles are kept: their errors are slow."""
LONGEST_DIFFERENCE_S = 0.5
"""Longest time between depths that give a velocity; between ways in proportion."""
DEEPEST_m = 12e3
"""Depths beyond this are no measurements: the oceans end before."""


class AxisSession:
    """One axis. Times in seconds from the start of the session."""

    def __init__(
        self, vehicle: Vehicle, model: Model, prior: Prior, tuning: Tuning, cross: CrossForces | None = None
    ) -> None:
        """`cross`: what the other axes do, for the live estimate; None where they are held."""
        self.model, self.prior = model, prior
        self._vehicle, self._tuning = vehicle, tuning
        lag = lag_s(vehicle, model.axis)
        self.lag_s = 0.0 if lag is None else lag
        # What the velocities were late by was taken off their stamps where it is known (`feed`).
        latency_s = USUAL_LATENCY_S if tuning.velocity_latency_s is None else 0.0
        self._prior_delays_s = (USUAL_LAG_S if lag is None else lag), latency_s
        self.estimator = AxisEstimator(model, self.lag_s, prior, tuning, self._prior_delays_s[0], cross=cross)
        self.drive = RunningDrive() if cross else None
        self._speed_source, self._way_source = SourceSelector(), SourceSelector()
        self._speed_bin = Bin(tuning.bin_s)
        self._position_s = ANGLE_S if model.restores else 0.0
        self._way_s = DEPTH_S if model.axis == 2 else WAY_S
        self._way_bin = Bin(self._way_s)
        self._way_before: tuple[float, float] | None = None
        self._velocities: dict[str, Samples[tuple[float, float]]] = {}
        self._positions: dict[str, Samples[tuple[float, float]]] = {}
        self._per_newton = tuple(unit_wrench(vehicle, thruster)[model.axis] for thruster in vehicle.thrusters)
        self._thrusts: Samples[tuple[float, Thrust]] = Samples()
        self._efforts: Samples[float | None] = Samples()
        self._hydrostatics: Samples[tuple[float, float]] = Samples()
        self._other_velocities: Samples[tuple[float, ...]] = Samples()
        self._others: tuple[float, ...] = ZERO6
        self._hydrostatic = self._coriolis = 0.0
        self._across: list[float] = weights_across(vehicle, model.axis).tolist()
        self._areas: list[float] = areas_across(vehicle, model.axis).tolist() if model.turns else []
        self._reported = {motion.side: reported_parameters(model, motion) for motion in motions_of(model.axis)}

    # ---- inputs, in time order

    def thrust(self, t_s: float, thrust: Thrust) -> None:
        """Thrust commanded from this time on."""
        self._thrusts.append((t_s, thrust))
        effort = self._effort(thrust)
        self._efforts.append(effort)
        self.estimator.thrust(t_s, thrust.wrench[self.model.axis], effort)
        if self.drive:
            self.drive.thrust(t_s, thrust.wrench[self.model.axis])

    def _effort(self, thrust: Thrust) -> float | None:
        """Effort of one thrust, also of thrusters that oppose each other; None where it lacks some forces."""
        if not self._per_newton or len(thrust.forces_N) != len(self._per_newton):
            return None
        parts = [share * force for share, force in zip(self._per_newton, thrust.forces_N, strict=True)]
        return sum(part * part for part in parts)  # a power of a huge number raises, a product does not

    def _of_forces(self) -> tuple[Series, ThrusterForces]:
        """Effort of a record, and the forces of all thrusters; empty where one thrust lacks them."""
        efforts = [one for one in self._efforts if one is not None]
        if not efforts or len(efforts) < len(self._thrusts):
            return series([]), NO_FORCES
        times, forces = [t for t, _ in self._thrusts], np.array([one.forces_N for _, one in self._thrusts])
        order = np.argsort(times, kind="stable")
        acting = ThrusterForces(array(np.array(times)[order]), array(np.array(self._per_newton)), array(forces[order]))
        return series(list(zip(times, efforts, strict=True))), acting

    def motion(self, t_s: float, nu: Vec6, masses: Masses, measured: Vec6 | None = None) -> None:
        """Velocities of all axes from this time on: with the masses they cause forces on this one (`coriolis`).

        Parameters
        ----------
        t_s : [s]
            In time order.
        nu : (6,) [m/s, rad/s]
            Body velocities; that of the own axis does not count.
        masses
            Present estimates of the masses.
        measured : (6,) [m/s, rad/s]
            Those that were measured at this time, NaN elsewhere; None: all. The record has lines between these.
        """
        axis = self.model.axis
        others = (*nu[:axis], 0.0, *nu[axis + 1 :])
        fresh = (
            others if measured is None or not self._other_velocities else (*measured[:axis], NAN, *measured[axis + 1 :])
        )
        if any(map(math.isfinite, fresh)):
            self._other_velocities.append((t_s, *fresh))
        if others == self._others:
            return
        self._others = others
        self._coriolis = coriolis(axis, masses.values, nu)
        if self.model.crossed:
            self.estimator.across(t_s, math.hypot(*map(mul, self._across, nu)), math.hypot(*map(mul, self._areas, nu)))
        self.estimator.others(t_s, others)
        self.estimator.known(t_s, self._hydrostatic + self._coriolis)

    def velocity(
        self, t_s: float, v: float, source: str, refusal: Coded[NotLearned] = LEARNED
    ) -> list[tuple[float, SampleVerdict]]:
        """Add one velocity of one source; a mean over a bin is learned from.

        Parameters
        ----------
        t_s : [s]
            In time order.
        v : [m/s, rad/s]
            Along the axis; NaN is left out.
        source
            Instrument or navigator; one of them counts.
        refusal
            Why the estimate is not to be updated, if so.

        Returns
        -------
        list[tuple[float, SampleVerdict]]
            Time [s] and verdict of each mean that it completes.
        """
        if not math.isfinite(v) or not self._speed_source.accepts(source) or self._is_derived:
            return []
        points = self._speed_bin.add(t_s, v)
        if not points:
            return []
        mean_s, mean_v = mean(points)
        self._velocities.setdefault(source, Samples()).append((mean_s, mean_v))
        return [(mean_s, self._learn(mean_s, mean_v, refusal))]

    @property
    def _is_derived(self) -> bool:
        """Whether the velocity of this axis follows from a depth or a way: no instrument measures it."""
        return bool(self._way_source.name) and self._speed_source.name in ("", *NAVIGATORS)

    def attitude(
        self, t_s: float, attitude_rad: tuple[float, float, float], depth_m: float, refusal: Coded[NotLearned] = LEARNED
    ) -> list[tuple[float, SampleVerdict]]:
        """Add attitude and depth: known forces, angles, and in heave the velocity derived from depth.

        Parameters
        ----------
        t_s : [s]
            In time order.
        attitude_rad : (3,) [rad]
            Roll, pitch, yaw; NaN where unknown.
        depth_m : [m]
            NaN where unknown.
        refusal
            Why the estimate is not to be updated, if so.

        Returns
        -------
        list[tuple[float, SampleVerdict]]
            As of `velocity`; only in heave there are any.
        """
        axis = self.model.axis
        roll, pitch, _ = attitude_rad
        if axis < 2 and math.isfinite(roll) and math.isfinite(pitch):
            self._hydrostatic = known_force(self._vehicle, axis, attitude_rad)
            self._hydrostatics.append((t_s, self._hydrostatic))
            self.estimator.known(t_s, self._hydrostatic + self._coriolis)
        if axis in (3, 4) and math.isfinite(attitude_rad[axis - 3]):
            self._add_position(t_s, attitude_rad[axis - 3], "attitude")
        if axis == 2 and abs(depth_m) < DEEPEST_m:
            return self.way(t_s, depth_m, "navigation" if math.isfinite(roll) else "depth", refusal)
        return []

    def _add_position(self, t_s: float, position: float, source: str) -> None:
        self.estimator.position(t_s, position)
        kept = self._positions.setdefault(source, Samples())
        if not kept or t_s - kept[-1][0] >= self._position_s:
            kept.append((t_s, position))

    def way(
        self, t_s: float, way_m: float, source: str, refusal: Coded[NotLearned] = LEARNED
    ) -> list[tuple[float, SampleVerdict]]:
        """Add the depth, or the way along the axis: the final fit takes it as it is, the live estimate its slopes.

        Parameters
        ----------
        t_s : [s]
            In time order.
        way_m : [m]
            Along the axis; NaN is left out.
        source
            Instrument or navigator; one of them counts.
        refusal
            Why the estimate is not to be updated, if so.

        Returns
        -------
        list[tuple[float, SampleVerdict]]
            Time [s] between two means and the verdict on their slope, where no instrument measures the velocity.
        """
        if not math.isfinite(way_m) or not self._way_source.accepts(source):
            return []
        self._add_position(t_s, way_m, source)
        if not self._is_derived:
            return []
        points = self._way_bin.add(t_s, way_m)
        if not points:
            return []
        before, self._way_before = self._way_before, mean(points)
        if before is None or self._way_before[0] - before[0] > LONGEST_DIFFERENCE_S * self._way_s / DEPTH_S:
            return []
        (earlier_s, higher_m), (later_s, lower_m) = before, self._way_before
        at_s, v = 0.5 * (earlier_s + later_s), (lower_m - higher_m) / (later_s - earlier_s)
        return [(at_s, self._learn(at_s, v, refusal, derived=True))]

    def _learn(
        self, t_s: float, v: float, refusal: Coded[NotLearned] = LEARNED, *, derived: bool = False
    ) -> SampleVerdict:
        """Nothing is learned while the thrust only answers the motion."""
        if self.drive:
            self.drive.velocity(t_s, v)
            refusal = refusal or not_learned(NotLearned(self.drive.now))
        return self.estimator.velocity(t_s, v, refusal, derived=derived)

    # ---- outputs

    def estimate(self, motion: Motion, verdict: SampleVerdict) -> Estimate:
        """Estimate of one motion after a sample; bounds apply to the report, not to the estimator."""
        theta, covariance = self._known()
        reported = self._reported[motion.side]
        values = theta[reported.rows]
        values[reported.mass] -= self.model.rigid
        block = covariance[reported.square]
        return Estimate(
            motion=motion.name,
            names=reported.names,
            units=reported.units,
            values=tuple(bounded(values, block, reported.low).tolist()),
            covariance=tuple(map(tuple, block.tolist())),
            samples=self.estimator.samples,
            effective_samples=self.estimator.effective_samples,
            learning=verdict.learned,
            reason=verdict.reason,
            innovation=verdict.innovation * self.estimator.regression.rate * float(theta[-1]),
        )

    def _known(self) -> tuple[Array, Array]:
        """Parameters and covariance, (p,) and (p, p): no more than before, while the thrust only answers the motion."""
        if self.drive and self.drive.now:
            return array(self.prior.values), array(np.diag(self.prior.sigmas**2))
        return self.estimator.estimate()

    @property
    def wrenches(self) -> tuple[Array, Array]:
        """Times [s] and thrusts on all axes [N, N m]: (n,), (n, 6)."""
        times, wrenches = [t for t, _ in self._thrusts], [one.wrench for _, one in self._thrusts]
        return array(times), array(wrenches).reshape(-1, 6)

    @property
    def velocities(self) -> tuple[Array, Array]:
        """Times [s] of the own velocities, and all at these times: (n,), (n, 6), NaN of what was never measured."""
        own = series(self._velocities.get(self._speed_source.name, Samples()))
        nu = np.full((len(own), 6), NAN)
        nu[:, self.model.axis] = own.y
        if self._other_velocities:
            moved_s, *sparse = np.array(self._other_velocities).T
            for axis, one in enumerate(sparse):
                if axis != self.model.axis and np.isfinite(one).any():
                    nu[:, axis] = np.interp(own.t, moved_s, between_samples(moved_s, one, self._tuning.gap_s))
        return own.t, array(nu)

    def record(self, plateaus: tuple[Stretch, ...], masses: Masses) -> Record:
        """Record of the axis until now, for the final fit.

        Parameters
        ----------
        plateaus
            Spans of time at constant thrust.
        masses
            Of all axes, for the forces by motion along the others.

        Returns
        -------
        Record
            Velocities of the source in use, thrust, known forces and positions, without stretches.
        """
        velocities = Samples() if self._is_derived else self._velocities.get(self._speed_source.name, Samples())
        moved_s, *sparse = np.array(self._other_velocities or [(0.0, *ZERO6)]).T
        nu = [between_samples(moved_s, one, self._tuning.gap_s) for one in sparse]
        effort, forces = self._of_forces()
        return Record(
            velocity=series(velocities),
            thrust=series([(t, one.wrench[self.model.axis]) for t, one in self._thrusts]),
            effort=effort,
            forces=forces,
            stretches=(),
            known=series(self._hydrostatics),
            others=tuple(Series(moved_s, one) for one in nu),
            across=Series(moved_s, speed_across(self._vehicle, self.model.axis, nu)),
            coriolis=Series(moved_s, coriolis(self.model.axis, masses.values, nu)),
            coriolis_errors=tuple(Series(moved_s, error) for error in coriolis_errors(self.model.axis, masses, nu)),
            position=series(self._positions.get(self._way_source.name or "attitude", [])),
            lag_s=self.lag_s,
            prior_delays_s=self._prior_delays_s,
            plateaus=plateaus,
            ranged=self._is_derived and self._way_source.name == SONAR,
        )

    def supply(self, stretches: tuple[Stretch, ...]) -> Supply:
        """How the supply voltage is known of all thrust that acts within the stretches: as of the least known."""
        known = series([(t, float(one.supply)) for t, one in self._thrusts])
        least = Supply.MEASURED if stretches else Supply.ASSUMED
        for one in stretches:
            begin, end = np.searchsorted(known.t, [one.start_s, one.end_s], side="right")
            acting = known.y[max(0, begin - 1) : end]
            least = min(least, Supply(int(acting.min())) if len(acting) else Supply.ASSUMED)
        return least
