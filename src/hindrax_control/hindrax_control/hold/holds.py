"""Heading, roll, pitch, depth and altitude holds: each owns its axis and leaves the others alone.

Gains follow from the vehicle file (see `regulator.py`), so a second vehicle needs none. A hold begins where the vehicle
is and moves its reference to the setpoint at a bounded rate; changing between depth and altitude keeps the effort. An
altitude hold without sonar holds the current depth, reports it, and returns when the sonar does.
"""

import math
from dataclasses import dataclass

from hindrax_control.hold.regulator import LoopTuning, Regulator, reference_speed
from hindrax_control.prior_dynamics import prior_dynamics
from hindrax_core.events import Stamp, seconds_between
from hindrax_core.knobs import knob
from hindrax_core.readings import Vec3, Vec6
from hindrax_core.rotation import wrapped
from hindrax_core.signals import NAN, ZERO6, Navigation
from hindrax_core.text.refusals import NOTHING, Reason, Refusal
from hindrax_core.vehicle import Vehicle

STATION = "station"
HOLDS = ("heading", "roll", "pitch", "depth", "altitude", STATION)
"""Axes that can be held. The station belongs to the pilot, which knows the pool."""
SNAME_OF = {"heading": "yaw", "roll": "roll", "pitch": "pitch", "depth": "heave", "altitude": "heave"}


@dataclass(frozen=True, slots=True)
class HoldKnobs:
    """Bandwidths of the holds; their gains follow from the vehicle file."""

    heading_bandwidth_radps: float = knob(2.0, 0.1, 5.0, "bandwidth of the heading hold [rad/s]")
    tilt_bandwidth_radps: float = knob(1.8, 0.1, 8.0, "bandwidth of the roll and pitch holds [rad/s]")
    vertical_bandwidth_radps: float = knob(1.0, 0.1, 5.0, "bandwidth of the depth and altitude holds [rad/s]")
    damping: float = knob(1.0, 0.4, 3.0, "damping ratio of every hold [-]")
    integral_s: float = knob(4.0, 0.5, 60.0, "time in which the integral part repeats the proportional one [s]")
    turn_radps: float = knob(0.5, 0.01, 3.0, "rate at which angles go to their setpoint [rad/s]")
    climb_mps: float = knob(0.25, 0.01, 1.0, "rate at which depth and altitude go to their setpoint [m/s]")
    integral_N: float = knob(15.0, 0.0, 500.0, "largest integral part of the depth and altitude holds [N]")
    integral_Nm: float = knob(5.0, 0.0, 500.0, "largest integral part of the angle holds [N m]")
    shortfall_N: float = knob(2.5, 0.0, 100.0, "shortfall of heave that stops its integral [N]")
    shortfall_Nm: float = knob(1.0, 0.0, 100.0, "shortfall of a moment that stops its integral [N m]")
    silent_s: float = knob(1.0, 0.1, 10.0, "age of the sonar at which altitude falls back to depth [s]")


@dataclass(frozen=True, slots=True)
class Setpoint:
    """An event: engage or move a hold (NaN: to where the vehicle is), or release it. Radians and meters."""

    axis: str
    engaged: bool = True
    value: float = NAN


@dataclass(frozen=True, slots=True)
class HoldState:
    """One hold: whether it acts, its setpoint, its error (setpoint - estimate), and why it acts less or not."""

    axis: str
    engaged: bool
    setpoint: float = NAN
    error: float = NAN
    note: str = ""


@dataclass(frozen=True, slots=True)
class HoldsOutput:
    """Wrench of all engaged holds [N, N m], zero on the axes of the others; and the state of each hold."""

    wrench: Vec6
    states: tuple[HoldState, ...]


@dataclass(slots=True)
class _Loop:
    """State of one axis between steps."""

    regulator: Regulator
    setpoint: float = NAN
    engaged: bool = False
    started: bool = False
    note: str = ""


def _tunings(knobs: HoldKnobs, vehicle: Vehicle) -> dict[str, LoopTuning]:
    """Tuning of each loop, by axis."""
    shared, turning = (knobs.damping, knobs.integral_s), (knobs.turn_radps, knobs.integral_Nm, knobs.shortfall_Nm)
    climbing = (reference_speed(knobs.climb_mps, vehicle), knobs.integral_N, knobs.shortfall_N)
    tilt = LoopTuning(knobs.tilt_bandwidth_radps, *shared, *turning)
    heading = LoopTuning(knobs.heading_bandwidth_radps, *shared, *turning)
    return {
        "yaw": heading,
        "roll": tilt,
        "pitch": tilt,
        "heave": LoopTuning(knobs.vertical_bandwidth_radps, *shared, *climbing),
    }


