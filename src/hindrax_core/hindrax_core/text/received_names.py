"""Names that come from elsewhere (another machine, a bag): data, of which no path is made unseen."""

import re
import unicodedata

CONTROL = frozenset(("Cc", "Cf", "Cs", "Zl", "Zp"))
"""Unicode categories of what a screen obeys, or does not show: controls, directions, bytes that are no text, breaks."""


def path_fault(name: str) -> str:
    """Reason why a path is no relative one within the folder below which it is put; empty when it is."""
    if any(unicodedata.category(letter) in CONTROL for letter in name):
        return "contains a control character"
    if not name or name.startswith("/"):
        return "is not relative"
    if any(part in ("", ".", "..") for part in name.split("/")):
        return "leads out of the folder"
    return ""


def file_name(text: str) -> str:
    """Name of a file for a text, without its slashes and with nothing but letters, digits, dots, dashes and _."""
    return re.sub(r"[^\w.-]+", "_", text.strip("/")).lstrip(".-") or "_"
