"""The lifecycle node `thrusters`: commands and arm requests in, applied pulses out. It runs under `deadman`.

The output is served by a thread from the start, with neutral first. Commands are judged on that thread, on the clock of
the output. The lifecycle shows whether the output is there; once an operator has asked for any state but active, the
output stays neutral and disarmed until `activate`. A finalized node keeps repeating neutral and reports it: an output
that no process serves keeps its last pulses.
"""

import contextlib
import ctypes
import os
import select
import signal
import threading
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import TimeoutError as NoAnswerError
from dataclasses import dataclass, replace

from rclpy.node import Node

from hindrax_core.driver_interface import Output, SerialDevice
from hindrax_core.events import Rejected, Stamp, Stamped, seconds_between
from hindrax_core.input_checks import SinglePublisher
from hindrax_core.readings import AppliedPulses, Battery
from hindrax_core.signals import AppliedOutput
from hindrax_core.text.coded import Coded
from hindrax_core.text.refusals import Reason, Refusal
from hindrax_core.topics import BATTERY, LIGHTS, THRUSTER_COMMAND, THRUSTER_STATE
from hindrax_drivers.buses.ports import open_clock
from hindrax_drivers.driver_registry import driver_of
from hindrax_drivers.lifecycle import ON_REQUEST, State
from hindrax_drivers.nodes.device_node import DeviceNode
from hindrax_drivers.nodes.force_topics import ForcePublishers
from hindrax_drivers.nodes.thruster_settings import (
    ARMED_WORD,
    BEAT_WORD,
    DISARMED_WORD,
    ENDED,
    KEEPALIVE_S,
    LEFT_ARMED,
    STOP_WORD,
    OutputAlone,
    Settings,
    read_settings,
)
from hindrax_drivers.output.force_output import DEVICE as FORCES
from hindrax_drivers.output.force_output import ForceOutput, require_force_curves
from hindrax_drivers.output.output_guard import (
    ArmingPhase,
    CommandFault,
    OutputGuardKnobs,
    RefusedCommand,
    Request,
    guard_of,
)
from hindrax_drivers.output.output_ports import Rider, ThrusterOutput, open_output
from hindrax_drivers.output.output_reasons import NO_REASON, OutputReason, all_of, output_reason
from hindrax_drivers.output.output_thread import OutputThread
from hindrax_msgs.srv import Arm
from hindrax_ros.graph import publisher, publishers_of, subscription
from hindrax_ros.messages.convert import stamp_from_msg
from hindrax_ros.messages.fast_serialization import applied_writer, command_from_bytes
from hindrax_ros.messages.reading_fields import writer
from hindrax_ros.parameters import SAFETY, knobs, text
from hindrax_ros.process import spin

NAME = "thrusters"
ANSWER_S = 2.0
LOOK_S = 0.1
PR_SET_PDEATHSIG = 1
STOPPED = "stopped from this machine"
SILENT_S, SILENT_WALL_S = 1.0, 0.8
"""Silence of the dead man, by the clock of the output and by the monotonic one."""


