"""The firmware lies outside the packages; here it is imported as the board does."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "firmware"))
