"""Vehicle files for tests: the Hindrax's with something else in it."""

import re
from pathlib import Path

from hindrax_bringup.share_files import default_vehicle


def hindrax_file(folder: Path, *changes: tuple[str, str]) -> Path:
    """Return a copy of the Hindrax's vehicle file with each pattern replaced by its text."""
    text = default_vehicle().read_text(encoding="utf-8")
    for pattern, instead in changes:
        text, found = re.subn(pattern, instead, text, flags=re.MULTILINE)
        assert found, pattern
    file = folder / "mine.yaml"
    file.write_text(text, encoding="utf-8")
    return file
