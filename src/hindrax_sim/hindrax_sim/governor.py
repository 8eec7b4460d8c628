"""Rate of the mock's time: as fast as the stack follows, and never faster than requested."""

from __future__ import annotations

from dataclasses import dataclass

from hindrax_core.events import Stamp, seconds_between

FREE_LAG_s = 0.035
DEAD_LAG_s = 1.0
SLOW = 8.0


@dataclass(slots=True)
class Governor:
    """Computes the minimum wall time of a step of the mock.

    The pulses written to the emulated outputs show how far the control loop is behind. While it keeps up, time runs
    free (or at `rate`, where that is not zero). When it falls behind by more than a period and a half, time nearly
    stands still until it has caught up: so a loaded machine makes a run longer, not the vehicle's latency. A loop that
    is dead for a second is waited for no more than in real time, and so is one that has not turned a thruster yet: the
    output of a stack that starts repeats neutral by itself, more slowly than any loop.
    """

    rate: float = 0.0
    turned: bool = True
    """Whether a thruster has turned."""
    worst_lag_s: float = 0.0

    def least_wall_s(self, step_s: float, now: Stamp, last_write: Stamp | None) -> float:
        """Minimum wall time of the step from `now` [s]."""
        asked = step_s / self.rate if self.rate > 0.0 else 0.0
        lag = seconds_between(last_write, now) if last_write is not None else DEAD_LAG_s
        if self.turned and lag < DEAD_LAG_s:
            self.worst_lag_s = max(self.worst_lag_s, lag)
        return max(asked, step_s * self._slowness(lag))

    def _slowness(self, lag_s: float) -> float:
        """Wall seconds per second of the mock, for a control loop that is this far behind."""
        if lag_s <= FREE_LAG_s:
            return 0.0
        return SLOW if self.turned and lag_s < DEAD_LAG_s else 1.0
