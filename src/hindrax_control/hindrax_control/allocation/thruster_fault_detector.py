"""Thruster fault detector: detects a thruster that does not push although it is commanded to.

The prior's momentum balance, filtered so that nothing is differentiated, leaves a residual wrench. A dead thruster
leaves one of a known direction, proportional to its commanded force; a current or a wrong drag coefficient does not.
Ballast and trim that differ from the vehicle file do: thrusters that hold a vehicle upright move nothing. So what
heave, roll and pitch leave on the average is learned, and only what comes on top of it counts: against the force of a
thruster (one that dies), and against what its force has on top of its own average (one that was dead from the start).
But ballast has its limit: a vehicle that rests although much more than that is pushed against it is moved by none.
So has a current: what holds a place or a speed against one looks like a dead supply, unless it is more than that takes.
For each thruster, and for all of them together, the part of the force that is missing is fitted; what explains most of
a residual too large for the model's own errors, for long enough, is suspected.

Symbols: n thrusters; B (6, n) effectiveness; F (n,) forces after their lag; M (6,) inertia with added mass; nu (6,)
rates. An index f means behind a low-pass of `filter_s`. The residual wrench, (6,) [N, N m], is

    r = M (nu - nu_f) / filter_s - (hydrostatics + Munk - drag)_f - B F_f

whose first term is the filtered M nu' exactly. A thruster j that gives a share (1 - m) of its force leaves
r = -m B_j F_j: m is 1 for a dead one and 2 for one that pushes the wrong way round. Everything is divided by the
model's own error, so that r.r counts in variances. Suspects are judged twice, 2 (n + 1) columns s: by their wrench, and
by what it has on top of its average.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix, effectiveness
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.events import Stamp, seconds_between
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.knobs import knob
from hindrax_core.readings import Vec6
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import AXES, Vehicle

LONGEST_STEP_S = 0.2
HEAVE = AXES.index("heave")
HYDROSTATIC = np.array([axis in ("heave", "roll", "pitch") for axis in AXES])
TURNS = np.array([axis in ("roll", "pitch", "yaw") for axis in AXES])
AT_WORK_N = 0.1
"""Force below which all thrusters stand: nothing is learned while the vehicle is held."""
FIRST_S = 5.0
"""Time under thrust for which ballast and trim are the mean of all that was seen."""
REVERSED = 1.5
"""Missing share of its force from which on a thruster is not dead, but wired the wrong way round."""
EVERY = "all thrusters"
"""Suspect where none of them moves the vehicle: a dead supply, a vehicle held fast, or a velocity that hangs."""
EVERY_MISSING, EVERY_EXPLAINED = 0.75, 0.85
"""The same two knobs for all of them together: weak thrusters, drag and current explain a share of it too."""
JUDGED_S = 0.09
"""Between two judgements: the balance is filtered at every step, its evidence over seconds."""


@dataclass(frozen=True, slots=True)
class FaultDetectorKnobs:
    """Detection thresholds."""

    trim_s: float = knob(30.0, 1.0, 600.0, "time over which ballast and trim are learned [s]")
    ballast_share: float = knob(0.05, 0.0, 1.0, "ballast that the file may not know, as a fraction of the weight [-]")
    filter_s: float = knob(0.6, 0.1, 10.0, "time constant of the filter of the momentum balance [s]")
    memory_s: float = knob(2.5, 0.2, 60.0, "time over which evidence is gathered [s]")
    patience_s: float = knob(1.5, 0.0, 60.0, "time for which the evidence must hold [s]")
    missing: float = knob(0.6, 0.1, 1.0, "fraction of its force that must be missing [-]")
    explained: float = knob(0.65, 0.1, 1.0, "fraction of the residual that one thruster must explain [-]")
    surprise: float = knob(9.0, 1.0, 1e4, "mean square of the residual, in variances of the model, from which on [-]")
    current_mps: float = knob(0.2, 0.0, 5.0, "current against which all thrusters may hold a vehicle that rests [m/s]")
    sigma: Vec6 = knob((0.8, 0.8, 1.0, 0.15, 0.2, 0.12), 1e-3, 1e3, "error of the model at rest [N, N m]")
    sigma_drag: float = knob(0.35, 0.0, 2.0, "error of the model as a fraction of the drag [-]")
    righting_times: float = knob(
        6.0, 1.0, 50.0, "times its righting moment, and its drag in a turn, that a vehicle may have [-]"
    )
    sigma_thrust: float = knob(0.1, 0.0, 1.0, "loss of each thruster under load, as a fraction of its thrust [-]")


def without_more(residual: Matrix, known: Matrix, times: float) -> Matrix:
    """Residual without more of a known wrench, up to so many times of it: towards zero, and never beyond.

    Parameters
    ----------
    residual, known : (n,) [N, N m]
        What is not explained, and what may act more strongly than modeled.
    times : [-]
        Largest multiple of the known wrench.

    Returns
    -------
    Matrix
        (n,) [N, N m].
    """
    way = np.sign(known)
    return np.asarray(residual - way * np.clip(residual * way, 0.0, (times - 1.0) * np.abs(known)))


@dataclass(frozen=True, slots=True)
class SuspectedFault:
    """A thruster and the share of its force that seems to be missing: 2 where it pushes the wrong way round."""

    name: str
    missing: float

    @property
    def sentence(self) -> str:
        """Message for the operator."""
        if self.name == EVERY:
            return (
                "none of the thrusters moves the vehicle: their supply is dead, something holds it fast, "
                "or the DVL does not show its motion"
            )
        if self.missing > REVERSED:
            return f"{self.name}: it pushes the wrong way round"
        return f"{self.name}: {100.0 * min(1.0, self.missing):.0f} % of its thrust is missing"


class ThrusterFaultDetector:
    """Monitors all thrusters of one vehicle, from the forces that the applied pulses should give."""

    def __init__(self, vehicle: Vehicle, knobs: FaultDetectorKnobs | None = None) -> None:
        self._knobs = knobs or FaultDetectorKnobs()
        self._names = tuple(thruster.name for thruster in vehicle.thrusters)
        self._suspects = (*self._names, EVERY)
        one_only = np.ones(len(self._names))
        self._least_missing = np.tile(np.append(one_only * self._knobs.missing, EVERY_MISSING), 2)
        self._least_explained = np.tile(np.append(one_only * self._knobs.explained, EVERY_EXPLAINED), 2)
        self._of_every = np.tile([name == EVERY for name in self._suspects], 2)
        self._most_ballast_N = self._knobs.ballast_share * vehicle.mass_kg * GRAVITY_mps2
        self._lags_s = tuple(max(thruster.lag_s, 1e-3) for thruster in vehicle.thrusters)
        self._B: Matrix = effectiveness(vehicle)
        found = prior_dynamics(vehicle)
        self._freedoms = tuple(found[axis] for axis in AXES)
        self._inertia = np.array([one.inertia for one in self._freedoms])
        self._masses = tuple(one.inertia for one in self._freedoms[:3])
        self._last: Stamp | None = None
        self._trim: Matrix = np.zeros(6)
        self._usual: Matrix = np.zeros((6, len(self._names)))
        self._learned_s: Matrix = np.zeros(6)
        self._clear()

    def _clear(self) -> None:
        count = len(self._names)
        self._thrust = [0.0] * count
        self._slow: Matrix = np.zeros(12 + count)
        self._slow_rates, self._slow_model, self._slow_thrust = np.split(self._slow, (6, 12))
        self._started = False
        judged = 2 * len(self._suspects)
        self._along, self._power, self._residual = np.zeros(judged), np.zeros(judged), np.zeros(judged)
        self._since_s: Matrix = np.zeros(judged)
        self._unjudged_s = 0.0

    def step(self, navigation: Navigation, stamp: Stamp, forces_N: Sequence[float]) -> SuspectedFault | None:
        """Look for one thruster whose force is missing from the motion.

        Parameters
        ----------
        navigation, stamp
            State, and its time.
        forces_N : (thrusters,) [N]
            That the applied pulses should have given since the last state.

        Returns
        -------
        SuspectedFault | None
            The thruster whose loss explains the residuals, once that is clear.
        """
        dt = 0.0 if self._last is None else seconds_between(self._last, stamp)
        self._last = stamp
        rates = (*navigation.velocity_mps, *navigation.rate_radps)
        # Without a measured velocity there is no residual: what was collected is dropped, and begins anew with a lock.
        if not (0.0 < dt <= LONGEST_STEP_S and navigation.dvl_locked and all(map(math.isfinite, rates))):
            self._clear()
            return None
        drag = [one.drag_force(rate) for one, rate in zip(self._freedoms, rates, strict=True)]
        self._filter(navigation, rates, drag, forces_N, dt)
        self._unjudged_s += dt
        if self._unjudged_s < JUDGED_S:
            return None
        dt, self._unjudged_s = self._unjudged_s, 0.0
        momentum = self._inertia * (rates - self._slow_rates) / self._knobs.filter_s
        residual = momentum - self._slow_model - self._B @ self._slow_thrust
        righting = np.array((0.0, 0.0, 0.0, *self._statics(navigation)[3:5], 0.0))
        return self._judge(residual, np.array(drag), righting, self._against_current(rates), dt)

    def _against_current(self, rates: Vec6) -> Matrix:
        """Force (6,) that it takes at most to hold surge and sway velocity against a current [N]."""
        current_mps = self._knobs.current_mps
        X, Y = (
            one.drag_force(abs(rate) + current_mps) for one, rate in zip(self._freedoms[:2], rates[:2], strict=True)
        )
        return np.array((X, Y, 0.0, 0.0, 0.0, 0.0))

    def _held(self, residual: Matrix, righting: Matrix, drag: Matrix) -> Matrix:
        """Residual (6,) without what a vehicle leaves that resists a tilt or a turn more than its file says [N m].

        Held at a tilt, or at the speed of a turn, it gathers no more speed, as if all its thrusters were dead. What
        resists is taken off, up to `righting_times` the moment of the file. Thrusters that are dead leave the opposite:
        one of them tilts it on, and without all of them it comes to rest, where nothing resists.
        """
        times = self._knobs.righting_times
        return without_more(without_more(residual, righting, times), np.where(TURNS, -drag, 0.0), times)

    def _filter(
        self, navigation: Navigation, rates: Vec6, drag: Sequence[float], forces_N: Sequence[float], dt: float
    ) -> None:
        """Filter rates [m/s, rad/s], wrench of the model [N, N m] and thrust [N]: `_slow`, in this order."""
        if not self._started:
            self._started, self._slow_rates[:] = True, rates
        terms = zip(self._statics(navigation), self._munk(rates), drag, strict=True)
        model = [static + munk - drag_N for static, munk, drag_N in terms]
        # Plain numbers: arrays of six and eight cost more to make than to compute with.
        self._thrust = [
            thrust + (force - thrust) * -math.expm1(-dt / lag_s)
            for thrust, force, lag_s in zip(self._thrust, forces_N, self._lags_s, strict=True)
        ]
        self._slow += ((*rates, *model, *self._thrust) - self._slow) * -math.expm1(-dt / self._knobs.filter_s)

    def _statics(self, navigation: Navigation) -> Vec6:
        """Righting moments and net buoyancy in body axes [N, N m]. Fossen 2011 eq. 4.6."""
        roll, pitch, _ = navigation.attitude_rad
        lift, righting = self._freedoms[2].bias, self._freedoms[3].restoring
        sin_p, sideways, upright = math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll)
        return lift * sin_p, -lift * sideways, -lift * upright, -righting * sideways, -righting * sin_p, 0.0

    def _munk(self, rates: Vec6) -> Vec6:
        """Coriolis and Munk terms of a diagonal mass matrix [N, N m]. Fossen 2011 eq. 6.43."""
        u, v, w, p, q, r = rates
        mx, my, mz = self._masses
        X, Y, Z = mx * u, my * v, mz * w
        return r * Y - q * Z, p * Z - r * X, q * X - p * Y, Y * w - Z * v, Z * u - X * w, X * v - Y * u

    def _learn_trim(self, residual: Matrix, wrenches: Matrix, drag: Matrix, dt: float) -> tuple[Matrix, Matrix]:
        """Residual (6,) and wrenches of the thrusters (6, n) without what they were on the average [N, N m].

        Learned in heave, roll and pitch only, where ballast and trim act. What a thruster that was dead from the start
        leaves on the average is learned as if it were ballast; only its changes about the average stay in the residual,
        so the wrench that they are compared with must lose its average too. A second counts by the model's error at
        rest to that in motion: in a dive the error of the drag would pass for ballast.
        """
        beyond, unusual = residual - self._trim, wrenches - self._usual
        if np.abs(self._slow_thrust).max() < AT_WORK_N:
            return beyond, np.zeros_like(wrenches)
        sigma = np.asarray(self._knobs.sigma)
        counted_s = dt * sigma / (sigma + self._knobs.sigma_drag * np.abs(drag))
        self._learned_s += counted_s
        learned = HYDROSTATIC * counted_s / np.where(self._learned_s < FIRST_S, self._learned_s, self._knobs.trim_s)
        self._trim = self._trim + learned * beyond
        self._usual = self._usual + learned[:, None] * unusual
        return beyond, unusual

    def _judge(
        self, residual: Matrix, drag: Matrix, righting: Matrix, against: Matrix, dt: float
    ) -> SuspectedFault | None:
        """Fit the missing share of each suspect alone, and return the one that explains most, long enough.

        Least squares of r = m s over a fading memory: m = <s.r> / <s.s>, and m <s.r> is the part of <r.r> that goes
        with it. One at a time: two that fail at once are found one after the other, and a joint fit of all would
        explain any current by many thrusters that are a little weak.
        """
        knobs = self._knobs
        wrenches = self._B * self._slow_thrust
        at_work = knobs.sigma_thrust * np.linalg.norm(wrenches, axis=1)
        residual, unusual = self._learn_trim(residual, wrenches, drag, dt)
        weight = 1.0 / (np.asarray(knobs.sigma) + knobs.sigma_drag * np.abs(drag) + at_work)
        together = [part for parts in (wrenches, unusual) for part in (parts, parts.sum(axis=1, keepdims=True))]
        signature = -np.hstack(together) * weight[:, None]
        # A column for each suspect: to all of them together, what is held upright is no evidence.
        held = self._held(residual, righting, drag)
        surprise = np.where(self._of_every, held[:, None], residual[:, None])
        # Nor can ballast resist everything. What is beyond it is constant: its changes would be compared with nothing.
        surprise[HEAVE, len(self._names)] += self._trim[HEAVE] - np.clip(
            self._trim[HEAVE], -self._most_ballast_N, self._most_ballast_N
        )
        surprise *= weight[:, None]
        # Nor does a push prove anything which a current may take all of.
        adrift = np.ix_(np.abs(wrenches.sum(axis=1)) < against, self._of_every)
        surprise[adrift] = signature[adrift] = 0.0
        keep = -math.expm1(-dt / knobs.memory_s)
        self._along += (np.sum(signature * surprise, axis=0) - self._along) * keep
        self._power += (np.sum(signature * signature, axis=0) - self._power) * keep
        self._residual += (np.sum(surprise * surprise, axis=0) - self._residual) * keep
        missing = self._along / np.maximum(self._power, 1e-9)
        explained = self._along * missing
        explains = explained > self._least_explained * self._residual
        suspect = (missing > self._least_missing) & explains & (self._residual > knobs.surprise)
        self._since_s = np.where(suspect, self._since_s + dt, 0.0)
        index = int(np.argmax(explained * (self._since_s > knobs.patience_s)))
        if self._since_s[index] <= knobs.patience_s:
            return None
        return SuspectedFault(self._suspects[index % len(self._suspects)], float(missing[index]))
