"""Whether the state of the vehicle is plausible: checks that hold in every mode, with their limits and remedies.

A maneuver has its own guards, which assume that the state is true. These checks test it: gravity along the attitude,
pressure and DVL consistent with the accelerometer, a possible motion, and no restart of the state while the thrusters
are armed. Without a trusted state nothing can be held, so a failure means neutral and disarmed for every commander.

The sensors behind third-party odometry are the responsibility of its maker. It must be recent, continuous, and possible
for this vehicle: another source, a step back in time or a jump is a restart, which is not accepted in flight.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

from hindrax_control.allocation.divergence_guard import DivergenceGuard, DivergenceKnobs
from hindrax_control.navigation.velocity_gain import described
from hindrax_control.sensors import SensorMount, altimeters
from hindrax_core.events import Stamp, Stamped, seconds_between
from hindrax_core.input_checks import StampWindow
from hindrax_core.knobs import knob
from hindrax_core.rotation import matrix
from hindrax_core.signals import NAN, NEVER, Consistency, Navigation
from hindrax_core.text.coded import Coded
from hindrax_core.text.digits import above
from hindrax_core.text.refusals import NOTHING, Refusal
from hindrax_core.vehicle import Vehicle

FASTEST = 3.0
"""Speeds beyond the vehicle's limit by this factor are no speeds of this vehicle."""
BEYOND_deg = 25.0
"""Tilt beyond the vehicle's limit by this much: no mode of flying goes there."""

SILENT_S = 1.0
"""Without pressure for longer, the depth is that of the accelerometer and of the floor."""
WINDOW = StampWindow(0.5, 0.1)
"""For the stamps of an odometry; those of a wrench have the same limits."""
SHORTEST_INTERVAL_S = 0.015
"""States in between are left out: the pilot counts on 50 Hz."""
JUMP_m = 0.3
"""A position may be corrected by so much at once."""
ALTITUDE_AGE_S = 2.0


@dataclass(frozen=True, slots=True)
class EstimatorHealthKnobs:
    """Limits beyond which a state is rejected."""

    tilt_sigma_deg: float = knob(3.0, 0.1, 90.0, "largest standard deviation of the tilt [deg]")
    gravity_deg: float = knob(20.0, 1.0, 90.0, "largest angle between gravity as measured and as estimated [deg]")
    refused: int = knob(20, 2, 1000, "surplus of refused depths over accepted ones [-]")
    refused_velocities: int = knob(8, 2, 1000, "surplus of refused velocities over accepted ones [-]")
    gain_off: float = knob(0.35, 0.05, 10.0, "largest distance of the velocity gain from 1, beyond its noise [-]")
    gain_sigmas: float = knob(3.0, 1.0, 20.0, "deviations by which that distance must stand out [-]")
    rate_dps: float = knob(450.0, 10.0, 4000.0, "fastest plausible turn; the gyroscope ends at 500 [deg/s]")
    sunk_m: float = knob(0.2, 0.01, 5.0, "largest difference of the descent by DVL and by pressure, over 5 s [m]")
    drifted_m: float = knob(0.2, 0.01, 5.0, "drift of the depth against DVL and range to the floor [m]")
    below_floor_m: float = knob(0.3, 0.01, 5.0, "depth below the floor accepted without pressure [m]")
    frozen_s: float = knob(0.2, 0.05, 60.0, "longest time for which the inertial sensor may repeat one sample [s]")
    patience_s: float = knob(0.1, 0.0, 5.0, "time for which a check must fail [s]")
    recovery_s: float = knob(1.0, 0.0, 60.0, "time for which all checks must hold before arming [s]")
    divergence: DivergenceKnobs = field(default_factory=DivergenceKnobs)


class StateCheck(StrEnum):
    """What a state can fail; the word begins its sentence, in diagnostics and as the reason of a disarm."""

    FINITE = "finite"
    ATTITUDE = "attitude"
    GRAVITY = "gravity"
    DEPTH = "depth"
    VELOCITY = "velocity"
    GAIN = "gain"
    SINKING = "sinking"
    DRIFT = "drift"
    FLOOR = "floor"
    FROZEN = "frozen"
    RATE = "rate"
    SPEED = "speed"
    TILT = "tilt"
    DIVERGENCE = "divergence"
    RESTART = "restart"


