"""Choice of the next leg that a session learns from.

First every motion at its extreme speeds; then the legs that shrink the uncertainty of the drag most per second
(A-optimal over a handful of candidates, by the covariance of the fit so far), until noise is below a third of what the
calibration of the thrust leaves, or below the share that was asked for, or the time is over. Pure: the caller flies
what is chosen, and feeds the session meanwhile.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.thrust_calibration import modes
from hindrax_ident.fit.plateaus import Plateaus, measure
from hindrax_ident.model.motion_model import Model, motions_of
from hindrax_ident.online.aim import LEVELS, Aim, Choice
from hindrax_ident.online.session import Session

SHARES = (0.5, 1.0)
"""Speeds at which the drag is to be known, as shares of the highest one flown."""
LEAST_S, MOST_REPEATS = 10.0, 6
"""Time on plateaus that a choice is worth settling for, and how often it may be flown for that."""
OF_CALIBRATION = 1.0 / 3.0
CONTENT_SHARE = 0.85
"""Share of the wanted noise at which it is content: the last fit, with what all axes taught, differs a bit."""
UNKNOWN_CALIBRATION = 0.03
"""Share of the thrust that counts as its deviation where the vehicle file gives none [-]."""


@dataclass(frozen=True, slots=True)
class DragEstimate:
    """Estimate of the drag along an axis; d parameters: drag and offset.

    `covariance` (d, d) of them; `gradient` (q, d) of the drag at the speeds that count, `force` (q,) the drag there
    [N, N m]; `wanted`: its noise at which enough is known [-].
    """

    model: Model
    plateaus: Plateaus
    covariance: Array
    gradient: Array
    force: Array
    wanted: float

    @property
    def noise(self) -> float:
        """Largest standard deviation of the drag, as a share of it [-]."""
        return float(np.sqrt(np.max(self._variance(self.covariance))))

    @property
    def density(self) -> float:
        """Noise of the force on a plateau of one second [N^2 s, (N m)^2 s]: by what the plateaus flown have left."""
        x = _columns(self.model, self.plateaus.v)
        flown = np.linalg.pinv(x.T @ (self.plateaus.duration_s[:, None] * x))
        return float(np.median(self._variance(self.covariance) / self._variance(array(flown))))

    def after(self, level: float) -> tuple[float, float, int]:
        """What flying one more level would improve.

        Parameters
        ----------
        level : [-]
            From the slowest plateau flown (0) to the fastest (1).

        Returns
        -------
        tuple[float, float, int]
            Improvement in squares of what is wanted, and only down to that; time on its plateaus [s]; how often it is
            to be flown out and back.
        """
        fast, order = np.abs(self.plateaus.v), np.argsort(np.abs(self.plateaus.v))
        speed = float(fast.min() + level * (fast.max() - fast.min()))
        seconds = float(np.interp(speed, fast[order], self.plateaus.duration_s[order]))
        times = min(MOST_REPEATS, max(1, math.ceil(0.5 * LEAST_S / max(seconds, 1e-3))))
        x = _columns(self.model, array([speed, -speed]))
        gain = self.covariance @ x.T
        left = self.covariance - gain @ np.linalg.solve(
            x @ gain + self.density / (times * seconds) * np.eye(len(x)), gain.T
        )
        now, then = (
            np.maximum(self._variance(one) / self.wanted**2, CONTENT_SHARE**2) for one in (self.covariance, array(left))
        )
        return float(np.sum(now - then)), 2.0 * times * seconds, times

    def _variance(self, covariance: Array) -> Array:
        """Variance of the drag at the speeds that count, in squares of its share: (q,)."""
        return array(np.maximum(np.sum(self.gradient @ covariance * self.gradient, axis=1), 1e-18) / self.force**2)


def drag_of(session: Session, axis: int, until: float | None) -> DragEstimate | None:
    """Present estimate of the drag along an axis, by its plateaus.

    Parameters
    ----------
    session
        Live session.
    axis
        0 to 5.
    until : [-]
        Wanted deviation of the drag, as a share of it; None: OF_CALIBRATION of that of the thrust.

    Returns
    -------
    DragEstimate | None
        None before two speeds were flown, or where there is no fit.
    """
    if axis not in session.axes:
        return None
    plateaus = measure(session.record(axis))
    if len(plateaus.v) < 2 or float(np.ptp(np.abs(plateaus.v))) == 0.0:
        return None
    try:
        fit = session.refined(axis).fit
    except ValueError:
        return None
    model, theta, covariance = fit.model, fit.theta, fit.covariance
    top, d = float(np.abs(plateaus.v).max()), model.drags + 1
    v = array([(motion.side or 1) * share * top for motion in motions_of(axis) for share in SHARES])
    gradient = _columns(model, v)
    gradient[:, -1] = 0.0
    force = array(np.maximum(np.abs(gradient @ theta[:d]), 1e-9))
    wanted = OF_CALIBRATION * calibration_of(session, axis, float(force.max())) if until is None else until
    return DragEstimate(model, plateaus, array(covariance[:d, :d]), gradient, force, wanted)


def calibration_of(session: Session, axis: int, force: float) -> float:
    """Standard deviation of a thrust by its calibration.

    Parameters
    ----------
    session
        With its vehicle.
    axis
        0 to 5.
    force : [N, N m]
        Thrust on the axis.

    Returns
    -------
    float
        Share of the thrust [-].
    """
    at = array([force])
    errors = [(mode.error(at), mode.covariance) for mode in modes(session.vehicle, axis)]
    variance = sum(float((error @ covariance @ error.T)[0, 0]) for error, covariance in errors)
    return math.hypot(math.sqrt(variance) / max(force, 1e-9), session.tuning.wrench_gain_sigma) or UNKNOWN_CALIBRATION


def _columns(model: Model, v: Array) -> Array:
    """Regressors of drag and offset at velocities v (n,): (n, d)."""
    return array(model.columns(v, np.zeros_like(v))[:, : model.drags + 1])


@dataclass(slots=True)
class Experiment:
    """One experiment. `ended`: why nothing more is chosen; `known`: the drag of the motions of which enough was flown.

    `estimate_drag` returns the drag along an axis as known by now.
    """

    motions: Sequence[str]
    aim: Aim = field(default_factory=Aim)
    estimate_drag: Callable[[Session, int, float | None], DragEstimate | None] = drag_of
    ended: str = ""
    known: dict[str, DragEstimate] = field(default_factory=dict)
    _flown_s: dict[str, float] = field(default_factory=dict)
    _started_s: float = math.nan
    _last: tuple[str, float] | None = None

    def left_s(self, now_s: float) -> float:
        """Time until what is flown is to be cut [s]; all of it before the first choice."""
        return self.aim.limit_s if math.isnan(self._started_s) else self.aim.limit_s - (now_s - self._started_s)

    def next(self, session: Session, now_s: float) -> Choice | None:
        """Choose what to fly now; None when it is over. To be called again when that has been flown, or was cut."""
        left_s = self.left_s(now_s)
        if self._last is None:
            self._started_s = now_s
        else:
            motion, since_s = self._last
            self._flown_s[motion] = self._flown_s.get(motion, 0.0) + now_s - since_s
            self._learn(session, motion)
        unflown = [motion for motion in self.motions if motion not in self._flown_s]
        chosen = None
        if left_s > 0.0:
            chosen = Choice(unflown[0]) if unflown else self._best(left_s)
        self.ended = "" if chosen else self._reason(unflown, left_s)
        self._last = None if chosen is None else (chosen.motion, now_s)
        return chosen

    def _best(self, left_s: float) -> Choice | None:
        """The legs that lessen what is missing most per second, of those that there is time for."""
        best, chosen = 0.0, None
        for motion, drag in self.known.items():
            # Transits, boosts and settling take as much again as they did before.
            stretch = self._flown_s[motion] / float(drag.plateaus.duration_s.sum())
            for level in LEVELS:
                gain, plateau_s, times = drag.after(level)
                seconds = plateau_s * stretch
                if seconds <= left_s and gain / seconds > best:
                    best, chosen = gain / seconds, Choice(motion, (level,) * times)
        return chosen

    def _learn(self, session: Session, motion: str) -> None:
        found = self.estimate_drag(session, AXES.index(motion), self.aim.until)
        if found is not None:
            self.known[motion] = found

    def _reason(self, unflown: Sequence[str], left_s: float) -> str:
        enough = {motion for motion, drag in self.known.items() if drag.noise <= CONTENT_SHARE * drag.wanted}
        lacking = [motion for motion in self.motions if motion not in enough]
        time = f"{self.aim.limit_s / 60.0:g} minutes"
        if unflown:
            return f"{time} are over before {', '.join(unflown)}"
        if not lacking:
            return "every motion has reached the wanted uncertainty"
        over = "are over" if left_s <= 0.0 else "leave no time for another leg"
        return f"{time} {over}; more was wanted of {', '.join(lacking)}"
