"""Whether the dead man is silent: what is to end our thrust must itself be there."""

from __future__ import annotations

from dataclasses import dataclass

from hindrax_core.events import Stamp, seconds_between

TOLD_S = 0.2
"""How often the dead man is heard, when he lives [wall time]."""
SILENT_S = 1.0
SILENT_WALL_S = 0.8


@dataclass(slots=True)
class ParentSilence:
    """Judges by the clock of the output and the monotonic one [s]: a mock's may stand still, the system's may leap."""

    heard_at: Stamp
    heard_s: float

    def on_beat(self, now: Stamp, now_s: float) -> None:
        """The dead man lives."""
        self.heard_at, self.heard_s = now, now_s

    def silent(self, now: Stamp, now_s: float) -> bool:
        """Whether he has not been heard for too long."""
        recent = 0.0 <= seconds_between(self.heard_at, now) < SILENT_S
        return not recent and now_s - self.heard_s >= SILENT_WALL_S
