"""The identification session: events in, estimates out; the same object live, over a bag, and in lock-step.

    session = Session(vehicle)
    for event in events:
        for estimate in session.step(event): ...
    results = session.finish()

It is deterministic, and what it finds does not depend on the order in which the events arrive: they are put in the
order of their stamps first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_core.events import Stamp, Stamped, after, seconds_between
from hindrax_core.state import Attitude, Estimate, IdentEvent, Phase, Thrust, Velocity
from hindrax_core.vehicle import Vehicle
from hindrax_ident.axis_run import AxisRun
from hindrax_ident.belief import wide_belief, with_prior
from hindrax_ident.conclude import MASS_SHARE, Conclusion, Draft, conclude, draft, result_of, together, unidentified
from hindrax_ident.coriolis import SPREAD, USUAL, Masses, Motions
from hindrax_ident.learner import Verdict
from hindrax_ident.models import MOTIONS, Motion, model_of, motions_of, rigid_mass
from hindrax_ident.phases import Limits, PhaseLog, usable
from hindrax_ident.record import Record
from hindrax_ident.results import MotionResult, Results
from hindrax_ident.sides import Online, one_sided, side_of
from hindrax_ident.sorter import InOrder
from hindrax_ident.tuning import Tuning

Prior = Mapping[str, Mapping[str, tuple[float, float]]]
"""Per motion and coefficient: value and standard deviation."""

JOIN_S = 1.0
"""A pause between two legs that is shorter does not part them: the equation holds while the vehicle turns back."""
NO_FIT = "no coefficients make this motion of this force: check axes, signs and times of both"


@dataclass(frozen=True, slots=True)
class Outcome:
    """Results, and per axis everything that a report needs besides."""

    results: Results
    conclusions: Mapping[int, Conclusion]


class Session:
    """One run of one vehicle."""

    def __init__(
        self, vehicle: Vehicle, tuning: Tuning | None = None, prior: Prior | None = None, *, silent: bool = False
    ) -> None:
        """`prior`: what is known from earlier runs, to start from; by default nothing is.

        A `silent` session learns the same, but works out no estimate before the end.
        """
        self._silent = silent
        self.vehicle, self.tuning = vehicle, tuning or Tuning()
        self._prior = prior or {}
        self._sorter: InOrder[IdentEvent] = InOrder(self.tuning.reorder_s)
        self._axes: dict[int, AxisRun] = {}
        self._log = PhaseLog([])
        self._phase = Phase("", "")
        self._origin: Stamp | None = None
        self._thrust: Thrust | None = None
        self._moves = Motions(self.tuning.gap_s)
        self._masses = self._believed_masses({})
        self._now_s = 0.0

    # ---- while it runs

    def step(self, event: Stamped[IdentEvent]) -> Sequence[Stamped[Estimate]]:
        """Take one event; give the estimates of the samples whose turn has come."""
        if isinstance(event.reading, Velocity) and self.tuning.velocity_latency_s:
            event = Stamped(after(event.stamp, -self.tuning.velocity_latency_s), event.reading)
        return [estimate for one in self._sorter.push(event) for estimate in self._take(one)]

    def flush(self) -> Sequence[Stamped[Estimate]]:
        """Give the estimates of the events that still wait for earlier ones: the run is over."""
        return [estimate for one in self._sorter.rest() for estimate in self._take(one)]

    @property
    def late_events(self) -> int:
        """Events that came too late to be put in order, and were left out."""
        return self._sorter.dropped

    def _take(self, event: Stamped[IdentEvent]) -> Sequence[Stamped[Estimate]]:
        if self._origin is None:
            self._origin = event.stamp
        t_s = self._now_s = seconds_between(self._origin, event.stamp)
        reading = event.reading
        if isinstance(reading, Phase):
            self._change(t_s, reading)
        elif isinstance(reading, Thrust):
            self._push(t_s, reading)
        elif isinstance(reading, Attitude):
            return self._turn(t_s, reading)
        else:
            return self._measure(t_s, reading)
        return ()

    @property
    def _motion(self) -> Motion | None:
        return MOTIONS.get(self._phase.motion)

    def _active(self) -> AxisRun | None:
        motion = self._motion
        return self._axes.get(motion.axis) if motion else None

    def _change(self, t_s: float, phase: Phase) -> None:
        if phase == self._phase:
            return
        self._phase = phase
        self._log.add(t_s, phase.motion, phase.phase)
        self._masses = self._believed_masses({})
        motion = self._motion
        if motion and motion.axis not in self._axes:
            self._axes[motion.axis] = self._new_axis(motion.axis)
        if motion and self._thrust is not None:
            # The axis may not have listened before: it learns what the thrusters do now.
            self._axes[motion.axis].thrust(t_s, self._thrust)

    def _new_axis(self, axis: int) -> AxisRun:
        model = model_of(self.vehicle, axis)
        belief = wide_belief(self.vehicle, model)
        for motion in motions_of(axis):
            known = self._prior.get(motion.name, {})
            suffix = "_negative" if model.split and motion.side < 0 else ""
            named = {f"{name}{suffix}" if name in ("k_q", "k_l") else name: pair for name, pair in known.items()}
            belief = with_prior(belief, model, named)
        return AxisRun(self.vehicle, model, belief, self.tuning)

    def _push(self, t_s: float, thrust: Thrust) -> None:
        if not all(np.isfinite(thrust.wrench)):
            return
        self._thrust = thrust
        run = self._active()
        if run:
            run.thrust(t_s, thrust)

    def _refusal(self) -> str:
        phases = ("plateau",) if self.tuning.plateaus_only else self.tuning.phases
        return "" if self._phase.phase in phases else f"phase {self._phase.phase}"

    def _turn(self, t_s: float, attitude: Attitude) -> Sequence[Stamped[Estimate]]:
        run = self._active()
        if not run:
            return ()
        return self._told(run.attitude(t_s, attitude.attitude_rad, attitude.depth_m, self._refusal()))

    def _measure(self, t_s: float, velocity: Velocity) -> Sequence[Stamped[Estimate]]:
        heard = self._moves.hear(t_s, velocity.nu)
        run, motion = self._active(), self._motion
        if not run or not motion:
            return ()
        if heard:
            run.motion(t_s, self._moves.at(t_s), self._masses)
        return self._told(run.velocity(t_s, velocity.nu[motion.axis], velocity.source, self._refusal()))

    def _told(self, verdicts: list[tuple[float, Verdict]]) -> Sequence[Stamped[Estimate]]:
        run, motion, origin = self._active(), self._motion, self._origin
        if self._silent or not run or not motion or origin is None:
            return ()
        return [Stamped(after(origin, t_s), run.estimate(motion, verdict)) for t_s, verdict in verdicts]

    # ---- at its end

    def finish(self) -> Results:
        """Refine every motion that was flown. May be called at any time; it changes nothing that was learned."""
        return self.conclude().results

    def conclude(self) -> Outcome:
        """Results together with what a report needs."""
        self.flush()
        motions: dict[str, MotionResult] = {}
        drafts: dict[int, Draft] = {}
        conclusions: dict[int, Conclusion] = {}
        for axis in sorted(self._axes):
            try:
                drafts[axis] = self._draft(axis, self._believed_masses(drafts))
            except ValueError as error:
                motions |= self._unidentified(axis, error)
        for axis, one in together(drafts).items():
            try:
                conclusions[axis] = conclude(self.vehicle, one, tuning=self.tuning)
            except ValueError as error:
                motions |= self._unidentified(axis, error)
                continue
            for motion in self._told_apart(axis, conclusions[axis]):
                motions[motion.name] = result_of(motion, self.vehicle, conclusions[axis], self.tuning)
        return Outcome(Results(motions, self.vehicle), conclusions)

    def _unidentified(self, axis: int, error: ValueError) -> dict[str, MotionResult]:
        why = NO_FIT if isinstance(error, np.linalg.LinAlgError) else str(error)
        return {motion.name: unidentified(motion, why) for motion in self._flown(axis)}

    def _flown(self, axis: int) -> tuple[Motion, ...]:
        names = {motion for _, motion, _ in self._log.changes}
        return tuple(motion for motion in motions_of(axis) if motion.name in names)

    def _told_apart(self, axis: int, conclusion: Conclusion) -> tuple[Motion, ...]:
        """Both directions where the drag of both was fitted, otherwise the one that was."""
        motions = motions_of(axis)
        if len(motions) == 1 or conclusion.fit.model.split:
            return motions
        return tuple(motion for motion in motions if motion.side == side_of(conclusion.record))

    def _believed_masses(self, drafts: Mapping[int, Draft]) -> Masses:
        values, sigmas = zip(*(self._believed_mass(axis, drafts.get(axis)) for axis in range(6)), strict=True)
        return Masses(values, sigmas)

    def _believed_mass(self, axis: int, drafted: Draft | None) -> tuple[float, float]:
        """Body and added mass of an axis and its deviation: refined, learned, from the prior, or a guess."""
        rigid = rigid_mass(self.vehicle, axis)
        if drafted or axis in self._axes:
            fit = drafted.fit if drafted else None
            theta, covariance = (fit.theta, fit.covariance) if fit else self._axes[axis].learner.estimate()
            value, sigma = float(theta[-1]), float(np.sqrt(covariance[-1, -1]))
            if sigma < MASS_SHARE * value:
                return value, sigma
        for motion in motions_of(axis):
            if "added_mass" in self._prior.get(motion.name, {}):
                added, sigma = self._prior[motion.name]["added_mass"]
                return rigid + added, sigma
        return USUAL * rigid, SPREAD * rigid

    def record(self, axis: int, masses: Masses | None = None) -> Record:
        """What was kept of an axis; `masses` of all axes by default as they were learned."""
        run, tuning = self._axes[axis], self.tuning
        names = [motion.name for motion in motions_of(axis)]
        phases = ("plateau",) if tuning.plateaus_only else tuning.phases
        spans = self._log.stretches(names, phases, self._now_s, JOIN_S)
        plateaus = tuple(self._log.stretches(names, ("plateau",), self._now_s))
        kept = run.record((), plateaus, masses or self._believed_masses({}))
        measured = kept.velocity.t if len(kept.velocity) else kept.position.t
        limits = Limits(tuning.gap_s, tuning.thrust_age_s, tuning.stretch_s)
        return kept.within(usable(spans, measured, kept.thrust, limits))

    def _draft(self, axis: int, masses: Masses) -> Draft:
        run = self._axes[axis]
        record = self.record(axis, masses)
        model, belief = run.model, run.belief
        online: Online = {self.tuning.estimator: run.learner.estimate()} if run.learner.samples else {}
        side = side_of(record) if model.split else 0
        if side:
            model, belief, online = one_sided(model, belief, online, side)
        return draft(model, record, belief, online, self.tuning.lag_doubt_s)
