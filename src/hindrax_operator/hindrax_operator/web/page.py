"""The page as one text: `page.html` with `page.css` and `page.js` in it, and the hash by which the script may run."""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path

from hindrax_control.maneuver.goal import EXCITATIONS, PLATEAUS
from hindrax_control.maneuver.plan import MOTIONS

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