class FailedCheck(Coded[StateCheck]):
    """The sentence of a failed check, "check: found, wanted; remedy"; `failed` takes the remedy from the table."""

    __slots__ = ()


REMEDIES: Mapping[StateCheck, str] = {
    StateCheck.FINITE: "restart the control process; see /diagnostics",
    StateCheck.ATTITUDE: "let the vehicle float quietly for some seconds",
    StateCheck.GRAVITY: "let the vehicle rest; check the mount of the inertial sensor",
    StateCheck.DEPTH: "let it rest at the surface; check the pressure sensor (`./hindrax doctor`)",
    StateCheck.VELOCITY: "let it rest; check the DVL (`./hindrax monitor`)",
    StateCheck.GAIN: "check the DVL's mount and scale (`./hindrax commission`)",
    StateCheck.SINKING: "check pressure sensor and DVL (`./hindrax monitor`)",
    StateCheck.DRIFT: "let it rest at the surface; check the pressure sensor (`./hindrax doctor`)",
    StateCheck.FLOOR: "bring it up; check the pressure sensor (`./hindrax doctor`)",
    StateCheck.FROZEN: "check the inertial sensor (`./hindrax doctor`)",
    StateCheck.RATE: "check the inertial sensor (`./hindrax doctor`)",
    StateCheck.SPEED: "let it come to rest; check the sensors (`./hindrax monitor`)",
    StateCheck.TILT: "bring it upright, and check its trim",
    StateCheck.DIVERGENCE: "bring it upright, run each thruster alone (`./hindrax thruster`), correct its wiring or "
    "sign",
    StateCheck.RESTART: "disarm and arm again",
}
"""Remedy of each failed check."""
AT_ONCE = (StateCheck.GRAVITY, StateCheck.DIVERGENCE)
"""Checks of what is smoothed already: an attitude that turns away at 40 deg/s leaves no time for patience."""


def failed(check: StateCheck, found: str) -> FailedCheck:
    """Make "check: what was found, what was wanted; remedy"."""
    return FailedCheck(check, f"{check}: {found}; {REMEDIES[check]}")


