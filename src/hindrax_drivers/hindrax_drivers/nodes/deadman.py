"""The dead man of the thruster output: a PCA9685 keeps its last pulses forever, so a second process must stop it.

Starts the node `thrusters` as its child, without ROS and next to idle itself. When the child dies of whatever cause, or
stops beating, neutral is written at once and then ten times a second, until a new child has the output in hand. When
this process dies, the child sees its pipe close, goes neutral and ends; when it is frozen, the child gets no keepalives
and goes neutral until it does. The two lie in different sessions, so that no signal to a group reaches both. Where both
are frozen, the supervisor kills both: `--neutral`, or a new dead man, puts neutral on the wire.

It also takes requests to stop from other processes of the machine (`stop_request`): it passes them on to the node,
and kills a node that does not disarm.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import FrameType
from typing import TYPE_CHECKING

from hindrax_core.bus_operations import DeviceError, run
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import Stamp, after, seconds_between
from hindrax_drivers.buses.clock import Clock, RegisterBus, SystemClock, pause
from hindrax_drivers.buses.line import Line, open_line
from hindrax_drivers.buses.ports import open_bus, open_clock
from hindrax_drivers.devices.pca9685 import Pca9685, pca9685_of
from hindrax_drivers.nodes.stop_request import StopRequests
from hindrax_drivers.nodes.thruster_settings import (
    ARMED_WORD,
    BEAT_WORD,
    DISARMED_WORD,
    ENDED,
    KEEPALIVE_S,
    LEFT_ARMED,
    STOP_WORD,
    Settings,
    read_settings,
)
from hindrax_drivers.nodes.thrusters import ARGUMENTS, NEUTRAL_WORD, NODE_WORD
from hindrax_drivers.nodes.zero_forces import ZeroForces
from hindrax_drivers.output.force_output import DEVICE as FORCES
from hindrax_ros.heartbeat import VARIABLE, HeartbeatFile
from hindrax_ros.standstill import STOOD_STILL

if TYPE_CHECKING:
    from hindrax_drivers.devices.ardupilot.farewell import Farewell

REPEAT_S = 0.09
SILENT_S = 0.3
HUNG_S = 3.0
SHUTDOWN_S = 4.0
OBEYED_S = 1.0
"""Time by the monotonic clock in which the node disarms on request; then it is killed."""
BACK_OFF_S = (0.0, 0.5, 1.0, 2.0, 4.0)
FAREWELL_S = 1.5
"""An autopilot's heartbeat comes every second."""
WELL_AFTER_S = 10.0
"""A child that lived this long was well: the next one is started at once."""