class Holds:
    """All holds of one vehicle. Setpoints are events; `step` is called for every new Navigation."""

    def __init__(self, vehicle: Vehicle, knobs: HoldKnobs | None = None) -> None:
        self._knobs, self._vehicle = knobs or HoldKnobs(), vehicle
        self._freedoms = prior_dynamics(vehicle)
        tunings = _tunings(self._knobs, vehicle)
        self._loops = {axis: _Loop(Regulator(self._freedoms[axis], one)) for axis, one in tunings.items()}
        self._vertical = self._loops["heave"]
        self._mode = "depth"
        self._measured = "depth"
        self._floor_m = NAN
        self._last: Stamp | None = None

    def tune(self, knobs: HoldKnobs) -> None:
        """Use other knobs from now on; engaged holds keep their setpoints, references and integrals."""
        self._knobs = knobs
        for axis, tuning in _tunings(knobs, self._vehicle).items():
            self._loops[axis].regulator.tune(tuning)

    # ---- events

    def set(self, setpoint: Setpoint) -> Refusal:
        """Engage, move or release one hold. Depth and altitude replace each other.

        Parameters
        ----------
        setpoint
            Axis, whether it is engaged, and its value; NaN is not judged by the range.

        Returns
        -------
        Refusal
            `SETPOINT` and why, or `NOTHING`.
        """
        refusal = self._refusal_of(setpoint)
        if refusal:
            return refusal
        loop = self._loops[SNAME_OF[setpoint.axis]]
        if loop is self._vertical and setpoint.axis != self._mode:
            if not setpoint.engaged:
                return NOTHING
            self._mode = setpoint.axis
        loop.started = loop.started and setpoint.engaged
        loop.engaged, loop.setpoint = setpoint.engaged, setpoint.value
        return NOTHING

    def release(self) -> None:
        """Release every hold."""
        for loop in self._loops.values():
            loop.engaged = loop.started = False

    def _refusal_of(self, setpoint: Setpoint) -> Refusal:
        axis, value = setpoint.axis, setpoint.value
        if axis not in SNAME_OF:
            return Refusal(Reason.SETPOINT, f"hold {axis!r}: unknown, wanted one of {', '.join(HOLDS)}")
        if not setpoint.engaged or math.isnan(value):
            return NOTHING
        low, high = self._range(axis)
        if low <= value <= high:
            return NOTHING
        unit, scale = ("m", 1.0) if axis in ("depth", "altitude") else ("deg", math.degrees(1.0))
        found = f"hold {axis}: found {value * scale:g} {unit}, wanted {low * scale:g} to {high * scale:g} {unit}"
        by = ", by depth_rating_m and pool.depth_m of the vehicle file" if unit == "m" else ""
        return Refusal(Reason.SETPOINT, f"{found}{by}")

    def _range(self, axis: str) -> tuple[float, float]:
        """Lowest and highest setpoint of a hold: no deeper than the vehicle may, and not in the floor of the pool."""
        if axis == "heading":
            return -1e6, 1e6
        if axis in ("roll", "pitch"):
            tilt_rad = math.radians(self._vehicle.limits.tilt_deg)
            return -tilt_rad, tilt_rad
        half_height_m, pool_m = 0.5 * self._vehicle.envelope_m[2], self._vehicle.pool.depth_m
        if axis == "depth":
            return 0.0, min(self._vehicle.depth_rating_m, pool_m - half_height_m)
        return half_height_m, pool_m

    # ---- time

    def step(self, navigation: Navigation, stamp: Stamp, shortfall: Vec6 = ZERO6, *, armed: bool = True) -> HoldsOutput:
        """Wrench of the holds for this state.

        A disarmed vehicle releases its holds: it shall not dive to an old setpoint when it is armed again.

        Parameters
        ----------
        navigation, stamp
            State, and its time.
        shortfall : [N, N m]
            What the allocator could not give of the last wrench: integral parts stand still there.
        armed
            Whether thrusters may turn.

        Returns
        -------
        HoldsOutput
            Wrench about the center of mass in SNAME axes, and the state of every hold.
        """
        if not armed:
            self.release()
        dt = 0.0 if self._last is None else seconds_between(self._last, stamp)
        self._last = stamp
        roll, pitch, yaw = navigation.attitude_rad
        p, q, r = navigation.rate_radps
        K = self._turn("roll", roll, p, dt, shortfall[3])
        M = self._turn("pitch", pitch, q, dt, shortfall[4])
        N = self._turn("yaw", yaw, r, dt, shortfall[5])
        K_munk, M_munk, N_munk = self._overturning(navigation)
        Z = self._climb(navigation, dt, shortfall[2])
        values = {"heading": yaw, "roll": roll, "pitch": pitch}
        values |= {"depth": navigation.depth_m, "altitude": navigation.altitude_m}
        states = [self._state(axis, value) for axis, value in values.items()]
        return HoldsOutput((0.0, 0.0, Z, K - K_munk, M - M_munk, N - N_munk), tuple(states))

    def _overturning(self, navigation: Navigation) -> Vec3:
        """Munk moments [N m] on the axes that are held: a hull that moves askew is turned across its way.

        Fossen 2011 eq. 6.43 for a diagonal mass matrix.
        """
        u, v, w = (value if math.isfinite(value) else 0.0 for value in navigation.velocity_mps)
        mx, my, mz = (self._freedoms[axis].inertia for axis in ("surge", "sway", "heave"))
        moments = {"roll": (my - mz) * v * w, "pitch": (mz - mx) * w * u, "yaw": (mx - my) * u * v}
        K, M, N = (moment if self._loops[axis].started else 0.0 for axis, moment in moments.items())
        return (K, M, N)

    def _turn(self, axis: str, value: float, rate: float, dt: float, shortfall: float) -> float:
        loop = self._loops[axis]
        if not self._ready(loop, value, rate):
            return 0.0
        regulator = loop.regulator
        to_goal = wrapped(loop.setpoint - regulator.ramp.value)
        effort = regulator.step(to_goal, wrapped(regulator.ramp.value - value), rate, dt, shortfall)
        return effort + self._freedoms[axis].restoring * math.sin(regulator.ramp.value)

    def _climb(self, navigation: Navigation, dt: float, shortfall: float) -> float:
        loop = self._vertical
        value, rate = self._downward(navigation)
        if not self._ready(loop, value, rate):
            return 0.0
        regulator = loop.regulator
        goal = -loop.setpoint if self._measured == "altitude" else loop.setpoint
        if self._measured != self._mode:
            goal = regulator.ramp.value
        effort = regulator.step(goal - regulator.ramp.value, regulator.ramp.value - value, rate, dt, shortfall)
        roll, pitch, _ = navigation.attitude_rad
        return (effort + self._freedoms["heave"].bias) / max(0.5, math.cos(roll) * math.cos(pitch))

    def _downward(self, navigation: Navigation) -> tuple[float, float]:
        """Coordinate that grows downward, and its rate; changes between depth and altitude keep the reference."""
        measured = self._mode
        self._vertical.note = ""
        age_s = navigation.altitude_age_s
        if math.isnan(navigation.altitude_m) or age_s > self._knobs.silent_s:
            if measured == "altitude":
                measured = "depth"
                self._vertical.note = f"altitude unknown for {age_s:.1f} s: holding depth"
        elif not math.isnan(navigation.depth_m + navigation.altitude_m):
            self._floor_m = navigation.depth_m + navigation.altitude_m
        if measured != self._measured and self._vertical.started:
            self._vertical.regulator.ramp.value += self._floor_m if measured == "depth" else -self._floor_m
        self._measured = measured
        value = navigation.depth_m if measured == "depth" else -navigation.altitude_m
        return value, down_rate(navigation)

    def _ready(self, loop: _Loop, value: float, rate: float) -> bool:
        """Whether a loop acts; one that is engaged starts as soon as its coordinate is known."""
        if loop is not self._vertical:
            loop.note = ""
        if not loop.engaged:
            return False
        if math.isnan(value) or math.isnan(rate):
            loop.note = "not measured: no effort"
            loop.started = False
            return False
        if not loop.started:
            loop.regulator.start(value, rate)
            loop.started = True
        if math.isnan(loop.setpoint) and (loop is not self._vertical or self._measured == self._mode):
            loop.setpoint = -value if loop is self._vertical and self._measured == "altitude" else value
        return True

    # ---- status

    def _state(self, axis: str, value: float) -> HoldState:
        loop = self._loops[SNAME_OF[axis]]
        vertical = loop is self._vertical
        if not loop.engaged or (vertical and axis != self._mode):
            return HoldState(axis, engaged=False)
        error = loop.setpoint - value
        return HoldState(axis, True, loop.setpoint, error if vertical else wrapped(error), loop.note)


def down_rate(navigation: Navigation) -> float:
    """Rate of depth: the third row of the rotation from body to north-east-down (Fossen 2011, eq. 2.18).

    Parameters
    ----------
    navigation
        Attitude and velocity; surge and sway, where unknown, count as zero: they matter only to a tilted vehicle.

    Returns
    -------
    float
        [m/s], downwards.
    """
    roll, pitch, _ = navigation.attitude_rad
    u, v, w = navigation.velocity_mps
    rate = math.cos(roll) * math.cos(pitch) * w
    if not math.isnan(u + v):
        rate += math.sin(roll) * math.cos(pitch) * v - math.sin(pitch) * u
    return rate
