"""The page as one text: markup, style and script in a single answer, and the hash by which the script may run."""

from __future__ import annotations

import base64
import hashlib

from hindrax_bringup.web.markup import BODY
from hindrax_bringup.web.script import SCRIPT
from hindrax_bringup.web.style import CSS

SCRIPT_HASH = base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode()
"""For the Content-Security-Policy: no other script runs in the page."""

PAGE = f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>hindrax</title>
<meta name="viewport" content="width=device-width,initial-scale=1">
<link rel="icon" href="data:,"><style>{CSS}</style></head>
<body>{BODY}<script>{SCRIPT}</script></body></html>
"""