class ThrustersNode(DeviceNode):
    """One output behind one guard. `beat` shows the dead man that this process is alive and controls the output."""

    def __init__(self, settings: Settings, beat: int) -> None:
        super().__init__(NAME, settings.vehicle)
        self._settings, self._beat_to = settings, beat
        for name, value, meaning in (
            ("vehicle", "", "vehicle file [-]"),
            ("port", settings.port, "port of the output, or mock:SOCKET [-]"),
            ("clock", settings.clock, "clock of a serial port: system, or mock:SOCKET [-]"),
        ):
            text(self, name, value, meaning)
        if settings.alone:
            knobs(self, OutputAlone)
        guard = guard_of(settings.vehicle, knobs(self, OutputGuardKnobs, fixed={"": SAFETY}))
        ended = os.environ.get(ENDED, "")
        begun = output_reason(OutputReason.STARTED_AGAIN, ended=ended)
        self._guard = replace(guard, begun=begun) if ended else guard
        self._riders: list[Rider] = []
        self._phase = self._reason = ""
        self._confirms = False
        self._commander, self._sender_refused, self._look_s = SinglePublisher(), "", 0.0
        self._inhibited_by = dict.fromkeys(("dead man", "lifecycle", "commander"), NO_REASON)
        self._state = publisher(self, THRUSTER_STATE)
        self._state_bytes = applied_writer(settings.vehicle.output.device)
        self._battery, self._battery_bytes = None, writer("battery")
        if settings.vehicle.output.on_line and not settings.vehicle.measuring("supply"):
            self._battery = publisher(self, BATTERY)
        self.sensors = [self._sensor(name) for name in settings.vehicle.on_output_line]
        """Nodes of the sensors on the line of the output, which one process only can own."""
        self._forces: ForcePublishers | None = None
        if settings.vehicle.output.device == FORCES:
            require_force_curves(settings.vehicle)
            self._forces = ForcePublishers(self, settings.vehicle, settings.port)
        self._thread = OutputThread(self._open, self._guard, self, self._beat)
        self.ready = lambda: self._thread.ready
        self.now = lambda: self._thread.now
        self.stop = self._thread.stop
        self.lead = subscription(self, THRUSTER_COMMAND, self._on_command, raw=True)
        subscription(self, LIGHTS, lambda message: self._thread.light(tuple(message.data)))
        self.create_service(Arm, "thrusters/arm", self._on_arm)
        self._thread.start()

    def _sensor(self, name: str) -> DeviceNode:
        """Make the node of a sensor whose bytes come on the line of the output."""
        vehicle = self._settings.vehicle
        mount = vehicle.sensors[name]
        node, row = DeviceNode(name, vehicle, mount.device, publish_queue=self.publish_queue), driver_of(mount.device)
        device: SerialDevice = row.make(knobs(node, row.knobs), mount, vehicle)
        node.ready, node.now = lambda: device.ready, lambda: self._thread.now
        self._riders.append(Rider(device, node.deliver, node.frame))
        return node

    def abandon(self) -> None:
        """Write neutral now, because the dead man is gone."""
        self._thread.drop(output_reason(OutputReason.DEAD_MAN, what="has died"))
        self._thread.stop()

    def on_dead_man(self, *, answers: bool) -> None:
        """Hold neutral and disarmed while the dead man does not answer."""
        silent = output_reason(OutputReason.DEAD_MAN, what="does not answer")
        self._inhibit("dead man", NO_REASON if answers else silent)

    def stop_thrust(self) -> None:
        """Disarm for the dead man, which somebody has asked to stop."""
        self._thread.disarm(Request(self._thread.now, 0, STOPPED))
        self._confirms = True

    def _inhibit(self, who: str, reason: Coded[OutputReason]) -> None:
        if self._inhibited_by[who] == reason:
            return
        self._inhibited_by[who] = reason
        self._thread.inhibit(all_of(self._inhibited_by))

    def applied(self, applied: AppliedOutput) -> None:
        """Publish the applied pulses."""
        if (applied.phase, applied.reason) != (self._phase, self._reason):
            log = applied.phase != self._phase or bool(applied.reason) != bool(self._reason)
            self._phase, self._reason = applied.phase, applied.reason
            self.health.note = f"{applied.phase}: {applied.reason}" if applied.reason else applied.phase
            if log:
                self.get_logger().info(self.health.note)
        self.health.alarm = self._alarm(armed=applied.armed)
        if applied.phase == ArmingPhase.FAULTED:
            self.health.identity = ""
        else:
            self.health.reading(self._thread.now)
        self._state.publish(self._state_bytes(applied))
        if self._confirms and applied.phase not in (ArmingPhase.ARMING, ArmingPhase.ARMED):
            self._confirms = False
            self._beat(DISARMED_WORD)

    def _alarm(self, *, armed: bool) -> str:
        """Reason why commands have no effect now or would have none; empty when they would."""
        if armed and self._reason:
            return f"armed, but neutral: {self._reason}"
        return output_reason(OutputReason.UNOBEYED, refused=self._sender_refused) if self._sender_refused else NO_REASON

    def on_idle(self) -> None:
        """Send the queued messages."""
        self.publish_queue.flush()

    def refused(self, refusal: RefusedCommand, stamp: Stamp) -> None:
        """Count a refused command."""
        if not self.health.rejects[refusal.fault]:
            self.get_logger().warning(f"command refused: {refusal.text}")
        self.health.reject(Rejected(stamp, refusal.fault))

    def found(self, identity: str) -> None:
        """Report the identity of the output."""
        self.health.identity = f"{identity} on {self._settings.port}"
        self.get_logger().info(f"found {self.health.identity}")

    def deliver(self, outputs: Iterable[Output]) -> None:
        """Publish other outputs of the device; its pulses come with `applied`."""
        for output in () if self.finalized else outputs:
            reading = output.reading if isinstance(output, Stamped) else None
            if isinstance(reading, Battery) and self._battery is not None:
                self._battery.publish(self._battery_bytes(output))
            elif not isinstance(reading, AppliedPulses):
                super().deliver([output])

    def on_request(self, wanted: State) -> None:
        """Go neutral and disarm in every state but active."""
        held = ON_REQUEST[wanted]
        self._inhibit("lifecycle", output_reason(OutputReason.LIFECYCLE, state=held) if held else NO_REASON)

    def _on_command(self, data: bytes) -> None:
        try:
            ordered = command_from_bytes(data)
        except ValueError as error:
            self.refused(RefusedCommand(CommandFault.NOT_A_COMMAND, str(error)), self._thread.now)
            return
        if (now_s := time.monotonic()) >= self._look_s:
            self._look_s = now_s + LOOK_S
            self._look_for_commanders()
        if self._sender_refused:  # as the graph was at most LOOK_S ago
            self._thread.refuse(RefusedCommand(CommandFault.SENDER, self._sender_refused))
            return
        self._thread.command(ordered)

    def _look_for_commanders(self) -> None:
        """Judge the publishers of commands; disarmed, and not armed again, while there is another one."""
        publishers = publishers_of(self, THRUSTER_COMMAND)
        found = self._commander.judge(publishers, armed=self._phase == ArmingPhase.ARMED)
        self._sender_refused = f"{THRUSTER_COMMAND.name}: {found}" if found else ""
        contested = output_reason(OutputReason.PUBLISHERS, found=self._sender_refused)
        self._inhibit("commander", contested if self._commander.is_contested(publishers) else NO_REASON)

    def _on_arm(self, request: Arm.Request, response: Arm.Response) -> Arm.Response:
        if request.arm:  # the disturber may have left, and no command arrived since
            self._look_for_commanders()
        asked = Request(stamp_from_msg(request.stamp), request.sequence, request.reason)
        future = self._thread.arm(asked) if request.arm else self._thread.disarm(asked)
        try:
            answer = future.result(ANSWER_S)
        except NoAnswerError:
            silent = Refusal(Reason.FAULTED, "the output does not answer; see /diagnostics")
            return Arm.Response(accepted=False, reason=str(silent), error_code=silent.reason)
        response.accepted = answer.accepted
        response.reason, response.error_code = str(answer.reason), answer.reason.reason
        self.get_logger().info(f"{'arm' if request.arm else 'disarm'}: {answer.reason or request.reason or 'accepted'}")
        return response

    def _open(self) -> ThrusterOutput:
        settings, neutral = self._settings, self._guard.neutral
        if self._forces is not None:
            return ForceOutput(settings.vehicle, self._forces, open_clock(settings.clock, NAME))
        wires = (settings.vehicle, settings.port, settings.clock, self.tap.add, NAME)
        left_armed = LEFT_ARMED in os.environ
        return open_output(*wires, neutral=neutral, riders=self._riders, left_armed=left_armed)

    def _beat(self, word: bytes = b"") -> None:
        armed = self._phase == ArmingPhase.ARMED or self._thread.left_armed
        word = word or (ARMED_WORD if armed else BEAT_WORD)
        with contextlib.suppress(BlockingIOError, BrokenPipeError):  # no reader; `watch_parent` handles it
            os.write(self._beat_to, word)


