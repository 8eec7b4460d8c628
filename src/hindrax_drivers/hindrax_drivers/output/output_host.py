"""Host of guard and output: checks commands, writes, repeats, monitors the output. Has no thread.

Everything that moves a thruster goes through the guard, on the clock of the output. The caller turns it, sleeps for
the time that it returns, and ends it; every end writes neutral.
"""

from collections.abc import Callable, Iterable
from typing import Protocol

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Output
from hindrax_core.events import Stamp, after, seconds_between
from hindrax_core.signals import AppliedOutput, Command
from hindrax_core.text.coded import Coded
from hindrax_core.text.refusals import STILL_ARMED, Reason, Refusal
from hindrax_drivers.output.output_guard import (
    Answer,
    ArmingPhase,
    CommandFault,
    OutputGuard,
    OutputGuardState,
    Pulses,
    RefusedCommand,
    Request,
)
from hindrax_drivers.output.output_ports import StillAnsweringError, ThrusterOutput
from hindrax_drivers.output.output_reasons import NO_REASON, OutputReason, output_reason

SET_UP_AGAIN_S = 0.5
LOOK_AGAIN_S = 0.1
"""Time after which an output that has answered, and is not ready yet, is looked at again."""
CHECK_S = 1.0
LAST_ATTEMPTS = 3


class OutputListener(Protocol):
    """Receiver of output events."""

    def applied(self, applied: AppliedOutput) -> None:
        """Pulses were written, or could not be (then the phase shows it)."""

    def refused(self, refusal: RefusedCommand, stamp: Stamp) -> None:
        """A command was refused."""

    def found(self, identity: str) -> None:
        """The output has been set up."""

    def troubled(self, text: str) -> None:
        """Something is wrong with the output."""

    def deliver(self, outputs: Iterable[Output]) -> None:
        """The output reported something."""

    def on_idle(self) -> None:
        """The output is idle: time for work that no thruster waits for."""