class NeutralWriter:
    """Writes neutral without the node. An STM32 does that itself: then the dead man only waits.

    An ArduSub does it too, but by sticks only after three seconds: it is disarmed, where the node had armed it.
    Forces on a topic are made zero by a process with ROS that stands by.
    """

    def __init__(self, settings: Settings) -> None:
        self._port = settings.port
        self.armed = False
        """Whether the node had armed the output, as far as its beats say so."""
        self._farewell = _farewell() if settings.vehicle.output.device == "ardusub" else None
        self._line: Line | None = None
        self._clock_port = settings.clock
        self._clock: Clock | None = None
        vehicle, rest_us = settings.vehicle, settings.guard.neutral.all_us
        self._chip: Pca9685 | None = pca9685_of(vehicle, rest_us) if vehicle.output.device == "pca9685" else None
        self._forces = ZeroForces(settings.arguments) if vehicle.output.device == FORCES else None
        self._bus: RegisterBus | None = None
        self._stack_clock = SystemClock()
        self.trouble = ""
        """Reason why neutral could not be written the last time; empty when it is on the wire."""

    @property
    def clock(self) -> Clock:
        """Clock of the bus or of the line; without one, of the stack."""
        if self._farewell is not None and self._clock is None and self._clock_port != "system":
            with contextlib.suppress(DeviceError):  # the mock may not be there yet
                self._clock = open_clock(self._clock_port, "thrusters dead man")
        return self._bus or self._clock or self._stack_clock

    @property
    def left_armed(self) -> bool:
        """Whether an autopilot was armed by the node, and has not said since that it is disarmed."""
        return self._farewell is not None and self.armed

    @property
    def blocked(self) -> bool:
        """Whether the node holds the line that neutral has to go over."""
        return self.left_armed and bool(self.trouble)

    def write(self) -> None:
        """Neutral first; then make sure that the chip is set up as it should be. What fails is tried again."""
        if self._forces is not None:
            self._forces.send()
            return
        if self._chip is None:
            if self._farewell is not None and self.armed:
                self._say(self._farewell)
            return
        try:
            if self._bus is None:
                self._bus = open_bus(self._port, "thrusters dead man")
            run(self._chip.hold(), self._bus.transfer, partial(pause, self._bus))
            self.trouble = ""
        except DeviceError as error:
            if str(error) != self.trouble:
                report(f"cannot write neutral: {error}")
            self.trouble = str(error)

    def _say(self, farewell: "Farewell") -> None:
        """Disarm the autopilot; the line is free again once it has said that it is."""
        try:
            if self._line is None:
                self._line = open_line(self._port, farewell.baud, self.clock)
            farewell.feed(*self._line.read())
            self._line.send_all(farewell.say(), lambda *_: None)
            self.trouble = ""
        except DeviceError as error:
            if str(error) != self.trouble:
                report(f"cannot disarm: {error}")
            self.trouble = str(error)
        if self.trouble or farewell.done:
            self.release()
        if farewell.done:
            self.armed, self._farewell = False, _farewell()

    def release(self) -> None:
        """Leave the line to the node."""
        if self._line is not None:
            self._line.close()
        self._line = None

    def close(self) -> None:
        """Close the bus, the line and the clocks; there is trouble if nobody heard the last zeros."""
        if self._forces is not None:
            self.trouble = self._forces.close()
        if self._bus is not None:
            self._bus.close()
        self.release()
        if self._clock is not None:
            self._clock.close()
        self._stack_clock.close()


@dataclass(slots=True)
class WatchedProcess:
    """The node's process, the pipe of its beats, the pipe of our keepalives, and the time of its last beat."""

    handle: subprocess.Popen[bytes]
    beats: int
    life: int
    started_s: float = field(default_factory=time.monotonic)
    beaten_at: Stamp | None = None
    beaten_s: float = field(default_factory=time.monotonic)
    keepalive_s: float = 0.0
    stop_s: float | None = None
    """Time at which it was asked to disarm."""
    disarmed: bool = False
    """Whether it has put neutral on the wire since."""
    armed: bool = False
    """Whether its last beat said so."""

    @classmethod
    def start(cls, arguments: Sequence[str], ended: str, *, left_armed: bool) -> "WatchedProcess":
        """Start the node in its own session.

        `ended`: how the one before it did, empty for the first; `left_armed`: whether that may have left an autopilot
        armed.
        """
        beats, beat = os.pipe()
        life_end, life = os.pipe()
        words = [sys.executable, "-m", "hindrax_drivers.nodes.thrusters", NODE_WORD, str(beat), str(life_end)]
        handle = subprocess.Popen(  # noqa: S603  # our own interpreter and our own module
            [*words, *arguments],
            pass_fds=(beat, life_end),
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            env={
                **os.environ,
                VARIABLE: _of_the_node(os.environ.get(VARIABLE, "")),
                ENDED: ended,
                **({LEFT_ARMED: "1"} if left_armed else {}),
            },
        )
        os.close(beat)
        os.close(life_end)
        os.set_blocking(beats, False)
        os.set_blocking(life, False)
        return cls(handle, beats, life)

    def listen(self, now: Stamp) -> bool:
        """Take the beats that have come; False when the child has closed its end, which means that it is dead."""
        try:
            data = os.read(self.beats, 4096)
        except BlockingIOError:
            return True
        if data:
            self.beaten_at, self.beaten_s = now, time.monotonic()
            self.armed = data.rfind(ARMED_WORD) > data.rfind(BEAT_WORD)
        self.disarmed |= DISARMED_WORD in data
        return bool(data)

    def ask_to_disarm(self, now_s: float) -> None:
        """Ask it once, until it has disarmed."""
        if self.stop_s is None:
            self.stop_s, self.disarmed = now_s, False
            with contextlib.suppress(BlockingIOError, BrokenPipeError):  # then it does not obey in time
                os.write(self.life, STOP_WORD)

    def send_keepalive(self, now_s: float) -> None:
        """Tell the child periodically that we live."""
        if now_s - self.keepalive_s >= KEEPALIVE_S:
            self.keepalive_s = now_s
            with contextlib.suppress(BlockingIOError, BrokenPipeError):  # it hangs or has died: see `listen`
                os.write(self.life, b"!")

    def silent_from(self, now: Stamp) -> Stamp:
        """Time from which it no longer controls the output: now, if it has never beaten or the clock went back."""
        return now if self.beaten_at is None or now < self.beaten_at else after(self.beaten_at, SILENT_S)

    def hung(self, now: Stamp) -> bool:
        """Whether it has beaten once and then not for long, by both clocks: that of a mock may stand still."""
        silent = self.beaten_at is not None and seconds_between(self.beaten_at, now) > HUNG_S
        return silent and time.monotonic() - self.beaten_s > HUNG_S

    def reap(self) -> int:
        """Wait for the end; returns the exit code."""
        os.close(self.beats)
        os.close(self.life)
        return self.handle.wait()


