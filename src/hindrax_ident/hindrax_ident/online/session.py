"""Identification session: events in, estimates out; the same object live, over a bag, and in lock-step.

    session = Session(vehicle)
    for event in feed.all(measurements):
        for estimate in session.step(event): ...
    results = session.finalize().results

It is deterministic. Its events are in the order of their stamps; the feed sorts them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from hindrax_core.events import Stamp, Stamped, after, seconds_between
from hindrax_core.signals import NAN, Attitude, Estimate, IdentEvent, Phase, Thrust, Velocity, Way
from hindrax_core.text.coded import Coded
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.assess.assessment import (
    MASS_SHARE,
    Assessment,
    DraftFit,
    assess,
    combine_drafts,
    draft,
    result_of,
    unidentified,
)
from hindrax_ident.assess.objections import Code, objection
from hindrax_ident.assess.plausibility import NOT_PLANAR, Planar, planar
from hindrax_ident.assess.results import MotionResult, Results
from hindrax_ident.model.coriolis import USUAL_MASS_RATIO, USUAL_MASS_RATIO_SIGMA, Masses, VelocityHistory
from hindrax_ident.model.model_parameters import OnlineEstimates, crossed, one_sided, uncrossed, wide_prior
from hindrax_ident.model.motion_model import MOTIONS, Model, Motion, model_of, motions_of, rigid_mass
from hindrax_ident.online.axis_session import AxisSession
from hindrax_ident.online.cross_forces import CrossForces
from hindrax_ident.online.sample_verdict import LEARNED, NotLearned, SampleVerdict, not_learned
from hindrax_ident.records.axis_record import PhaseLog, Record, side_of, unbroken, usable
from hindrax_ident.records.excited_time import excited_stretches
from hindrax_ident.tuning import Tuning

JOIN_S = 1.0
"""Longest pause between legs of one stretch: the equation of motion holds while the vehicle turns back."""
CROSSED = 0.1
"""Mean square of the speed across, of that along an axis, from which the drag by it is a parameter [-]."""
LONGEST_WAY_S = 15.0
"""Longest stretch of surge or sway by places alone. An unmodeled force adds up twice there: over a minute it is metres,
which unknown forces would explain as well as the parameters, and the fit would end in either basin."""
FASTEST, STRONGEST = 50.0, 1e6
"""Velocities [m/s, rad/s] and thrusts [N, N m] beyond these are no measurements; filters would keep them long."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Results, and per axis the assessment for a report."""

    results: Results
    assessments: Mapping[int, Assessment]


