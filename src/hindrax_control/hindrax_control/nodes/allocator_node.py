"""The allocator node: wrenches in, pulses out; and what the applied pulses achieve, every cycle."""

from collections.abc import Callable
from dataclasses import replace

from geometry_msgs.msg import Wrench, WrenchStamped
from sensor_msgs.msg import BatteryState

from hindrax_control.allocation.allocation_cycle import AllocationCycle, SupplyKnobs
from hindrax_control.allocation.allocator import AllocationKnobs
from hindrax_control.allocation.thrust_curve import check_pulses
from hindrax_control.allocation.wrench_guard import WrenchGuardKnobs
from hindrax_core.events import Stamp
from hindrax_core.input_checks import SinglePublisher, impossible, names_of_others
from hindrax_core.readings import Vec6
from hindrax_core.rotation import FLU, FSD, foreign_frame
from hindrax_core.signals import ZERO6, Allocation
from hindrax_core.text.refusals import unreadable
from hindrax_core.topics import ALLOCATION, BATTERY, THRUSTER_COMMAND, THRUSTER_HEALTH, THRUSTER_STATE, WRENCH, Topic
from hindrax_core.vehicle import Vehicle
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.diagnostics import DiagnosticsPublisher
from hindrax_ros.graph import publisher, publishers_of, subscription
from hindrax_ros.messages.convert import stamp_from_msg, wrench_from_msg
from hindrax_ros.messages.fast_serialization import allocation_writer, applied_from_bytes, command_writer
from hindrax_ros.parameters import SAFETY, frame_prefix, knobs, text

REPORT_S = 1.0