class EstimatorHealth:
    """Judges one state after the other. What has failed once while armed is not forgotten before it is disarmed."""

    def __init__(self, vehicle: Vehicle, knobs: EstimatorHealthKnobs | None = None) -> None:
        self._knobs = knobs or EstimatorHealthKnobs()
        self._limits = vehicle.limits
        self._has_depth = bool(vehicle.measuring("depth"))
        self._divergence = DivergenceGuard(vehicle, self._knobs.divergence)
        self._failing_since: dict[StateCheck, Stamp] = {}
        self._held: tuple[FailedCheck, ...] = ()
        self._failed_at = NEVER
        self._began: Stamp | None = None

    def step(
        self, navigation: Navigation, stamp: Stamp, forces_N: Sequence[float] = (), *, armed: bool
    ) -> tuple[FailedCheck, ...]:
        """Judge one state.

        Parameters
        ----------
        navigation, stamp
            State, and its time.
        forces_N : (thrusters,) [N]
            What each should give now, where that is known.
        armed
            Whether thrusters may turn, or are about to.

        Returns
        -------
        tuple[FailedCheck, ...]
            Every reason against thrust; nothing when all is well.
        """
        diverging = self._divergence.step(navigation, stamp, forces_N if armed else ())
        found = self._restarted(navigation, armed=armed) + self._failing(navigation, stamp, diverging)
        if found:
            self._failed_at = stamp
            self._held = found
        elif not armed and seconds_between(self._failed_at, stamp) >= self._knobs.recovery_s:
            self._held = ()
        return self._held

    def _restarted(self, navigation: Navigation, *, armed: bool) -> tuple[FailedCheck, ...]:
        """Say that this is not the state with which the thrusters were armed."""
        began = navigation.consistency.began
        before, self._began = self._began, began
        if before is None or before == began or not armed:
            return ()
        found = "the state of the vehicle restarted in flight, wanted a continuous one"
        return (failed(StateCheck.RESTART, found),)

    def _failing(self, navigation: Navigation, stamp: Stamp, diverging: str) -> tuple[FailedCheck, ...]:
        found = []
        for check, text in ((StateCheck.DIVERGENCE, diverging), *self._checks(navigation)):
            patience_s = 0.0 if check in AT_ONCE else self._knobs.patience_s
            if not text:
                self._failing_since.pop(check, None)
            elif seconds_between(self._failing_since.setdefault(check, stamp), stamp) >= patience_s:
                found.append(failed(check, text))
        return tuple(found)

    def _checks(self, navigation: Navigation) -> Iterator[tuple[StateCheck, str]]:
        """Yield each check, and what it found and wanted: nothing where it holds."""
        knobs, limits, evidence = self._knobs, self._limits, navigation.consistency
        roll, pitch, yaw = navigation.attitude_rad
        # Attitude and rates are always known; velocity and depth may not be.
        finite = all(map(math.isfinite, (roll, pitch, yaw, *navigation.rate_radps)))
        yield StateCheck.FINITE, "" if finite else "attitude or rates are no numbers, wanted finite ones"
        found, most = math.degrees(evidence.tilt_sigma_rad), knobs.tilt_sigma_deg
        yield StateCheck.ATTITUDE, above("tilt known to {} deg, wanted {} deg", found, most, 1)
        found, most = math.degrees(evidence.gravity_off_rad), knobs.gravity_deg
        yield StateCheck.GRAVITY, above("{} deg from where it is measured, wanted at most {} deg", found, most, 0)
        refused, fewest = evidence.refused_depths, knobs.refused
        words = "depths by pressure contradict depth and heave velocity, wanted fewer than"
        yield StateCheck.DEPTH, f"{refused} {words} {fewest}" if refused >= fewest else ""
        refused, fewest = evidence.refused_velocities, knobs.refused_velocities
        words = "velocities of the DVL contradict the accelerometer, wanted fewer than"
        yield StateCheck.VELOCITY, f"{refused} {words} {fewest}" if refused >= fewest else ""
        yield StateCheck.GAIN, self._wrong_gain(evidence)
        words = "DVL and pressure differ by {} m, wanted at most {} m"
        yield StateCheck.SINKING, above(words, abs(evidence.sunk_off_m), knobs.sunk_m, 2)
        words = "depth by pressure is {} m off DVL and range to the floor, wanted at most {} m"
        yield StateCheck.DRIFT, above(words, abs(evidence.drifted_off_m), knobs.drifted_m, 2)
        words = "{} m below it without pressure, wanted at most {} m"
        # Never measured at all is the guards' concern: an age of infinity here would be a false alarm at the start.
        silent_s = navigation.depth_age_s if self._has_depth and math.isfinite(navigation.depth_age_s) else 0.0
        below = above(words, -navigation.altitude_m, knobs.below_floor_m, 2) if silent_s > SILENT_S else ""
        yield StateCheck.FLOOR, below
        found, most = evidence.frozen_s, knobs.frozen_s
        words = "the inertial sensor has repeated one sample for"
        yield StateCheck.FROZEN, f"{words} {found:.1f} s, wanted noise" if found > most else ""
        found, most = math.degrees(math.hypot(*navigation.rate_radps)), knobs.rate_dps
        yield StateCheck.RATE, above("{} deg/s, wanted at most {} deg/s", found, most, 0)
        found = math.sqrt(sum(v * v for v in navigation.velocity_mps if not math.isnan(v)))
        yield StateCheck.SPEED, above("{} m/s, wanted at most {} m/s", found, FASTEST * limits.speed_mps, 1)
        leans = math.isfinite(roll) and math.isfinite(pitch)
        found = math.degrees(math.acos(math.cos(roll) * math.cos(pitch))) if leans else 0.0
        yield StateCheck.TILT, above("{} deg, wanted at most {} deg", found, limits.tilt_deg + BEYOND_deg, 0)

    def _wrong_gain(self, evidence: Consistency) -> str:
        """Say that the DVL is turned or scaled, where its changes of velocity show it beyond doubt."""
        off, sigma = abs(evidence.velocity_gain - 1.0), evidence.velocity_gain_sigma
        if off <= self._knobs.gain_off or off <= self._knobs.gain_sigmas * sigma:
            return ""
        return f"changes of velocity by the DVL are {described(evidence.velocity_gain)}, wanted as by the accelerometer"