class Session:
    """One run of one vehicle."""

    def __init__(self, vehicle: Vehicle, tuning: Tuning | None = None, *, every_s: float = 0.0) -> None:
        """`every_s`: least time between the estimates of `step`, which take longer than learning; infinite: none.

        What is learned does not depend on it.
        """
        self._every_s, self._due_s = every_s, 0.0 if math.isfinite(every_s) else math.inf
        self.vehicle, self.tuning = vehicle, tuning or Tuning()
        self._axes: dict[int, AxisSession] = {}
        self._log = PhaseLog([])
        self._phase = Phase("", "")
        self._origin: Stamp | None = None
        self._thrust: Thrust | None = None
        self._velocities = VelocityHistory(self.tuning.gap_s)
        self._masses = self._estimated_masses({})
        self._now_s = 0.0

    # ---- during the run

    def step(self, event: Stamped[IdentEvent]) -> Sequence[Stamped[Estimate]]:
        """Process the next event.

        Times count from the first motion: what came before depends on when a node subscribed, and rounding would too.

        Parameters
        ----------
        event
            Phase of a maneuver, thrust, attitude or velocity (SNAME axes), not earlier than the one before.

        Returns
        -------
        Sequence[Stamped[Estimate]]
            Estimates of the samples that the event completes; mostly none or one.
        """
        if self._origin is None:
            if not (isinstance(event.reading, Phase) and event.reading.motion in MOTIONS):
                if isinstance(event.reading, Thrust):
                    self._on_thrust(0.0, event.reading)
                return ()
            self._origin = event.stamp
        t_s = seconds_between(self._origin, event.stamp)
        assert t_s >= self._now_s, f"event: found at {t_s} s, wanted none before {self._now_s} s, the last"
        self._now_s = t_s
        reading = event.reading
        if isinstance(reading, Phase):
            self._on_phase(t_s, reading)
        elif isinstance(reading, Thrust):
            self._on_thrust(t_s, reading)
        elif isinstance(reading, Attitude):
            return self._on_attitude(t_s, reading)
        elif isinstance(reading, Way):
            return self._on_way(t_s, reading)
        else:
            return self._on_velocity(t_s, reading)
        return ()

    @property
    def _motion(self) -> Motion | None:
        return MOTIONS.get(self._phase.motion)

    def _active(self) -> AxisSession | None:
        motion = self._motion
        return self._axes.get(motion.axis) if motion else None

    def _on_phase(self, t_s: float, phase: Phase) -> None:
        if phase == self._phase:
            return
        self._phase = phase
        self._log.add(t_s, phase.motion, phase.phase)
        self._masses = self._estimated_masses({})
        motion = self._motion
        if motion and motion.axis not in self._axes:
            model, vehicle = self._live_model(motion.axis), self.vehicle
            cross = CrossForces(vehicle, model) if self._piloted else None
            self._axes[motion.axis] = AxisSession(vehicle, model, wide_prior(vehicle, model), self.tuning, cross)
        if motion and self._thrust is not None:
            # An axis that was not active before needs the present thrust.
            self._axes[motion.axis].thrust(t_s, self._thrust)

    def _live_model(self, axis: int) -> Model:
        """Model of the live estimate: what moves across an axis slows it down as well."""
        model = model_of(self.vehicle, axis)
        return replace(model, crossed=self._piloted and not model.restores)

    @property
    def _piloted(self) -> bool:
        """Whether this is the record of another stack, in which several axes may move at once."""
        return self._phase.phase == "excite" and self.tuning.lag_doubt_s is not None

    def _on_thrust(self, t_s: float, thrust: Thrust) -> None:
        if not all(abs(force) < STRONGEST for force in thrust.wrench):
            return
        self._thrust = thrust = self._weighed(thrust)
        axis_session = self._active()
        if axis_session:
            axis_session.thrust(t_s, thrust)

    def _weighed(self, thrust: Thrust) -> Thrust:
        """Thrust of the curves, corrected by the known weight."""
        gains = self.vehicle.thrust_gain
        if not gains:
            return thrust
        X, Y, Z, K, M, N = (
            force * gains[axis].of(force) if axis in gains else force
            for axis, force in zip(AXES, thrust.wrench, strict=True)
        )
        return replace(thrust, wrench=(X, Y, Z, K, M, N))

    def _refusal(self) -> Coded[NotLearned]:
        phases = ("plateau",) if self.tuning.plateaus_only else self.tuning.phases
        phase = self._phase.phase
        return LEARNED if phase in phases else not_learned(NotLearned.PHASE, phase=phase)

    def _on_attitude(self, t_s: float, attitude: Attitude) -> Sequence[Stamped[Estimate]]:
        axis_session = self._active()
        if not axis_session:
            return ()
        return self._estimates(axis_session.attitude(t_s, attitude.attitude_rad, attitude.depth_m, self._refusal()))

    def _on_way(self, t_s: float, way: Way) -> Sequence[Stamped[Estimate]]:
        axis_session, motion = self._active(), self._motion
        if not axis_session or not motion or motion.axis >= len(way.way_m):
            return ()
        return self._estimates(axis_session.way(t_s, way.way_m[motion.axis], way.source, self._refusal()))

    def _on_velocity(self, t_s: float, velocity: Velocity) -> Sequence[Stamped[Estimate]]:
        nu = [speed if abs(speed) < FASTEST else NAN for speed in velocity.nu]
        measured = self._velocities.update(t_s, nu)
        axis_session, motion = self._active(), self._motion
        if not axis_session or not motion:
            return ()
        if measured:
            axis_session.motion(t_s, self._velocities.at(t_s), self._masses, self._velocities.measured_at(t_s))
        return self._estimates(axis_session.velocity(t_s, nu[motion.axis], velocity.source, self._refusal()))

    def _estimates(self, verdicts: list[tuple[float, SampleVerdict]]) -> Sequence[Stamped[Estimate]]:
        axis_session, motion, origin = self._active(), self._motion, self._origin
        if not axis_session or not motion or origin is None:
            return ()
        found = []
        for t_s, verdict in verdicts:
            if t_s >= self._due_s:
                self._due_s = t_s + self._every_s
                found.append(Stamped(after(origin, t_s), axis_session.estimate(motion, verdict)))
        return found

    # ---- after the run

    def finalize(
        self,
        progress: Callable[[str], None] = lambda _: None,
        found_masses: Mapping[int, tuple[float, float]] = MappingProxyType({}),
    ) -> Outcome:
        """Fit every motion flown, first each axis alone, then with what the others found; assess what came out.

        May be called at any time; it changes nothing that was learned.

        Parameters
        ----------
        progress
            Is told what begins, such as "fit of surge, 1 of 6".
        found_masses
            Total masses of axes that are not flown in this session, and their deviations [kg, kg m^2].

        Returns
        -------
        Outcome
            Results by motion, also of those that could not be identified, and the assessment of each axis.
        """
        motions: dict[str, MotionResult] = {}
        drafts: dict[int, DraftFit] = {}
        for index, axis in enumerate(sorted(self._axes), start=1):
            progress(f"fit of {AXES[axis]}, {index} of {len(self._axes)}")
            try:
                drafts[axis] = self._draft(axis, self._estimated_masses(drafts, found_masses))
            except ValueError as error:
                motions |= self._unidentified(axis, error)
        assessments, failed = assess(self.vehicle, combine_drafts(drafts), tuning=self.tuning, progress=progress)
        for axis, reason in failed.items():
            motions |= self._unidentified(axis, reason)
        for axis, assessment in assessments.items():
            try:
                found = {one.name: result_of(one, assessment) for one in self._reported_motions(axis, assessment)}
            except np.linalg.LinAlgError as error:
                found = self._unidentified(axis, error)
            motions |= found
        return Outcome(
            Results({name: self._if_driven(one) for name, one in motions.items()}, self.vehicle), assessments
        )

    def _if_driven(self, result: MotionResult) -> MotionResult:
        drive = self._axes[MOTIONS[result.motion].axis].drive
        return result.refused_for(objection(Code(drive.now))) if drive and drive.now else result

    def _unidentified(self, axis: int, error: ValueError) -> dict[str, MotionResult]:
        singular = isinstance(error, np.linalg.LinAlgError)
        why = objection(Code.NO_FIT) if singular else objection(Code.UNUSABLE, why=str(error))
        return {motion.name: unidentified(motion, why) for motion in self._flown(axis)}

    def _flown(self, axis: int) -> tuple[Motion, ...]:
        names = {motion for _, motion, _ in self._log.changes}
        return tuple(motion for motion in motions_of(axis) if motion.name in names)

    def _reported_motions(self, axis: int, assessment: Assessment) -> tuple[Motion, ...]:
        """Both directions where the drag of both was fitted, otherwise the fitted one."""
        motions = motions_of(axis)
        if len(motions) == 1 or assessment.fit.model.split:
            return motions
        return tuple(motion for motion in motions if motion.side == side_of(assessment.record))

    def _estimated_masses(
        self, drafts: Mapping[int, DraftFit], found: Mapping[int, tuple[float, float]] = MappingProxyType({})
    ) -> Masses:
        """Of all axes; `found` counts where this session has none of its own."""
        own = ({} if axis in self._axes else found for axis in range(6))
        pairs = (known.get(axis) or self._estimated_mass(axis, drafts.get(axis)) for axis, known in enumerate(own))
        values, sigmas = zip(*pairs, strict=True)
        return Masses(values, sigmas)

    def _estimated_mass(self, axis: int, draft_fit: DraftFit | None) -> tuple[float, float]:
        """Total mass of an axis and its deviation [kg, kg m^2]: refined, online, or the usual ratio."""
        rigid = rigid_mass(self.vehicle, axis)
        if draft_fit or axis in self._axes:
            fit = draft_fit.fit if draft_fit else None
            theta, covariance = (fit.theta, fit.covariance) if fit else self._axes[axis].estimator.estimate()
            value, sigma = float(theta[-1]), float(np.sqrt(covariance[-1, -1]))
            if sigma < MASS_SHARE * value:
                return value, sigma
        return USUAL_MASS_RATIO * rigid, USUAL_MASS_RATIO_SIGMA * rigid

    @property
    def axes(self) -> tuple[int, ...]:
        """Axes that were excited."""
        return tuple(self._axes)

    def record(self, axis: int, masses: Masses | None = None) -> Record:
        """Record of an axis; `masses` of all axes are the online estimates by default."""
        axis_session, tuning = self._axes[axis], self.tuning
        names = [motion.name for motion in motions_of(axis)]
        phases = ("plateau",) if tuning.plateaus_only else tuning.phases
        plateaus = tuple(self._log.stretches(names, ("plateau",), self._now_s))
        kept = axis_session.record(plateaus, masses or self._estimated_masses({}))
        spans = self._log.stretches(names, phases, self._now_s, JOIN_S)
        measured = kept.velocity.t if len(kept.velocity) else kept.position.t
        if self._log.undivided:
            # A thrust whose motion was not measured is no measure of the others.
            seen = [one for span in spans for one in unbroken(span, measured, tuning.gap_s)]
            spans = excited_stretches(seen, *axis_session.wrenches, axis)
        if axis < 2 and not len(kept.velocity):
            tuning = replace(tuning, stretch_s=min(tuning.stretch_s, LONGEST_WAY_S))
        stretches = usable(spans, measured, kept.thrust, tuning)
        return replace(kept, stretches=stretches, supply=axis_session.supply(stretches))

    def planar(self) -> Planar:
        """Thrusts and velocities of surge and sway of a session of surge, to see whether they have the same axes."""
        if 0 not in self._axes:
            return NOT_PLANAR
        (times, wrenches), (t, nu) = self._axes[0].wrenches, self._axes[0].velocities
        moved, turned = (np.isfinite(nu[:, columns]).all(axis=1) for columns in ([0, 1], [5]))
        return planar((times, wrenches[:, :2]), (t[moved], nu[moved, :2]), (t[turned], nu[turned, 5]))

    def refined(self, axis: int) -> DraftFit:
        """Fit of what was flown along an axis so far, with its noise; takes a second. ValueError where nothing fits."""
        return self._draft(axis, self._estimated_masses({}))

    def _draft(self, axis: int, masses: Masses) -> DraftFit:
        axis_session = self._axes[axis]
        record = self.record(axis, masses)
        model, prior = axis_session.model, axis_session.prior
        online: OnlineEstimates = (
            {self.tuning.estimator: axis_session.estimator.estimate()} if axis_session.estimator.samples else {}
        )
        side = side_of(record) if model.split else 0
        if side:
            model, prior, online = one_sided(model, prior, online, side)
        # Roll and pitch answer to their restoring moment: beside it a record does not tell two drags apart.
        crosses = self._log.undivided and not model.restores and record.crossing() > CROSSED
        if crosses and not model.crossed:
            model, prior, online = crossed(self.vehicle, model, prior, online)
        elif model.crossed and not crosses:
            model, prior, online = uncrossed(model, prior, online)
        return draft(self.vehicle, model, record, prior, online, tuning=self.tuning)
