"""Whether the operator's link is alive, by heartbeats alone: the node graph lists dead nodes for many seconds."""

from dataclasses import dataclass

from hindrax_core.knobs import choice

HOLD, NEUTRAL, STAY = "hold", "neutral", "stay"
PATIENCE_S = 2.0
"""Four beats; half of them may be lost before the link counts as lost."""
STEADY_BEATS = 4
"""Heartbeats, none later than the patience after the one before, from which a link counts as steady."""
UNSTEADY_PATIENCE_S = 10.0
"""Longest silence of a link that is not steady yet: discovery and a busy machine delay the first heartbeats."""


@dataclass(frozen=True, slots=True)
class SafetyMonitorKnobs:
    """Reaction to the loss of the operator's link."""

    without_operator: str = choice(
        STAY, (HOLD, NEUTRAL, STAY), "hold: end the maneuver; neutral: disarm as well; stay: the link is not monitored"
    )


@dataclass(slots=True)
class LinkMonitor:
    """Time is an argument [s], of any clock that only goes forward."""

    last_s: float | None = None
    lost: bool = False
    regular: int = 0
    """Regular heartbeats in a row, up to `STEADY_BEATS`; zero after a loss, one again after a late one before that."""

    def beat(self, now_s: float) -> str:
        """Take a heartbeat; returns a message when the operator appears or is back, else an empty text."""
        silent_s = self.silent_s(now_s)
        message = ""
        if self.last_s is None:
            message = "link: an operator is connected"
        elif self.lost:
            message = f"link: the operator is back after {silent_s:.1f} s"
        if self.regular < STEADY_BEATS:
            on_time = self.last_s is not None and not self.lost and silent_s <= PATIENCE_S
            self.regular = self.regular + 1 if on_time else 1
        self.last_s, self.lost = now_s, False
        return message

    def step(self, now_s: float) -> bool:
        """Return True once per loss, when it is detected; never before the first heartbeat."""
        if self.lost or self.last_s is None or self.silent_s(now_s) <= self.allowed_s:
            return False
        self.lost, self.regular = True, 0
        return True

    @property
    def allowed_s(self) -> float:
        """Silence after which the link is lost [s]: longer before it is steady."""
        return PATIENCE_S if self.regular >= STEADY_BEATS else UNSTEADY_PATIENCE_S

    def silent_s(self, now_s: float) -> float:
        """Return the time since the last heartbeat [s]; zero before the first."""
        return 0.0 if self.last_s is None else now_s - self.last_s

    def status_text(self, now_s: float) -> str:
        """Return the state of the link as text."""
        if self.last_s is None:
            return "no operator yet"
        silent_s = self.silent_s(now_s)
        return f"no operator for {silent_s:.0f} s" if self.lost else "an operator is connected"
