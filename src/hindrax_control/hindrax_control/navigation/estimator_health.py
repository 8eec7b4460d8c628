"""Whether the state of the vehicle can be believed: checks that hold in every mode, with their limits and remedies.

A maneuver has guards of its own, which suppose that the state is true. These here ask whether it is: does gravity lie
where the attitude says, do pressure and DVL agree with what the accelerometer predicts, is the motion possible at all,
and is it still the same state, or one that began anew while the thrusters were armed. What fails here leaves nothing to
hold on to, so the answer is neutral and disarmed, whoever commands.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from hindrax_control.sensor_kinds import DEPTH, sensors_of
from hindrax_core.events import Stamp, seconds_between
from hindrax_core.knobs import knob
from hindrax_core.signals import Consistency, Navigation
from hindrax_core.vehicle import Vehicle

FASTEST = 3.0
"""Speeds beyond the vehicle's limit by this factor are no speeds of this vehicle."""
BEYOND_deg = 25.0
"""Tilt beyond the vehicle's limit by this much: no mode of flying goes there."""

SILENT_S = 1.0
"""Without pressure for longer, the depth is that of the accelerometer and of the floor."""
AT_ONCE = ("gravity",)
"""Checks of what is smoothed already: an attitude that turns away at 40 deg/s leaves no time for patience."""


@dataclass(frozen=True, slots=True)
class EstimatorHealthKnobs:
    """From where on a state is not believed."""

    tilt_sigma_deg: float = knob(3.0, 0.1, 90.0, "largest standard deviation of the tilt [deg]")
    gravity_deg: float = knob(20.0, 1.0, 90.0, "largest angle between gravity as measured and as believed [deg]")
    refused: int = knob(20, 2, 1000, "surplus of refused depths or velocities over accepted ones [-]")
    rate_dps: float = knob(450.0, 10.0, 4000.0, "fastest believable turn; the gyroscope ends at 500 [deg/s]")
    sunk_m: float = knob(0.2, 0.01, 5.0, "largest difference of the way down by DVL and by pressure, of 5 s [m]")
    below_floor_m: float = knob(0.3, 0.01, 5.0, "way below the floor that is believed while there is no pressure [m]")
    frozen_s: float = knob(0.2, 0.05, 60.0, "longest time for which the inertial sensor may say the very same [s]")
    patience_s: float = knob(0.1, 0.0, 5.0, "time for which a check must fail [s]")
    recovery_s: float = knob(1.0, 0.0, 60.0, "time for which all checks must hold before arming [s]")


Check: TypeAlias = Callable[[Navigation, Consistency], str]