class ExternalOdometry:
    """One vehicle's state, made complete: an odometry stands for all sensors but the altimeter."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._fastest_mps = FASTEST * vehicle.limits.speed_mps
        self._altimeters = altimeters(vehicle)
        self._mount = SensorMount(vehicle.sensors[self._altimeters[0]]) if self._altimeters else None
        self._ages_s = {name: 0.0 for name in vehicle.sensors if name not in self._altimeters}
        self._range: Stamped[float] | None = None
        self._last: Stamped[Navigation] | None = None
        self._source, self._began = "", NEVER
        self.breaks = 0
        """Count of restarts of the state, so that its position does not continue the previous one."""

    def range(self, stamp: Stamp, range_m: float) -> None:
        """Keep the distance to the bottom along the axis of the altimeter [m]."""
        if 0.0 < range_m < math.inf:
            self._range = Stamped(stamp, range_m)

    def step(self, found: Stamped[Navigation], source: str, now: Stamp) -> tuple[Stamped[Navigation] | None, Refusal]:
        """Make the state to fly on of somebody's odometry.

        Parameters
        ----------
        found
            State by the odometry.
        source
            GID of its publisher.
        now
            Time of the vehicle.

        Returns
        -------
        tuple[Stamped[Navigation] | None, Refusal]
            The state, None for one that is too near to the last or refused; why it was refused, if it was.
        """
        wrong_stamp = WINDOW.judge(found.stamp, now)
        if wrong_stamp is not None:
            return None, wrong_stamp.refusal
        last = self._last
        if (
            last is not None
            and source == self._source
            and 0.0 <= seconds_between(last.stamp, found.stamp) < SHORTEST_INTERVAL_S
        ):
            return None, NOTHING
        if last is None or source != self._source or self._broken(last, found):
            self._began, self.breaks = found.stamp, self.breaks + (last is not None)
        self._source, self._last = source, found
        consistency = replace(found.reading.consistency, began=self._began)
        altitude_m, age_s = self._altitude(found)
        ages_s = self._ages_s | dict.fromkeys(self._altimeters, age_s)
        depth_age_s = 0.0 if math.isfinite(found.reading.depth_m) else math.inf
        state = replace(
            found.reading,
            consistency=consistency,
            altitude_m=altitude_m,
            ages_s=ages_s,
            depth_age_s=depth_age_s,
            altitude_age_s=age_s,
        )
        return Stamped(found.stamp, state), NOTHING

    def _broken(self, last: Stamped[Navigation], found: Stamped[Navigation]) -> bool:
        dt_s = seconds_between(last.stamp, found.stamp)
        moved_m = math.dist(_place(last.reading), _place(found.reading))
        return dt_s < 0.0 or moved_m > JUMP_m + self._fastest_mps * dt_s

    def _altitude(self, found: Stamped[Navigation]) -> tuple[float, float]:
        """Height of the body origin above the bottom [m], NaN where unknown, and the age of the range [s]."""
        if self._range is None or self._mount is None:
            return NAN, math.inf
        age_s = max(0.0, seconds_between(self._range.stamp, found.stamp))
        if age_s > ALTITUDE_AGE_S:
            return NAN, age_s
        down = matrix(found.reading.attitude_rad)[2]
        axis, lever = self._mount.axis, self._mount.lever_m
        along = (self._range.reading * a + b for a, b in zip(axis, lever, strict=True))
        return sum(part * way for part, way in zip(down, along, strict=True)), age_s


def _place(state: Navigation) -> tuple[float, float, float]:
    """North, east, depth; what is unknown is at zero [m]."""
    north, east, down = (value if math.isfinite(value) else 0.0 for value in (*state.position_m, state.depth_m))
    return (north, east, down)
