"""A cell of the table of faults: what went wrong in which mode of flying, what came of it, and what must never."""

import math
from dataclasses import dataclass

from hindrax_core.signals import Navigation
from hindrax_sim.hardware import TrueState

MANEUVER, HOLD, OPERATOR, DISARMED = MODES = ("maneuver", "hold", "operator", "disarmed")
ARMING, BRAKING, RECENTRE, WEIGHING = MOMENTS = ("arming", "braking", "recentre", "weighing")
"""Moments at which faults come besides: while it arms, brakes after a cancelled maneuver, restarts dead reckoning, and
holds every axis to weigh something."""
EVERY_MODE = (*MODES, *MOMENTS)
WRENCH = (12.0, 0.0, 6.0, 0.0, 0.0, 1.0)
"""Wrench of the operator: forward, down, and turning."""
HELD = (("depth", 0.8), ("heading", math.nan), ("roll", 0.0), ("pitch", 0.0))
"""What a hold holds: axes and setpoints."""
WRONG_TILT_deg, WRONG_SPEED_mps, WRONG_DEPTH_m = 15.0, 0.5, 0.5
"""Errors of the state from which on it is wrong: guards and holds reckon with less."""
LONGEST_WRONG_S = 0.5
"""Thrust on a state that is wrong: never for longer after the last fault. One that silences a sensor that lies leaves
to the output guard what the estimator was about to tell: both times add up."""
WORST_TILT_deg = 30.0
"""True tilt that no cell may reach. It leans by 21 to 23 where it loses its thrust in the fastest surge."""
WORST_THRUST_deg = 45.0
"""True tilt beyond which there is no thrust."""
AT_END_S = 0.2


@dataclass(frozen=True, slots=True)
class FaultOutcome:
    """One fault in one mode with one seed. Times are those of the mock."""

    who: str
    what: str
    mode: str
    seed: int
    neutral_s: float | None
    """From the fault to neutral for good; None when the flight went on."""
    wrong_s: float
    """The longest thrust on a state that is wrong."""
    tilt_deg: float
    """The largest true tilt after the fault."""
    reason: str
    """What the vehicle reported."""
    violated: tuple[str, ...] = ()
    wall: bool = False
    """Whether the hull met a wall after the fault."""
    told: tuple[str, ...] = ()
    """Where the operator is told: terminal, report, exit code."""


class Judge:
    """Sees every step of the hardware after a fault, with the state that was estimated last, and makes the cell."""

    def __init__(self, begin: TrueState) -> None:
        """`begin`: the true state when the fault came."""
        self._begin = self._last = begin
        self._thrust_s = self._right_s = begin.now_s
        self._wrong_s = self._tilt_deg = self.thrust_tilt_deg = 0.0

    def observe(self, true: TrueState, estimated: Navigation | None) -> None:
        """Take notice of one step."""
        self._last = true
        self._tilt_deg = max(self._tilt_deg, true.tilt_deg)
        if not true.neutral:
            self._thrust_s = true.now_s
            self.thrust_tilt_deg = max(self.thrust_tilt_deg, true.tilt_deg)
        if true.neutral or estimated is None or not is_wrong(estimated, true):
            self._right_s = true.now_s
        self._wrong_s = max(self._wrong_s, true.now_s - self._right_s)

    def broken(self) -> None:
        """One more fault begins: the time to find out begins anew."""
        self._right_s = self._last.now_s

    @property
    def flies_on(self) -> bool:
        """Whether there is thrust to the end."""
        return self._thrust_s > max(self._begin.now_s, self._last.now_s - AT_END_S)

    def cell(
        self,
        who: str,
        what: str,
        mode: str,
        seed: int,
        reason: str,
        *,
        within_s: float = math.inf,
        lost: str = "",
        armed: bool = False,
        worst_deg: float = WORST_TILT_deg,
        longest_wrong_s: float = LONGEST_WRONG_S,
        worst_thrust_deg: float = WORST_THRUST_deg,
        told: tuple[str, ...] = (),
        unsaid: tuple[str, ...] = (),
    ) -> FaultOutcome:
        """The judgement. `within_s`: until neutral; `lost`: what never came; `armed`: it flies on though at rest.

        `worst_deg`: true tilt that it may not reach, `worst_thrust_deg`: with thrust; `longest_wrong_s`: of thrust on a
        state that is wrong. `told`:
        where the operator is told, `unsaid`: what is told nowhere.
        """
        took_s, wall = self._thrust_s - self._begin.now_s, self._last.wall_hits > self._begin.wall_hits
        found = {
            lost: bool(lost),
            "thrust while disarmed": mode == DISARMED and took_s > 0.0,
            f"neutral after {took_s:.2f} s, wanted {within_s:g} s": took_s > within_s,
            f"thrust for {self._wrong_s:.2f} s on a state that is wrong": self._wrong_s > longest_wrong_s,
            f"tilted by {self._tilt_deg:.0f} deg": self._tilt_deg > worst_deg,
            f"thrust at a tilt of {self.thrust_tilt_deg:.0f} deg": self.thrust_tilt_deg > worst_thrust_deg,
            "ran into a wall unnoticed": wall and mode == MANEUVER and not reason,
        }
        violated = (*(sentence for sentence, so in found.items() if so), *unsaid)
        neutral_s = None if self.flies_on or armed else took_s
        return FaultOutcome(
            who, what, mode, seed, neutral_s, self._wrong_s, self._tilt_deg, reason, violated, wall, told
        )


def is_wrong(estimated: Navigation, true: TrueState) -> bool:
    """Whether a state is so far from the truth that thrust on it does harm."""
    roll, pitch, _ = (found - wanted for found, wanted in zip(estimated.attitude_rad, true.attitude_rad, strict=True))
    speeds = zip(estimated.velocity_mps, true.velocity_mps, strict=True)
    # Without a lock the state says itself that it does not know the velocity; what is NaN is not claimed to be known.
    too_fast = estimated.dvl_locked and any(abs(found - wanted) > WRONG_SPEED_mps for found, wanted in speeds)
    too_deep = abs(estimated.depth_m - true.depth_m) > WRONG_DEPTH_m
    return math.degrees(math.hypot(roll, pitch)) > WRONG_TILT_deg or too_fast or too_deep
