"""The update that every page gets five times a second: a snapshot as plain values, angles in degrees."""

from __future__ import annotations

import math
from typing import Any

from hindrax_control.hold.holds import HoldState
from hindrax_control.maneuver.maneuver_guards import ManeuverGuardKnobs, walls_after_braking_m
from hindrax_control.pool_bounds import PoolBounds
from hindrax_core.signals import Estimate, Navigation
from hindrax_core.vehicle import Vehicle
from hindrax_operator.monitor.draw import BAND
from hindrax_operator.snapshot import ANGLES, ManeuverView, Snapshot, Thrusters

Json = dict[str, Any]
LIMITS = ManeuverGuardKnobs()
"""Where the pilot's guards draw the line unless its parameters say otherwise."""


class Chart:
    """The pool from above: as the pilot does, it takes the vehicle to lie along the pool until it is first armed."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._box: PoolBounds | None = None
        self._was_armed = self._guessed = False

    def step(self, view: Snapshot) -> Json:
        """Return walls, hull and place [m, deg]; without a place while nothing is known.

        `guessed`: the vehicle was armed before it was first seen, so nobody here saw how it lay.
        """
        navigation = view.navigation
        known = navigation is not None and math.isfinite(navigation.attitude_rad[2])
        if navigation is not None and known and (self._box is None or not self._was_armed):
            self._guessed = self._box is None and view.thrusters.armed
            self._box = PoolBounds(self._vehicle, navigation.attitude_rad[2])
        self._was_armed = self._was_armed or view.thrusters.armed
        pool, hull = self._vehicle.pool, self._vehicle.envelope_m
        place = self._box.place(navigation) if self._box and navigation is not None else None
        return {
            "size": (pool.length_m, pool.width_m, pool.depth_m),
            "hull": (hull[0], hull[1]),
            "margin": LIMITS.wall_m,
            "walls": self._box and place and walls_after_braking_m(place, self._box.walls_m(place), LIMITS),
            "guessed": self._guessed,
            "place": place and {"x": place.x_m, "y": place.y_m, "heading": math.degrees(place.heading_rad)},
        }


def summary(view: Snapshot) -> Json:
    """Return everything in a snapshot except the pool."""
    found = view.thrusters
    return {
        "time": view.time_s,
        "silent": view.silent_s,
        "armed": found.armed,
        "state": found.state,
        "reason": found.reason,
        "navigation": _navigation(view.navigation),
        "thrusters": _thrusters(found),
        "lost": found.lost_axes,
        "plans": dict(view.plans),
        "holds": [_hold(one) for one in view.holds],
        "flight": _flight(view.flight),
        "health": [
            {"name": name, "level": one.level, "message": one.message, "rate": one.rate_Hz}
            for name, one in view.health.items()
        ],
        "estimates": [_estimate(motion, one) for motion, one in view.estimates.items()],
        "cameras": view.cameras,
    }


def _navigation(found: Navigation | None) -> Json | None:
    if found is None:
        return None
    roll, pitch, heading = (math.degrees(angle) for angle in found.attitude_rad)
    surge, sway, heave = found.velocity_mps
    return {
        "heading": heading % 360.0,
        "roll": roll,
        "pitch": pitch,
        "depth": found.depth_m,
        "altitude": found.altitude_m,
        "surge": surge,
        "sway": sway,
        "heave": heave,
        "locked": found.dvl_locked,
    }


def _thrusters(found: Thrusters) -> list[Json]:
    rows = zip(found.names, found.pulses_us, found.forces_N, found.saturated, strict=True)
    return [
        {"name": name, "pulse": pulse, "force": force, "saturated": bool(full), "disabled": name in found.disabled}
        for name, pulse, force, full in rows
    ]


def _hold(hold: HoldState) -> Json:
    angle = hold.axis in ANGLES
    setpoint, error = (math.degrees(one) if angle else one for one in (hold.setpoint, hold.error))
    return {
        "axis": hold.axis,
        "engaged": bool(hold.engaged),
        "setpoint": setpoint % 360.0 if hold.axis == "heading" else setpoint,
        "error": error,
        "unit": "deg" if angle else "m",
        "note": hold.note,
    }


def _flight(found: ManeuverView | None) -> Json | None:
    if found is None:
        return None
    turning = found.motion in ("roll", "pitch", "yaw")
    return {
        "motion": found.motion,
        "phase": found.phase,
        "aborted": found.aborted,
        "progress": found.progress,
        "remaining": found.remaining_s,
        "wall": found.wall_m,
        "force": found.force,
        "velocity": found.velocity,
        "units": ("Nm", "rad/s") if turning else ("N", "m/s"),
    }


def _estimate(motion: str, found: Estimate) -> Json:
    rows = zip(found.names, found.units, found.values, (BAND * sigma for sigma in found.sigmas), strict=True)
    keys = ("name", "unit", "value", "band")
    return {
        "motion": motion,
        "learning": found.learning,
        "reason": found.reason,
        "samples": found.samples,
        "values": [dict(zip(keys, row, strict=True)) for row in rows],
    }
