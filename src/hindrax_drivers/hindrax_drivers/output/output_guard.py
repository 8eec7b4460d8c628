"""The output guard, the last safety layer: only neutral passes unless armed with a fresh command.

Pure: a state goes in, a new state comes out, and time is an argument. All times are those of the output's bus. The
host calls `command` for each command, `tick` no later than `due`, and reports each write with `written` or
`failed`. A new guard is always disarmed.

    disarmed --arm--> arming --neutral for the time of the ESCs--> armed, and neutral until a command comes
    armed --silence--> armed, but neutral --long silence--> disarmed
    any --writes keep failing--> faulted --output set up again--> disarmed
"""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, after, seconds_between
from hindrax_core.input_checks import StampFault, StampWindow
from hindrax_core.knobs import knob
from hindrax_core.signals import Command
from hindrax_core.text.coded import Coded
from hindrax_core.text.refusals import NOTHING, Reason, Refusal
from hindrax_core.thrust.curves import running
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.devices.stm32 import BOARD_NEUTRAL_us
from hindrax_drivers.output.output_reasons import NEW, NO_REASON, OutputReason, output_reason

SERVO_LOW_us, SERVO_HIGH_us = 500.0, 2500.0
"""A value outside is no servo pulse but garbage; one inside is clipped to the limits."""
REFUSING_S = 1.0
"""Time for which the last refusal explains why nothing is obeyed."""
WORTH_ANOTHER_TRY = frozenset((Reason.LATE, Reason.CLOCK, Reason.OUT_OF_ORDER))
"""Refusals of a request that would be taken if it were made now."""
LEAST_REST_us = 1000.0
"""No speed controller rests at a shorter pulse."""


@dataclass(frozen=True, slots=True)
class OutputGuardKnobs:
    """Times and limits of the guard. Neutral is on the wire no later than `silence_s` after the last command."""

    arming_s: float = knob(7.0, 0.0, 60.0, "neutral that the ESCs need before they run [s]")
    silence_s: float = knob(0.5, 0.1, 2.0, "longest time from the last valid command to neutral on the wire [s]")
    margin_s: float = knob(0.1, 0.0, 1.0, "part of the silence kept for scheduling and the bus [s]")
    disarm_after_s: float = knob(5.0, 0.5, 600.0, "silence after which the thrusters disarm [s]")
    command_lifespan_s: float = knob(0.2, 0.01, 2.0, "age from which a command is dropped [s]")
    arm_lifespan_s: float = knob(1.0, 0.1, 5.0, "age from which an arm request is refused [s]")
    challenge_s: float = knob(8.0, 1.0, 10.0, "time in which a request without a stamp may repeat its number [s]")
    future_s: float = knob(0.1, 0.0, 1.0, "how far ahead of the vehicle's clock a stamp may be [s]")
    repeat_s: float = knob(0.09, 0.01, 0.1, "longest time between two writes, neutral or not [s]")
    failing_s: float = knob(0.2, 0.0, 2.0, "time of failing writes after which the output is faulted [s]")
    neutral_us: float | None = knob(None, 0.0, 2500.0, "neutral pulse; none: each thruster's stop_us [us]")
    low_us: float = knob(1100.0, 500.0, 1500.0, "shortest pulse [us]")
    high_us: float = knob(1900.0, 1500.0, 2500.0, "longest pulse [us]")
    slew_usps: float = knob(4000.0, 100.0, 1e6, "largest change of a pulse, but for going neutral [us/s]")
    light_off_us: float = knob(1100.0, 500.0, 2500.0, "pulse of a dark lamp [us]")
    light_full_us: float = knob(1900.0, 500.0, 2500.0, "pulse of a lamp at full brightness [us]")

    def __post_init__(self) -> None:
        """Check that the trip comes after the end of a fresh command, and that rest is an allowed pulse."""
        if self.silence_s - self.margin_s <= 0.0:
            raise ValueError(f"margin_s: found {self.margin_s:g}, wanted less than silence_s ({self.silence_s:g})")
        least_us = max(self.low_us, LEAST_REST_us)
        if self.neutral_us is not None and not least_us <= self.neutral_us <= self.high_us:
            wanted = f"{least_us:g} to {self.high_us:g}; without it: by the vehicle file"
            raise ValueError(f"neutral_us: found {self.neutral_us:g}, wanted {wanted}")