class OutputHost:
    """One open output behind one guard."""

    def __init__(self, output: ThrusterOutput, guard: OutputGuard, listener: OutputListener) -> None:
        self._output, self._guard, self._listener = output, guard, listener
        now = output.now()
        self._state = guard.fault(guard.start(now), output_reason(OutputReason.NOT_SET_UP), now)
        self._was_set_up = False
        self._inhibited_because = NO_REASON
        self._pending: Pulses | None = None
        self._last = guard.neutral
        self._set_up_at = self._checked_at = now

    @property
    def ready(self) -> bool:
        """Whether the output is set up and follows commands."""
        return self._state.phase is not ArmingPhase.FAULTED

    @property
    def left_armed(self) -> bool:
        """Whether the far end was armed from here, and may be so although it should not be."""
        return not self._state.armed and self._output.left_armed()

    def command(self, command: Command) -> None:
        """Check a command; the next `turn` writes it."""
        self._judge(self._guard.command, command)

    def refuse(self, refusal: RefusedCommand) -> None:
        """Refuse a command for a reason of the caller's own: it is not checked."""
        now = self._output.now()
        self._state = self._guard.refuse(self._state, refusal, now)
        self._listener.refused(refusal, now)

    def light(self, levels: tuple[float, ...]) -> None:
        """Set the lamps, 0 (dark) to 1; the next `turn` writes it."""
        self._judge(self._guard.light, levels)

    def _judge(self, rule: Callable[..., tuple[OutputGuardState, Pulses | RefusedCommand]], asked: object) -> None:
        now = self._output.now()
        decision: Pulses | RefusedCommand = RefusedCommand(CommandFault.INHIBITED, self._inhibited_because)
        if not self._inhibited_because:
            self._state, decision = rule(self._state, asked, now)
        if isinstance(decision, RefusedCommand):
            self._listener.refused(decision, now)
        else:
            self._pending = decision

    def arm(self, request: Request) -> Answer:
        """Start arming, or return the reason of a refusal."""
        if self._inhibited_because:
            return Answer(accepted=False, reason=Refusal(Reason.INHIBITED, self._inhibited_because))
        self._state, answer = self._guard.arm(self._state, request, self._output.now())
        return answer

    def disarm(self, request: Request) -> Answer:
        """Disarm; the next `turn` writes neutral."""
        self._state, answer = self._guard.disarm(self._state, request, self._output.now())
        return answer

    def drop(self, reason: Coded[OutputReason]) -> None:
        """Disarm for a reason of the caller's own."""
        self._state = self._guard.drop(self._state, reason, self._output.now())

    def inhibit(self, reason: Coded[OutputReason]) -> None:
        """Disarm, and refuse every command while there is a reason; an empty reason ends it."""
        self._inhibited_because = reason
        if reason:
            self.drop(reason)

    def turn(self) -> Stamp:
        """Run one round: recover, read, write, check. Returns the latest time of the next one."""
        if not self.ready:
            self._recover()
        self._listen()
        self._write()
        self._check()
        return self._guard.due(self._state) if self.ready else self._set_up_at

    def end(self) -> None:
        """Write neutral, then close. A failed write is retried; the dead man follows."""
        for _ in range(LAST_ATTEMPTS):
            try:
                self._output.write(self._guard.neutral, armed=False)
                break
            except DeviceError as error:
                self._listener.troubled(f"neutral at the end: {error}")
        self._output.close()

    def broken(self, why: str) -> None:
        """Fault, and set up again at once: an unreachable output must not keep its last pulses."""
        now = self._output.now()
        self._state = self._guard.fault(self._state, output_reason(OutputReason.DEVICE, found=why), now)
        self._set_up_at = now
        self._output.shut_off()
        self._listener.troubled(why)
        self._report()

    def _recover(self) -> None:
        """Set the output up, which brings it to neutral; it comes back disarmed."""
        if 0.0 < seconds_between(self._output.now(), self._set_up_at) <= SET_UP_AGAIN_S:
            return
        try:
            identity = self._output.set_up()
        except StillAnsweringError:
            # Late is not wrong: the reason stays what it was, and the line is served meanwhile.
            self._set_up_at = after(self._output.now(), LOOK_AGAIN_S)
            self._report()
            return
        except DeviceError as error:
            now = self._output.now()
            self._set_up_at = after(now, SET_UP_AGAIN_S)
            self._state = self._guard.fault(self._state, output_reason(OutputReason.DEVICE, found=error), now)
            self._listener.troubled(str(error))
            self._report()
            return
        now = self._checked_at = self._output.now()
        self._state = self._guard.restored(self._state, now) if self._was_set_up else self._guard.start(now)
        self._last, self._was_set_up = self._guard.neutral, True
        self._listener.found(identity)

    def _listen(self) -> None:
        try:
            outputs = self._output.serve()
        except DeviceError as error:
            self.broken(str(error))
            return
        if outputs:
            self._listener.deliver(outputs)
        fault = self._output.fault() if self._state.armed else ""
        if fault:
            self.drop(output_reason(OutputReason.DEVICE, found=fault))

    def _write(self) -> None:
        """Write what a command or the clock requires. A change to neutral overrides an earlier command."""
        self._state, due = self._guard.tick(self._state, self._output.now())
        pulses, self._pending = due or self._pending, None
        if pulses is None or not self.ready:
            return
        try:
            self._output.write(pulses, armed=self._state.armed)
        except DeviceError as error:
            why = output_reason(OutputReason.DEVICE, found=error)
            self._state = self._guard.failed(self._state, why, self._output.now())
            if self.ready:
                self._listener.troubled(str(error))
            else:
                self.broken(str(error))
            return
        self._state = self._guard.written(self._state)
        self._last = pulses
        self._report()

    def _check(self) -> None:
        """Verify the output once a second; write again before reporting a mismatch."""
        now = self._output.now()
        if not self.ready or 0.0 <= seconds_between(self._checked_at, now) < CHECK_S:
            return
        self._checked_at = now
        try:
            self._output.check(self._last)
        except DeviceError as first:
            self._listener.troubled(str(first))
            try:
                self._output.write(self._last, armed=self._state.armed)
                self._output.check(self._last)
            except DeviceError as error:
                self.broken(str(error))

    def _report(self) -> None:
        """Report the pulses that were written: after a failed write the last are most likely still active."""
        state, last = self._state, self._last
        why = state.reason or state.unobeyed
        if self.left_armed:
            why = Coded(why.code, f"{why}{STILL_ARMED}")
        as_now = (last.sequence, state.armings, state.phase, why)
        for made in self._output.applied(last):
            self._listener.applied(AppliedOutput(made.stamp, state.armed, made.reading.pulses_us, *as_now))
