"""Pulses of single thrusters, by which a vehicle file is proven: the one maneuver that believes nothing of the file.

A wrench cannot be asked for here: which thruster pushes where is what the pulses find out. So they are forces of
thrusters, small and short, with all holds released: a hold with a sign wrong in its loop would turn the vehicle over.
Nor is the state of the vehicle trusted further than the gyroscope, gravity and the pressure: a sensor that is turned
makes position and heading wrong, and the guards that use them are left out.

Pure, as `Maneuver` is, and flown by the pilot in its place.
"""

import math
from collections.abc import Sequence

from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_control.maneuver.goal import Goal
from hindrax_control.maneuver.maneuver import ManeuverKnobs, ManeuverOutput
from hindrax_control.maneuver.maneuver_guards import ManeuverGuardKnobs, ManeuverGuards, Situation
from hindrax_control.maneuver.plan import Plan
from hindrax_control.maneuver.stages import RELEASED
from hindrax_core.events import Stamp, seconds_between, to_s
from hindrax_core.readings import Vec3, Vec6, vec6
from hindrax_core.signals import NAN, ZERO6, Navigation, Phase
from hindrax_core.text.digits import above
from hindrax_core.text.refusals import CANCELLED, NOTHING, Reason, Refusal, found
from hindrax_core.vehicle import Vehicle

COMMISSION = "commission"
"""What status and record call the motion."""
BELIEVED = frozenset(
    (Reason.DEPTH_BAND, Reason.ALTITUDE_BAND, Reason.BATTERY, Reason.LEAK, Reason.TIME_OUT, Reason.SENSOR_AGE)
)
"""Guards that hold although the vehicle file may be wrong."""
MOST_TILT_rad, MOST_LEAN_rad = math.radians(20.0), math.radians(27.0)
"""From where it was at the start, and from the vertical. Neutral from here, a vehicle that rights itself stays below 30
degrees."""
MOST_LIST_rad = math.radians(23.0)
"""At the start: one that lists further has no room left for its pulses, and is trimmed first."""
UPRIGHT = 0.8
"""Cosine of a list; beyond it, it is the sensor that is turned."""
MOST_RATE_radps = math.radians(90.0)
CALM_radps, CALM_S, CALM_PATIENCE_S = math.radians(2.5), 0.3, 6.0
"""Rates that count as rest, for how long they must last, and how long they are waited for."""


def believed(guards: Sequence[Refusal]) -> tuple[Refusal, ...]:
    """Those findings of the guards that count in a commissioning."""
    return tuple(one for one in guards if one.reason in BELIEVED)


