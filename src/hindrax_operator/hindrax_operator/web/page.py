"""What a browser gets: the page as one text, and the update five times a second, plain values with angles in degrees.

The page is `page.html` with `page.css` and `page.js` in it; the script runs by its hash.
"""

import base64
import hashlib
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hindrax_control.hold.holds import HoldState
from hindrax_control.maneuver.goal import EXCITATIONS, PLATEAUS
from hindrax_control.maneuver.plan import MOTIONS
from hindrax_core.signals import Estimate, Navigation
from hindrax_core.text.digits import TWO_SIDED_95
from hindrax_core.vehicle import Vehicle
from hindrax_operator.progress import units
from hindrax_operator.snapshot import ANGLES, PlaceView, Snapshot, Thrusters

NO_CHOICES = '{"motions": [], "excitations": []}'
STYLE_LINK, SCRIPT_LINK = '<link rel="stylesheet" href="page.css">', '<script src="page.js"></script>'
"""Places in `page.html`, each there once: what an editor follows there, and one answer without further files here."""


def _file(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


CHOICES = json.dumps({"motions": list(MOTIONS), "excitations": [PLATEAUS, *EXCITATIONS]})
"""What the form offers; the script reads it from the page."""
SCRIPT = _file("page.js")
SCRIPT_HASH = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
"""For the Content-Security-Policy: no other script runs in the page."""
PAGE = (
    _file("page.html")
    .replace(NO_CHOICES, CHOICES)
    .replace(STYLE_LINK, f"<style>{_file('page.css')}</style>")
    .replace(SCRIPT_LINK, f"<script>{SCRIPT}</script>")
)


Json = dict[str, Any]


def pool(vehicle: Vehicle, found: PlaceView | None) -> Json:
    """Return the pool from above as the pilot sees it: walls, hull and place [m, deg]."""
    size, hull = vehicle.pool, vehicle.envelope_m
    return {
        "size": (size.length_m, size.width_m, size.depth_m),
        "hull": (hull[0], hull[1]),
        "margin": found and found.margin_m,
        "walls": found and found.walls_m,
        "sigma": found and found.sigma_m,
        "unplaced": found.unplaced if found else "",
        "place": found and {"x": found.along_m, "y": found.across_m, "heading": math.degrees(found.heading_rad)},
    }


def summary(view: Snapshot) -> Json:
    """Return everything in a snapshot except the pool."""
    found = view.thrusters
    return {
        "time": view.time_s,
        "silent": view.silent_s,
        "stoppable": view.stoppable,
        "armed": found.armed,
        "state": found.state,
        "reason": found.reason,
        "navigation": _navigation(view.navigation),
        "thrusters": _thrusters(found),
        "lost": found.lost_axes,
        "plans": dict(view.plans),
        "holds": [_hold(one) for one in view.holds],
        "flight": view.flight and {**asdict(view.flight), "units": units(view.flight.motion)},
        "health": [{"name": name, **asdict(one)} for name, one in view.health.items()],
        "estimates": [_estimate(motion, one) for motion, one in view.estimates.items()],
        "cameras": view.cameras,
    }


def _navigation(found: Navigation | None) -> Json | None:
    if found is None:
        return None
    roll, pitch, heading = (math.degrees(angle) for angle in found.attitude_rad)
    velocity = dict(zip(("surge", "sway", "heave"), found.velocity_mps, strict=True))
    angles = {"roll": roll, "pitch": pitch, "heading": heading % 360.0}
    return {**angles, **velocity, "depth": found.depth_m, "altitude": found.altitude_m, "locked": found.dvl_locked}


def _thrusters(found: Thrusters) -> list[Json]:
    rows = zip(found.names, found.pulses_us, found.stops_us, found.forces_N, found.saturated, strict=True)
    return [
        {"name": name, "pulse": pulse, "stop": stop, "force": force, "saturated": bool(full)}
        | {"disabled": name in found.disabled}
        for name, pulse, stop, force, full in rows
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


def _estimate(motion: str, found: Estimate) -> Json:
    rows = zip(found.names, found.units, found.values, (TWO_SIDED_95 * sigma for sigma in found.sigmas), strict=True)
    keys = ("name", "unit", "value", "band")
    return {
        "motion": motion,
        "learning": found.learning,
        "reason": found.reason,
        "samples": found.samples,
        "values": [dict(zip(keys, row, strict=True)) for row in rows],
    }