class ArmingPhase(StrEnum):
    """Phase of the guard: only `ARMED` passes other pulses than neutral."""

    DISARMED = "disarmed"
    ARMING = "arming"
    ARMED = "armed"
    FAULTED = "faulted"


@dataclass(frozen=True, slots=True)
class Request:
    """A request to arm or to disarm, with the time at which it was made.

    A disarm with a `reason` comes from a monitor: its sequence is not compared with those of operators.
    """

    stamp: Stamp
    sequence: int
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Challenge:
    """A number that was handed out to a request without a stamp, once, and when."""

    number: int
    made: Stamp


@dataclass(frozen=True, slots=True)
class Pulses:
    """Pulses to write to the output now [us]; `sequence` is that of the command behind it, zero when it is neutral."""

    thrusters: tuple[float, ...]
    lights: tuple[float, ...]
    sequence: int = 0

    @property
    def all_us(self) -> tuple[float, ...]:
        """Thrusters, then lights."""
        return self.thrusters + self.lights


class CommandFault(StrEnum):
    """Why a command is refused, as the counters in /diagnostics have it."""

    WRONG_COUNT = "wrong count"
    NOT_A_COMMAND = "not a command"
    NOT_A_PULSE = "not a pulse"
    NOT_A_BRIGHTNESS = "not a brightness"
    SENDER = "sender"
    INHIBITED = "inhibited"
    OUT_OF_ORDER = "out of order"
    EXPIRED = StampFault.EXPIRED
    FUTURE = StampFault.FUTURE
    UNSTAMPED = StampFault.UNSTAMPED
    TIMELESS = StampFault.TIMELESS