class EstimatorHealth:
    """Judges one state after the other. What has failed once while armed is not forgotten before it is disarmed."""

    def __init__(self, vehicle: Vehicle, knobs: EstimatorHealthKnobs | None = None) -> None:
        self._knobs = knobs or EstimatorHealthKnobs()
        self._limits = vehicle.limits
        self._depth_sensors = sensors_of(vehicle, DEPTH)
        self._checks: dict[str, tuple[Check, str]] = {
            "finite": (_finite, "restart the control process; see /diagnostics"),
            "attitude": (self._attitude, "let the vehicle float quietly for some seconds"),
            "gravity": (self._gravity, "let the vehicle rest; look at the mount of the inertial sensor"),
            "depth": (self._depth, "let it rest at the surface; look at the pressure sensor (`./hindrax doctor`)"),
            "velocity": (self._velocity, "let it rest; see whether the DVL tells the truth (`./hindrax monitor`)"),
            "sinking": (self._sinking, "see whether pressure sensor and DVL tell the truth (`./hindrax monitor`)"),
            "floor": (self._floor, "bring it up; look at the pressure sensor (`./hindrax doctor`)"),
            "frozen": (self._frozen, "look at the inertial sensor (`./hindrax doctor`)"),
            "rate": (self._rate, "look at the inertial sensor (`./hindrax doctor`)"),
            "speed": (self._speed, "let it come to rest; see what the sensors say (`./hindrax monitor`)"),
            "tilt": (self._tilt, "bring it upright, and look at its trim"),
        }
        self._failing_since: dict[str, Stamp] = {}
        self._held: tuple[str, ...] = ()
        self._failed_at: Stamp | None = None
        self._began: Stamp | None = None

    def step(self, navigation: Navigation, stamp: Stamp, *, armed: bool) -> tuple[str, ...]:
        """Return "name: found, wanted; remedy" for all that speaks against thrust; nothing when all is well.

        `armed` are thrusters that may turn or are about to.
        """
        found = self._restarted(navigation, armed=armed) + self._failing(navigation, stamp)
        if found:
            self._failed_at = stamp
            self._held = found
        elif not armed and not self._recovering(stamp):
            self._held = ()
        return self._held

    def _recovering(self, stamp: Stamp) -> bool:
        return self._failed_at is not None and seconds_between(self._failed_at, stamp) < self._knobs.recovery_s

    def _restarted(self, navigation: Navigation, *, armed: bool) -> tuple[str, ...]:
        """Say that this is not the state with which the thrusters were armed."""
        began = navigation.consistency.began
        before, self._began = self._began, began
        if before is None or before == began or not armed:
            return ()
        return ("restart: the state of the vehicle began anew in flight, wanted an unbroken one; disarm and arm again",)

    def _failing(self, navigation: Navigation, stamp: Stamp) -> tuple[str, ...]:
        found = []
        for name, (check, remedy) in self._checks.items():
            text = check(navigation, navigation.consistency)
            patience_s = 0.0 if name in AT_ONCE else self._knobs.patience_s
            if not text:
                self._failing_since.pop(name, None)
            elif seconds_between(self._failing_since.setdefault(name, stamp), stamp) >= patience_s:
                found.append(f"{name}: {text}; {remedy}")
        return tuple(found)

    def _attitude(self, _: Navigation, consistency: Consistency) -> str:
        found, most = math.degrees(consistency.tilt_sigma_rad), self._knobs.tilt_sigma_deg
        return f"tilt known to {found:.1f} deg, wanted {most:.1f} deg" if found > most else ""

    def _gravity(self, _: Navigation, consistency: Consistency) -> str:
        found, most = math.degrees(consistency.gravity_off_rad), self._knobs.gravity_deg
        return f"{found:.0f} deg from where it is measured, wanted at most {most:.0f} deg" if found > most else ""

    def _depth(self, _: Navigation, consistency: Consistency) -> str:
        return self._refused(consistency.refused_depths, "depths by pressure contradict depth and heave velocity")

    def _velocity(self, _: Navigation, consistency: Consistency) -> str:
        return self._refused(consistency.refused_velocities, "velocities of the DVL contradict the accelerometer")

    def _sinking(self, _: Navigation, consistency: Consistency) -> str:
        found, most = abs(consistency.sunk_off_m), self._knobs.sunk_m
        return f"DVL and pressure differ by {found:.2f} m, wanted at most {most:.2f} m" if found > most else ""

    def _floor(self, navigation: Navigation, _: Consistency) -> str:
        found, most = -navigation.altitude_m, self._knobs.below_floor_m
        silent_s = min((navigation.ages_s.get(name, 0.0) for name in self._depth_sensors), default=0.0)
        below = silent_s > SILENT_S and found > most
        return f"{found:.2f} m below it without pressure, wanted at most {most:.2f} m" if below else ""

    def _frozen(self, _: Navigation, consistency: Consistency) -> str:
        found, most = consistency.frozen_s, self._knobs.frozen_s
        return f"the inertial sensor has said the very same for {found:.1f} s, wanted noise" if found > most else ""

    def _refused(self, count: int, text: str) -> str:
        return f"{count} {text}, wanted fewer than {self._knobs.refused}" if count >= self._knobs.refused else ""

    def _rate(self, navigation: Navigation, _: Consistency) -> str:
        found, most = math.degrees(math.hypot(*navigation.rate_radps)), self._knobs.rate_dps
        return f"{found:.0f} deg/s, wanted at most {most:.0f} deg/s" if found > most else ""

    def _speed(self, navigation: Navigation, _: Consistency) -> str:
        found = math.sqrt(sum(v * v for v in navigation.velocity_mps if not math.isnan(v)))
        most = FASTEST * self._limits.speed_mps
        return f"{found:.1f} m/s, wanted at most {most:.1f} m/s" if found > most else ""

    def _tilt(self, navigation: Navigation, _: Consistency) -> str:
        roll, pitch, _yaw = navigation.attitude_rad
        if not all(map(math.isfinite, (roll, pitch))):
            return ""
        found = math.degrees(math.acos(math.cos(roll) * math.cos(pitch)))
        most = self._limits.tilt_deg + BEYOND_deg
        return f"{found:.0f} deg, wanted at most {most:.0f} deg" if found > most else ""


def _finite(navigation: Navigation, _: Consistency) -> str:
    """Attitude and rates are always known; velocity and depth may not be."""
    finite = all(map(math.isfinite, (*navigation.attitude_rad, *navigation.rate_radps)))
    return "" if finite else "attitude or rates are no numbers, wanted finite ones"