class AllocatorNode(BatchedNode):
    """Turns wrenches into `thrusters/command`; `control/allocation` reports what `thrusters/state` achieves.

    It obeys the one publisher of `control/wrench`. A pilot of the same process calls `on_wrench` instead and is
    `pilot`. `allocation_listeners` are called with every achieved allocation. While `inhibited`, wrenches are zero.
    """

    def __init__(self, vehicle: Vehicle, now: Callable[[], Stamp] | None = None) -> None:
        """`now`: the clock of its time; its own by default."""
        super().__init__("allocator", ros_time=now is None)
        self._now = now or self.now
        self.pilot = ""
        self.inhibited: Callable[[], bool] = lambda: False
        self._commander, self._armed = SinglePublisher(), False
        self._cycle = AllocationCycle(
            vehicle,
            knobs(self, AllocationKnobs, self._tune),
            knobs(self, WrenchGuardKnobs, fixed={"": SAFETY}),
            knobs(self, SupplyKnobs, self._tune),
        )
        self.supply = self._cycle.supply
        """Measured supply voltage, shared with the other nodes of the process."""
        names = [thruster.name for thruster in vehicle.thrusters]
        self._thrusters = len(names)
        self._prefix = prefix = frame_prefix(self)
        self._command_bytes = command_writer(len(names), prefix)
        self._status_bytes = allocation_writer(names, vehicle.supply_V, prefix)
        self._command = publisher(self, THRUSTER_COMMAND)
        self._status = publisher(self, ALLOCATION)
        self._reporter = DiagnosticsPublisher(self)
        self.allocation_listeners: list[Callable[[Stamp, Allocation], None]] = []
        subscription(self, THRUSTER_STATE, self._on_state, raw=True)
        subscription(self, THRUSTER_HEALTH, lambda message: self._cycle.disable(frozenset(message.disabled)))
        subscription(self, BATTERY, self._on_battery)
        self.lead = subscription(self, WRENCH, self._on_wrench_message)
        reference = text(
            self, "reference", "", "topic of geometry_msgs/Wrench that commands too, as in ros2_control [-]"
        )
        self._reference_frame = text(self, "reference_frame", FLU, f"frame of those, {FLU} or {FSD} [-]")
        self._commands = [WRENCH]
        if reference:
            row = replace(WRENCH, name=reference, type="geometry_msgs/msg/Wrench")
            self._commands.append(row)
            self.lead = subscription(self, row, self._on_reference)
        self.every(REPORT_S, self._report)

    def _tune(self, knobs: AllocationKnobs | SupplyKnobs) -> None:
        if isinstance(knobs, SupplyKnobs):
            self.supply.tune(knobs)
        else:
            self._cycle.tune(knobs)

    def on_wrench(self, wrench: Vec6, frame: str, stamp: Stamp, now: Stamp) -> bool:
        """Allocate one wrench [N, N m] and publish its command; False if it is refused."""
        command = self._cycle.command(ZERO6 if self.inhibited() else wrench, frame, stamp, now)
        if command is not None:
            self._command.publish(self._command_bytes(stamp, command.sequence, command.pulses_us))
        return command is not None

    def on_forces(self, wrench: Vec6, forces_N: tuple[float, ...], stamp: Stamp) -> None:
        """Give the thrusters these forces [N]; `wrench` is what they should give. Only the pilot of this process."""
        wrench, forces_N = (ZERO6, ()) if self.inhibited() else (wrench, forces_N)
        command = self._cycle.command(wrench, FSD, stamp, stamp, forces_N)
        if command is not None:
            self._command.publish(self._command_bytes(stamp, command.sequence, command.pulses_us))

    def _on_wrench_message(self, message: WrenchStamped) -> None:
        """Obey the only publisher; its wrenches are judged like those of the pilot."""
        self._obey(WRENCH, message, message.header.frame_id, stamp_from_msg(message.header.stamp))

    def _on_reference(self, message: Wrench) -> None:
        """Obey a wrench without a header: it is of now, for nobody can say how long it has been on its way."""
        made = WrenchStamped(wrench=message)
        self._obey(self._commands[-1], made, self._reference_frame, self._now())

    def _obey(self, topic: Topic, message: WrenchStamped, frame: str, stamp: Stamp) -> None:
        refused = self._commander.judge(self._commanding(), armed=self._armed) or foreign_frame(frame, self._prefix)
        if not refused and not self.on_wrench(wrench_from_msg(message), frame, stamp, self._now()):
            refused = self._cycle.refused[0]
        if refused:
            self._reporter.refuse(topic, refused)

    def _commanding(self) -> dict[str, str]:
        """Of all topics that command."""
        return {gid: name for topic in self._commands for gid, name in publishers_of(self, topic).items()}

    def _on_state(self, data: bytes) -> None:
        """Publish what the applied pulses achieve; pulses without a command have a wanted wrench of zero."""
        try:
            applied = applied_from_bytes(data)
            check_pulses(applied.pulses_us, self._thrusters)
        except ValueError as error:
            self._reporter.refuse(THRUSTER_STATE, unreadable(error))
            return
        if refused := impossible(applied.stamp):
            self._reporter.refuse(THRUSTER_STATE, refused)
            return
        self._armed = applied.armed
        achieved = self._cycle.achieved(applied.sequence, applied.pulses_us)
        for listener in self.allocation_listeners:
            listener(applied.stamp, achieved)
        self._status.publish(self._status_bytes(applied, achieved, self._cycle.supply_V))

    def _on_battery(self, message: BatteryState) -> None:
        refused = self._cycle.supply.update(float(message.voltage), Stamp(max(self._cycle.now, self._now())))
        if refused:
            self._reporter.refusals.add(BATTERY.name, refused)

    def _report(self) -> None:
        cycle, now = self._cycle, self._cycle.now
        wrong: list[str] = [f"axes lost: {', '.join(cycle.lost_axes)}"] if cycle.lost_axes else list(cycle.refused)
        if cycle.inexact:
            wrong.append(f"{cycle.inexact} wrenches without forces within limits; check the thrust curves")
        wrong += filter(None, [self._ignored_publishers(), cycle.supply.silence_warning(now)])
        values = {"supply [V]": cycle.supply.status_text(now), "disabled": ", ".join(sorted(cycle.disabled))}
        values["commander"] = self.pilot or self._commander.name or "none yet"
        self._reporter.report(now, wrong, "allocating", values)

    def _ignored_publishers(self) -> str:
        """Publishers of wrenches that are refused beside the pilot of this process."""
        others = names_of_others(self._commanding(), self.pilot) if self.pilot else ""
        return f"not obeyed: {others}, because {self.pilot} commands" if others else ""
