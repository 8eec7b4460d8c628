"""Content for a browser: the page as one text, and the update five times a second, plain values with angles in degrees.

The page is `page.html` with `page.css` and `page.js` in it; the script runs by its hash.
"""

import base64
import hashlib
import json
import math
from dataclasses import asdict, fields
from pathlib import Path

from hindrax_control.hold.holds import HoldState
from hindrax_control.maneuver.goal import EXCITATIONS, PLATEAUS
from hindrax_core.signals import Estimate, Navigation
from hindrax_core.text.digits import TWO_SIDED_95
from hindrax_core.vehicle import AXES
from hindrax_operator.progress import units
from hindrax_operator.snapshot import ANGLES, Snapshot

NO_CHOICES = '{"motions": [], "excitations": []}'
STYLE_LINK, SCRIPT_LINK = '<link rel="stylesheet" href="page.css">', '<script src="page.js"></script>'
"""Places in `page.html`, each there once: what an editor follows there, and one answer without further files here."""


def _file(name: str) -> str:
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


CHOICES = json.dumps({"motions": list(AXES), "excitations": [PLATEAUS, *EXCITATIONS]})
"""Choices of the form; the script reads them from the page."""
SCRIPT = _file("page.js")
SCRIPT_HASH = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
"""For the Content-Security-Policy: no other script runs in the page."""
PAGE = (
    _file("page.html")
    .replace(NO_CHOICES, CHOICES)
    .replace(STYLE_LINK, f"<style>{_file('page.css')}</style>")
    .replace(SCRIPT_LINK, f"<script>{SCRIPT}</script>")
)


Json = dict[str, object]


def summary(view: Snapshot) -> Json:
    """Return what a page shows of a snapshot: all as it is, but for angles in degrees and coefficients in rows."""
    return {
        **{one.name: getattr(view, one.name) for one in fields(view)},
        "navigation": _navigation(view.navigation),
        "holds": [_hold(one) for one in view.holds],
        "flight": view.flight and {**asdict(view.flight), "units": units(view.flight.motion)},
        "estimates": [_estimate(motion, one) for motion, one in view.estimates.items()],
    }


def _navigation(found: Navigation | None) -> Json | None:
    if found is None:
        return None
    roll, pitch, heading = (math.degrees(angle) for angle in found.attitude_rad)
    velocity = dict(zip(("surge", "sway", "heave"), found.velocity_mps, strict=True))
    angles = {"roll": roll, "pitch": pitch, "heading": _compass(heading)}
    return {**angles, **velocity, "depth": found.depth_m, "altitude": found.altitude_m, "locked": found.dvl_locked}


def _compass(angle_deg: float) -> float:
    """Heading from 0 on, rounded to what the page shows before the turn is taken off: never 360.0 there."""
    return round(angle_deg, 1) % 360.0


def _hold(hold: HoldState) -> Json:
    angle = hold.axis in ANGLES
    setpoint, error = (math.degrees(one) if angle else one for one in (hold.setpoint, hold.error))
    return {
        "axis": hold.axis,
        "engaged": bool(hold.engaged),
        "setpoint": _compass(setpoint) if hold.axis == "heading" else setpoint,
        "error": error,
        "unit": "deg" if angle else "m",
        "note": hold.note,
    }


def _estimate(motion: str, found: Estimate) -> Json:
    bands = (TWO_SIDED_95 * sigma for sigma in found.sigmas)
    rows = zip(found.names, found.units, found.values, found.sigmas, bands, strict=True)
    keys = ("name", "unit", "value", "std", "band")
    return {
        "motion": motion,
        "learning": found.learning,
        "reason": found.reason,
        "samples": found.samples,
        "values": [dict(zip(keys, row, strict=True)) for row in rows],
    }
