"""From the operator's hand to a wrench: joysticks (sensor_msgs/Joy) and velocities (geometry_msgs/Twist).

A joystick moves the vehicle only while its dead-man button is held. What comes late is ignored: messages carry
the time at which they were made, on a clock that need not be ours, so the message that took the shortest way is the
measure for the others.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_core.knobs import knob
from hindrax_core.readings import Vec3, Vec6, vec6
from hindrax_core.rotation import half_turn
from hindrax_core.signals import ZERO6
from hindrax_core.vehicle import AXES

UNUSED = -1
FORGETTING = 1e-3
"""Two clocks drift apart by less than this [s/s]."""


@dataclass(frozen=True, slots=True)
class TeleopKnobs:
    """Sticks and buttons. Defaults: a gamepad as numbered by `joy_node`, its left shoulder button as dead man."""

    dead_man: int = knob(4, 0, 63, "button that must be held [-]")
    surge_axis: int = knob(1, -1, 63, "axis for surge, forward is positive, -1: none [-]")
    sway_axis: int = knob(0, -1, 63, "axis for sway, left is positive, -1: none [-]")
    heave_axis: int = knob(4, -1, 63, "axis for heave, up is positive, -1: none [-]")
    roll_axis: int = knob(-1, -1, 63, "axis for roll, starboard down is positive, -1: none [-]")
    pitch_axis: int = knob(-1, -1, 63, "axis for pitch, bow down is positive, -1: none [-]")
    yaw_axis: int = knob(3, -1, 63, "axis for yaw, left is positive, -1: none [-]")
    dead_zone: float = knob(0.08, 0.0, 0.9, "part of a stick's way that counts as released [-]")
    share: float = knob(0.5, 0.0, 1.0, "wrench at full deflection as a part of the vehicle's limits [-]")
    full_speed_mps: float = knob(0.5, 0.01, 10.0, "linear velocity that equals a full deflection [m/s]")
    full_rate_radps: float = knob(1.0, 0.01, 10.0, "angular velocity that equals a full deflection [rad/s]")
    late_s: float = knob(0.3, 0.02, 5.0, "delay beyond the shortest one at which a message counts as late [s]")


class Teleop:
    """One operator's hand on one vehicle, whose largest wrench is `limits` [N, N m]."""

    def __init__(self, limits: Vec6, knobs: TeleopKnobs | None = None) -> None:
        self._limits, self._knobs = limits, knobs or TeleopKnobs()
        self._held = False
        self._shortest_s = self._made_s = self._received_s = math.inf

    def joystick(self, axes: Sequence[float], buttons: Sequence[int], made_s: float, now_s: float) -> Vec6 | None:
        """Turn the state of a joystick into a wrench.

        A release of the button is sent once, as zero; after that, silence leaves the vehicle to other sources.

        Parameters
        ----------
        axes, buttons
            As sensor_msgs/Joy has them.
        made_s, now_s : [s]
            When it was made, and the time now.

        Returns
        -------
        Vec6 | None
            In base_link_fsd [N, N m]; None where nothing is to be sent.
        """
        late = self._is_late(made_s, now_s)
        knobs = self._knobs
        pressed = not late and knobs.dead_man < len(buttons) and bool(buttons[knobs.dead_man])
        was_held, self._held = self._held, pressed
        if not pressed:
            return ZERO6 if was_held else None
        return self._wrench(vec6(self._deflection(axes, getattr(knobs, f"{axis}_axis")) for axis in AXES))

    def twist(self, linear_mps: Vec3, angular_radps: Vec3) -> Vec6:
        """Return the wrench for a velocity in base_link (x forward, y left, z up; REP-103)."""
        u, v, w = (value / self._knobs.full_speed_mps for value in linear_mps)
        p, q, r = (value / self._knobs.full_rate_radps for value in angular_radps)
        return self._wrench((u, v, w, p, q, r))

    def _wrench(self, parts: Vec6) -> Vec6:
        """Parts of the share of the limits, in base_link; what is not finite stays so: the vehicle refuses it."""
        share = self._knobs.share
        return vec6(
            share * limit * (max(-1.0, min(1.0, part)) if math.isfinite(part) else part)
            for part, limit in zip(half_turn(parts), self._limits, strict=True)
        )

    def _deflection(self, axes: Sequence[float], axis: int) -> float:
        """Way of a stick beyond its dead zone, -1 to 1; one that is not there, or not a number, is at rest."""
        if axis == UNUSED or axis >= len(axes) or not math.isfinite(axes[axis]):
            return 0.0
        zone, way = self._knobs.dead_zone, float(axes[axis])
        return math.copysign(max(0.0, min(1.0, abs(way)) - zone) / (1.0 - zone), way)

    def _is_late(self, made_s: float, now_s: float) -> bool:
        """Whether a message took much longer than the fastest one; resets when the clock of its sender goes back."""
        delay_s = now_s - made_s
        if made_s < self._made_s:
            self._shortest_s = math.inf
        drift_s = FORGETTING * max(0.0, now_s - self._received_s)
        self._shortest_s = min(delay_s, self._shortest_s + drift_s)
        self._made_s, self._received_s = made_s, now_s
        return delay_s - self._shortest_s > self._knobs.late_s