@dataclass(frozen=True, slots=True)
class RefusedCommand:
    """A refused command: its fault to count by, and a sentence."""

    fault: CommandFault
    text: str


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer to a request."""

    accepted: bool
    reason: Refusal = NOTHING


class OutputGuardState(NamedTuple):
    """State of the guard. `reason`: why it is not armed; `fresh_until` is the end of the last valid command.

    A tuple: it is replaced a hundred times a second, which costs a dataclass of its size four times as much.

    `armings` counts how often it was armed since its start.
    """

    phase: ArmingPhase
    reason: Coded[OutputReason]
    since: Stamp
    seen: Stamp
    pulses: Pulses
    written_at: Stamp | None = None
    moved_at: Stamp | None = None
    commanded_at: Stamp | None = None
    lit_at: Stamp | None = None
    fresh_until: Stamp | None = None
    failing_since: Stamp | None = None
    last_command: Command | None = None
    last_request: Request | None = None
    monitor_disarmed_at: Stamp | None = None
    challenge: Challenge | None = None
    armings: int = 0
    refused: str = ""
    """Why a command was refused last, at `refused_at`: None where a later one was obeyed."""
    refused_at: Stamp | None = None

    @property
    def armed(self) -> bool:
        """Whether pulses other than neutral can pass."""
        return self.phase is ArmingPhase.ARMED

    @property
    def fresh(self) -> bool:
        """Whether the last valid command still counts."""
        return self.fresh_until is not None and self.seen < self.fresh_until

    @property
    def unobeyed(self) -> Coded[OutputReason]:
        """Reason why an armed output obeys no command now; empty when it does."""
        if not self.armed or self.fresh:
            return NO_REASON
        if not self.refusing:
            return output_reason(OutputReason.NO_COMMAND)
        return output_reason(OutputReason.UNOBEYED, refused=self.refused)

    @property
    def refusing(self) -> bool:
        """Whether commands arrive and are refused."""
        return self.refused_at is not None and seconds_between(self.refused_at, self.seen) <= REFUSING_S


@dataclass(frozen=True, slots=True)
class OutputGuard:
    """The rules, for thrusters by their neutral pulse and a number of lights. Stateless."""

    rest_us: tuple[float, ...]
    lights: int = 0
    knobs: OutputGuardKnobs = OutputGuardKnobs()
    fresh_number: Callable[[], int] = lambda: random.SystemRandom().randrange(100_000, 1_000_000)
    """Number for a challenge: six digits that nobody guesses, and none in use before."""
    begun: Coded[OutputReason] = NEW
    """Why it is disarmed at first."""

    @property
    def neutral(self) -> Pulses:
        """Thrusters at rest, lights off: the state after every exit."""
        return Pulses(self.rest_us, (self.knobs.light_off_us,) * self.lights)

    def start(self, now: Stamp) -> OutputGuardState:
        """Disarmed, with neutral due at once."""
        return OutputGuardState(ArmingPhase.DISARMED, self.begun, now, now, self.neutral)

    def command(
        self, state: OutputGuardState, command: Command, now: Stamp
    ) -> tuple[OutputGuardState, Pulses | RefusedCommand]:
        """Check a command.

        A malformed one makes the output neutral until the next valid one; an old one is dropped. While not armed, good
        commands set the lights and keep the line alive, and the thrusters stay neutral.

        Parameters
        ----------
        state
            Before it.
        command
            Pulses with stamp and number.
        now
            Time of the output.

        Returns
        -------
        tuple[OutputGuardState, Pulses | RefusedCommand]
            State after it; what to write, or why it is refused.
        """
        state, now = self._observe(state, now)
        refusal = self._wrong_time(state, command, now)
        if refusal is not None:
            return self.refuse(state, refusal, now), refusal
        refusal = self._malformed(command)
        if refusal is not None:
            return self.refuse(state._replace(fresh_until=None), refusal, now), refusal
        if state.armed and state.last_command and not _newer(command.sequence, state.last_command.sequence):
            state = self.drop(state, output_reason(OutputReason.OTHER_SENDER), now)
        held = self._held(state)
        fresh_until = after(Stamp(min(command.stamp, now)), self.knobs.silence_s - self.knobs.margin_s)
        state = state._replace(commanded_at=now, fresh_until=fresh_until, last_command=command, refused_at=None)
        state, now = self._observe(state, now)
        pulses = self._applied(state, held, command, now)
        return state._replace(pulses=pulses, written_at=now, moved_at=now), pulses

    def refuse(self, state: OutputGuardState, refusal: RefusedCommand, now: Stamp) -> OutputGuardState:
        """Record a refused command, by this guard or by its host: the reason when no other one is obeyed.

        Parameters
        ----------
        state
            Before it.
        refusal
            Code and sentence.
        now
            Time of the output.

        Returns
        -------
        OutputGuardState
            After it.
        """
        return state._replace(refused=refusal.text, refused_at=now)

    def light(
        self, state: OutputGuardState, levels: tuple[float, ...], now: Stamp
    ) -> tuple[OutputGuardState, Pulses | RefusedCommand]:
        """Set the brightness of every lamp, armed or not, and nothing else.

        Lamps keep their level as long as commands arrive.

        Parameters
        ----------
        state
            Before it.
        levels : [-]
            0 (dark) to 1.
        now
            Time of the output.

        Returns
        -------
        tuple[OutputGuardState, Pulses | RefusedCommand]
            State after it; what to write, or why it is refused.
        """
        state, now = self._observe(state, now)
        if len(levels) != self.lights or not all(0.0 <= level <= 1.0 for level in levels):
            found = ", ".join(f"{level:g}" for level in levels)
            text = f"lamps: found {found or 'none'}, wanted {self.lights} from 0 to 1"
            return state, RefusedCommand(CommandFault.NOT_A_BRIGHTNESS, text)
        span_us = self.knobs.light_full_us - self.knobs.light_off_us
        lights = tuple(self.knobs.light_off_us + span_us * level for level in levels)
        pulses = replace(self._held(state), lights=lights)
        return state._replace(pulses=pulses, written_at=now, lit_at=now), pulses

    def tick(self, state: OutputGuardState, now: Stamp) -> tuple[OutputGuardState, Pulses | None]:
        """Advance time. Return the pulses that are due now: a change to neutral, or a repetition."""
        state, now = self._observe(state, now)
        pulses = self._held(state)
        written = state.written_at
        if pulses == state.pulses and written is not None and now < after(written, self.knobs.repeat_s):
            return state, None
        moved_at = state.moved_at if pulses == state.pulses else now
        return state._replace(pulses=pulses, written_at=now, moved_at=moved_at), pulses

    def due(self, state: OutputGuardState) -> Stamp:
        """Return the latest time of the next `tick`."""
        if state.written_at is None:
            return state.seen
        due = after(state.written_at, self.knobs.repeat_s)
        if state.pulses.thrusters == self.neutral.thrusters:
            return due
        return state.seen if state.fresh_until is None else min(due, state.fresh_until)

    def arm(self, state: OutputGuardState, request: Request, now: Stamp) -> tuple[OutputGuardState, Answer]:
        """Start arming, unless the request is late or out of order or the output is faulted.

        Parameters
        ----------
        state
            Before it.
        request
            Stamp, or number of a challenge.
        now
            Time of the output.

        Returns
        -------
        tuple[OutputGuardState, Answer]
            State after it; whether it is accepted, and why not.
        """
        state, now = self._observe(state, now)
        if request.stamp == 0:
            state, why = self._challenged(state, request, now)
            request = replace(request, stamp=now, sequence=state.last_request.sequence if state.last_request else 0)
        else:
            why = self._request_fault(state, request, now)
        if why:
            return state, Answer(accepted=False, reason=why)
        state = state._replace(last_request=request)
        if state.phase is not ArmingPhase.DISARMED:
            return state, Answer(accepted=True)
        return self._enter(state, ArmingPhase.ARMING, output_reason(OutputReason.WAITING), now), Answer(accepted=True)

    def _challenged(self, state: OutputGuardState, request: Request, now: Stamp) -> tuple[OutputGuardState, Refusal]:
        """Judge a request without a stamp by the number that it repeats; the reason of a refusal has a new number.

        A number counts once, and not after a disarm: whatever waited in a link finds it expired or gone.
        """
        given, state = state.challenge, state._replace(challenge=None)
        if state.phase is ArmingPhase.FAULTED:
            return state, _faulted(state)
        if given is not None and request.sequence == given.number:
            age_s = seconds_between(given.made, now)
            if age_s <= self.knobs.challenge_s:
                return state, NOTHING
            why = f"the number {given.number} is {age_s:.1f} s old"
        else:
            why = "request has no stamp"
        made = Challenge(self.fresh_number(), now)
        within = f"within {self.knobs.challenge_s:g} s with sequence: {made.number}"
        sentence = f"{why}; to arm without one, call again {within}"
        return state._replace(challenge=made), Refusal(Reason.REPEAT, sentence)

    def disarm(self, state: OutputGuardState, request: Request, now: Stamp) -> tuple[OutputGuardState, Answer]:
        """Disarm at once, however old the request is; arm requests made before it are refused from now on.

        Parameters
        ----------
        state, request, now
            As of `arm`.

        Returns
        -------
        tuple[OutputGuardState, Answer]
            State after it; it is always accepted.
        """
        state, now = self._observe(state, now)
        made = Stamp(min(request.stamp, now))
        if request.reason:
            state = state._replace(monitor_disarmed_at=max(made, state.monitor_disarmed_at or made))
            why = output_reason(OutputReason.UNNAMED, sentence=request.reason)
            return self.drop(state, why, now), Answer(accepted=True)
        last = state.last_request or request
        sequence = request.sequence if _newer(request.sequence, last.sequence) else last.sequence
        state = state._replace(last_request=Request(max(made, Stamp(min(last.stamp, now))), sequence))
        return self.drop(state, output_reason(OutputReason.REQUEST), now), Answer(accepted=True)

    def drop(self, state: OutputGuardState, reason: Coded[OutputReason], now: Stamp) -> OutputGuardState:
        """Disarm for a reason of the host's own; a fault stays a fault.

        Parameters
        ----------
        state, now
            Before it, and time of the output.
        reason
            For `thrusters/state`.

        Returns
        -------
        OutputGuardState
            After it.
        """
        if state.phase is ArmingPhase.FAULTED:
            return state
        return self._enter(state, ArmingPhase.DISARMED, reason, now)

    def written(self, state: OutputGuardState) -> OutputGuardState:
        """Record that the last pulses have reached the output."""
        return state if state.failing_since is None else state._replace(failing_since=None)

    def failed(self, state: OutputGuardState, why: Coded[OutputReason], now: Stamp) -> OutputGuardState:
        """Record a failed write: arming starts over, and an output that keeps failing is faulted.

        Parameters
        ----------
        state, now
            Before it, and time of the output.
        why
            For `thrusters/state`.

        Returns
        -------
        OutputGuardState
            After it.
        """
        since = now if state.failing_since is None else state.failing_since
        state = state._replace(failing_since=since)
        if state.phase is not ArmingPhase.FAULTED and seconds_between(since, now) >= self.knobs.failing_s:
            return self._enter(state, ArmingPhase.FAULTED, why, now)
        return state._replace(since=now) if state.phase is ArmingPhase.ARMING else state

    def fault(self, state: OutputGuardState, why: Coded[OutputReason], now: Stamp) -> OutputGuardState:
        """Fault the output at once: its state shows that it does not follow commands.

        Parameters
        ----------
        state, now
            Before it, and time of the output.
        why
            For `thrusters/state`.

        Returns
        -------
        OutputGuardState
            After it.
        """
        return self._enter(state, ArmingPhase.FAULTED, why, now)

    def restored(self, state: OutputGuardState, now: Stamp) -> OutputGuardState:
        """End a fault after the output was set up again: disarmed, never armed."""
        if state.phase is not ArmingPhase.FAULTED:
            return state
        state = state._replace(failing_since=None)
        why = output_reason(OutputReason.RESTORED, fault=state.reason)
        return self._enter(state, ArmingPhase.DISARMED, why, now)

    def _observe(self, state: OutputGuardState, now: Stamp) -> tuple[OutputGuardState, Stamp]:
        """Apply the effects of time. A small step back of the clock is ignored; a jump back disarms."""
        back_s = seconds_between(now, state.seen)
        if back_s > self.knobs.margin_s:
            return self._rebased(state, back_s, now), now
        now = max(now, state.seen)
        if now > state.seen:
            state = state._replace(seen=now)
        if state.phase is ArmingPhase.ARMING and seconds_between(state.since, now) >= self.knobs.arming_s:
            state = self._enter(state, ArmingPhase.ARMED, NO_REASON, now)
        commanded = state.since if state.commanded_at is None else state.commanded_at
        if state.armed and seconds_between(max(commanded, state.since), now) > self.knobs.disarm_after_s:
            code = OutputReason.DISOBEYED if state.refusing else OutputReason.SILENCE
            silence = output_reason(code, silent_s=self.knobs.disarm_after_s, refused=state.refused)
            state = self.drop(state, silence, now)
        if state.commanded_at is not None and seconds_between(commanded, now) > self.knobs.disarm_after_s:
            state = state._replace(commanded_at=None)
        if state.lit_at is not None and seconds_between(state.lit_at, now) > self.knobs.disarm_after_s:
            state = state._replace(lit_at=None)
        return state, now

    def _rebased(self, state: OutputGuardState, back_s: float, now: Stamp) -> OutputGuardState:
        """Disarm after a jump back of the clock, and forget all times of before, which would now be in the future."""
        forgotten = state._replace(
            seen=now,
            commanded_at=None,
            lit_at=None,
            moved_at=None,
            last_command=None,
            last_request=None,
            monitor_disarmed_at=None,
            refused_at=None,
        )
        return self.drop(forgotten, output_reason(OutputReason.CLOCK, back_s=back_s), now)._replace(since=now)

    def _enter(
        self, state: OutputGuardState, phase: ArmingPhase, reason: Coded[OutputReason], now: Stamp
    ) -> OutputGuardState:
        """Change the phase. Armed keeps the fresh command that brought it; any other phase makes neutral due now."""
        if phase is ArmingPhase.ARMED:
            return state._replace(phase=phase, reason=reason, since=now, armings=state.armings + 1)
        return state._replace(phase=phase, reason=reason, since=now, fresh_until=None, written_at=None, challenge=None)

    def _held(self, state: OutputGuardState) -> Pulses:
        """Pulses without a new command: the last ones while fresh, else neutral; lights keep their level."""
        if state.armed and state.fresh:
            return state.pulses
        silent = state.commanded_at is None and state.lit_at is None
        return self.neutral if silent else replace(self.neutral, lights=state.pulses.lights)

    def _applied(self, state: OutputGuardState, held: Pulses, command: Command, now: Stamp) -> Pulses:
        lights = tuple(self._clip(light) for light in command.lights_us) or held.lights
        if not state.armed or not state.fresh:
            return Pulses(self.neutral.thrusters, lights)
        moved = now if state.moved_at is None else state.moved_at
        # Of one write at most: after a pause the pulse begins to move, it does not make up for the time.
        step = self.knobs.slew_usps * min(seconds_between(moved, now), self.knobs.repeat_s)
        pairs = zip(held.thrusters, command.pulses_us, strict=True)
        thrusters = tuple(max(old - step, min(old + step, self._clip(new))) for old, new in pairs)
        return Pulses(thrusters, lights, command.sequence)

    def _clip(self, pulse_us: float) -> float:
        return max(self.knobs.low_us, min(self.knobs.high_us, float(pulse_us)))

    def _malformed(self, command: Command) -> RefusedCommand | None:
        if len(command.pulses_us) != len(self.rest_us) or len(command.lights_us) not in (0, self.lights):
            found = f"{len(command.pulses_us)} pulses and {len(command.lights_us)} lights"
            text = f"found {found}, wanted {len(self.rest_us)} and {self.lights}, or no lights"
            return RefusedCommand(CommandFault.WRONG_COUNT, text)
        for index, pulse in enumerate((*command.pulses_us, *command.lights_us)):
            if not math.isfinite(pulse) or not SERVO_LOW_us <= pulse <= SERVO_HIGH_us:
                wanted = f"{SERVO_LOW_us:g} to {SERVO_HIGH_us:g} us"
                return RefusedCommand(CommandFault.NOT_A_PULSE, f"pulse {index}: found {pulse:g}, wanted {wanted}")
        return None

    def _wrong_time(self, state: OutputGuardState, command: Command, now: Stamp) -> RefusedCommand | None:
        wrong_stamp = StampWindow(self.knobs.command_lifespan_s, self.knobs.future_s).judge(command.stamp, now)
        if wrong_stamp is not None:
            return RefusedCommand(CommandFault(wrong_stamp.kind), f"command is {wrong_stamp.sentence}")
        last = state.last_command
        if last is None:
            return None
        # A restarted sender counts from the beginning: its lower numbers are accepted once the old one is silent. An
        # armed output then disarms (`command`), for nobody has armed it for this sender.
        again = state.fresh and not _newer(command.sequence, last.sequence)
        if command.stamp < last.stamp or again:
            return RefusedCommand(CommandFault.OUT_OF_ORDER, f"command {command.sequence} came after {last.sequence}")
        return None

    def _request_fault(self, state: OutputGuardState, request: Request, now: Stamp) -> Refusal:
        # First: an output that is being set up answers late, and a request that is made again would not help it.
        if state.phase is ArmingPhase.FAULTED:
            return _faulted(state)
        wrong_stamp = StampWindow(self.knobs.arm_lifespan_s, self.knobs.future_s).judge(request.stamp, now)
        if wrong_stamp is not None:
            clocks = wrong_stamp.remedy if wrong_stamp.other_clock else "set the clocks of both machines if this lasts"
            reason = Reason.LATE if wrong_stamp.kind is StampFault.EXPIRED else Reason.CLOCK
            return Refusal(reason, f"request is {wrong_stamp.text}; {clocks}, and try again")
        last = state.last_request
        if last is not None:
            # A restarted console counts from the beginning: accepted once no late request can still arrive.
            again = seconds_between(last.stamp, request.stamp) <= self.knobs.arm_lifespan_s
            if request.stamp <= last.stamp or (again and not _newer(request.sequence, last.sequence)):
                found = f"request {request.sequence} is not newer than {last.sequence}, the last one"
                return Refusal(Reason.OUT_OF_ORDER, f"{found}; try again")
        if state.monitor_disarmed_at is not None and request.stamp <= state.monitor_disarmed_at:
            found = f"request {request.sequence} was made before the vehicle disarmed itself"
            return Refusal(Reason.OUT_OF_ORDER, f"{found}; try again")
        return NOTHING


def _faulted(state: OutputGuardState) -> Refusal:
    return Refusal(Reason.FAULTED, f"output is faulted: {state.reason}")


def guard_of(vehicle: Vehicle, knobs: OutputGuardKnobs | None = None) -> OutputGuard:
    """Make the guard of the thrusters and lamps of a vehicle file, at rest where their curves are.

    Parameters
    ----------
    vehicle
        Channels, curves and limits.
    knobs
        Times and slew; None: defaults.

    Returns
    -------
    OutputGuard
        Stateless.

    Raises
    ------
    UsageError
        Where a thruster rests at a pulse that the guard or the output does not make.
    """
    chosen = knobs or OutputGuardKnobs()
    curves = [vehicle.curves[one.curve] for one in vehicle.thrusters]
    rest_us = tuple(one.stop_us if chosen.neutral_us is None else chosen.neutral_us for one in curves)
    for thruster, curve, pulse_us in zip(vehicle.thrusters, curves, rest_us, strict=True):
        if not chosen.low_us <= pulse_us <= chosen.high_us:
            wanted = f"{chosen.low_us:g} to {chosen.high_us:g} us (low_us, high_us)"
            raise UsageError(f"thrusters: {thruster.name} rests at {pulse_us:g} us, wanted {wanted}")
        below_us, above_us = (end_us - curve.stop_us for end_us in running(curve, vehicle.supply_V).dead_us)
        if vehicle.output.on_line and not below_us <= BOARD_NEUTRAL_us - pulse_us <= above_us:
            raise UsageError(
                f"thrusters: {thruster.name} rests at {pulse_us:g} us, and the {vehicle.output.device} by itself at "
                f"{BOARD_NEUTRAL_us:g}"
                " us, which would turn it; calibrate the speed controller (`./hindrax esc calibrate`), then correct "
                "stop_us"
            )
    return OutputGuard(rest_us, len(vehicle.output.light_channels), chosen)


def _newer(sequence: int, than: int) -> bool:
    """Whether a 32-bit counter is ahead of another, also across its wrap (RFC 1982)."""
    return 0 < (sequence - than) % (1 << 32) < 1 << 31
