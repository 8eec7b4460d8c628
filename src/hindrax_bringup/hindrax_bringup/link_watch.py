"""Whether the operator's link lives, judged by heartbeats alone: the node graph shows the dead for many seconds."""

from __future__ import annotations

from dataclasses import dataclass

PATIENCE_s = 2.0
"""Four beats; half of them may be lost without anybody being called gone."""


@dataclass(slots=True)
class LinkWatch:
    """Time is an argument [s], of any clock that only goes forward."""

    patience_s: float = PATIENCE_s
    last_s: float | None = None
    lost: bool = False

    def beat(self, now_s: float) -> str:
        """Take a heartbeat; returns what to say of it, empty when it is no news."""
        silent_s = self.silent_s(now_s)
        news = ""
        if self.last_s is None:
            news = "link: the operator is there"
        elif self.lost:
            news = f"link: the operator is back after {silent_s:.1f} s"
        self.last_s, self.lost = now_s, False
        return news

    def step(self, now_s: float) -> bool:
        """Return True once for every loss, when it is noticed. Nobody is lost who was never there."""
        if self.lost or self.last_s is None or self.silent_s(now_s) <= self.patience_s:
            return False
        self.lost = True
        return True

    def silent_s(self, now_s: float) -> float:
        """Return the time since the last heartbeat [s]; zero before the first."""
        return 0.0 if self.last_s is None else now_s - self.last_s

    def words(self, now_s: float) -> str:
        """Return the state of the link in a few words."""
        if self.last_s is None:
            return "no operator yet"
        silent_s = self.silent_s(now_s)
        return f"no operator for {silent_s:.0f} s" if self.lost else "the operator is there"