class DeadMan:
    """Watches over one child after the other until asked to stop."""

    def __init__(self, settings: Settings, arguments: Sequence[str]) -> None:
        self._neutral, self._arguments = NeutralWriter(settings), arguments
        self._asked_s: float | None = None
        self._heartbeat = HeartbeatFile(os.environ)
        self._stops = stop_requests(self._wake)
        signal.signal(signal.SIGINT, self._ask)
        signal.signal(signal.SIGTERM, self._ask)

    def run(self) -> int:
        """Neutral, child, neutral, until the end.

        Returns
        -------
        int
            Exit code: 0 only when neutral was written last, and no autopilot may be armed still.
        """
        failures, ended = 0, ""
        self._neutral.write()
        while True:
            child = WatchedProcess.start(self._arguments, ended, left_armed=self._neutral.left_armed)
            code = self._watch(child)
            self._neutral.write()
            self._see_disarmed()
            self._answer("the node had ended, or was killed because it did not disarm")
            if self._asked_s is not None or code in (0, UsageError.exit_code):
                break
            well = code == STOOD_STILL or time.monotonic() - child.started_s > WELL_AFTER_S
            failures = 0 if well else failures + 1
            wait_s = BACK_OFF_S[min(failures, len(BACK_OFF_S) - 1)]
            ended = "the node had stood still" if code == STOOD_STILL else f"the node ended with {code}"
            report(f"{ended}; neutral is on the wire, it restarts in {wait_s:g} s")
            if not self._wait(wait_s):
                break
        self._neutral.write()
        self._answer("the stack was ending")
        if self._stops is not None:
            self._stops.close()
        self._neutral.close()
        unsafe = bool(self._neutral.trouble) or self._neutral.left_armed
        return int(unsafe) if self._asked_s is not None else code

    def _watch(self, child: WatchedProcess) -> int:
        """Return the exit code of the child when it has ended; neutral in its place whenever it is silent."""
        sent = False
        while child.listen(self._neutral.clock.now()):
            child.send_keepalive(time.monotonic())
            self._heartbeat.beat(time.monotonic())
            if self._asked_s is not None and not sent:
                child.handle.send_signal(signal.SIGTERM)
                sent = True
            late = self._asked_s is not None and time.monotonic() - self._asked_s > SHUTDOWN_S
            if late or not self._obeys(child, time.monotonic()) or child.hung(self._neutral.clock.now()):
                child.handle.kill()
            now = self._neutral.clock.now()
            look_at = child.silent_from(now)
            if look_at > now:
                self._neutral.armed = child.armed
            else:
                self._neutral.write()
                if self._neutral.blocked:  # it is frozen, and what it holds must be neutral
                    child.handle.kill()
                look_at = after(now, REPEAT_S)
            self._neutral.clock.sleep_until(look_at, child.beats)
        self._neutral.write()
        return child.reap()

    def _see_disarmed(self) -> None:
        """Repeat until the output says that it is disarmed, where it can and was armed, but not for long."""
        end_s = time.monotonic() + FAREWELL_S
        while self._neutral.armed and time.monotonic() < end_s:
            self._heartbeat.beat(time.monotonic())
            self._neutral.write()
            self._neutral.clock.sleep_until(after(self._neutral.clock.now(), REPEAT_S))
        self._neutral.release()

    def _obeys(self, child: WatchedProcess, now_s: float) -> bool:
        """Pass requests to stop on to the node; False when it has not disarmed in time. It starts disarmed."""
        if self._stops is None or not self._stops.pending:
            return True
        if child.beaten_at is None:
            self._neutral.write()
            self._answer("the node was starting, disarmed")
            return True
        child.ask_to_disarm(now_s)
        if child.disarmed:
            child.stop_s = None
            self._stops.answer("disarmed", neutral=True)
        return child.stop_s is None or now_s - child.stop_s <= OBEYED_S

    def _answer(self, how: str) -> None:
        """Answer those who asked to stop: neutral was just written here, or could not be."""
        if self._stops is not None and self._stops.pending:
            trouble = self._neutral.trouble
            self._stops.answer(f"cannot write neutral: {trouble}" if trouble else how, neutral=not trouble)

    def _wait(self, seconds: float) -> bool:
        """Repeat neutral for a while; False when asked to stop."""
        end_s = time.monotonic() + seconds
        while self._asked_s is None and time.monotonic() < end_s:
            self._heartbeat.beat(time.monotonic())
            self._neutral.write()
            self._answer("the node was restarting, disarmed")
            self._neutral.clock.sleep_until(after(self._neutral.clock.now(), REPEAT_S))
        return self._asked_s is None

    def _ask(self, _number: int, _frame: FrameType | None) -> None:
        if self._asked_s is None:
            self._asked_s = time.monotonic()
        self._wake()

    def _wake(self) -> None:
        self._neutral.clock.wake()


