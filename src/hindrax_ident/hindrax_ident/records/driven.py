"""Whether the thrust on an axis drives its motion, or answers it, as that of a controller which holds the axis.

Where a controller holds an axis, other forces move it, and the thrust brakes. A fit takes one for the other: its "drag"
is then the controller's gain with the sign turned, confidently (closed-loop identification, Ljung 1999 section 13.4);
with a delay of half a period an answer that brakes looks like a push, and its drag was ten times the true one.
"""

from collections import deque
from enum import StrEnum

import numpy as np

from hindrax_ident.arrays import Array
from hindrax_ident.model.thrust_lag import LaggedInput

USUAL_S = 0.7
"""Usual time constant of a small vehicle."""
AGAINST, ANSWERS = -0.6, 0.05
"""Correlation of velocity and thrust below which the sign of the thrust is wrong; and how much weaker it is behind the
lag of a vehicle than at once where the thrust follows the velocity, as that of a controller which damps it."""
DELAYS_S, BRAKED = (0.0, 0.1, 0.2, 0.3), -0.1
"""Usual delays of a motion behind its command, and the correlation of both below which the thrust takes energy out of
the motion. At the best delay it was 0.27 and more of 40 motions of three vehicles that were flown, and -0.15 and less
of 12 that a controller held."""
BLOCK = 25
"""Rows between two looks."""


class Drive(StrEnum):
    """What the thrust does to the motion; its values are codes of objections and of samples."""

    DRIVES = ""
    AGAINST = "against_thrust"
    BRAKES = "braked_by_thrust"


class RunningDrive:
    """What the thrust does while velocities and thrust come, in time order (seconds); `now`: by the last look.

    It drives also where one of them never changed.
    """

    def __init__(self) -> None:
        self.now = Drive.DRIVES
        # Of ones, the velocity, the thrust behind the usual lag, and behind each delay: sums of products.
        self._sums: Array = np.zeros((len(DELAYS_S) + 3,) * 2)
        self._rows: list[tuple[float, ...]] = []
        self._commands: deque[tuple[float, float]] = deque()
        self._lagged = LaggedInput(USUAL_S)

    def thrust(self, t_s: float, force: float) -> None:
        """Thrust commanded from this time on [N, N m]."""
        self._lagged.set(t_s, force)
        self._commands.append((t_s, force))

    def velocity(self, t_s: float, v: float) -> None:
        """Velocity along the axis at this time [m/s, rad/s]."""
        commands, longest_s = self._commands, DELAYS_S[-1]
        while len(commands) > 1 and commands[1][0] <= t_s - longest_s:
            commands.popleft()
        if not commands:
            return
        delayed = [
            next((f for at_s, f in reversed(commands) if at_s <= t_s - late), commands[0][1]) for late in DELAYS_S
        ]
        self._rows.append((1.0, v, self._lagged.at(t_s), *delayed))
        if len(self._rows) == BLOCK:
            rows = np.array(self._rows)
            self._sums = self._sums + rows.T @ rows
            self._rows = []
            self.now = _drive(self._sums)


def _drive(sums: Array) -> Drive:
    """By the correlations of the velocity with each thrust."""
    means = sums[0, 1:] / sums[0, 0]
    scatter = sums[1:, 1:] / sums[0, 0] - np.outer(means, means)
    sizes = np.sqrt(np.maximum(0.0, np.diag(scatter)))
    if np.any(sizes <= 1e-9 * np.abs(means)):
        return Drive.DRIVES
    moved, at_once, *later = (scatter[0, 1:] / (sizes[0] * sizes[1:])).tolist()
    if moved <= AGAINST and moved <= at_once + ANSWERS:
        return Drive.AGAINST
    return Drive.BRAKES if max(at_once, *later) < BRAKED else Drive.DRIVES