@dataclass(slots=True)
class ParentSilence:
    """Whether the dead man is silent: what is to end our thrust must itself be there.

    Judged by the clock of the output and the monotonic one [s]: a mock's may stand still, the system's may leap.
    """

    beaten_at: Stamp
    beaten_s: float

    def on_beat(self, now: Stamp, now_s: float) -> None:
        """The dead man lives."""
        self.beaten_at, self.beaten_s = now, now_s

    def silent(self, now: Stamp, now_s: float) -> bool:
        """Whether no keepalive has come for too long."""
        recent = 0.0 <= seconds_between(self.beaten_at, now) < SILENT_S
        return not recent and now_s - self.beaten_s >= SILENT_WALL_S


def watch_parent(life: int, node: ThrustersNode) -> None:
    """Go neutral when the dead man falls silent; exit when it dies: its end of the pipe then closes."""

    def wait() -> None:
        silence, silent = ParentSilence(node.now(), time.monotonic()), False
        while True:
            ready, _, _ = select.select([life], (), (), KEEPALIVE_S)
            words = os.read(life, 4096) if ready else b""
            if ready and not words:
                break
            if STOP_WORD in words:
                node.stop_thrust()
            now, now_s = node.now(), time.monotonic()
            if ready:
                silence.on_beat(now, now_s)
            if silence.silent(now, now_s) is not silent:
                silent = not silent
                node.on_dead_man(answers=not silent)
        node.abandon()
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, name="parent", daemon=True).start()


def main(arguments: Sequence[str], beat: int, life: int) -> int:
    """Run the node until a signal, or until the dead man dies; `beat` and `life` are pipes to and from it."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    os.set_blocking(beat, False)
    settings = read_settings(arguments)

    def make() -> Sequence[Node]:
        node = ThrustersNode(settings, beat)
        watch_parent(life, node)
        return [node, *node.sensors]

    return spin(make, ["thrusters", *arguments])