def _farewell() -> "Farewell":
    from hindrax_drivers.devices.ardupilot.farewell import Farewell  # noqa: PLC0415  # other outputs do without it

    return Farewell()


def stop_requests(wake: Callable[[], None]) -> StopRequests | None:
    """Take requests to stop; without the address a dead man still does all the rest."""
    try:
        return StopRequests(wake)
    except OSError as error:
        report(f"takes no requests to stop ({error}); `./hindrax stop` needs ROS")
        return None


def _of_the_node(heartbeat: str) -> str:
    """Path of the node's heartbeat beside ours; empty without one."""
    return f"{heartbeat}_node" if heartbeat else ""


def write_neutral(settings: Settings) -> int:
    """Write neutral once; returns the exit code, 0 only when it is on the wire."""
    neutral = NeutralWriter(settings)
    neutral.write()
    neutral.close()
    if neutral.trouble:
        return 1
    output = settings.vehicle.output
    alone = f"the {output.device} goes neutral by itself without commands"
    if output.device == "ardusub":
        alone += ", and may still be armed: disarm it at a ground station"
    print(alone if output.on_line else "neutral is on the wire")  # noqa: T201  # for the supervisor
    return 0


def report(text: str) -> None:
    """One line to the operator, in the log of the process."""
    with contextlib.suppress(OSError):  # its reader may be gone
        sys.stderr.write(f"thrusters: {text}\n")
        sys.stderr.flush()


def main() -> int:
    """Run with the arguments of `thrusters`."""
    arguments = json.loads(os.environ[ARGUMENTS])
    try:
        settings = read_settings(arguments)
        settings.vehicle.output_channels()
    except HindraxError as error:
        report(str(error))
        return error.exit_code
    if arguments[:1] == [NEUTRAL_WORD]:
        return write_neutral(settings)
    return DeadMan(settings, arguments).run()


if __name__ == "__main__":
    sys.exit(main())
