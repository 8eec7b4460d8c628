"""Divergence guard: detects a vehicle that turns faster and faster against what its thrusters are asked for.

A thruster wired the wrong way round, or a sensor with the wrong sign, makes every correction worse: the vehicle lies on
its back two seconds after the first one. The thruster fault detector gathers evidence for seconds, which is right for a
flight that can go on. This guard looks at rotation only, needs no DVL, decides within tenths of a second, and ends the
thrust.

The moments that the model does not explain (the momentum balance, filtered, as in the thruster fault detector) are
compared with what each thruster, and each axis, would leave if its force were missing (a share of 1) or reversed (2).

Symbols: n thrusters; B (3, n) moments per newton [m]; I (3,) inertia with added mass [kg m^2]; omega (3,) rates; F (n,)
forces after their lag; an index f means behind a low-pass of `filter_s`. The residual moment, (3,) [N m], is

    r = I (omega - omega_f) / filter_s - (righting - drag)_f - B F_f

and what is gathered is r / I: angular accelerations, so that one limit serves all axes and vehicles. n + 3 suspects:
the thrusters, then roll, pitch and yaw as a whole, which is what a sensor with the wrong sign looks like.

Drag and righting moment are what a vehicle file knows least: a guess of them may be several times too small, and what a
turn or a tilt then meets looks like thrust that is missing. So a residual that resists the turn or the tilt counts only
beyond what `known_times` of them explain. What is reversed does the opposite: it tilts the vehicle on.

A residual alone is no divergence: a hand or a wave makes one. It must drive the motion (r omega > 0) or, where the
vehicle has leaned slowly, push it further over; a decision at a small tilt also wants the angular momentum to grow.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix, effectiveness
from hindrax_control.allocation.thruster_fault_detector import without_more
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.events import Stamp, seconds_between
from hindrax_core.knobs import knob
from hindrax_core.readings import Vec3
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import AXES, Vehicle

LONGEST_STEP_S = 0.2
TURNING = AXES[3:]
REVERSED = (1.5, 3.0)
"""Share of a force that is missing when it pushes the wrong way: 1 is a dead thruster, 2 a reversed one. A moment from
outside, which several thrusters hold together, is a multiple of what each of them gives."""
CERTAIN_S = 0.8
"""Time after which a large moment without explanation is no blow."""
AT_WORK_N = 0.1
"""Commanded force below which all thrusters stand: what leans then is carried, swings or lies somewhere, and no
thrust is there to end."""
AHEAD_S = 0.15
"""Time from the decision to the end of the thrust: lag of thrusters and output."""


@dataclass(frozen=True, slots=True)
class DivergenceKnobs:
    """When rotation counts as diverging."""

    filter_s: float = knob(0.12, 0.02, 1.0, "time constant of the filter of the momentum balance [s]")
    memory_s: float = knob(0.3, 0.05, 5.0, "time over which evidence is gathered [s]")
    patience_s: float = knob(0.1, 0.0, 2.0, "time for which it must diverge [s]")
    rate_dps: float = knob(15.0, 1.0, 400.0, "slowest tilting that may be a divergence [deg/s]")
    yaw_dps: float = knob(70.0, 1.0, 400.0, "slowest turning that may be a divergence [deg/s]")
    tilt_deg: float = knob(10.0, 0.0, 90.0, "least tilt with something reversed [deg]")
    worst_deg: float = knob(38.0, 5.0, 90.0, "tilt that nothing but asked thrust may bring about [deg]")
    surprise_radps2: float = knob(0.6, 0.05, 50.0, "least angular acceleration without explanation [rad/s^2]")
    certain_radps2: float = knob(3.0, 0.1, 100.0, "the same, from which on it ends thrust without diverging [rad/s^2]")
    known_times: float = knob(6.0, 1.0, 50.0, "times drag and righting moment of its file that a vehicle may have [-]")
    explained: float = knob(0.6, 0.1, 1.0, "fraction of it that one thruster or axis must explain [-]")


class DivergenceGuard:
    """Monitors the rotation of one vehicle, from the forces that the applied pulses should give."""

    def __init__(self, vehicle: Vehicle, knobs: DivergenceKnobs | None = None) -> None:
        self._knobs = knobs or DivergenceKnobs()
        self._names = tuple(thruster.name for thruster in vehicle.thrusters)
        self._lags_s = np.array([max(thruster.lag_s, 1e-3) for thruster in vehicle.thrusters])
        self._B: Matrix = effectiveness(vehicle)[3:]
        found = prior_dynamics(vehicle)
        self._freedoms = tuple(found[axis] for axis in TURNING)
        self._inertia = np.array([one.inertia for one in self._freedoms])
        self._last: Stamp | None = None
        self._begin()

    def _begin(self) -> None:
        count = len(self._names)
        self._thrust: Matrix = np.zeros(count)
        self._slow_thrust: Matrix = np.zeros(count)
        self._slow_drag: Matrix = np.zeros(3)
        self._slow_righting: Matrix = np.zeros(3)
        self._slow_rates: Matrix | None = None
        self._along, self._power, self._surprise = np.zeros(count + 3), np.zeros(count + 3), 0.0
        self._since_s = self._certain_s = 0.0
        self._at_work = False

    def step(self, navigation: Navigation, stamp: Stamp, forces_N: Sequence[float]) -> str:
        """Compare what the vehicle does with what its thrusters should do to it.

        Parameters
        ----------
        navigation, stamp
            State, and its time.
        forces_N : (thrusters,) [N]
            Commanded since the last state; another number of them begins anew.

        Returns
        -------
        str
            What diverges and why; empty where nothing does, or not for long enough.
        """
        dt = 0.0 if self._last is None else seconds_between(self._last, stamp)
        self._last = stamp
        rates, attitude_rad = np.array(navigation.rate_radps), navigation.attitude_rad
        known = bool(np.isfinite(rates).all()) and math.isfinite(attitude_rad[0] + attitude_rad[1])
        if not (0.0 < dt <= LONGEST_STEP_S and known and len(forces_N) == len(self._names)):
            self._begin()
            return ""
        self._at_work = bool(np.abs(forces_N).max(initial=0.0) >= AT_WORK_N)
        residual, momentum = self._balance(rates, attitude_rad, np.array(forces_N), dt)
        self._gather(residual, dt)
        missing = self._along / np.maximum(self._power, 1e-9)
        explains = self._along * missing / max(self._surprise, 1e-9)
        explains *= missing < REVERSED[1]
        count = len(self._names)
        best = int(np.argmax(explains[:count])) if count else 0
        if explains[best] <= self._knobs.explained:  # a thruster fails more often than a sign is wrong
            best = count + int(np.argmax(explains[count:]))
        share = float(missing[best]) if explains[best] > self._knobs.explained else 0.0
        motion = self._diverging(rates, attitude_rad, (residual, momentum), best, share)
        self._since_s = self._since_s + dt if motion else 0.0
        certain = _is_reversed(share) and self._surprise > self._knobs.certain_radps2**2
        self._certain_s = self._certain_s + dt if certain else 0.0
        if self._since_s > self._knobs.patience_s:
            return f"it {motion} against its thrusters{self._reason(best, share)}"
        return (
            f"it does not turn as its thrusters push{self._reason(best, share)}" if self._certain_s > CERTAIN_S else ""
        )

    def _balance(self, rates: Matrix, attitude_rad: Vec3, forces_N: Matrix, dt: float) -> tuple[Matrix, Matrix]:
        """Moment that nothing explains, and change of the angular momentum, both filtered (3,) [N m]."""
        if self._slow_rates is None:
            self._slow_rates = rates
        drag = np.array([one.drag_force(rate) for one, rate in zip(self._freedoms, rates, strict=True)])
        roll, pitch, _ = attitude_rad
        righting = self._freedoms[0].restoring
        # Righting moment of the net weight's arm. Fossen 2011 eq. 4.6.
        upright = np.array([-righting * math.cos(pitch) * math.sin(roll), -righting * math.sin(pitch), 0.0])
        self._thrust = self._thrust + (forces_N - self._thrust) * -np.expm1(-dt / self._lags_s)
        keep = -math.expm1(-dt / self._knobs.filter_s)
        self._slow_thrust = self._slow_thrust + (self._thrust - self._slow_thrust) * keep
        self._slow_drag = self._slow_drag + (drag - self._slow_drag) * keep
        self._slow_righting = self._slow_righting + (upright - self._slow_righting) * keep
        momentum = self._inertia * (rates - self._slow_rates) / self._knobs.filter_s
        self._slow_rates = self._slow_rates + (rates - self._slow_rates) * keep
        residual = momentum - (self._slow_righting - self._slow_drag) - self._B @ self._slow_thrust
        for known in (-self._slow_drag, self._slow_righting):
            residual = without_more(residual, known, self._knobs.known_times)
        return residual, momentum

    def _gather(self, residual: Matrix, dt: float) -> None:
        """Correlate the residual with what each thruster and each axis would leave [rad/s^2].

        As `_judge` of the thruster fault detector: the sums of which missing shares and explained parts are quotients.
        An axis alone leaves a moment about itself only, hence the diagonal matrix.
        """
        wrenches = self._B * self._slow_thrust
        signatures = -np.hstack([wrenches, np.diag(wrenches.sum(axis=1))]) / self._inertia[:, None]
        surprise = residual / self._inertia
        keep = -math.expm1(-dt / self._knobs.memory_s)
        self._along += (signatures.T @ surprise - self._along) * keep
        self._power += (np.sum(signatures * signatures, axis=0) - self._power) * keep
        self._surprise += (float(surprise @ surprise) - self._surprise) * keep

    def _diverging(
        self, rates: Matrix, attitude_rad: Vec3, balance: tuple[Matrix, Matrix], best: int, share: float
    ) -> str:
        """What it does against its thrusters, in words; empty when it does not diverge.

        Four ways: it turns fast about the vertical with something reversed; it has leaned slowly to a tilt that it may
        not reach; it tilts with one thruster reversed and the motion growing (`early`: a small tilt is enough); it
        tilts and will be too far when the thrust ends, whatever the reason but a swing without thrust (`late`).
        """
        knobs, (residual, momentum) = self._knobs, balance
        if self._surprise < knobs.surprise_radps2**2:
            return ""
        driven = residual * rates > 0.0
        faster = driven & (momentum * rates > 0.0)
        is_reversed = _is_reversed(share)
        if is_reversed and driven[2] and abs(rates[2]) > math.radians(knobs.yaw_dps):
            return f"turns at {math.degrees(abs(rates[2])):.0f} deg/s"
        tilt, tilting = tilt_of(attitude_rad, rates)
        if self._leans(balance, attitude_rad, tilt):
            return f"leans by {math.degrees(tilt):.0f} deg"
        if tilting < math.radians(knobs.rate_dps) or not driven[:2].any():
            return ""
        # By power [W]: what thrusters turn more than anything else does was asked for, and is no divergence.
        unasked = float(residual[:2] @ rates[:2]) > float((self._B @ self._slow_thrust)[:2] @ rates[:2])
        by_thruster = is_reversed and best < len(self._names)
        early = by_thruster and faster[:2].any() and tilt > math.radians(knobs.tilt_deg)
        late = self._at_work and unasked and tilt + AHEAD_S * tilting > math.radians(knobs.worst_deg)
        found = f"tilts by {math.degrees(tilt):.0f} deg at {math.degrees(tilting):.0f} deg/s"
        return found if early or late else ""

    def _leans(self, balance: tuple[Matrix, Matrix], attitude_rad: Vec3, tilt: float) -> bool:
        """Whether it has come slowly to a tilt that it may not reach, which its thrusters, at work, do not ask for.

        What is brought back as hard as a surprise is no slow lean: a maneuver that turned further than it was to.
        """
        if tilt < math.radians(self._knobs.worst_deg) or not self._at_work:
            return False
        outwards = np.sin(attitude_rad[:2])
        residual, momentum = (float(one[:2] @ outwards) for one in balance)
        back = float(self._inertia[:2] @ np.abs(outwards)) * self._knobs.surprise_radps2
        return momentum > -back and residual > max(0.0, float((self._B @ self._slow_thrust)[:2] @ outwards))

    def _reason(self, best: int, share: float) -> str:
        """What explains it, as the end of a sentence; it may also be somebody who holds the vehicle."""
        if share <= 0.0:
            return ""
        if best >= len(self._names):
            return f", as if the sign of {TURNING[best - len(self._names)]} were wrong, of a sensor or of the thrusters"
        return f", as if {self._names[best]} pushed {'the wrong way round' if _is_reversed(share) else 'too little'}"


def _is_reversed(share: float) -> bool:
    least, most = REVERSED
    return least < share < most


def tilt_of(attitude_rad: Vec3, rates: Matrix) -> tuple[float, float]:
    """Angle from upright [rad], and how fast it grows with these rates (3,) [rad/s]."""
    roll, pitch, _ = attitude_rad
    tilt = math.acos(math.cos(roll) * math.cos(pitch))
    # Chain rule, with roll and pitch turning as the body does: exact where both are small, close enough up to 45 deg.
    growing = math.sin(roll) * math.cos(pitch) * rates[0] + math.cos(roll) * math.sin(pitch) * rates[1]
    return tilt, float(growing) / max(math.sin(tilt), 1e-3)