class PulseManeuver:
    """One list of pulses, from its first step to its end: neutral, with nothing held."""

    def __init__(
        self,
        vehicle: Vehicle,
        goal: Goal,
        *,
        knobs: ManeuverKnobs | None = None,
        safety_knobs: ManeuverGuardKnobs | None = None,
    ) -> None:
        self.goal = goal
        self.plans: tuple[Plan, ...] = ()
        self._B = effectiveness(vehicle)
        self._rest = (0.0,) * len(vehicle.thrusters)
        self._knobs = knobs or ManeuverKnobs()
        self._safety = ManeuverGuards(vehicle, safety_knobs)
        self.seconds = sum(pulse.seconds + pulse.calm * CALM_S for pulse in goal.pulses)
        """Shortest duration [s]."""
        self._longest_s = sum(pulse.seconds + pulse.calm * CALM_PATIENCE_S for pulse in goal.pulses) + 1.0
        self._at = -1
        self._since_s = 0.0
        self._restless_s = 0.0
        self._started_at: Stamp | None = None
        self._down: Vec3 | None = None
        self._aborted = NOTHING
        self.last: ManeuverOutput | None = None
        """Its last output; None before its first step."""

    @property
    def done(self) -> bool:
        """Whether it is over."""
        return self.last is not None and self.last.done

    def keep(self, _navigation: Navigation, _stamp: Stamp) -> Vec6:
        """Nothing is kept after it."""
        return ZERO6

    def cancel(self, reason: Refusal = CANCELLED, ending: str = "neutral") -> None:  # noqa: ARG002  # what every maneuver takes
        """End with the next step, whatever the `ending`: neutral."""
        if not self.done:
            self._aborted = self._aborted or reason

    def step(
        self,
        navigation: Navigation,
        stamp: Stamp,
        *,
        shortfall: Vec6 = ZERO6,  # noqa: ARG002  # part of what every maneuver is told
        lost_axes: Sequence[str] = (),  # noqa: ARG002  # as above
        battery_V: float = NAN,
    ) -> ManeuverOutput:
        """Fly one cycle.

        Parameters
        ----------
        navigation, stamp
            State, and its time.
        shortfall, lost_axes
            As every maneuver is told; pulses do not ask.
        battery_V : [V]
            NaN where it is not measured.

        Returns
        -------
        ManeuverOutput
            Forces of single thrusters, or rest.
        """
        if self.last is not None and self.last.done:
            return self.last
        begins = self._started_at is None
        self._started_at = stamp if self._started_at is None else self._started_at
        now_s = seconds_between(self._started_at, stamp)
        forces, phase = self._act(navigation, now_s)
        # Asked with what it is about to do: the list at rest is that of the moment before the first pulse.
        if not self._aborted:
            self._aborted = next(iter(self._wrong(navigation, stamp, battery_V)), NOTHING)
        if self._aborted:
            return self._put_out(self._rest, "aborted", now_s, done=True)
        return self._put_out(forces, phase, now_s, done=phase == "done", begins=begins)

    def _act(self, navigation: Navigation, now_s: float) -> tuple[tuple[float, ...], str]:
        """Forces and phase of now: the pulse that is running, or the rest before the next one."""
        pulses = self.goal.pulses
        if self._at >= 0 and now_s - self._since_s < pulses[self._at].seconds:
            return pulses[self._at].forces_N, "excite"
        following = self._at + 1
        if following == len(pulses):
            return self._rest, "done"
        ended_s = self._since_s + (pulses[self._at].seconds if self._at >= 0 else 0.0)
        if max(map(abs, navigation.rate_radps)) > CALM_radps:
            self._restless_s = now_s
        calm = now_s - max(self._restless_s, ended_s) >= CALM_S or now_s - ended_s >= CALM_PATIENCE_S
        if pulses[following].calm and not calm:
            return self._rest, "settle"
        self._at, self._since_s = following, now_s
        return pulses[following].forces_N, "excite"

    def _wrong(self, navigation: Navigation, stamp: Stamp, battery_V: float) -> tuple[Refusal, ...]:
        """What must end it: the guards that are believed, and its own of tilt and rate."""
        roll, pitch, _ = navigation.attitude_rad
        down = (-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch))
        # What still swings when it begins would be judged by the moment: until the first pulse, now is its rest.
        resting = self._at < 0
        if resting or self._down is None:
            self._down = down
        cosine = sum(a * b for a, b in zip(down, self._down, strict=True))
        tilt_rad = math.acos(max(-1.0, min(1.0, cosine)))
        rate_radps = math.hypot(*navigation.rate_radps)
        # Of a sensor that is turned, the vertical is false, and only the tilt from rest counts.
        known = not resting and self._down[2] > UPRIGHT
        list_rad, lean_rad = (math.acos(min(1.0, one[2])) if known else 0.0 for one in (self._down, down))
        own = (
            above("lists by {} deg at rest, wanted at most {} deg", *_deg(list_rad, MOST_LIST_rad), 0),
            above("tilted by {} deg from rest, wanted at most {} deg", *_deg(tilt_rad, MOST_TILT_rad), 0),
            above("tilted by {} deg, wanted at most {} deg", *_deg(lean_rad, MOST_LEAN_rad), 0),
            above("turns at {} deg/s, wanted at most {} deg/s", *_deg(rate_radps, MOST_RATE_radps), 0),
            "" if math.isfinite(cosine + rate_radps) else "attitude or rate unknown, wanted both",
        )
        assert self._started_at is not None
        situation = Situation(
            navigation=navigation,
            place=None,
            walls_m={},
            time_s=to_s(stamp),
            battery_V=battery_V,
            deadline_s=to_s(self._started_at) + self._longest_s,
        )
        return (
            *(found(Reason.COMMISSION, text) for text in own if text),
            *believed(self._safety.step(situation)),
        )

    def _put_out(
        self, forces_N: tuple[float, ...], phase: str, now_s: float, *, done: bool, begins: bool = False
    ) -> ManeuverOutput:
        flown = sum(pulse.seconds for pulse in self.goal.pulses[: max(self._at, 0)])
        whole = sum(pulse.seconds for pulse in self.goal.pulses)
        self.last = ManeuverOutput(
            wrench=vec6(self._B.dot(forces_N).tolist()),
            setpoints=RELEASED if begins or done else (),
            phase=Phase("" if done else COMMISSION, phase),
            progress=1.0 if phase == "done" else flown / whole,
            remaining_s=0.0 if done else max(0.0, self.seconds - now_s),
            wall_distance_m=NAN,
            force=max(map(abs, forces_N), default=0.0),
            velocity=NAN,
            done=done,
            aborted=self._aborted if done else NOTHING,
            neutral=done,
            forces_N=forces_N,
        )
        return self.last


def _deg(found_rad: float, most_rad: float) -> tuple[float, float]:
    return math.degrees(found_rad), math.degrees(most_rad)
